"""Colour scales over powers of two: their limits, ticks and labels, and colouring by them."""

import math

import numpy as np
from matplotlib.colors import Colormap, ListedColormap, Normalize

from asmjax.report.figures.style import BACKGROUND, hex_rgb
from asmjax.report.table import is_long_power

_RAISED = str.maketrans("-.0123456789", "⁻·⁰¹²³⁴⁵⁶⁷⁸⁹")


def log2_or_nan(values) -> np.ndarray:
    """float64 log2, and NaN for what is not positive or not finite."""
    x = np.asarray(values, np.float64)
    good = np.isfinite(x) & (x > 0)
    return np.where(good, np.log2(np.where(good, x, 1.0)), np.nan)


def power_of_two(exponent: float) -> str:
    """2^exponent for an axis: plain from 1/8 to 8, else 2 with a raised exponent, in halves."""
    k = round(2 * exponent) / 2
    if abs(k) <= 3 and k == int(k):
        return str(2 ** int(k)) if k >= 0 else f"1/{2 ** -int(k)}"
    return "2" + f"{k:g}".translate(_RAISED)


def texels_a_side(count: int) -> str:
    """Texels a side of a map: 915, 2,048, and 2 with a raised exponent where that is shorter."""
    short = is_long_power(count)
    return power_of_two(count.bit_length() - 1) if short else f"{count:,}"


def factor(exponent: float) -> str:
    """2^exponent as a ratio: 1/4x, 1x, 8x, 2^12 x with a raised exponent."""
    k = round(exponent)
    if 0 <= k <= 10:
        return f"{2**k}×"
    if -10 <= k < 0:
        return f"1/{2**-k}×"
    return f"2{str(k).translate(_RAISED)}×"


def half_ticks(low: float, high: float, most: int = 7) -> list[float]:
    """As `exponent_ticks`, but in halves where whole exponents are fewer than four."""
    whole = exponent_ticks(low, high, most)
    return [k / 2 for k in exponent_ticks(2 * low, 2 * high, most)] if len(whole) < 4 else [*whole]


def exponent_ticks(low: float, high: float, most: int = 7) -> list[int]:
    """Whole exponents in [low, high] at an even step; a multiple of it, so that 0 is among them."""
    first, last = math.ceil(low - 1e-9), math.floor(high + 1e-9)
    if last < first:
        return []
    step = next(s for s in (1, 2, 4, 5, 10, 20, 50, 100, 10**9) if (last - first) / s <= most - 1)
    return [k for k in range(first, last + 1) if k % step == 0]


def around_zero(colour_map: Colormap, low: float, high: float) -> Colormap:
    """The part of a diverging colour map for [low, high]: its middle at 0, one slope throughout."""
    reach = max(-low, high)
    share = 0.5 + 0.5 * np.linspace(low, high, 512) / reach
    return ListedColormap(colour_map(share))


def beyond(exponents: np.ndarray, low: float, high: float) -> str:
    """Which ends of a scale values lie beyond, as `extend` of a colour bar has it."""
    finite = exponents[np.isfinite(exponents)]
    below, above = bool((finite < low).any()), bool((finite > high).any())
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]


def colours_of(values: np.ndarray, colour_map: Colormap, norm: Normalize) -> np.ndarray:
    """(height, width, 3) uint8: `values` through a colour map, `BACKGROUND` where not finite.

    Not left to `imshow`: it colours after resampling, which bleeds masked pixels into others.
    """
    shown = np.where(np.isfinite(values), values, norm.vmin if norm.vmin is not None else 0.0)
    image = colour_map(norm(shown), bytes=True)[..., :3].copy()
    image[~np.isfinite(values)] = hex_rgb(BACKGROUND)
    return image


def scale_limits(exponents: np.ndarray, centred: bool) -> tuple[float, float]:
    """Ends of a colour scale in log2 units, at least 2 apart: the inner 98 % of finite values.

    `centred` scales reach at least from -1 to 1; see `around_zero` for their colours.
    """
    finite = exponents[np.isfinite(exponents)]
    if not finite.size:
        return (-1.0, 1.0) if centred else (0.0, 2.0)
    low, high = (float(v) for v in np.percentile(finite, [1, 99]))
    if centred:
        return min(low, -1.0), max(high, 1.0)
    if high - low < 2:
        middle = 0.5 * (low + high)
        return middle - 1, middle + 1
    return low, high
