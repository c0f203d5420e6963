"""The eye buffer: exact positions, sides, ids, clip planes, orientation, and reflectance."""

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded, mitsuba_points, pinhole, real_scene

from asmjax.render.load import load_scene
from asmjax.render.variant import activate
from asmjax.scene.builtin import load_builtin

pytestmark = pytest.mark.mitsuba

SIZE = (96, 64)


def seen(scene, view=None, size=SIZE):
    """Eye buffer of a small view of a scene."""
    return scene.eye(scene.view(view).resized(*size))


def one_of_each(mi) -> dict:
    """A ground mesh, and four kinds of other shapes beside each other; the cube comes last."""
    move = mi.ScalarTransform4f().translate
    return {
        "type": "scene",
        "eye": pinhole(mi, (0.0, -6.0, 5.0), (0.0, 0.0, 0.0), SIZE, (0, 0, 1), fov=50.0),
        "ground": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(6.0)},
        "ball": {"type": "sphere", "center": [-1.8, 0.0, 0.6], "radius": 0.6},
        "lid": {"type": "disk", "to_world": move([-0.4, 0.0, 0.8]).scale(0.5)},
        "pipe": {"type": "cylinder", "p0": [0.5, 0.0, 0.2], "p1": [1.3, 0.3, 0.9], "radius": 0.3},
        "block": {"type": "cube", "to_world": move([2.1, 0.0, 0.4]).scale(0.4)},
        "lamp": {"type": "point", "position": [0.0, 0.0, 9.0]},
    }


