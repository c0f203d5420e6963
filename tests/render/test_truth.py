"""Ray-traced truth against a float64 oracle: contact, self-shadowing, far from the origin."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded, vectorised
from helpers.shadow_oracle import disagreements, ref_blocked

from asmjax.render.load import load_scene
from asmjax.scene.builtin import load_builtin
from asmjax.scene.bunny import make_bunny
from asmjax.scene.mesh_tools import rotation, transform
from asmjax.scene.shapes import box, grid, quad, sphere
from asmjax.scene.spec import LightSpec, Mesh, SceneSpec, ViewSpec

pytestmark = pytest.mark.mitsuba

TURN = rotation((1.0, 2.0, 3.0), 0.65)
FAR = (1000.0, -2000.0, 500.0)


def traced(scene, view: ViewSpec, light: str | None = None):
    """Eye buffer, light frame, the prepared shadow rays, and the visibility of all pixels."""
    eye = scene.eye(view)
    frame = scene.light_frame(eye, light)
    rays = scene.shadow_rays(eye, frame, scene.light_rays(light))
    return eye, frame, rays, rays.trace()


def moved(spec: SceneSpec, turn: np.ndarray, offset) -> SceneSpec:
    """The same scene turned and then moved as a whole. Rectangles must be meshes by then."""

    def point(p):
        return None if p is None else tuple((turn @ np.asarray(p) + offset).tolist())

    def direction(d):
        return None if d is None else tuple((turn @ np.asarray(d)).tolist())

    shapes = [transform(s, turn, tuple(offset)) for s in spec.shapes if isinstance(s, Mesh)]
    assert len(shapes) == len(spec.shapes)
    views = {n: replace(v, origin=point(v.origin), target=point(v.target), up=direction(v.up))
             for n, v in spec.views.items()}  # fmt: skip
    lights = {n: replace(li, position=point(li.position), direction=direction(li.direction))
              for n, li in spec.lights.items()}  # fmt: skip
    return replace(spec, shapes=tuple(shapes), views=views, lights=lights)


def at_shadow_edges(lit: np.ndarray, rays, size) -> np.ndarray:
    """Pixels with a ray whose neighbour to the right or below has the other visibility."""
    image = lit.reshape(size)
    edge = np.zeros(size, bool)
    edge[:, :-1] |= image[:, 1:] != image[:, :-1]
    edge[:-1] |= image[1:] != image[:-1]
    return np.flatnonzero(edge.ravel() & rays.facing)


@pytest.mark.parametrize(
    "view",
    ["overview", *(pytest.param(near, marks=pytest.mark.slow) for near in ("closeup", "macro"))],
)
def test_paper_room(view):
    """31,000 triangles, every ray against every triangle in float64: no disagreement but for
    pixels that a shift of 1e-6 of the coordinates decides. Half the pixels lie at shadow edges;
    in `macro` a pixel is 0.04 mm wide, 5 m from the origin."""
    scene = loaded("paper_room")
    eye, frame, rays, lit = traced(scene, scene.view(view))
    assert not lit[~rays.facing].any()
    rng = np.random.default_rng(0)
    edges = at_shadow_edges(lit, rays, eye.size)
    pixels = np.concatenate([rng.choice(rays.pixels, 1500), rng.choice(edges, 1500)])
    wrong, undecided = disagreements(scene, eye, frame, lit, pixels)
    assert wrong == 0
    assert undecided <= 0.02 * pixels.size
    assert 0.2 < lit[pixels].mean() < 0.8


def as_meshes(spec: SceneSpec) -> SceneSpec:
    """`letter_f` with its plane as two triangles."""
    plane = quad("plane", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)])
    return replace(spec, shapes=(plane, *spec.shapes[1:]))


@pytest.mark.parametrize("place", ["home", "far"])
@pytest.mark.parametrize("light", ["point", "spot", "directional"])
def test_letter_f(light, place):
    """Each kind of light, and the scene moved by 2,000 times its size, where float32 coordinates
    are 1.2e-4 apart. The oracle sees the same rounded triangles."""
    spec = as_meshes(load_builtin("letter_f"))
    scene = load_scene(spec if place == "home" else moved(spec, TURN, FAR))
    eye, frame, rays, lit = traced(scene, scene.view("angle").resized(160, 160), light)
    wrong, undecided = disagreements(scene, eye, frame, lit, rays.pixels)
    assert wrong == 0
    assert undecided <= (0.001 if place == "home" else 0.01) * rays.count
    assert 0.85 < lit[rays.pixels].mean() < 0.97
    # Outside the cone of the spot all is dark, without a ray.
    assert rays.count < (0.7 if light == "spot" else 0.91) * lit.size


HEIGHTS = (2e-5, 5e-5, 1e-4, 3e-4, 1e-3)


def contact_scene() -> SceneSpec:
    """Plates 2 mm wide that hover `HEIGHTS` above a floor, and a box that stands on it, 5 units
    from the origin, under a light at 7 degrees. A pixel is 7.5e-5 wide."""
    x, y = 3.6, 3.4
    floor = quad("floor", [(-6, -6, 0), (6, -6, 0), (6, 6, 0), (-6, 6, 0)])
    casters = [box("block", (x + 0.006, y - 0.001, 0.0), (x + 0.008, y + 0.001, 4e-4))]
    for k, height in enumerate(HEIGHTS):
        a, b = x - 0.009 + 0.003 * k, x - 0.007 + 0.003 * k
        corners = [(a, y - 0.001), (b, y - 0.001), (b, y + 0.001), (a, y + 0.001)]
        casters.append(quad(f"plate{k}", [(*corner, height) for corner in corners]))
    view = ViewSpec("macro", (x, y - 0.05, 0.06), (x, y, 0.0), fov_x_deg=14.0, width=256,
                    height=160)  # fmt: skip
    lamp = LightSpec("lamp", "point", position=(x + 1.0, y + 7.9, 1.0))
    sun = LightSpec("sun", "directional", direction=(-1.0, -7.9, -1.0))
    lights = {"lamp": lamp, "sun": sun}
    return SceneSpec("contact", "", (floor, *casters), {"macro": view}, lights)


@pytest.mark.parametrize("light", ["lamp", "sun"])
@pytest.mark.parametrize("turned", [False, True], ids=["axis-aligned", "turned"])
def test_contact_shadows_at_macro_scale(turned, light):
    """Shadows of casters 2e-5 to 1e-3 above the receiver start where they should."""
    spec = contact_scene()
    if turned:
        spec = moved(spec, TURN, np.zeros(3))
    scene = load_scene(spec)
    eye, frame, rays, lit = traced(scene, scene.view(), light)
    on_floor = eye.shape == 0
    dark = (on_floor & ~lit).reshape(eye.size)
    # Each caster has a dark pixel right beside it: six groups of dark columns.
    columns = dark.any(axis=0).astype(int)
    assert np.count_nonzero(np.diff(columns) == 1) >= 5 and dark.mean() > 0.05
    wrong, undecided = disagreements(scene, eye, frame, lit, rays.pixels)
    assert wrong == 0
    assert undecided <= 0.02 * rays.count


def test_spawned_rays_would_have_missed_contact_shadows():
    """Why truth has an offset of its own: `spawn_ray_to` starts (1 + max|p|) x 9e-5 = 4e-4 off
    the surface here, above most of these casters, and loses a quarter of the shadow."""
    spec = contact_scene()
    scene = load_scene(spec)
    eye, frame, rays, lit = traced(scene, scene.view(), "lamp")
    mi, pixels = scene._mi, np.flatnonzero(rays.facing & (eye.shape == 0))
    ray = eye.camera.directions(*eye.camera.centres())[:, pixels]
    start = np.tile(eye.camera.origin[:, None], pixels.size)
    if vectorised(mi):
        hit = scene._scene.ray_intersect(mi.Ray3f(mi.Point3f(start), mi.Vector3f(ray)))
        spawned = scene._scene.ray_test(
            hit.spawn_ray_to(mi.Point3f(*frame.origin.tolist()))
        ).numpy()
    else:
        found = (scene._scene.ray_intersect(mi.Ray3f(o, d))
                 for o, d in zip(start.T.tolist(), ray.T.tolist(), strict=True))  # fmt: skip
        target = frame.origin.tolist()
        spawned = np.array([scene._scene.ray_test(h.spawn_ray_to(target)) for h in found])
    corners = scene.geometry.corners(np.arange(scene.geometry.triangles))
    own = eye.prim[pixels]
    blocked = ref_blocked(corners, eye.world[:, pixels], frame.origin, own)
    assert np.mean(~spawned[blocked]) > 0.25
    # A few edge pixels, which a shift of 5e-6 decides, are all that truth itself gets wrong.
    assert np.mean(lit[pixels][blocked]) < 0.05


GRAZING_DEG = (0.0, 30.0, 60.0, 80.0, 88.0, 89.0, 89.5, 89.9)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), FAR], ids=["home", "far"])
@pytest.mark.parametrize("cells", [1, 40])
def test_planes_do_not_shade_themselves(cells, offset):
    """A plane of any tilt up to 89.9 degrees to the light is lit all over, whether it is two
    triangles or 3,200, and wherever it lies. Any acne would be a dark pixel."""
    at = np.linspace(-5.0, 5.0, cells + 1)
    sheet = grid("sheet", at, at, np.zeros((cells + 1, cells + 1)))
    lights = {}
    for tilt in GRAZING_DEG:
        sine, cosine = np.sin(np.radians(tilt)), np.cos(np.radians(tilt))
        towards = np.array([sine * np.cos(tilt), sine * np.sin(tilt), cosine])
        # 6 units beyond the border of the sheet the light stands low over all of it.
        lights[f"lamp{tilt}"] = LightSpec(f"lamp{tilt}", "point", position=tuple(13.0 * towards))
        lights[f"sun{tilt}"] = LightSpec(f"sun{tilt}", "directional", direction=tuple(-towards))
    view = ViewSpec("v", (1.0, -3.0, 4.0), (0.3, 0.2, 0.0), fov_x_deg=50.0, width=128, height=128)
    spec = SceneSpec("sheet", "", (sheet,), {"v": view}, lights)
    scene = load_scene(moved(spec, TURN, offset))
    eye = scene.eye(scene.view())
    for name in lights:
        frame = scene.light_frame(eye, name)
        rays = scene.shadow_rays(eye, frame, scene.light_rays(name))
        assert rays.count > 0.9 * eye.valid.sum(), name
        assert np.array_equal(rays.trace(), rays.facing), name


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (30.0, -20.0, 10.0)], ids=["home", "moved"])
def test_convex_ball_does_not_shade_itself(offset):
    """On a convex closed mesh every facet that faces the light sees it: 12,800 of them, with
    facets at every angle to the light, and no ray may be stopped."""
    ball = sphere("ball", (0.0, 0.0, 0.0), 1.0, 40)
    view = ViewSpec("v", (0.5, -4.0, 1.0), (0.0, 0.0, 0.0), fov_x_deg=32.0, width=200, height=200)
    lights = {"lamp": LightSpec("lamp", "point", position=(3.0, -1.0, 2.0)),
              "sun": LightSpec("sun", "directional", direction=(-0.8, 0.2, -0.4))}  # fmt: skip
    spec = SceneSpec("ball", "", (ball,), {"v": view}, lights)
    scene = load_scene(moved(spec, TURN, offset))
    for name in lights:
        _, _, rays, lit = traced(scene, scene.view(), name)
        assert rays.count > 8000
        assert np.array_equal(lit, rays.facing)


def test_smooth_bunny():
    """20,000 small facets near the terminator, where a wrong offset shows first as acne: the
    1,200 pixels most nearly edge-on to the light agree with the oracle."""
    view = ViewSpec("v", (0.2, -2.0, 0.9), (0.0, 0.0, 0.35), fov_x_deg=30.0, width=256, height=256)
    bunny = make_bunny()
    middle = 0.5 * (bunny.vertices.min(axis=1) + bunny.vertices.max(axis=1))
    view = replace(view, target=tuple(middle), origin=tuple(middle + [0.3, -1.6, 0.7]))
    lamp = LightSpec("lamp", "point", position=tuple(middle + [2.0, -0.5, 1.0]))
    scene = load_scene(SceneSpec("bunny", "", (bunny,), {"v": view}, {"lamp": lamp}))
    eye, frame, rays, lit = traced(scene, scene.view())
    to_light = frame.origin[:, None] - eye.world[:, rays.pixels]
    cosine = np.sum(eye.normal[:, rays.pixels] * to_light, axis=0)
    pixels = rays.pixels[np.argsort(cosine / np.linalg.norm(to_light, axis=0))[:1200]]
    wrong, undecided = disagreements(scene, eye, frame, lit, pixels)
    assert rays.count > 5000 and wrong == 0 and undecided <= 3
    assert 0.1 < lit[pixels].mean() < 0.999
