"""The cost of a node, a N + b: fitted to timings whose coefficients are known."""

import types

import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.counting import CountingRays
from hypothesis import given
from hypothesis import strategies as st

from asmjax.shadow.adaptive import CostModel, calibrate, fit_cost_model
from asmjax.shadow.adaptive.cost_model import SIDES

TEXELS = np.square(np.array(SIDES, float))
A, B = 2e-9, 2e-9 * 128**2
"""Both coefficients matter: they are equal at 128 x 128, in the middle of the sizes."""


def test_exact_timings_are_recovered():
    model = fit_cost_model(TEXELS, A * TEXELS + B)
    assert model.a_seconds_per_texel == pytest.approx(A, rel=1e-9)
    assert model.b_seconds == pytest.approx(B, rel=1e-9)
    assert model.residual == pytest.approx(0.0, abs=1e-12)
    assert model.seconds(1000.0) == pytest.approx(A * 1000 + B)


def test_ten_percent_noise_is_recovered_within_five():
    """Reference T9: 10 % noise on each run, the median of 5 runs of each of the 7 sizes.

    The median of 5 has 5.4 % noise, and some 3 of the 7 sizes tell of either coefficient:
    5.4 % / sqrt(3) = 3.1 %, so the error is below 5 % on average, and below 15 % nearly always.
    """
    rng = np.random.default_rng(7)
    errors = []
    for _ in range(300):
        runs = (A * TEXELS + B) * (1 + 0.1 * rng.standard_normal((5, TEXELS.size)))
        model = fit_cost_model(TEXELS, np.median(runs, axis=0))
        errors.append([model.a_seconds_per_texel / A - 1, model.b_seconds / B - 1])
    spread = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (spread < 0.05).all(), spread
    assert np.mean(np.abs(errors) < 0.15) > 0.99
    # No systematic part but that of relative weights, which favour short measurements: var / mean.
    assert (np.abs(np.mean(errors, axis=0)) < 0.01).all()


def test_many_sizes_are_recovered_within_five_percent_every_time():
    """Weights from the measured times favour what happened to be short: with 10 % noise that takes
    2 sigma^2 = 2 % off either coefficient; the rest is below 1 % for 600 sizes."""
    texels = np.square(np.geomspace(16, 1024, 600))
    for seed in range(20):
        noise = 1 + 0.1 * np.random.default_rng(seed).standard_normal(texels.size)
        model = fit_cost_model(texels, (A * texels + B) * noise)
        assert model.a_seconds_per_texel == pytest.approx(A, rel=0.05)
        assert model.b_seconds == pytest.approx(B, rel=0.05)


@given(
    a=st.floats(1e-12, 1e-6),
    b=st.floats(1e-7, 1e-1),
    noise=st.lists(st.floats(-0.9, 5.0), min_size=7, max_size=7),
)
def test_coefficients_are_never_negative_and_the_best_that_are_not(a, b, noise):
    """Against a grid of all other non-negative pairs; the residual is its definition."""
    seconds = (a * TEXELS + b) * (1 + np.array(noise))
    model = fit_cost_model(TEXELS, seconds)
    assert model.a_seconds_per_texel >= 0 and model.b_seconds >= 0
    assert model.seconds(TEXELS[0]) > 0

    def residual(a, b):
        return np.sqrt(np.mean(((a * TEXELS + b - seconds) / seconds) ** 2))

    got = residual(model.a_seconds_per_texel, model.b_seconds)
    assert model.residual == pytest.approx(got, rel=1e-9, abs=1e-12)
    steps = np.r_[0.0, np.geomspace(1e-3, 1e3, 25)]
    for other_a in steps * (model.a_seconds_per_texel or a):
        for other_b in steps * (model.b_seconds or b):
            assert residual(other_a, other_b) >= got - 1e-9


@pytest.mark.parametrize(
    ("seconds", "zero"),
    [(1e-3 * TEXELS**-0.2, "a_seconds_per_texel"), (1e-9 * TEXELS**1.2, "b_seconds")],
)
def test_a_trend_that_no_cost_has_is_clamped_to_zero(seconds, zero):
    model = fit_cost_model(TEXELS, seconds)
    assert getattr(model, zero) == 0.0
    assert max(model.a_seconds_per_texel, model.b_seconds) > 0


class TickingRays(CountingRays):
    """Rays whose casting takes a N + b seconds of a clock that only they move. Of each size the
    first launch takes ten times as long, and the third and fifth half as long again: three of six,
    but two of the five that count."""

    now = 0.0

    def light_buffer(self, frame, windows):
        before = sum(windows.side == seen.side for seen in self.windows)
        slow = {0: 10.0, 2: 1.5, 4: 1.5}.get(before, 1.0)
        self.now += slow * (A * windows.texels + B)
        self.launches += 1
        self.windows.append(windows)
        return ()


def test_calibration_takes_medians_after_a_warm_up(monkeypatch):
    case = analytic_case("a4_disc_light", 64)
    rays = TickingRays(case.rays)
    clock = types.SimpleNamespace(perf_counter=lambda: rays.now)
    monkeypatch.setattr("asmjax.shadow.adaptive.cost_model.time", clock)
    model = calibrate(rays, case.frame, repeats=5)
    assert model.a_seconds_per_texel == pytest.approx(A, rel=1e-6)
    assert model.b_seconds == pytest.approx(B, rel=1e-6)
    assert [w.side for w in rays.windows] == [side for side in SIDES for _ in range(6)]
    # Each map covers the whole face.
    assert all(w.texel[0, 0] * w.side == 1.0 and not w.corner.any() for w in rays.windows)


def test_calibration_of_real_rays():
    case = analytic_case("a4_disc_light", 64)
    model = calibrate(case.rays, case.frame, sides=(8, 16, 32), repeats=1)
    assert isinstance(model, CostModel) and model.seconds(64**2) > 0
