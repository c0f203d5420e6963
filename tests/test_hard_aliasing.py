"""Maps of views that leave them little to be made for, and the theory at the ends of its range.

That every algorithm is right on every hard scene is asked in `test_hard_cases_scene.py`.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import each_of
from helpers.registry import SIBLINGS
from helpers.theory import QUICKLY
from helpers.traced_cases import hard_case

from asmjax import theory
from asmjax.hard_cases import CASES, SIDE, Setup
from asmjax.hard_cases.lights import SHAPES, SUN, VIEW
from asmjax.shadow import PartitionedShadowMap, SubdividedShadowMap, UniformShadowMap

TEXELS = 4**7

UNLIT = {"few pixels, one, and none": 1e9, "nothing that the light reaches": 3.0}
"""Cases of views that see nothing, and nothing that is lit, at these severities."""

each_sibling = pytest.mark.parametrize("sibling", each_of(SIBLINGS))


@functools.cache
def hard_view(name: str, severity: float):
    """A scene of the catalogue, made once."""
    setup = CASES[name].build(severity)
    assert isinstance(setup, Setup)
    return hard_case(setup, SIDE)


@functools.cache
def base():
    """What all these are extremes of."""
    return hard_case(Setup(SHAPES, VIEW, SUN), SIDE)


@pytest.mark.parametrize("name", UNLIT)
@each_sibling
def test_the_next_view_is_served_as_ever(sibling, name):
    """After a view of nothing, that of something is nearly as good as from the start: an adaptive
    map that follows a view looks at an eighth of its pixels."""
    case, seen = hard_view(name, UNLIT[name]), base()
    algorithm = sibling.of_budget(TEXELS, 1)
    state = algorithm.build(case.eye, case.frame, case.rays)
    state = algorithm.update(state, seen.eye, seen.frame, seen.rays)
    fresh = algorithm.build(seen.eye, seen.frame, seen.rays)
    lit = [algorithm.visibility(each, seen.eye.points) for each in (state, fresh)]
    assert seen.error(lit[0]) <= max(seen.error(lit[1]), 0.02)


@pytest.mark.parametrize("name", UNLIT)
@pytest.mark.parametrize("sibling", [s for s in SIBLINGS if s.charts], ids=lambda s: s.name)
def test_a_map_with_nothing_to_fit_to_is_flat(sibling, name):
    """It answers other points as the uniform map does, bit for bit."""
    case = hard_view(name, UNLIT[name])
    algorithm = sibling.of_budget(TEXELS, 1)
    state = algorithm.build(case.eye, case.frame, case.rays)
    flat = UniformShadowMap(algorithm.resolution, compare=algorithm.compare)
    expected = flat.build(case.eye, case.frame, case.rays)
    points = base().eye.points
    np.testing.assert_array_equal(
        algorithm.visibility(state, points), flat.visibility(expected, points)
    )
    assert algorithm.effective_resolution(state) == algorithm.resolution


@pytest.mark.parametrize("severity", [1e8, 1e16])
def test_slabs_of_one_depth_leave_no_gap(severity):
    """All splits are one number in float32: the slab that holds all receivers holds all depths."""
    case = hard_view("one depth only", severity)
    for partitions in (1, 4, 16):
        charts = PartitionedShadowMap(resolution=64, partitions=partitions).charts(
            case.eye, case.frame
        )
        assert [chart.depths for chart in charts] == [(-np.inf, np.inf)]


def test_slabs_meet():
    """Each slab that holds receivers goes on to the next one that does."""
    case = base()
    charts = PartitionedShadowMap(resolution=64, partitions=16, near=0.01).charts(
        case.eye, case.frame
    )
    ends = [chart.depths for chart in charts]
    assert 1 < len(ends) < 16
    assert [least for least, _ in ends[1:]] == [most for _, most in ends[:-1]]
    assert (ends[0][0], ends[-1][1]) == (-np.inf, np.inf)


def test_subdivisions_that_hold_nothing_get_no_chart():
    """Of the most parts, on the faces of a lamp, few hold receivers; all of these are served."""
    case = hard_view("points beside and behind the light", 8.0)
    algorithm = SubdividedShadowMap(resolution=128, parts=8)
    charts = algorithm.charts(case.eye, case.frame)
    assert 3 <= len(charts) < algorithm.most_charts(case.frame.faces) / 2
    state = algorithm.build(case.eye, case.frame, case.rays)
    lit = algorithm.visibility(state, case.eye.points)
    assert case.error(lit) <= 0.05 and case.expected.mean() > 0.5


ALPHAS = (1.0, 1.0 + 1e-7, 1e8, 1e9)
THETA = 0.5


@functools.partial(jax.jit, compiler_options=QUICKLY)
def theory_at(alpha, gamma):
    """Every quantity of the theory for one depth range, at its ends and for several warps."""
    u = jnp.stack([jnp.zeros_like(alpha), 1e-6 + 0 * alpha, theory.u_lispsm(alpha), alpha / alpha])
    z = jnp.stack([alpha / alpha, jnp.sqrt(alpha), alpha])[:, None]
    parts = jnp.asarray([1.0, 4.0, 1e6], alpha.dtype)
    found = {
        "s": theory.s_of_z(z, alpha, u),
        "z": theory.z_of_s(theory.s_of_z(z, alpha, u), alpha, u),
        "log s": theory.log_perspective_s(z, alpha, u),
        "m_z": theory.m_z(z, alpha, u, THETA),
        "m_x": theory.m_x(z, alpha, u),
        "log m_z": theory.log_perspective_m_z(z, alpha, u, THETA),
        "least m_z": theory.logarithmic_m_z(alpha, THETA),
        "1 + xi": 1 + theory.xi_from_u(u, alpha),
        "splits": theory.practical_splits(1.0, alpha, 4),
        "parts": theory.subdivided_m_z_max(alpha, parts, 0.0, THETA),
    }
    for warp in theory.DIRECTION_WARPS:
        found[warp] = theory.direction_storage(alpha, THETA, gamma, warp).storage
    for warp in theory.WARPS:
        found[f"overhead {warp}"] = theory.overhead_factors(alpha, THETA, warp).storage
    return found


@pytest.mark.parametrize("alpha", ALPHAS)
def test_theory_at_the_ends_of_the_depth_range(alpha, dtype):
    """Finite and not negative, also for light along the view; no warp is below the logarithm, which
    many parts come to, and none that is searched for is worse than none."""
    gamma = np.array([0.0, 0.01, 0.5, np.pi / 2, np.pi], dtype)
    found = {name: np.asarray(a) for name, a in theory_at(np.asarray(alpha, dtype), gamma).items()}
    for name, value in found.items():
        assert np.isfinite(value).all() and (value >= -1e-6).all(), (name, value)
    slack = 1 + 1e-4
    assert (found["m_z"].max(axis=0) * slack >= found["least m_z"]).all()
    assert (np.diff(found["parts"]) <= 1e-6 * found["parts"][0]).all()
    assert found["parts"][-1] == pytest.approx(found["least m_z"], rel=1e-4)
    assert (np.diff(found["splits"]) >= 0).all()
    assert (found["perspective"] <= slack * found["uniform"]).all()
