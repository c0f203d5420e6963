"""The built-in scenes: exact counts, closed and outward surfaces, sane views, an asymmetric F."""

import math

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.scene import builtin, letter_f, mesh_tools, paper_room, shapes, terrain
from asmjax.scene.analytic import closest, occluded, primitive_offsets
from asmjax.scene.spec import Disk, Mesh, Rectangle, Sphere

NAMES = sorted(builtin.BUILTIN)


@pytest.fixture(scope="module")
def room():
    return paper_room.make_paper_room()


@pytest.fixture(scope="module")
def scenes(room):
    return {n: room if n == room.name else builtin.load_builtin(n) for n in NAMES}


def view_rays(view, side):
    """Rays (origin, unit directions (3, side^2)) through the pixel centres of a square image."""
    origin = np.asarray(view.origin)
    forward = np.asarray(view.target) - origin
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, view.up)
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)
    step = ((np.arange(side) + 0.5) / side * 2.0 - 1.0) * math.tan(math.radians(view.fov_x_deg / 2))
    x, y = np.meshgrid(step, -step)
    rays = forward[:, None] + right[:, None] * x.ravel() + up[:, None] * y.ravel()
    return origin, rays / np.linalg.norm(rays, axis=0)


@pytest.mark.parametrize(
    ("mesh", "triangles", "volume"),
    [
        (shapes.box("box", (0, 0, 0), (1, 2, 3)), 12, 6.0),
        (shapes.bevelled_box("bevelled", (0, 0, 0), (1, 2, 3), 0.1), 44, None),
        (shapes.sphere("sphere", (1, 2, 3), 0.5, 16), 8 * 16**2, math.pi / 6.0),
        (shapes.rounded_solid("solid", (0, 0, 0), (1, 1, 1), 30.0, 16), 8 * 16**2, 8.0),
        (shapes.cylinder("cone", (0, 0, 0), (1, 1, 1), (0.2, 0.1), 9), 32, None),
        (shapes.torus_knot("torus", (1, 0), (2.0, 0.0, 0.3), 80, 24), 2 * 80 * 24, None),
        (shapes.torus_knot("knot", (2, 3), (1.0, 0.4, 0.1), 120, 7), 2 * 120 * 7, None),
        (letter_f.letter_mesh(), 36, 0.12 * (0.3 * 1.6 + 0.4 * 0.25 + 0.7 * 0.25)),
    ],
    ids=lambda value: value.name if isinstance(value, Mesh) else "",
)
def test_makers_are_closed_outward_and_exact(mesh, triangles, volume):
    assert mesh.faces.shape == (3, triangles) and mesh.faces.dtype == np.int32
    assert mesh.vertices.dtype == np.float64
    assert mesh_tools.is_closed(mesh)
    assert mesh_tools.signed_volume(mesh) > 0.0
    if volume is not None:
        # Inscribed triangles lose a few per cent of a round body.
        assert mesh_tools.signed_volume(mesh) == pytest.approx(volume, rel=0.03)


def test_torus_volume_is_pappus():
    """Volume of a tube around a circle: cross-section (a 24-gon) times the way of its centre."""
    mesh = shapes.torus_knot("torus", (1, 0), (2.0, 0.0, 0.3), 400, 24)
    section = 12 * 0.3**2 * math.sin(2.0 * math.pi / 24)
    assert mesh_tools.signed_volume(mesh) == pytest.approx(section * 4.0 * math.pi, rel=1e-4)


def test_grid_faces_up():
    mesh = shapes.grid("grid", np.arange(4.0), np.arange(3.0), np.zeros((3, 4)))
    assert mesh.faces.shape == (3, 12)
    assert np.array_equal(mesh_tools.face_normals(mesh)[2], np.ones(12))


def test_mirroring_keeps_outward_and_merge_keeps_faces():
    ball = shapes.sphere("ball", (0, 0, 0), 1.0, 4)
    mirrored = mesh_tools.transform(ball, np.diag([-1.0, 1.0, 1.0]), (5.0, 0.0, 0.0))
    both = mesh_tools.merge("both", [ball, mirrored])
    assert mesh_tools.signed_volume(mirrored) == pytest.approx(mesh_tools.signed_volume(ball))
    assert both.faces.shape[1] == 256 and mesh_tools.is_closed(both)


