"""Timing, sampling and pixel means: what a measured number is made of."""

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case

from asmjax.experiment import analysis_maps, median_by_stage, repeated, timed
from asmjax.experiment.methods import measure, pixel_mean, settings_of
from asmjax.shadow import AdaptiveShadowMap, CostModel, UniformShadowMap


def test_repeated_warms_up_and_takes_the_median(monkeypatch):
    """Four calls for three timed runs; the warm-up, by far the slowest, does not count."""
    clock, lasts = [0.0], iter([100.0, 1.0, 9.0, 2.0])
    monkeypatch.setattr("asmjax.experiment.clock.time.perf_counter", lambda: clock[0])

    def call():
        clock[0] += next(lasts)
        return jnp.float32(clock[0])

    result, seconds = repeated(call, 3)
    assert seconds == 2.0
    assert float(result) == 112.0
    assert next(lasts, None) is None


def test_timed_returns_the_result():
    """The result comes back computed, with a time that is not negative."""
    result, seconds = timed(lambda: jnp.arange(3).sum())
    assert int(result) == 3
    assert seconds >= 0


def test_median_by_stage_is_per_stage():
    """Each stage has its own median."""
    runs = [{"build": b, "analysis": a} for b, a in ((1.0, 30.0), (3.0, 10.0), (2.0, 20.0))]
    assert median_by_stage(runs) == {"build": 2.0, "analysis": 20.0}


def test_pixel_mean_counts_valid_samples_only():
    """A sample that sees no surface says nothing; a pixel without any is 0, not NaN."""
    eye = analytic_case("a1_square", 16).eye
    eyes = [replace(eye, shape=np.array(shape)) for shape in ([0, 0, -1], [0, -1, -1])]
    mean = pixel_mean([np.array([1.0, 1.0, 1.0]), np.array([0.0, 1.0, 1.0])], eyes)
    np.testing.assert_array_equal(mean, [0.5, 1.0, 0.0])


def test_settings_leave_the_calibration_out():
    """Settings are what one can type in again; the cost model is measured."""
    settings = settings_of(AdaptiveShadowMap(cost_model=CostModel(1e-8, 1e-4, 0.0)))
    assert settings["node_resolution"] == 16
    assert "cost_model" not in settings


@pytest.mark.parametrize("samples", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_measured_uniform_map(samples):
    """Rays, bytes and passes are those of one build, however often it was repeated."""
    case = analytic_case("a1_square", 32)
    measured = measure(UniformShadowMap(64), [case.eye] * samples, case.frame, case.rays, 2)
    assert measured.cost.rays == 64**2
    assert measured.cost.bytes == 4 * 64**2
    assert set(measured.cost.seconds) == {"build", "analysis", "query"}
    assert set(np.unique(measured.visibility)) <= {0.0, 1.0}
    assert case.error(measured.visibility > 0.5) < 0.05


def test_maps_are_those_of_the_flat_map():
    """Halving the resolution doubles texels, quadruples their area, and leaves the need alone."""
    case = analytic_case("a1_square", 32)
    maps = {}
    for resolution in (16, 32):
        algorithm = UniformShadowMap(resolution)
        state = algorithm.build(case.eye, case.frame, case.rays)
        maps[resolution] = analysis_maps(case.eye, case.frame, algorithm, state)
    coarse, fine = maps[16], maps[32]
    facing = np.isfinite(coarse["m"])
    assert facing.any()
    for name, factor in (("area_ratio", 4), ("linear_ratio", 2), ("m", 2), ("n_required", 1)):
        np.testing.assert_allclose(coarse[name][facing], factor * fine[name][facing], rtol=1e-5)
    np.testing.assert_allclose(
        coarse["n_required"][facing], 16**2 * coarse["area_ratio"][facing], rtol=1e-5
    )
    assert (coarse["area_ratio"][facing] <= coarse["m"][facing] ** 2 * (1 + 1e-5)).all()
    assert coarse["benefit"].max() > 0
    assert (coarse["benefit"][~facing] == 0).all()


def test_benefit_vanishes_where_the_map_is_fine_enough():
    """With texels far smaller than pixels nobody is mismatched."""
    case = analytic_case("a5_half_plane", 16)
    algorithm = UniformShadowMap(1024)
    state = algorithm.build(case.eye, case.frame, case.rays)
    maps = analysis_maps(case.eye, case.frame, algorithm, state)
    assert np.nanmax(maps["m"]) < 1
    assert maps["benefit"].max() == 0


def test_sample_offsets_are_centred_distinct_and_seeded():
    """The pixel centre first, then points inside the pixel; the seed decides them."""
    from asmjax.preparation import sample_offsets

    offsets = sample_offsets(16, seed=3)
    assert offsets[0] == (0.0, 0.0)
    assert len(set(offsets)) == 16
    assert all(-0.5 <= x < 0.5 for offset in offsets for x in offset)
    assert offsets == sample_offsets(16, seed=3)
    assert offsets != sample_offsets(16, seed=4)
    # Spread over the pixel: each quarter has its share, give or take one.
    quarters = np.bincount([2 * (x >= 0) + (y >= 0) for x, y in offsets[1:]], minlength=4)
    assert quarters.min() >= math.floor(15 / 4) - 1


def test_time_limit_keeps_what_was_built():
    """A limit too short for any pass leaves the starting resolution, and says so."""
    case = analytic_case("a1_square", 64)
    algorithm = replace(
        AdaptiveShadowMap(memory_bytes=2**20, cost_model=CostModel(1e-6, 1e-3, 0.0)),
        time_limit=1e-6,
    )
    measured = measure(algorithm, [case.eye], case.frame, case.rays, 1)
    assert measured.status.name == "TIME_LIMIT"
    assert case.error(measured.visibility > 0.5) < 0.1
