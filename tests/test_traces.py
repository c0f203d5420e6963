"""Nothing is traced twice: one trace per shape, and none in a second frame of the same size.

Tracing costs more than a whole pass of refinement, so a value that slips into the static part of an
argument would spoil every timing. JAX reports each trace to its monitor.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case, walk
from helpers.poses import random_pose
from helpers.soft_cases import soft_case

from asmjax.experiment.aliasing import aliasing_maps
from asmjax.experiment.maps import analysis_maps
from asmjax.experiment.traces import counted_traces
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import (
    AdaptiveShadowMap,
    FilteredShadowMap,
    LightSpaceShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
    UniformShadowMap,
)
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.storing import BUCKETS

SIZE = 48
EYES = ((3.0, -4.0, 5.0), (-2.5, -3.5, 6.0), (0.5, -5.5, 4.0))
MEMORY = 2**19
MODEL = CostModel(1e-8, 1e-4, 0.0)


def whole_jax_side(scene, eye_at) -> tuple[np.ndarray, np.ndarray]:
    """Everything but the figures, for one eye: both maps, their visibility, the analysis."""
    shapes = scene.spec.shapes
    view = ViewSpec("eye", eye_at, (0.0, 0.0, 0.0), fov_x_deg=50, width=SIZE, height=SIZE)
    eye = analytic_eye(shapes, view)
    frame = light_frame(next(iter(scene.spec.lights.values())), eye, scene_bounds(shapes))
    rays = AnalyticRays(shapes)
    flat = UniformShadowMap(resolution=64)
    flat_state = flat.build(eye, frame, rays)
    maps = analysis_maps(eye, frame, flat, flat_state)
    adaptive = AdaptiveShadowMap(
        memory_bytes=MEMORY, start_resolution=64, compare="depth", cost_model=MODEL
    )
    state = adaptive.build(eye, frame, rays)
    lit = adaptive.visibility(state, eye.points)
    flat.visibility(flat_state, eye.points)
    return np.asarray(lit), maps["m"]


@pytest.mark.parametrize("name", ["a1_square", "a6_sphere_sun"])
def test_a_second_view_of_the_same_size_traces_nothing(name):
    """Two views warm up (the second may meet a bucket size that the first did not); the third,
    from another eye and hence with another light frame, must trace nothing at all."""
    scene = ANALYTIC_SCENES[name]()
    first = whole_jax_side(scene, EYES[0])
    whole_jax_side(scene, EYES[1])
    with counted_traces() as traced:
        third = whole_jax_side(scene, EYES[2])
    assert traced == []
    # Not the same picture again: the comparison would be empty.
    assert not np.array_equal(first[0], third[0])
    assert not np.array_equal(first[1], third[1], equal_nan=True)


def walked_updates(adaptive, cases, state):
    """Update and query for each of a walk's cases; the state, and nodes made by each update."""
    made = []
    for case in cases:
        state = adaptive.update(state, case.eye, case.frame, case.rays)
        adaptive.visibility(state, case.eye.points).block_until_ready()
        made.append(adaptive.cost(state).nodes.made)
    return state, made


STRIDES = [0.0, 0.02, 0.0, *[0.02] * 6, 0.8, 1.2, 2.5, 0.0, *[0.02] * 6, 0.0, 3.0, 0.0, 0.02]
"""Steps of an eye along the ground, scene units: small and large ones, and rests."""


def traced_on_a_walk(start: float, memory: int):
    """What is traced after the warm-up of a walk along the ground, and how many nodes
    each of the other updates made. `memory` must be new: traces are kept by size."""
    steps = [(start + x, 0.1, 0.0) for x in np.cumsum(STRIDES)]
    cases = walk("a4_disc_light", SIZE, steps, fov_deg=140.0, direction=(0.0, 0.0, -1.0))
    adaptive = AdaptiveShadowMap(
        memory_bytes=memory, node_resolution=8, start_resolution=32, cost_model=MODEL
    )
    state = adaptive.build(cases[0].eye, cases[0].frame, cases[0].rays)
    adaptive.visibility(state, cases[0].eye.points).block_until_ready()
    adaptive.warm_up(state, cases[0].eye, cases[0].frame)
    with counted_traces() as traced:
        _, made = walked_updates(adaptive, cases[1:], state)
    return traced, made


def test_a_walk_traces_nothing_after_its_warm_up():
    """Twenty-two updates and queries on ground that was not seen before; the numbers of new nodes
    fall into several of the sizes that they are stored in."""
    traced, made = traced_on_a_walk(start=1.0, memory=2**21)
    assert traced == []
    assert len(made) == 22
    stored = {next(b for b in BUCKETS if b >= count) for count in made if count}
    assert len(stored) > 1, made


def test_a_walk_towards_a_shadow_traces_nothing_after_its_warm_up():
    traced, made = traced_on_a_walk(start=-6.0, memory=3 * 2**19)
    assert sum(made) > 0
    assert traced == []


