"""Soft shadows by accumulation: exact steps of a ramp, suns, wide lights, faces of a cube."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.counting import CountingRays

from asmjax.buffers import EyeBuffer
from asmjax.errors import UseError
from asmjax.experiment.traces import counted_traces
from asmjax.geometry import disk_light, rectangle_light, sphere_light, sun_light
from asmjax.hard_cases import CASES, SIDE, Setup
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import a4_disc_light, a5_half_plane
from asmjax.scene.closed_forms import half_plane_disc_visibility, half_plane_square_visibility
from asmjax.scene.lights import light_frame
from asmjax.scene.soft_visibility import analytic_soft_visibility
from asmjax.scene.spec import LightSpec, Rectangle, ViewSpec
from asmjax.shadow import UniformShadowMap
from asmjax.shadow.soft import AccumulatedShadowMap

H, HEIGHT, HALF = 5.0, 2.0, 0.6
WIDTH = 2 * HALF * HEIGHT / (H - HEIGHT)
"""Of the penumbra."""

LAMP = LightSpec(
    "lamp",
    "point",
    (0.0, 0.0, H),
    area=rectangle_light((0, 0, H), (HALF, 0, 0), (0, -HALF, 0)),
)
NEAR_EDGE = ViewSpec("edge", (0.9, 0.2, 1.6), (0.0, 0.0, 0.0), fov_x_deg=32.0, width=64, height=64)


def visibility(shapes, view: ViewSpec, light: LightSpec, algorithm) -> tuple[EyeBuffer, np.ndarray]:
    eye = analytic_eye(shapes, view)
    frame = light_frame(light, eye, scene_bounds(shapes))
    state = algorithm.build(eye, frame, AnalyticRays(shapes))
    return eye, np.asarray(algorithm.visibility(state, eye.points))


@pytest.mark.parametrize("m", [4, 8, 16])
def test_a_half_plane_is_off_by_half_a_sample(m):
    """Columns of samples go dark one after the other: the visibility is their count but within a
    texel of a step, and is off from the linear ramp by 1 / (2 m) at the steps."""
    shapes = a5_half_plane().spec.shapes
    texels = 96
    eye, found = visibility(shapes, NEAR_EDGE, LAMP, AccumulatedShadowMap(texels * m, m))
    x = eye.world[0]
    at = HALF * ((np.arange(m) + 0.5) * 2 / m - 1)
    steps = -at * HEIGHT / (H - HEIGHT)
    count = (x[:, None] > steps).sum(axis=1) / m
    plane = eye.shape == 0
    # The image holds what is seen, and from all samples: a little more.
    texel = 1.3 * np.ptp(x[plane]) / texels
    clear = plane & (np.abs(x[:, None] - steps).min(axis=1) > texel)
    assert 0.1 < clear.mean() and np.ptp(count[clear]) == 1
    np.testing.assert_allclose(found[clear], count[clear], atol=1e-6)
    off = np.abs(found - half_plane_square_visibility(x, WIDTH))
    assert off[plane].max() <= 1 / (2 * m) + texel / WIDTH
    # In closed form: beside a step, on a fine grid.
    fine = np.linspace(-0.6, 0.6, 200_001)
    ramp = half_plane_square_visibility(fine, WIDTH)
    worst = np.abs((fine[:, None] > steps).sum(axis=1) / m - ramp).max()
    assert worst == pytest.approx(1 / (2 * m), abs=1e-4)


def test_more_samples_come_nearer_to_the_closed_form():
    """A disc below a disc light, of which a sample is a hard shadow."""
    scene = a4_disc_light()
    view = next(iter(scene.spec.views.values())).resized(64, 64)
    errors = []
    for m in (1, 2, 4, 8):
        eye, found = visibility(
            scene.spec.shapes, view, scene.soft_light(), AccumulatedShadowMap(128 * m, m)
        )
        assert scene.soft_visibility is not None
        x, y, _ = eye.world
        plane = eye.shape == 0
        errors.append(np.abs(found - scene.soft_visibility(x, y))[plane].mean())
    assert errors[1] < 0.5 * errors[0] and errors[2] < 0.6 * errors[1]
    assert errors[3] < 0.8 * errors[2] and errors[3] < 0.01


def test_a_light_without_a_size_is_the_uniform_map():
    """And so is one sample of a flat light, for what lies before it."""
    case = analytic_case("a4_disc_light", 64)
    flat = UniformShadowMap(128)
    expected = flat.visibility(flat.build(case.eye, case.frame, case.rays), case.eye.points)
    area = disk_light(case.frame.origin, (HALF, 0, 0), (0, -HALF, 0))
    for algorithm, frame in (
        (AccumulatedShadowMap(128), case.frame),
        (AccumulatedShadowMap(128, 1), replace(case.frame, area=area)),
    ):
        state = algorithm.build(case.eye, frame, case.rays)
        np.testing.assert_array_equal(algorithm.visibility(state, case.eye.points), expected)
        assert algorithm.cost(state).texels == 128**2
        np.testing.assert_array_equal(
            algorithm.density(state, case.eye.points),
            flat.density(flat.build(case.eye, case.frame, case.rays), case.eye.points),
        )


@pytest.mark.parametrize("direction", [(0.0, 0.0, -1.0), (0.5, 0.2, -1.0)])
def test_the_sun(direction):
    """Frames of the samples start before all casters and hold all receivers, under slanted light
    too, where the edge's shadow is aside: A5 along the projected direction."""
    shapes = a5_half_plane().spec.shapes
    angle = np.radians(8.0)
    light = LightSpec("sun", "directional", direction=direction, area=sun_light(direction, angle))
    aside = HEIGHT * direction[0] / -direction[2]
    view = replace(NEAR_EDGE, origin=(aside + 0.9, 0.2, 1.6), target=(aside, 0.0, 0.0))
    eye, found = visibility(shapes, view, light, AccumulatedShadowMap(96 * 8, 8))
    plane = eye.shape == 0
    if direction[0] == 0:
        expected = half_plane_disc_visibility(eye.world[0] / (HEIGHT * np.tan(angle / 2)))
    else:
        frame = light_frame(light, eye, scene_bounds(shapes))
        expected = analytic_soft_visibility(shapes, eye, frame, 6, 2).visibility
    assert np.abs(found - expected)[plane].mean() < 0.02
    assert 0.2 < expected[plane].mean() < 0.8


