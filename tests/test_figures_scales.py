"""Shading, and colour scales over powers of two."""

import matplotlib
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import Normalize

from asmjax.report.figures import shade
from asmjax.report.figures.scales import (
    around_zero,
    beyond,
    colours_of,
    exponent_ticks,
    factor,
    half_ticks,
    log2_or_nan,
    power_of_two,
    scale_limits,
    texels_a_side,
)
from asmjax.report.figures.shading import tone
from asmjax.report.figures.style import BACKGROUND, SKY, hex_rgb


def test_shading_keeps_shape_in_shadow_and_exposes_for_the_lit_picture():
    albedo = np.full((3, 4, 6), 0.5)
    cosine = np.tile(np.linspace(-0.5, 1, 6), (4, 1))
    lit = shade(albedo, cosine, np.ones((4, 6)))
    dark = shade(albedo, cosine, np.zeros((4, 6)))
    assert (lit >= dark).all()
    np.testing.assert_array_equal(lit[:, :2], dark[:, :2])
    assert lit[0, -1, 0] > 200
    assert (np.diff(dark[0, :, 0].astype(int)) > 0).all()
    masked = shade(albedo, cosine, np.full((4, 6), np.nan), np.zeros((4, 6), bool))
    np.testing.assert_array_equal(masked[0, 0], hex_rgb(SKY))
    assert shade(albedo * 0, cosine, np.ones((4, 6))).max() == 0
    steps = tone(np.linspace(0, 50, 200))
    assert (np.diff(steps.astype(int)) >= 0).all() and steps[0] == 0 and steps[-1] == 255


def test_labels_of_powers():
    assert [power_of_two(k) for k in (-3, 0, 3, 11)] == ["1/8", "1", "8", "2¹¹"]
    assert [power_of_two(k) for k in (0.5, 11.5, -10)] == ["2⁰·⁵", "2¹¹·⁵", "2⁻¹⁰"]
    sides = [texels_a_side(n) for n in (915, 2048, 65536, 2**24, 2**24 + 2)]
    assert sides == ["915", "2,048", "65,536", "2²⁴", "16,777,218"]
    assert half_ticks(11.2, 12.7) == [11.5, 12.0, 12.5]
    assert half_ticks(8, 12) == [8, 9, 10, 11, 12]
    assert [factor(k) for k in (-2, 0, 3, 12, -20)] == ["1/4×", "1×", "8×", "2¹²×", "2⁻²⁰×"]


@given(st.floats(-100, 100), st.floats(0, 200))
def test_ticks_are_few_inside_and_evenly_spaced(low, span):
    ticks = exponent_ticks(low, low + span)
    assert len(ticks) <= 8
    assert all(low - 1e-6 <= k <= low + span + 1e-6 for k in ticks)
    assert len(set(np.diff(ticks))) <= 1
    if span >= 1:
        assert ticks or span < 101


@given(st.lists(st.floats(-60, 60) | st.just(np.nan), max_size=20), st.booleans())
def test_scales_hold_most_values_and_are_never_empty(values, centred):
    exponents = np.array(values, float)
    low, high = scale_limits(exponents, centred)
    assert high - low >= 2 - 1e-9
    if centred:
        assert low <= -1 < 1 <= high
    finite = exponents[np.isfinite(exponents)]
    assert finite.size == 0 or low - 1e-9 <= np.median(finite) <= high + 1e-9


def test_diverging_scales_are_white_at_zero_and_have_one_slope():
    low, high = -1.0, 8.0
    part, whole = (
        around_zero(matplotlib.colormaps["RdBu_r"], *ends) for ends in ((low, high), (-8, 8))
    )
    for exponent in (-1.0, 0.0, 4.0, 8.0):
        mine = part((exponent - low) / (high - low))
        np.testing.assert_allclose(mine, whole((exponent + 8) / 16), atol=0.02)
    assert min(part((0.0 - low) / (high - low))[:3]) > 0.94


def test_scales_are_pointed_where_values_lie_beyond():
    values = np.array([0.0, 5.0, np.nan])
    assert [beyond(values, *ends) for ends in ((0, 5), (1, 5), (0, 4), (1, 4))] == [
        "neither",
        "min",
        "max",
        "both",
    ]


def test_values_without_a_logarithm_are_background():
    exponents = log2_or_nan([[4.0, 0.0, -1.0, np.inf, np.nan]])
    np.testing.assert_array_equal(exponents[0], [2, *[np.nan] * 4])
    norm = Normalize(0, 4)
    image = colours_of(exponents, matplotlib.colormaps["viridis"], norm)
    assert (image[0, 1:] == hex_rgb(BACKGROUND)).all()
    assert (image[0, 0] != hex_rgb(BACKGROUND)).any()
