"""Colour scales over powers of two: their limits, ticks and labels, and colouring by them."""

import math

import numpy as np
from matplotlib.colors import Colormap, Normalize

from asmjax.report.figures.style import BACKGROUND, hex_rgb

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def log2_or_nan(values) -> np.ndarray:
    """float64 log2, and NaN for what is not positive or not finite."""
    x = np.asarray(values, np.float64)
    good = np.isfinite(x) & (x > 0)
    return np.where(good, np.log2(np.where(good, x, 1.0)), np.nan)


def power_of_two(exponent: float) -> str:
    """2^exponent for an axis: plain up to 1024, then 2 with a raised exponent."""
    k = round(exponent)
    if abs(k) <= 3:
        return str(2**k) if k >= 0 else f"1/{2**-k}"
    return "2" + str(k).translate(_RAISED)


def factor(exponent: float) -> str:
    """2^exponent as a ratio: 1/4x, 1x, 8x, 2^12 x with a raised exponent."""
    k = round(exponent)
    if 0 <= k <= 10:
        return f"{2**k}×"
    if -10 <= k < 0:
        return f"1/{2**-k}×"
    return f"2{str(k).translate(_RAISED)}×"


def exponent_ticks(low: float, high: float, most: int = 7) -> list[int]:
    """Whole exponents in [low, high] at an even step; a multiple of it, so that 0 is among them."""
    first, last = math.ceil(low - 1e-9), math.floor(high + 1e-9)
    if last < first:
        return []
    step = next(s for s in (1, 2, 4, 5, 10, 20, 50, 100, 10**9) if (last - first) / s <= most - 1)
    return [k for k in range(first, last + 1) if k % step == 0]


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

    `centred` scales reach as far below 0 as above.
    """
    finite = exponents[np.isfinite(exponents)]
    if not finite.size:
        return (-1.0, 1.0) if centred else (0.0, 2.0)
    low, high = (float(v) for v in np.percentile(finite, [1, 99]))
    if centred:
        reach = max(abs(low), abs(high), 1.0)
        return -reach, reach
    if high - low < 2:
        middle = 0.5 * (low + high)
        return middle - 1, middle + 1
    return low, high