def room(half: float = 1.0) -> list[Rectangle]:
    """The six walls of a cube."""
    axes = np.eye(3)
    walls = []
    for k in range(3):
        for sign in (1.0, -1.0):
            sides = (tuple((half * axes[(k + j) % 3]).tolist()) for j in (1, 2))
            walls.append(Rectangle(f"{k}{sign}", tuple((sign * half * axes[k]).tolist()), *sides))
    return walls


def test_faces_of_a_cube_have_no_seams():
    """A ball of light in the middle of a room: every wall is lit by all of it, but within a texel
    of a crease."""
    light = LightSpec("ball", "point", (0.0, 0.0, 0.0), area=sphere_light((0, 0, 0), 0.2))
    view = ViewSpec("in", (-0.7, -0.6, 0.5), (1.0, 0.7, -0.6), fov_x_deg=100, width=48, height=48)
    eye = analytic_eye(room(), view)
    frame = light_frame(light, eye, scene_bounds(room()))
    assert frame.faces > 2
    algorithm = AccumulatedShadowMap(64 * 3, 3)
    state = algorithm.build(eye, frame, AnalyticRays(room()))
    found = np.asarray(algorithm.visibility(state, eye.points))
    from_crease = 1 - np.sort(np.abs(eye.world), axis=0)[1]
    assert found[from_crease > 0.08].min() == 1


def test_samples_see_receivers_on_faces_of_their_own():
    """A light as wide as it is high above what is seen on two faces of a cube: from its samples
    receivers lie on other faces. With those of the centre for all, 256 samples were off by 0.049 of
    the light, 0.042 of it to one side."""
    setup = CASES["light as large as its distance"].build(1.0)
    assert isinstance(setup, Setup)
    scene = setup.traced(SIDE)
    assert scene.frame.faces == 2
    off = {}
    for samples in (4, 16):
        algorithm = AccumulatedShadowMap(128 * samples, samples)
        state = algorithm.build(scene.eye, scene.frame, scene.rays)
        found = np.asarray(algorithm.visibility(state, scene.eye.points))
        off[samples] = (found - scene.expected)[scene.judged]
        cost = algorithm.cost(state)
        assert 0.9 * 2 * (128 * samples) ** 2 <= cost.texels <= 2 * (128 * samples) ** 2
    assert np.abs(off[16]).mean() < 0.4 * np.abs(off[4]).mean() < 0.012
    assert abs(off[16].mean()) < 0.002