@pytest.mark.parametrize("name", ["paper_room", "terrain", "letter_f"])
def test_positions_lie_on_the_true_planes(name):
    """Of the float32 hit only the triangle's number is kept: the point is exact in float64.

    The distance from the plane of the triangle, formed in float64 from its corners, and the
    distance from the pixel's ray, are below 1e-12 of the largest coordinate in play.
    """
    scene = loaded(name)
    eye = seen(scene)
    pixels = np.flatnonzero(eye.valid)
    assert pixels.size > 2000
    a, b, c = scene.geometry.corners(eye.prim[pixels])
    normal = np.cross(b - a, c - a, axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    point = eye.world[:, pixels]
    size = np.abs([a, b, c]).max(axis=(0, 1))
    assert np.all(np.abs(np.sum(normal * (point - a), axis=0)) <= 1e-12 * size)
    ray = eye.camera.directions(*eye.camera.centres())[:, pixels]
    aside = point - eye.camera.origin[:, None] - eye.depth[pixels] * ray
    assert np.all(np.abs(aside) <= 1e-12 * size)
    assert np.abs(np.sum(normal * eye.normal[:, pixels], axis=0)) == pytest.approx(1.0, abs=1e-12)
    # On the device the position counts from the eye, so it keeps its digits in float32 too.
    relative = np.asarray(eye.points.position)[:, pixels] + eye.points.origin[:, None]
    assert np.all(np.abs(relative - point) <= 1e-6 * eye.depth[pixels])


@pytest.mark.parametrize("name", ["paper_room", "letter_f", "a6_sphere", "each", "cornell"])
def test_positions_agree_with_mitsuba(name):
    """The exact point is Mitsuba's own `si.p` up to the rounding of a float32 hit."""
    mi = activate()
    sources = {"each": lambda: load_scene(one_of_each(mi)),
               "cornell": lambda: loaded(real_scene("cornell_box"))}  # fmt: skip
    scene = sources.get(name, lambda: loaded(name))()
    eye = seen(scene)
    ray = eye.camera.directions(*eye.camera.centres())
    start = eye.camera.origin[:, None] + eye.camera.near * ray
    theirs = mitsuba_points(mi, scene._scene, start, ray)
    assert np.array_equal(eye.valid, ~np.isnan(theirs[0]))
    pixels = np.flatnonzero(eye.valid)
    # Across the ray float32 errs by roundings of the coordinates; along it by 1 / cosine more.
    cosine = -np.sum(eye.normal * ray, axis=0)[pixels] / np.linalg.norm(ray[:, pixels], axis=0)
    error = np.linalg.norm(eye.world - theirs, axis=0)[pixels]
    scale = np.abs(eye.world[:, pixels]).max(axis=0) + eye.depth[pixels]
    # The renderer's float32 quadratics of curved shapes lose a digit more than its triangles.
    flat = scene.geometry.flat[scene.geometry.stored(eye.prim[pixels], eye.shape[pixels])]
    assert np.all(error * cosine <= np.where(flat, 1e-6, 1e-5) * scale)


@pytest.mark.parametrize("name", ["paper_room", "terrain", "letter_f", "a6_sphere"])
def test_normals_are_unit_and_face_the_eye(name):
    """Normals are of length 1 and on the side of the surface that the pixel sees; 0 elsewhere."""
    eye = seen(loaded(name))
    ray = eye.camera.directions(*eye.camera.centres())
    facing = np.sum(eye.normal * ray, axis=0)
    assert np.all(facing[eye.valid] < 0) and np.all(eye.normal[:, ~eye.valid] == 0)
    assert np.linalg.norm(eye.normal[:, eye.valid], axis=0) == pytest.approx(1.0, abs=1e-6)


def test_inside_of_a_sphere_faces_the_eye():
    """From inside, the seen side of a sphere is its inside: the normal points to the middle."""
    mi = activate()
    scene = load_scene({
        "type": "scene", "ball": {"type": "sphere", "radius": 3.0}, "lamp": {"type": "point"},
        "eye": pinhole(mi, (0.0, 0.0, 1.0), (1.0, 0.0, 0.5), (16, 16)),
    })  # fmt: skip
    eye = seen(scene, size=(16, 16))
    assert eye.valid.all()
    assert eye.normal == pytest.approx(-eye.world / 3.0, abs=1e-5)


def test_ids_are_dense_and_count_through_the_shapes():
    """Each shape is named by where it lies; ids run through the shapes in scene order."""
    mi = activate()
    scene = load_scene(one_of_each(mi))
    eye = seen(scene)
    names = [shape.id() for shape in scene._scene.shapes()]
    x, y, z = eye.world
    where = {
        "ground": np.abs(z) < 1e-9,
        "ball": np.abs(np.hypot(np.hypot(x + 1.8, y), z - 0.6) - 0.6) < 1e-4,
        "lid": (np.abs(z - 0.8) < 1e-5) & (np.hypot(x + 0.4, y) <= 0.5001),
        "pipe": (x > 0.2) & (x < 1.5) & (z > 1e-3) & (y < 0.7),
        "block": (np.abs(x - 2.1) < 0.4001) & (np.abs(y) < 0.4001) & (z > 1e-9),
    }
    assert set(names) == set(where) and eye.valid.sum() > 3000
    prim = eye.prim
    first = scene.geometry.first_prim
    for index, name in enumerate(names):
        mine = eye.shape == index
        assert mine.sum() > 20, name
        assert np.all(where[name][mine]), name
        assert np.all((prim[mine] >= first[index]) & (prim[mine] < first[index + 1])), name
    counts = dict(zip(names, np.diff(first), strict=True))
    assert counts == {"ground": 2, "ball": 1, "lid": 1, "pipe": 1, "block": 12}
    assert np.all(prim[~eye.valid] == -1) and np.all(eye.shape[~eye.valid] == -1)


def test_curves_have_an_id_per_segment(tmp_path):
    """A curve's segments are primitives of their own and never spill into the next shape's ids."""
    mi = activate()
    points = "\n".join(f"{0.4 * i - 2} {0.3 * (-1) ** i} 1 0.12" for i in range(11))
    (tmp_path / "curve.txt").write_text(points)
    scene = load_scene({
        "type": "scene", "lamp": {"type": "point"}, "eye": pinhole(mi, size=SIZE, fov=60.0),
        "wire": {"type": "linearcurve", "filename": str(tmp_path / "curve.txt")},
        "wall": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(9.0)},
    })  # fmt: skip
    assert scene.geometry.first_prim.tolist() == [0, 10, 12]
    eye = seen(scene)
    prim = eye.prim
    assert set(prim[eye.shape == 0]) == set(range(10))
    assert set(prim[eye.shape == 1]) == {10, 11}
    # Ids follow the curve: the middle of segment k is at x = 0.4 k - 1.8.
    for k in range(10):
        assert eye.world[0, prim == k].mean() == pytest.approx(0.4 * k - 1.8, abs=0.1)


def test_clip_planes():
    """What is nearer than near_clip or further than far_clip, along the axis, is not seen."""
    mi = activate()
    move = mi.ScalarTransform4f().translate
    shapes = {f"sheet{k}": {"type": "rectangle", "to_world": move([0, 0, 5 - d]).scale(0.6 * d)}
              for k, d in enumerate((1.0, 2.0, 3.0))}  # fmt: skip

    def nearest(**clip):
        scene = load_scene({"type": "scene", "lamp": {"type": "point"}, **shapes,
                            "eye": pinhole(mi, size=(17, 17), fov=50.0, **clip)})  # fmt: skip
        eye = scene.eye(scene.view())
        assert eye.valid.all() and np.ptp(eye.depth) < 1e-14
        return eye.shape[0], round(eye.depth[0], 14)

    assert nearest() == (0, 1.0)
    # Axial: at the corner of the image the sheet is 20 % further away along the ray.
    assert nearest(near_clip=1.05) == (1, 2.0)
    assert nearest(near_clip=2.5) == (2, 3.0)
    assert nearest(near_clip=2.5, far_clip=3.05) == (2, 3.0)
    with pytest.raises(Exception, match="sees no surface"):
        nearest(near_clip=2.5, far_clip=2.95)