def test_split_to_count_keeps_the_surface():
    ball = shapes.sphere("ball", (0, 0, 0), 1.0, 4)
    split = mesh_tools.split_to_count(ball, 200)
    assert split.faces.shape[1] == 200 and mesh_tools.is_closed(split)
    assert mesh_tools.signed_volume(split) == pytest.approx(mesh_tools.signed_volume(ball))
    with pytest.raises(ValueError, match="odd"):
        mesh_tools.split_to_count(ball, 201)
    with pytest.raises(ValueError, match="already has"):
        mesh_tools.split_to_count(ball, 100)


def test_list_matches_the_scenes(scenes):
    """The written-out list entries are those of the scenes; order and names are the registry's."""
    items = builtin.list_scenes()
    assert [i.name for i in items] == list(builtin.BUILTIN)
    for item in items:
        assert item == builtin.describe(scenes[item.name])


def test_unknown_name_is_one_helpful_line():
    with pytest.raises(UseError, match="Did you mean 'paper_room'"):
        builtin.load_builtin("paper_rom")


@pytest.mark.parametrize("name", NAMES)
def test_eyes_and_lights_are_outside_bodies_and_see_something(scenes, name):
    """Whoever stands in a closed body sees its back: eyes and lights see fronts only."""
    scene = scenes[name]
    if scene.instances:
        scene = mesh_tools.written_out(builtin.load_builtin(f"{name}:100k"))
    closed = [s for s in scene.shapes if isinstance(s, Mesh) and mesh_tools.is_closed(s)]
    assert scene.views and scene.lights
    for view in scene.views.values():
        assert np.isfinite([*view.origin, *view.target, view.fov_x_deg]).all()
        assert np.linalg.norm(np.cross(np.subtract(view.target, view.origin), view.up)) > 1e-3
        origin, rays = view_rays(view, 4)
        t, _, _ = closest(scene.shapes, origin[:, None], rays)
        assert np.isfinite(t).mean() > 0.5
        assert t.min() > view.near
        assert_sees_fronts(closed, origin, rays)
    for light in scene.lights.values():
        if light.position is not None:
            middle = np.mean([s.vertices.mean(axis=1) for s in closed], axis=0) if closed else 0.0
            towards = middle - np.asarray(light.position)
            spread = np.random.default_rng(4).normal(0.0, 0.1, (3, 16))
            assert_sees_fronts(closed, np.asarray(light.position), towards[:, None] + spread)


def assert_sees_fronts(closed, origin, rays):
    t, _, normal = closest(closed, origin[:, None], rays)
    assert np.all(np.sum(normal * rays, axis=0)[np.isfinite(t)] < 0.0)