def test_receivers_beside_a_wide_light_are_not_dark():
    """A light two units wide half a unit above the floor: samples whose frames do not reach as far
    to the side do not count."""
    floor = [Rectangle("floor", (0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))]
    light = LightSpec(
        "panel", "point", (0, 0, 0.5), area=rectangle_light((0, 0, 0.5), (1, 0, 0), (0, -1, 0))
    )
    view = ViewSpec("down", (0.3, -5.0, 4.0), (0.0, 0.0, 0.0), fov_x_deg=60, width=48, height=48)
    eye, found = visibility(floor, view, light, AccumulatedShadowMap(128, 4))
    assert found[eye.valid].min() == 1


def test_half_a_light_above_the_horizon_is_half_a_light():
    """A wall whose plane cuts a disk light in the middle; and nothing is lit behind the light."""
    wall = [Rectangle("wall", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 3.0))]
    view = ViewSpec("aside", (8.0, 0.5, 0.2), (0.0, 0.0, 0.0), fov_x_deg=40, width=24, height=24)
    light = LightSpec(
        "lamp", "point", (0.0, 0.0, 1.5), area=disk_light((0, 0, 1.5), (0.5, 0, 0), (0, -0.5, 0))
    )
    eye, found = visibility(wall, view, light, AccumulatedShadowMap(64, 4))
    height = np.where(eye.valid, eye.world[2], np.nan)
    assert found[height < 0.4] == pytest.approx(0.5)
    assert (height > 1.5).any() and not found[height > 1.5].any()
    assert not found[~eye.valid].any()


def soft_case(side: int):
    scene = a4_disc_light()
    view = next(iter(scene.spec.views.values())).resized(side, side)
    eye = analytic_eye(scene.spec.shapes, view)
    frame = light_frame(scene.soft_light(), eye, scene_bounds(scene.spec.shapes))
    return eye, frame, AnalyticRays(scene.spec.shapes)


def test_one_compilation_serves_any_number_of_samples():
    eye, frame, rays = soft_case(21)
    few = AccumulatedShadowMap(2 * 40, 2)
    state = few.build(eye, frame, rays)
    few.visibility(state, eye.points)
    many = AccumulatedShadowMap(5 * 40, 5)
    assert many.program(frame) == few.program(frame) != AccumulatedShadowMap(40).program(frame)
    with counted_traces() as traces:
        state = many.build(eye, frame, rays)
        many.visibility(state, eye.points).block_until_ready()
    assert traces == []


def test_costs_are_those_of_all_maps(dtype):
    """And visibility has the points' precision, jitted with the state too."""
    eye, frame, rays = soft_case(22)
    counting = CountingRays(rays)
    algorithm = AccumulatedShadowMap(100, 3, compare="both")
    state = algorithm.build(eye, frame, counting)
    cost = algorithm.cost(state)
    assert (cost.rays, cost.passes) == (counting.texels, counting.launches) == (9 * 33**2, 9)
    assert cost.texels == 9 * 33**2 and cost.bytes == 6 * cost.texels
    assert cost.bytes <= algorithm.memory(1).state.bytes
    assert algorithm.effective_resolution(state) == 33
    found = algorithm.visibility(state, eye.points)
    assert found.dtype == dtype
    jitted = eqx.filter_jit(algorithm.visibility)(state, eye.points)
    assert np.mean(np.asarray(jitted) != np.asarray(found)) < 0.01
    assert jax.tree.leaves(algorithm.update(state, eye, frame, rays))


