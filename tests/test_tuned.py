"""Tuned maps: the closed-form optimum, what a tuned map gains, and what it never loses."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case, case_of
from test_predicted import along_a_plane, on_a_line

from asmjax.errors import UseError
from asmjax.experiment.aliasing import aliasing_maps
from asmjax.experiment.traces import counted_traces
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import LightSpaceShadowMap, PartitionedShadowMap, Status, TunedShadowMap
from asmjax.shadow.warped.predicted import Layout, log2_errors, log2_p_mean
from asmjax.shadow.warped.sampled import sampled_receivers
from asmjax.shadow.warped.tune import Rest, free, layout_of, minimised
from asmjax.theory import m_z

POWER = 4.0


@functools.cache
def best_n():
    """n of least p-mean of `m_z` over receivers even in log z, by u = 1 / n in (0, 1)."""

    def search(alpha, power, z, start):
        def loss(t):
            u = jnp.exp(-jax.nn.softplus(t))
            return log2_p_mean(jnp.log2(m_z(z, alpha, u, 0.5)), jnp.ones_like(z), power)

        found = minimised(loss, start, tolerance=1e-8)
        return jnp.exp(jax.nn.softplus(found.value)), found

    return jax.jit(search)


@pytest.mark.parametrize("alpha", [2.0, 10.0, 100.0, 1e4])
@pytest.mark.parametrize("power", [1.0, 4.0, 32.0])
def test_the_closed_form_optimum_is_found(alpha, power, x64):
    """n = 1 + sqrt(alpha) for every p, from weaker and from stronger warps."""
    z = jnp.exp(jnp.linspace(0, np.log(alpha), 257))
    for start in (-1.0, 1.0, 3.0):
        n, found = best_n()(alpha, power, z, start)
        assert found.rest is Rest.SETTLED
        assert float(n) == pytest.approx(1 + np.sqrt(alpha), rel=1e-6)


@pytest.mark.parametrize("alpha", [2.0, 1e4])
def test_the_closed_form_optimum_is_found_by_prediction(alpha, x64):
    """The same through the predicted error of a layout of one slab."""
    seen = on_a_line(np.exp(np.linspace(0, np.log(alpha), 257)))
    one = jnp.ones((1, 1))

    def loss(log_u):
        layout = Layout(jnp.exp(log_u), jnp.zeros(0), one, one)
        return log2_p_mean(*log2_errors(seen, layout, 1.0), POWER)

    start = jnp.log(jnp.full((1, 1), 0.05))
    found = jax.jit(lambda s: minimised(loss, s, tolerance=1e-8))(start)
    assert float(jnp.exp(-found.value[0, 0])) == pytest.approx(1 + np.sqrt(alpha), rel=1e-6)


def test_a_search_that_fails_keeps_the_start(x64):
    """Steps run out: the status says so, the better end is kept. No number off the start: the
    start is."""

    def valley(y):
        return (1 - y[0]) ** 2 + 100 * (y[1] - y[0] ** 2) ** 2

    start = jnp.array([-1.2, 1.0])
    found = minimised(valley, start, max_steps=3)
    assert found.rest is Rest.STEPS_SPENT
    assert float(found.loss) == pytest.approx(float(valley(found.value)), rel=1e-12)
    assert float(found.loss) <= float(found.start_loss)
    found = minimised(lambda y: jnp.where(y[0] == -1.2, -y[0], jnp.nan), start, max_steps=8)
    assert not found.improved and found.rest is Rest.STEPS_SPENT
    np.testing.assert_array_equal(found.value, start)
    found = minimised(lambda y: jnp.sum(y) * jnp.nan, start, max_steps=8)
    assert found.rest is Rest.NOT_FINITE


def test_unconstrained_numbers_are_a_layout_s(x64):
    layout = Layout(*(jnp.asarray(a) for a in ([[0.3, 1.7]], [5.0], [[0.25, 0.75]], [[2.0, 0.5]])))
    again = layout_of(free(layout, 2.0, 30.0), 2.0, 30.0, warped=True)
    for before, after in zip(layout, again, strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-12)
    still = layout_of(free(layout, 2.0, 30.0), 2.0, 30.0, warped=False)
    np.testing.assert_array_equal(still.u, 0.0)


@pytest.mark.parametrize(
    ("name", "partitions", "warp", "measure"),
    [
        ("plane", 1, "light-space", "m"),
        pytest.param("plane", 3, "none", "perspective", marks=pytest.mark.slow),
        pytest.param("plane", 3, "light-space", "m", marks=pytest.mark.slow),
        pytest.param("lamp", 3, "light-space", "perspective", marks=pytest.mark.slow),
    ],
)
def test_what_is_promised_is_what_the_map_has(name, partitions, warp, measure):
    """The p-mean that tuning reports is that of the built map's own density (1 %: the map
    measures at texel centres), and not above the sibling's; all receivers are samples here."""
    case = along_a_plane() if name == "plane" else analytic_case("a6_sphere", 40)
    tuned = TunedShadowMap(resolution=256, partitions=partitions, warp=warp, measure=measure)
    sibling = (
        LightSpaceShadowMap(resolution=256)
        if partitions == 1
        else PartitionedShadowMap(resolution=256, partitions=partitions, warp=warp)
    )
    with jax.enable_x64(True):
        receivers = sampled_receivers(case.eye, case.frame, "m")
    counted = receivers.pixel[receivers.counts]
    found = tuned.tuning(case.eye, case.frame)
    assert found.improved == (found.tuned < found.start)
    for algorithm, expected in ((sibling, found.start), (tuned, min(found.start, found.tuned))):
        state = algorithm.build(case.eye, case.frame, case.rays)
        maps = aliasing_maps(algorithm, state, case.eye, case.frame)
        values = getattr(maps, measure)[counted]
        mean = np.mean(values**POWER) ** (1 / POWER)
        assert mean == pytest.approx(expected, rel=0.01), algorithm.name
        assert state.used <= case.frame.faces * 256**2
    assert found.tuned < 0.97 * found.start


