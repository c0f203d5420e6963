"""What the protocol promises in a word each: jit with a state, ownership, curved shapes."""

import time
from functools import partial

import jax
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case

from asmjax.errors import UseError
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, Rectangle, Sphere, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel, UniformShadowMap

COST = CostModel(1e-8, 1e-3, 0.0)
ALGORITHMS = [
    UniformShadowMap(64, compare="both"),
    AdaptiveShadowMap(memory_bytes=2**19, node_resolution=8, cost_model=COST),
]


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_visibility_may_be_jitted_with_a_state(algorithm):
    """A state is a pytree of arrays: jit with it as an argument, and again with another state or
    an updated one, gives what the plain call gives, with one trace."""
    case = analytic_case("a1_square", 48)
    traces = []

    @jax.jit
    def visibility(state, points):
        traces.append(1)
        return algorithm.visibility(state, points)

    state = algorithm.build(case.eye, case.frame, case.rays)
    for make in (algorithm.build, partial(algorithm.update, state)):
        state = make(case.eye, case.frame, case.rays)
        np.testing.assert_array_equal(
            visibility(state, case.eye.points), algorithm.visibility(state, case.eye.points)
        )
    assert len(traces) == 1


def test_a_state_that_update_took_over_says_so():
    """Its arrays are gone: every use is refused in words, and the new state works."""
    case, algorithm = analytic_case("a1_square", 48), ALGORITHMS[1]
    old = algorithm.build(case.eye, case.frame, case.rays)
    new = algorithm.update(old, case.eye, case.frame, case.rays)
    for use in (
        lambda: algorithm.visibility(old, case.eye.points),
        lambda: algorithm.cost(old),
        lambda: algorithm.update(old, case.eye, case.frame, case.rays),
    ):
        with pytest.raises(UseError, match="update returned"):
            use()
    assert case.error(algorithm.visibility(new, case.eye.points)) < 0.02


def test_a_state_that_a_jitted_function_returned_says_so():
    """Its arrays would go with the host's side of the first state that was traced."""
    case, algorithm = analytic_case("a1_square", 48), ALGORITHMS[1]
    first, second = (algorithm.build(case.eye, case.frame, case.rays) for _ in range(2))
    same = jax.jit(lambda state: state)
    same(first)
    with pytest.raises(UseError, match="jitted function"):
        algorithm.cost(same(second))


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_a_copy_may_be_updated_while_the_state_stays(algorithm):
    """Whatever becomes of the copy, under another light too, the state answers as before."""
    case = analytic_case("a1_square", 48)
    state = algorithm.build(case.eye, case.frame, case.rays)
    before, cost = algorithm.visibility(state, case.eye.points), algorithm.cost(state)
    box = np.array([[[-9.0, 9.0]] * 3])
    for moved in (None, box):
        other = algorithm.copied(state)
        np.testing.assert_array_equal(algorithm.visibility(other, case.eye.points), before)
        algorithm.update(other, case.eye, case.frame, AnalyticRays(case.shapes[:1]), moved=moved)
    np.testing.assert_array_equal(algorithm.visibility(state, case.eye.points), before)
    assert algorithm.cost(state) == cost
    state = algorithm.update(state, case.eye, case.frame, case.rays)
    np.testing.assert_array_equal(algorithm.visibility(state, case.eye.points), before)


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_the_inside_of_a_sphere_is_shaded_by_the_sphere(algorithm):
    """Eye inside, light outside: the seen wall faces the light, and its own primitive blocks it."""
    shapes = [Sphere("shell", (0.0, 0.0, 0.0), 1.0)]
    view = ViewSpec("in", (0.0, 0.0, 0.0), (0.0, 1.0, -1.0), width=24, height=24, fov_x_deg=60)
    eye = analytic_eye(shapes, view)
    light = LightSpec("far", "point", position=(0.0, 0.0, 4.0))
    frame = light_frame(light, eye, scene_bounds(shapes))
    state = algorithm.build(eye, frame, AnalyticRays(shapes))
    assert eye.valid.all()
    assert np.asarray(algorithm.visibility(state, eye.points)).max() == 0


def test_a_light_all_around_lights_every_wall():
    """A closed box around a point light: no wall is dark, behind the light's axis either."""
    unit = np.eye(3)
    walls = [
        Rectangle(f"wall{i}{s:+.0f}", tuple(s * unit[i]), tuple(unit[j]), tuple(unit[k]))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        for s in (1.0, -1.0)
    ]
    light = LightSpec("middle", "point", position=(0.0, 0.0, 0.0))
    algorithm = UniformShadowMap(64)
    for axis in range(3):
        for sign in (1.0, -1.0):
            target = tuple(sign * unit[axis])
            up = (0.0, 1.0, 0.0) if axis == 2 else (0.0, 0.0, 1.0)
            # The eye a little before the middle sees one wall and parts of its neighbours.
            view = ViewSpec("wall", (0.001, 0.002, 0.003), target, up, 100.0, 33, 33)
            eye = analytic_eye(walls, view)
            frame = light_frame(light, eye, scene_bounds(walls))
            state = algorithm.build(eye, frame, AnalyticRays(walls))
            dark = np.asarray(algorithm.visibility(state, eye.points)) == 0
            # Within a texel of a crease, a texel of the next wall may decide.
            from_crease = 1 - np.sort(np.abs(eye.world), axis=0)[1]
            assert (from_crease[dark] < 2 * 2 / 64).all()
            assert dark.mean() < 0.1


def test_seconds_are_all_the_time_that_a_build_takes(monkeypatch):
    """Nothing between the passes is left out: the stages together are all of the time but for a
    tenth. By a clock that stands still while other processes run."""
    monkeypatch.setattr("time.perf_counter", time.process_time)
    algorithm = ALGORITHMS[1]
    case = analytic_case("a4_disc_light", 160)
    algorithm.build(case.eye, case.frame, case.rays)
    shares = []
    for _ in range(3):
        start = time.perf_counter()
        state = jax.block_until_ready(algorithm.build(case.eye, case.frame, case.rays))
        wall = time.perf_counter() - start
        shares.append(sum(algorithm.cost(state).seconds.values()) / wall)
    assert 0.9 < max(shares) <= 1.0