def test_orientation_is_that_of_a_mitsuba_render():
    """The letter F rendered by Mitsuba (position and albedo, one sample per pixel centre) is our
    eye buffer: row 0 at the top, not mirrored. Silhouettes may differ in a pixel or two."""
    mi = activate()
    scene = loaded("letter_f")
    view = load_builtin("letter_f").views["angle"]
    sensor = pinhole(mi, view.origin, view.target, SIZE, view.up, fov=view.fov_x_deg)
    sensor["film"] |= {"pixel_format": "rgb", "component_format": "float32"}
    sensor["sampler"] = {"type": "stratified", "sample_count": 1, "jitter": False}
    shapes = {f"s{i}": shape for i, shape in enumerate(scene._scene.shapes())}
    twin = mi.load_dict({
        "type": "scene", "eye": sensor, "lamp": {"type": "point", "position": [0, 0, 9]},
        "integrator": {"type": "aov", "aovs": "where:position,paint:albedo"}, **shapes,
    }, optimize=False)  # fmt: skip
    theirs = np.array(mi.render(twin, spp=1), np.float64)
    eye = seen(scene, "angle")
    ours = np.concatenate([np.where(eye.valid, eye.world, 0.0), eye.albedo])
    ours = ours.reshape(6, *eye.size).transpose(1, 2, 0)

    def differs(image):
        return np.mean(np.any(np.abs(image - theirs[..., -6:]) > 3e-3, axis=2))

    assert differs(ours) < 0.005
    for flip in (ours[::-1], ours[:, ::-1], ours[::-1, ::-1]):
        assert differs(flip) > 0.5


def test_offset_moves_the_samples_right_and_down():
    """Half a pixel right and down of one grid are the pixel corners: those of a doubled grid."""
    scene = loaded("letter_f")
    view = scene.view("above").resized(32, 32)
    fine = scene.eye(view.resized(64, 64))
    world = fine.world.reshape(3, 64, 64)
    shifted = scene.eye(view, offset=(0.25, -0.25)).world.reshape(3, 32, 32)
    assert shifted == pytest.approx(world[:, ::2, 1::2], abs=1e-9)


def test_albedo_is_the_reflectance_of_what_is_seen():
    """Colours per shape of letter_f, and 0 where nothing is seen."""
    scene = loaded("letter_f")
    eye = seen(scene, size=(48, 48))
    for index, shape in enumerate(load_builtin("letter_f").shapes):
        mine = eye.albedo[:, eye.shape == index]
        expected = np.broadcast_to(np.array(shape.reflectance)[:, None], mine.shape)
        assert mine == pytest.approx(expected, abs=1e-6)
    assert not eye.albedo[:, ~eye.valid].any()


def test_albedo_of_a_texture_and_of_two_sides():
    """A texture is looked up where the pixel looks; a two-sided material on the side it sees."""
    mi = activate()
    checks = {"type": "checkerboard", "color0": 0.2, "color1": 0.9,
              "to_uv": mi.ScalarTransform4f().scale(2)}  # fmt: skip
    one, two = ({"type": "diffuse", "reflectance": {"type": "rgb", "value": c}}
                for c in ([0.1, 0.2, 0.3], [0.6, 0.5, 0.4]))  # fmt: skip
    painted = {"type": "diffuse", "reflectance": checks}
    coin = {"type": "twosided", "front": one, "back": two}
    move = mi.ScalarTransform4f().translate

    def albedo(bsdf, height):
        sheet = {"type": "rectangle", "to_world": move([0, 0, 0]), "bsdf": bsdf}
        eye = pinhole(mi, (0, 0, height), size=(16, 16), fov=20.0)
        scene = load_scene({"type": "scene", "lamp": {"type": "point"}, "m": sheet, "eye": eye})
        buffer = scene.eye(scene.view())
        return buffer.world, buffer.albedo

    world, paint = albedo(painted, 5.0)
    # Two tiles of [0, 1]^2 in each of u, v = (x + 1) / 2, (y + 1) / 2; four checks in each.
    check = np.floor((world[0] + 1) * 2) + np.floor((world[1] + 1) * 2)
    assert paint[0] == pytest.approx(np.where(check % 2 == 0, 0.2, 0.9), abs=1e-5)
    assert len(np.unique(np.round(paint, 3))) == 2
    for height, colour in ((5.0, [0.1, 0.2, 0.3]), (-5.0, [0.6, 0.5, 0.4])):
        assert albedo(coin, height)[1].T == pytest.approx(np.tile(colour, (256, 1)), abs=1e-6)
