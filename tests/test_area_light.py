"""Lights with a size: where samples lie, how wide they look, and what frames know of them."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.poses import projected
from hypothesis import example, given
from hypothesis import strategies as st

from asmjax.buffers import eye_buffer
from asmjax.errors import UseError
from asmjax.experiment.traces import counted_traces
from asmjax.geometry import (
    AreaLight,
    disk_light,
    in_domain,
    look_at,
    rectangle_light,
    sphere_light,
    stratified,
    sun_light,
)
from asmjax.hard_cases.measure import algorithm_for
from asmjax.scene.analytic_rays import scene_bounds
from asmjax.scene.lights import area_of, kept_light_frame, light_frame
from asmjax.scene.motion import moved_light
from asmjax.scene.spec import Disk, LightSpec, Rectangle, Sphere

SUN_DEG = 0.5338
GRID = 64
FLAT = {
    "rectangle": rectangle_light((1.0, 2.0, 3.0), (0.6, 0.0, 0.0), (0.0, -0.3, 0.0)),
    "disk": disk_light((1.0, 2.0, 3.0), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0)),
}
ROUND = {
    "sphere": sphere_light((1.0, 2.0, 3.0), 0.5),
    "sun": sun_light((0.3, 0.1, -1.0), np.radians(SUN_DEG)),
}
LIGHTS = FLAT | ROUND
SPECS = {
    "rectangle": LightSpec("lamp", "point", (1.0, 2.0, 3.0), area=FLAT["rectangle"]),
    "sphere": LightSpec("ball", "point", (1.0, 2.0, 3.0), area=ROUND["sphere"]),
    "sun": LightSpec("sun", "directional", direction=(0.3, 0.1, -1.0), area=ROUND["sun"]),
}

each_light = pytest.mark.parametrize("shape", LIGHTS)


def coordinates(area: AreaLight, offsets: np.ndarray) -> np.ndarray:
    """(2, k) parts of the half axes."""
    axes = np.stack([area.half_u, area.half_v])
    return (axes @ offsets) / np.sum(axes * axes, axis=1)[:, None]


@each_light
def test_samples_are_uniform_in_area(shape):
    """Means of 1, x, x^2, xy and x^2 y^2 over a fine grid are those of the square or the disk."""
    area = LIGHTS[shape]
    offsets = area.offsets(stratified(GRID))
    x, y = coordinates(area, offsets)
    np.testing.assert_allclose(offsets, np.outer(area.half_u, x) + np.outer(area.half_v, y))
    second, fourth = (1 / 3, 1 / 9) if shape == "rectangle" else (1 / 4, 1 / 24)
    found = [np.mean(m) for m in (x, y, x * y, x * x, y * y, x * x * y * y)]
    np.testing.assert_allclose(found, [0, 0, 0, second, second, fourth], atol=1e-3)
    if shape != "rectangle":
        radius = np.hypot(x, y)
        # A ring's share of the samples is its share of the area; grids of the map are rings.
        for ring in (0.25, 0.5, 0.75):
            assert np.mean(radius < ring) == pytest.approx(ring**2, abs=1e-9)


def test_stratified_samples_are_the_centres_of_cells():
    np.testing.assert_allclose(stratified(2), [[0.25, 0.75, 0.25, 0.75], [0.25, 0.25, 0.75, 0.75]])
    assert stratified(1).tolist() == [[0.5], [0.5]]
    # An odd grid has the centre itself, which then is the light of hard shadows.
    assert not FLAT["disk"].offsets(stratified(3))[:, 4].any()


def test_a_sphere_is_sampled_where_a_receiver_sees_it():
    """All samples lie on the disk of the tangents from there, within the ball, evenly; and an own
    receiver for each sample gives the same as all at once."""
    area = ROUND["sphere"]
    for receiver in ([1.0, 2.0, 0.0], [-3.0, 4.0, 2.5], [1.0, 2.0, 2.4]):
        away = np.array(receiver) - area.centre
        distance = np.linalg.norm(away)
        offsets = area.offsets(stratified(GRID), np.array(receiver))
        assert np.linalg.norm(offsets, axis=0).max() <= 0.5 + 1e-12
        np.testing.assert_allclose(away @ offsets / distance, 0.25 / distance)
        to_samples = offsets - away[:, None]
        cosine = -(away @ to_samples) / distance / np.linalg.norm(to_samples, axis=0)
        assert cosine.min() >= np.sqrt(1 - (0.5 / distance) ** 2) - 1e-12
        across = offsets - np.outer(away, away @ offsets) / distance**2
        rim2 = 0.25 * (1 - (0.5 / distance) ** 2)
        assert np.mean(np.sum(across**2, axis=0)) == pytest.approx(rim2 / 2, rel=1e-3)
        many = np.repeat(np.array(receiver)[:, None], GRID**2, axis=1)
        np.testing.assert_allclose(area.offsets(stratified(GRID), many), offsets)
    inside = area.offsets(stratified(2), area.centre)
    assert np.isfinite(inside).all() and np.linalg.norm(inside, axis=0).max() <= 0.5 + 1e-12


def test_effective_width_is_that_of_the_disk_that_looks_as_large(dtype):
    """Straight on, at 60 degrees, from behind, edge-on; in both precisions."""
    down = np.array([0.0, 0.0, -2.0])
    slanted = np.array([np.sqrt(0.75), 0.0, -0.5])
    directions = np.stack([down, slanted, -down, [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], axis=1)
    expected = {
        "rectangle": 2 * np.sqrt(4 * 0.6 * 0.3 / np.pi) * np.array([1, np.sqrt(0.5), 0, 0, 0]),
        "disk": np.array([1, np.sqrt(0.5), 0, 0, 0]),
        "sphere": np.ones(5),
        # 9.32 mm of penumbra for each metre behind the edge.
        "sun": np.full(5, 9.316e-3),
    }
    for shape, area in LIGHTS.items():
        width = area.effective_width(jnp.asarray(directions, dtype))
        assert width.dtype == dtype
        np.testing.assert_allclose(width, expected[shape], rtol=1e-4, atol=1e-7)
        np.testing.assert_allclose(area.effective_width(directions), expected[shape], rtol=1e-4)


WIDTHS = {
    shape: jax.jit(jax.value_and_grad(lambda d, area=area: area.effective_width(d[:, None])[0]))
    for shape, area in FLAT.items()
}
VECTORS = st.lists(st.floats(-10, 10, width=32), min_size=3, max_size=3)


@example([0.0, 1.0, -1.1754943508222875e-38])
@example([0.0, 2.2e-16, -4.2e-33])
@example([0.0, 0.0, -1e-29])
@given(VECTORS)
@pytest.mark.parametrize("shape", FLAT)
def test_the_gradient_of_the_width_is_finite(shape, direction):
    """Edge-on, from behind and of no direction too."""
    value, slope = WIDTHS[shape](np.array(direction, np.float32))
    assert jnp.isfinite(value) and jnp.isfinite(slope).all()


def test_flat_lights_emit_on_one_side():
    points = np.array([[0.0, 0.0, 2.9], [0.0, 0.0, 3.1], [9.0, 9.0, 3.0]]).T
    for shape, area in LIGHTS.items():
        expected = [True, False, False] if shape in FLAT else [True] * 3
        assert area.emits_towards(points).tolist() == expected
        assert area.emits_towards(jnp.asarray(points)).tolist() == expected


@each_light
def test_extents_areas_and_radii(shape):
    """Along an axis, and across; by samples of a fine grid."""
    area = LIGHTS[shape]
    directions = np.stack([np.eye(3)[0], [0.6, 0.8, 0.0], np.eye(3)[2], [0.0, 0.6, -0.8]], axis=1)
    farthest = (directions.T @ area.offsets(stratified(400))).max(axis=1)
    if shape == "sphere":
        farthest = np.full(4, 0.5)
    np.testing.assert_allclose(area.extent_along(directions), farthest, atol=0.01 * area.radius)
    reach = np.linalg.norm(area.offsets(stratified(400)), axis=0).max()
    assert area.radius == pytest.approx(reach, rel=0.01)
    half = np.tan(np.radians(SUN_DEG / 2))
    areas = {"rectangle": 0.72, "disk": np.pi / 4, "sphere": np.pi / 4, "sun": np.pi * half**2}
    assert area.area == pytest.approx(areas[shape])


WRONG = {
    "flat": (lambda: rectangle_light((0, 0, 0), (1, 0, 0), (2, 0, 0)), "has no area"),
    "none": (lambda: disk_light((0, 0, 0), (0, 0, 0), (0, 1, 0)), "has no area"),
    "not finite": (lambda: disk_light((0, np.nan, 0), (1, 0, 0), (0, 1, 0)), "is no vector"),
    "two numbers": (lambda: sphere_light((0, 0), 1.0), "is no vector"),
    "radius": (lambda: sphere_light((0, 0, 0), 0.0), "radius 0.0 is not possible"),
    "wide sun": (lambda: sun_light((0, 0, -1), 2.0), "allowed: more than 0 and at most 90"),
    "sharp sun": (lambda: sun_light((0, 0, -1), 0.0), "allowed: more than 0"),
    "no samples": (lambda: stratified(0), "allowed: 1 or more a side"),
    "spot": (
        lambda: LightSpec("a", "spot", (1, 2, 3), (0, 0, -1), None, 20.0, FLAT["disk"]),
        "kind 'spot' cannot have the size of a disk",
    ),
    "sun on a point": (
        lambda: LightSpec("a", "point", (1, 2, 3), area=ROUND["sun"]),
        "cannot have the size of a sun",
    ),
    "elsewhere": (
        lambda: LightSpec("a", "point", (1, 2, 4), area=FLAT["disk"]),
        "give the same for both",
    ),
    "another sun": (
        lambda: LightSpec("a", "directional", direction=(0, 0, -1), area=ROUND["sun"]),
        "give the same for both",
    ),
    "dark": (lambda: LightSpec("a", "point", (1, 2, 3), intensity=-1.0), "intensity of -1.0"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_use_is_refused(name):
    make, said = WRONG[name]
    with pytest.raises(UseError, match=said):
        make()


def test_shapes_become_lights():
    """With their front where it says: along half_u x half_v, along the normal, on all sides."""
    rectangle = area_of(Rectangle("a", (0, 0, 5), (0.6, 0, 0), (0, -0.6, 0)))
    disk = area_of(Disk("a", (0, 0, 5), (0, 0, -1), 0.6))
    sphere = area_of(Sphere("a", (0, 0, 5), 0.6))
    assert [a.shape for a in (rectangle, disk, sphere)] == ["rectangle", "disk", "sphere"]
    for flat in (rectangle, disk):
        np.testing.assert_allclose(flat.normal, [0, 0, -1])
    assert [a.radius for a in (disk, sphere)] == pytest.approx([0.6, 0.6])
    assert not sphere.normal.any()


def floor(x=0.0, half=1.0, normal=(0.0, 0.0, 1.0)):
    """An eye that sees a square of the floor around (x, 0), whose surface may be tilted."""
    side = np.linspace(-half, half, 9)
    at = np.stack(np.meshgrid(x + side, side)).reshape(2, -1)
    n = at.shape[1]
    return eye_buffer(
        look_at((x, 0.0, 4.0), (x, 0.0, 0.0), (0.0, 1.0, 0.0), fov_x_deg=40, width=9, height=9),
        world=np.concatenate([at, np.zeros((1, n))]),
        normal=np.repeat(np.array(normal)[:, None], n, axis=1),
        depth=np.full(n, 4.0),
        prim=np.zeros(n, np.int32),
        shape=np.zeros(n, np.int32),
        albedo=np.ones((3, n), np.float32),
        flat=np.ones(n, bool),
    )


BOUNDS = np.array([[-10.0, 10.0], [-10.0, 10.0], [0.0, 6.0]])


@pytest.mark.parametrize("name", SPECS)
def test_frames_have_the_area_of_their_light(name):
    """Kept frames too, which are the same while light and view rest and follow a light that moves;
    without an area nothing is left of it."""
    light = SPECS[name]
    frame = light_frame(light, floor(), BOUNDS)
    assert eqx.tree_equal(frame.area, light.area)
    kept = kept_light_frame(None, light, floor(), BOUNDS)
    assert eqx.tree_equal(kept_light_frame(kept, light, floor(), BOUNDS), kept)
    moved = moved_light(light, 30, 10.0, (0.0, 0.0, 1.0))
    assert moved.area is not None and light.area is not None
    followed = kept_light_frame(kept, moved, floor(), BOUNDS)
    assert eqx.tree_equal(followed.area, moved.area)
    assert followed.area is not None and followed.area.radius == pytest.approx(light.area.radius)
    if name == "sun":
        np.testing.assert_allclose(followed.area.normal, followed.rotation[0, 2], atol=1e-12)
    else:
        np.testing.assert_array_equal(followed.area.centre, followed.origin)
    point = replace(light, area=None)
    assert kept_light_frame(kept, point, floor(), BOUNDS).area is None
    assert moved_light(point, 30, 10.0, (0.0, 0.0, 1.0)) == replace(moved, area=None)


def test_receivers_that_a_part_of_the_light_shines_on_are_in_its_frame():
    """The floor is tilted so that the light's centre lies just behind its plane, and an edge of the
    light before it."""
    light = LightSpec("lamp", "point", (0.0, 0.0, 3.0), area=sphere_light((0, 0, 3), 0.5))
    normal = np.array([1.0, 0.0, -0.1]) / np.hypot(1.0, 0.1)
    eye = floor(half=0.1, normal=tuple(normal))
    with pytest.raises(UseError, match="shines on no surface"):
        light_frame(replace(light, area=None), eye, BOUNDS)
    assert in_domain(light_frame(light, eye, BOUNDS), eye.world).all()


def test_a_light_without_a_size_costs_nothing():
    """Its frame has the leaves that it had before there were sizes, and jitted functions of frames
    trace once for all lights of a kind."""
    light = SPECS["rectangle"]
    with_area, without = (
        light_frame(one, floor(), BOUNDS) for one in (light, replace(light, area=None))
    )
    assert len(jax.tree.leaves(without)) == 8
    assert len(jax.tree.leaves(with_area)) == 12
    back = kept_light_frame(with_area, replace(light, area=None), floor(), BOUNDS)
    assert len(jax.tree.leaves(back)) == 8 and back.cos_cutoff == without.cos_cutoff == -1
    assert not eqx.tree_equal(with_area, without)

    @eqx.filter_jit
    def origin(frame):
        return jnp.asarray(frame.origin)

    for frame in (without, with_area):
        origin(frame)
    with counted_traces() as traces:
        origin(replace(without, near=np.float64(0.5)))
        moved = light.moved_to((0.0, 0.0, 4.0))
        origin(light_frame(moved, floor(), BOUNDS))
    assert traces == []


def test_hard_shadows_of_flat_lights_are_on_their_front():
    """A wall to both sides of a lamp's plane: what is behind is neither in the frame nor in the
    domain; of the point at its centre all is."""
    light = LightSpec("lamp", "point", (0.0, 0.0, 3.0), area=FLAT["disk"].at((0.0, 0.0, 3.0)))
    eye = floor()
    wall = eye_buffer(
        eye.camera,
        world=np.stack([0 * eye.world[0] - 2.0, eye.world[0], 3.0 + eye.world[1]]),
        normal=np.repeat([[1.0], [0.0], [0.0]], 81, axis=1),
        depth=eye.depth,
        prim=eye.prim,
        shape=eye.shape,
        albedo=eye.albedo,
        flat=np.ones(81, bool),
    )
    below = wall.world[2] < 3.0
    for one, expected in ((light, below), (replace(light, area=None), np.ones(81, bool))):
        frame = light_frame(one, wall, BOUNDS)
        np.testing.assert_array_equal(in_domain(frame, wall.world), expected)
        receivers = projected(wall.points, frame)
        np.testing.assert_array_equal(receivers.facing, expected)


@pytest.mark.parametrize("family", ["uniform", "adaptive", "light-space"])
def test_hard_maps_take_the_centre(family):
    """A size changes nothing for them where all receivers lie before the light."""
    case = analytic_case("a4_disc_light", 32)
    area = disk_light(case.frame.origin, (0.6, 0, 0), (0, -0.6, 0))
    sized = light_frame(replace(case.light, area=area), case.eye, scene_bounds(case.shapes))
    np.testing.assert_array_equal(sized.extent, case.frame.extent)
    algorithm = algorithm_for(family, 1)
    plain, other = (
        algorithm.visibility(algorithm.build(case.eye, frame, case.rays), case.eye.points)
        for frame in (case.frame, sized)
    )
    np.testing.assert_array_equal(plain, other)
    assert 0 < plain.mean() < 1