def test_a_walk_towards_the_sky_traces_nothing_after_its_warm_up():
    """Fewer and fewer pixels see a surface."""
    scene = ANALYTIC_SCENES["a1_square"]()
    shapes = scene.spec.shapes
    eyes = [
        analytic_eye(
            shapes,
            ViewSpec("eye", (3.0, -4.0, 5.0), (0.0, 0.0, z), fov_x_deg=50, width=SIZE, height=SIZE),
        )
        for z in np.linspace(0.0, 4.6, 22)
    ]
    assert eyes[1].valid.mean() > 0.9 and 0.02 < eyes[-1].valid.mean() < 0.25
    light = next(iter(scene.spec.lights.values()))
    frame, rays = light_frame(light, eyes[0], scene_bounds(shapes)), AnalyticRays(shapes)
    adaptive = AdaptiveShadowMap(memory_bytes=MEMORY, start_resolution=64, cost_model=MODEL)
    state = adaptive.build(eyes[0], frame, rays)
    adaptive.visibility(state, eyes[0].points).block_until_ready()
    adaptive.warm_up(state, eyes[0], frame)
    with counted_traces() as traced:
        for eye in eyes[1:]:
            state = adaptive.update(state, eye, frame, rays)
            adaptive.visibility(state, eye.points).block_until_ready()
    assert traced == []


def test_what_is_rehearsed_traces_nothing_whatever_its_goals():
    """Under a limit of time a build that traces gets nowhere; it would be judged by that."""
    case = analytic_case("a6_sphere", 64)
    base = AdaptiveShadowMap(memory_bytes=MEMORY, pixel_share=4, cost_model=MODEL)
    base.visibility(base.rehearse(case.eye, case.frame, case.rays), case.eye.points)
    program, made = base.program(case.frame), []
    with counted_traces() as traced:
        for goals in (
            {},
            {"ratio_target": 0.25},
            {"ratio_target": 4.0, "finest_ratio": 4.0},
            {"cover": False},
            {"least_profit": 1e-3},
            {"time_limit": 0.02},
        ):
            one = replace(base, **goals)
            assert one.program(case.frame) == program
            state = one.build(case.eye, case.frame, case.rays)
            one.visibility(state, case.eye.points).block_until_ready()
            nodes = one.cost(state).nodes
            assert nodes is not None
            made.append(nodes.made)
    assert traced == []
    assert len(set(made)) > 3, "the goals are not heard of"


FLAT = UniformShadowMap(32)
OTHERWISE = (
    (FLAT, {"bias": 1.0}),
    (LightSpaceShadowMap(32), {"bias": 1.0}),
    (PCSSShadowMap(32, blocker_taps=4, filter_taps=4), {"bias": 1.0}),
    (MomentShadowMap(32, kernel=1.0), {"bias": 1.0}),
    (MomentShadowMap(32, kernel=1.0), {"kernel": 9.0}),
    (FilteredShadowMap("area", 2.0, inner=FLAT), {"inner": replace(FLAT, bias=1.0)}),
    (FilteredShadowMap("original", 1.0, strata=2, inner=FLAT), {"width": 9.0}),
)
"""Settings, and others that differ in numbers which decide no shape."""

EVERY_DAY = (FLAT, OTHERWISE[-1][0])
"""Of those, the ones that are not left to the longer run: each compiles for seconds."""


@pytest.mark.parametrize(
    ("algorithm", "other"),
    [
        pytest.param(
            one,
            other,
            id=f"{one.name}-{min(other)}",
            marks=() if one in EVERY_DAY else pytest.mark.slow,
        )
        for one, other in OTHERWISE
    ],
)
def test_numbers_that_decide_no_shape_trace_nothing(algorithm, other):
    """Whoever sweeps a bias or a kernel would wait for a compilation at every step."""
    case = soft_case("a5_square", 24)

    def asked(algorithm):
        state = algorithm.build(case.eye, case.frame, case.rays)
        algorithm.density(state, case.eye.points)
        return np.asarray(algorithm.visibility(state, case.eye.points))

    before = asked(algorithm)
    with counted_traces() as traced:
        after = asked(replace(algorithm, **other))
    assert traced == []
    assert not np.array_equal(before, after), "the number is not heard of"


def test_other_distances_of_eye_and_light_trace_nothing():
    """Near, far and a cone's cosine are numbers of a view; one frame's are not the next one's."""
    case, flat = analytic_case("a1_square", 24), UniformShadowMap(32)

    def look(near, cosine):
        eye = replace(case.eye, camera=replace(case.eye.camera, near=near, far=1 / near))
        frame = replace(case.frame, near=near, cos_cutoff=cosine)
        state = flat.build(eye, frame, case.rays)
        lit = flat.visibility(state, eye.points)
        aliasing_maps(flat, state, eye, frame)
        return np.asarray(lit), analysis_maps(eye, frame, flat, state)["m"]

    first = look(1e-4, -1.0)
    with counted_traces() as traced:
        second = look(2e-4, 0.999)
    assert traced == []
    assert not np.array_equal(first[0], second[0]), "the cone is not heard of"


def test_kernels_trace_once_per_shape_and_type():
    """New values trace nothing; a new number of points, or another dtype, does."""
    poses = [random_pose(seed, "point", 90) for seed in range(3)]
    poses[0].jacobian(np.float32)
    with counted_traces() as traced:
        poses[1].jacobian(np.float32)
        poses[2].jacobian(np.float32)
    assert traced == []
    with counted_traces() as traced:
        random_pose(1, "point", 91).jacobian(np.float32)
    assert traced != []


def test_the_counter_counts():
    """The tests above pass for nothing if the monitor stays silent."""
    fresh = jax.jit(lambda x: x * 3 + 1)
    with counted_traces() as traced:
        fresh(jnp.ones(7))
        fresh(jnp.zeros(7))
    assert len(traced) >= 1
    with counted_traces() as traced:
        fresh(jnp.ones(7))
    assert traced == []