def test_primitive_ids_count_through_shapes(scenes):
    """A ray from outside against each shape's own first primitive, in shape order."""
    shapes_ = (
        Sphere("s", (0.0, 0.0, 5.0), 1.0),
        shapes.box("b", (9.0, 0.0, 0.0), (10.0, 1.0, 1.0)),
        Disk("d", (20.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0),
        Rectangle("r", (30.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    )
    assert primitive_offsets(shapes_).tolist() == [0, 1, 13, 14, 15]
    origins = np.array([[0.0, 9.3, 20.5, 30.5, 50.0], [0.0, 0.6, 0.2, 0.9, 0.0], [9.0] * 5])
    t, primitive, normal = closest(shapes_, origins, np.array([[0.0], [0.0], [-2.0]]))
    assert t == pytest.approx([1.5, 4.0, 4.5, 4.5, np.inf])
    assert primitive.dtype == np.int32
    assert primitive[[0, 2, 3, 4]].tolist() == [0, 13, 14, -1] and 1 <= primitive[1] <= 12
    assert normal.T == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 4 + [[0.0, 0.0, 0.0]]))


def test_caster_respects_its_interval_and_the_inside_of_a_sphere():
    ball = (Sphere("s", (0.0, 0.0, 0.0), 1.0),)
    origin, along = np.array([[-3.0], [0.0], [0.0]]), np.array([[1.0], [0.0], [0.0]])
    assert closest(ball, origin, along)[0] == pytest.approx([2.0])
    assert closest(ball, origin, along, 2.5)[0] == pytest.approx([4.0])
    assert closest(ball, origin, along, 0.0, 1.9)[1].tolist() == [-1]
    assert closest(ball, np.zeros((3, 1)), along)[0] == pytest.approx([1.0])


def test_mesh_caster_is_the_sphere_in_the_limit():
    """A fine geodesic sphere against the closed form: depths to second order in the edges."""
    rng = np.random.default_rng(5)
    origins = np.stack([*rng.uniform(-0.9, 0.9, (2, 500)), np.full(500, 3.0)])
    origins = origins[:, np.hypot(*origins[:2]) < 0.9]
    down = np.array([[0.0], [0.0], [-1.0]])
    ref = closest((Sphere("s", (0.0, 0.0, 0.0), 1.0),), origins, down)
    got = closest((shapes.sphere("m", (0, 0, 0), 1.0, 32),), origins, down)
    assert np.max(np.abs(got[0] - ref[0])) < 5e-3
    assert np.min(np.sum(got[2] * ref[2], axis=0)) > 0.99


def test_paper_room_is_the_papers(room):
    """Section 5 of the 2001 paper: 31,000 polygons, a 20,000-polygon model, 122 degrees."""
    counts = {s.name: s.faces.shape[1] for s in room.shapes}
    assert room.triangles == sum(counts.values()) == paper_room.TRIANGLES == 31_000
    assert counts["bunny"] == 20_000
    light = room.lights["ceiling"]
    assert light.kind == "point" and light.fov_deg == 122.0
    assert light.direction == (0.0, 0.0, -1.0)
    for view in room.views.values():
        assert (view.width, view.height) == (512, 512)


def test_paper_room_bodies_are_closed_and_stand_in_the_room(room):
    walls = [s for s in room.shapes if s.faces.shape[1] == 2]
    assert len(walls) == 6
    middle = np.array([0.0, 0.0, 3.0])
    for wall in walls:
        inward = middle - wall.vertices.mean(axis=1)
        assert np.all(inward @ mesh_tools.face_normals(wall) > 0.0)
    for body in (s for s in room.shapes if s.faces.shape[1] > 2):
        assert mesh_tools.is_closed(body), body.name
        assert mesh_tools.signed_volume(body) > 0.0
        assert mesh_tools.face_areas(body).min() > 0.0
        assert np.all(np.abs(body.vertices[:2]) < 5.0)
        # Feet may be let into what they stand on, by at most a centimetre.
        assert -0.011 <= body.vertices[2].min() and body.vertices[2].max() < 3.0


def test_bunny_normals_are_smooth(room):
    """Neighbouring faces of the smooth model meet at small angles."""
    bunny = next(s for s in room.shapes if s.name == "bunny")
    start, end = bunny.faces.astype(np.int64), np.roll(bunny.faces, -1, axis=0).astype(np.int64)
    face = np.broadcast_to(np.arange(bunny.faces.shape[1]), start.shape).ravel()
    low, high = np.minimum(start, end).ravel(), np.maximum(start, end).ravel()
    pairs = face[np.lexsort((high, low))].reshape(-1, 2)
    normal = mesh_tools.face_normals(bunny)
    cosine = np.sum(normal[:, pairs[:, 0]] * normal[:, pairs[:, 1]], axis=0)
    assert np.mean(cosine > math.cos(math.radians(25.0))) > 0.97


@pytest.mark.parametrize(
    ("view", "least", "most"),
    [("overview", 1_500, 6_000), ("closeup", 50_000, 100_000), ("macro", 450_000, 600_000)],
)
def test_paper_room_views_need_the_papers_resolution(room, view, least, most):
    """Median side of a flat map whose texels match the pixels, with dark and lit pixels aplenty."""
    spec = room.views[view]
    origin, rays = view_rays(spec, 10)
    t, _, normal = closest(room.shapes, origin[:, None] + 0.0 * rays, rays)
    assert np.isfinite(t).all()
    points = origin[:, None] + t * rays
    light = np.asarray(room.lights["ceiling"].position)
    spoke = light[:, None] - points
    frame = math.tan(math.radians(61.0))
    assert np.all(np.abs(spoke[:2] / spoke[2]) < frame)
    # Solid angles: a pixel covers pitch^2 cos^3 of the eye's sphere, a texel the same of the light.
    forward = np.subtract(spec.target, spec.origin)
    cos_eye = forward @ rays / np.linalg.norm(forward)
    pitch = 2.0 * math.tan(math.radians(spec.fov_x_deg / 2.0)) / 512
    distance = np.linalg.norm(spoke, axis=0)
    eye_facing = np.abs(np.sum(normal * rays, axis=0))
    light_facing = np.abs(np.sum(normal * spoke, axis=0)) / distance
    pixel = pitch**2 * cos_eye**3 * t**2 / eye_facing
    whole_map = (2.0 * frame) ** 2 * (spoke[2] / distance) ** 3 * distance**2 / light_facing
    assert least < np.median(np.sqrt(whole_map / pixel)) < most
    lifted = points + 1e-7 * normal
    dark = np.mean(occluded(room.shapes, lifted, light, 1e-7))
    assert (0.03 if view == "overview" else 0.25) < dark < 0.75


def test_terrain_is_real_and_to_scale():
    x, y, height = terrain.elevation()
    assert height.shape == (344, 403) and (height.min(), height.max()) == (236.0, 1076.0)
    # 3 arc seconds: 92.5 m north everywhere, times the cosine of 36.6 degrees east.
    assert np.diff(y) == pytest.approx(92.5, abs=0.1)
    assert np.diff(x) == pytest.approx(92.8 * math.cos(math.radians(36.59)), abs=0.2)
    assert terrain.TRIANGLES == 2 * 343 * 402
    scene = terrain.make_terrain()
    (ground,) = scene.shapes
    assert isinstance(ground, Mesh)
    normal = mesh_tools.face_normals(ground)
    assert normal[2].min() > 0.3
    sun = np.asarray(scene.lights["sun"].direction)
    assert math.degrees(math.asin(-sun[2])) == pytest.approx(12.0)
    # A sun in the west-north-west lights towards the east and south.
    assert sun[0] > 0.0 > sun[1]


def test_terrain_eye_is_near_the_ground():
    x, y, height = terrain.elevation()
    view = terrain.make_terrain().views["ground"]
    column, row = np.searchsorted(x, view.origin[0]), np.searchsorted(y, view.origin[1])
    around = height[row - 1 : row + 1, column - 1 : column + 1]
    assert 5.0 < view.origin[2] - around.max() and view.origin[2] - around.min() < 100.0


@pytest.mark.parametrize("light", ["point", "spot", "directional"])
def test_letter_shadow_has_no_symmetry(light):
    """No flip, transpose or quarter turn of the lit image from above is the image itself."""
    scene = letter_f.make_letter_f()
    origin, rays = view_rays(scene.views["above"], 96)
    t, _, normal = closest(scene.shapes, origin[:, None] + 0.0 * rays, rays)
    points = origin[:, None] + t * rays + 1e-9 * normal
    spec = scene.lights[light]
    if spec.kind == "directional":
        towards = -np.asarray(spec.direction)[:, None] + 0.0 * points
        dark = closest(scene.shapes, points, towards)[1] >= 0
    else:
        dark = occluded(scene.shapes, points, np.asarray(spec.position))
    image = dark.reshape(96, 96)
    assert 0.03 < image.mean() < 0.2
    for turns in range(4):
        for flipped in (image, image[:, ::-1]):
            other = np.rot90(flipped, turns)
            if turns or flipped is not image:
                assert np.mean(other != image) > 0.5 * image.mean()


def test_letter_spot_covers_both_casters():
    """The cone of the spot holds letter and dot, so all lights cast the same two shadows."""
    scene = letter_f.make_letter_f()
    spot = scene.lights["spot"]
    assert spot.direction is not None and spot.cutoff_deg is not None
    axis = np.asarray(spot.direction) / np.linalg.norm(spot.direction)
    for caster in scene.shapes[1:]:
        assert isinstance(caster, Mesh)
        spoke = caster.vertices - np.asarray(spot.position)[:, None]
        angle = np.degrees(np.arccos(axis @ spoke / np.linalg.norm(spoke, axis=0)))
        assert angle.max() < spot.cutoff_deg