@pytest.mark.slow
@pytest.mark.parametrize("toward", [(0.0, 0.0, -1.0), (0.0, -0.5, -1.0), (0.0, 0.985, -0.42)])
def test_one_warp_of_a_plane_is_the_eye_s_own(toward):
    """A plane's map can be the eye's image itself, a homography. Then m is that of N pixels spread
    over T texels, sqrt(N / T), and no map has a smaller p-mean, as the mean of 1 / m^2 is at most
    T / N. (Maps are fitted to the centres of the outermost pixels: 2 % less.)"""
    case = along_a_plane(64, toward=toward)
    found = TunedShadowMap(resolution=256, partitions=1).tuning(case.eye, case.frame)
    receivers = int((case.eye.normal[2] > 0.99).sum())
    least = np.sqrt(receivers / 256**2)
    assert 0.97 * least < found.tuned < 1.03 * least < found.start / 2


@pytest.mark.slow
def test_a_view_without_receivers_or_with_one_depth():
    """Light that reaches nothing that is seen gives a flat map; a wall across the view has slabs
    that hold nothing."""
    scene = ANALYTIC_SCENES["a5_half_plane"]()
    view = ViewSpec("down", (0.0, -1.0, 3.0), (0.0, -1.0, 0.0), (0, 1, 0), 30.0, 24, 24)
    light = LightSpec("sun", "directional", direction=(0.3, 0.2, -1.0))
    case = case_of(scene, scene.spec.shapes, view, light)
    algorithm = TunedShadowMap(resolution=64, partitions=3)
    state = algorithm.build(case.eye, case.frame, case.rays)
    assert np.isfinite(np.asarray(algorithm.visibility(state, case.eye.points))).all()
    density = np.asarray(algorithm.density(state, case.eye.points), np.float64)
    assert (np.abs(np.linalg.det(np.moveaxis(density, -1, 0)))[case.eye.valid] > 0).all()


@pytest.mark.parametrize(
    ("rest", "improved", "status"),
    [
        (Rest.SETTLED, True, Status.COMPLETE),
        (Rest.SETTLED, False, Status.COMPLETE),
        (Rest.STEPS_SPENT, True, Status.UNSETTLED),
        (Rest.STEPS_SPENT, False, Status.FALLBACK),
        (Rest.NOT_FINITE, False, Status.FALLBACK),
    ],
)
def test_a_search_without_rest_is_told_by_the_map(rest, improved, status, monkeypatch):
    """In the status, which reports and notices have; not in `tuning` alone."""
    case = along_a_plane(48)
    algorithm = TunedShadowMap(resolution=64, partitions=1, warp="none")
    found = replace(algorithm.tuning(case.eye, case.frame), rest=rest, improved=improved)
    monkeypatch.setattr(TunedShadowMap, "tuning", lambda self, view, frame: found)
    state = algorithm.build(case.eye, case.frame, case.rays)
    assert algorithm.status(state) is status
    assert status.is_limit == (rest is not Rest.SETTLED)


def test_tuning_again_is_the_same_and_traces_nothing():
    """Another view and light of the same sizes compile nothing again."""
    case, other = along_a_plane(), along_a_plane(toward=(0.1, -0.5, -1.0))
    algorithm = TunedShadowMap(resolution=128, partitions=3)
    first = algorithm.tuning(case.eye, case.frame)
    with counted_traces() as traces:
        again = algorithm.tuning(case.eye, case.frame)
        algorithm.tuning(other.eye, other.frame)
    assert traces == []
    assert (again.start, again.tuned) == (first.start, first.tuned)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"partitions": 0}, "partitions"),
        ({"partitions": 17}, "partitions"),
        ({"power": 0.5}, "power"),
        ({"power": float("nan")}, "power"),
        ({"resolution": 0}, "texels a side"),
    ],
)
def test_wrong_settings_are_refused(settings, message):
    with pytest.raises(UseError, match=message):
        TunedShadowMap(**settings)