WRONG = {
    "none": (lambda: AccumulatedShadowMap(64, 0), "0 x 0 samples"),
    "many": (lambda: AccumulatedShadowMap(2**15, 65), "allowed: 1 to 64"),
    "large": (lambda: AccumulatedShadowMap(2**16), "allowed: 1 to 32768"),
    "bias": (lambda: AccumulatedShadowMap(64, bias=-1.0), "bias of -1.0"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_settings_are_refused(name):
    make, said = WRONG[name]
    with pytest.raises(UseError, match=said):
        make()


def test_what_has_no_texels_is_refused():
    """Less than a texel for each map, and filters of a mean."""
    eye, frame, rays = soft_case(8)
    with pytest.raises(UseError, match="no texel for each face of each of its maps"):
        AccumulatedShadowMap(3, 4).build(eye, frame, rays)
    algorithm = AccumulatedShadowMap(8, 2)
    with pytest.raises(UseError, match="cannot be filtered"):
        algorithm.around(algorithm.build(eye, frame, rays), eye.points)


class Drawn(Exception):
    """The windows that a map asks for, in place of its texels."""


class NoTexels(CountingRays):
    """Rays that only tell how many texels are asked for: maps too large to draw in a test."""

    def light_buffer(self, frame, windows):
        raise Drawn(frame.faces, windows.texels)


def test_no_sample_has_a_larger_map_than_there_are():
    """A panel wider than the floor below it sees it all around, its corners on one face: of the
    texels of five, more than a map may have a side. With one sample a map of all five is refused,
    for the resolution that it was given."""
    floor = [Rectangle("floor", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    area = rectangle_light((0, 0, 0.5), (2.5, 0, 0), (0, -2.5, 0))
    light = LightSpec("panel", "point", (0, 0, 0.5), area=area)
    view = ViewSpec("down", (0.3, -1.0, 7.0), (0.0, 0.0, 0.0), fov_x_deg=60, width=24, height=24)
    eye = analytic_eye(floor, view)
    frame = light_frame(light, eye, scene_bounds(floor))
    assert frame.faces == 5
    with pytest.raises(Drawn) as asked:
        AccumulatedShadowMap(2**15, 2).build(eye, frame, NoTexels(AnalyticRays(floor)))
    assert asked.value.args == (1, 2**30)
    with pytest.raises(UseError, match="32768 texels a side for each of 5 light faces"):
        AccumulatedShadowMap(2**15, 1).build(eye, frame, NoTexels(AnalyticRays(floor)))


def test_maps_of_more_faces_than_the_light_stay_within_its_memory():
    """At one texel a map those with four faces have none for each, at two they have."""
    setup = CASES["light as large as its distance"].build(1.0)
    assert isinstance(setup, Setup)
    scene = setup.traced(SIDE)
    few = AccumulatedShadowMap(4, 4)
    with pytest.raises(UseError, match="one has 4 and the light's own frame 2;"):
        few.build(scene.eye, scene.frame, scene.rays)
    # What is asked before anything is built has nothing to refuse.
    assert few.program(scene.frame) and AccumulatedShadowMap(3, 4).program(scene.frame)
    algorithm = AccumulatedShadowMap(8, 4)
    state = algorithm.build(scene.eye, scene.frame, scene.rays)
    cost, faces = algorithm.cost(state), {one.frame.faces for one in state.maps}
    assert 4 in faces and 16 <= cost.texels <= 2 * 8**2
    assert cost.bytes <= algorithm.memory(scene.frame.faces).state.bytes
    assert np.isfinite(algorithm.visibility(state, scene.eye.points)).all()


def test_maps_are_kept_while_nothing_moves():
    """And drawn anew where a caster moved, or where what is seen is no longer between the depths
    that the samples' frames were made for."""
    shapes = a5_half_plane().spec.shapes
    eye = analytic_eye(shapes, replace(NEAR_EDGE, width=16, height=16))
    frame = light_frame(LAMP, eye, scene_bounds(shapes))
    rays = CountingRays(AnalyticRays(shapes))
    algorithm = AccumulatedShadowMap(32, 2, keep=True)
    assert algorithm.name == "accumulated-32-2x2-kept"
    state = algorithm.build(eye, frame, rays)
    kept = algorithm.update(state, eye, frame, rays)
    assert rays.launches == 4 and algorithm.cost(kept).rays == 0
    lit = algorithm.visibility(state, eye.points)
    np.testing.assert_array_equal(algorithm.visibility(kept, eye.points), lit)
    box = np.array([[[-9.0, 9.0]] * 3])
    algorithm.update(kept, eye, frame, rays, moved=box)
    assert rays.launches == 8
    higher = analytic_eye(shapes, replace(NEAR_EDGE, target=(-1.0, 0.0, 2.0), width=16, height=16))
    assert (higher.shape == 1).any()
    algorithm.update(kept, higher, frame, rays)
    assert rays.launches == 12
    replace(algorithm, keep=False).update(state, eye, frame, rays)
    assert rays.launches == 16
