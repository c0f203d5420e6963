"""What a new node costs in time: cost = a N + b, calibrated on this machine and scene."""

import time
from dataclasses import dataclass

import jax
import numpy as np

from asmjax.buffers import LightRays, TexelWindows
from asmjax.geometry import LightFrame

SIDES = (16, 32, 64, 128, 256, 512, 1024)
"""Texels a side of the square maps that are timed, evenly spaced in the logarithm."""

LONGEST = 2.0
"""Seconds that timing one size may take."""


@dataclass(frozen=True)
class CostModel:
    """cost(N) = a_seconds_per_texel * N + b_seconds (Fernando et al. 2001, 3.1).

    `residual` is the root mean square of (fit - measured) / measured over the calibration.
    """

    a_seconds_per_texel: float
    b_seconds: float
    residual: float

    def seconds(self, texels):
        """Predicted seconds to cast `texels` texels in one launch."""
        return self.a_seconds_per_texel * texels + self.b_seconds


def fit_cost_model(texels: np.ndarray, seconds: np.ndarray) -> CostModel:
    """Least squares with weights 1 / t^2, so that every size counts alike; a, b >= 0.

    Where the unconstrained solution has a negative coefficient, that one is 0 and the other is
    fitted alone.
    """
    texels, seconds = np.asarray(texels, np.float64), np.asarray(seconds, np.float64)
    rows = np.stack([texels / seconds, 1 / seconds], axis=1)
    ones = np.ones_like(seconds)
    fits = [np.linalg.lstsq(rows, ones, rcond=None)[0]]
    for k in (0, 1):
        alone = np.zeros(2)
        alone[k] = rows[:, k].sum() / (rows[:, k] ** 2).sum()
        fits.append(alone)
    allowed = [fit for fit in fits if (fit >= 0).all()]
    best = min(allowed, key=lambda fit: np.sum((rows @ fit - 1) ** 2))
    residual = float(np.sqrt(np.mean((rows @ best - 1) ** 2)))
    return CostModel(float(best[0]), float(best[1]), residual)


def calibrate(
    rays: LightRays, frame: LightFrame, sides: tuple[int, ...] = SIDES, repeats: int = 5
) -> CostModel:
    """Time square maps of several sizes (median of `repeats` runs after one warm-up) and fit.

    A renderer so slow that the next size would take more than `LONGEST` seconds is timed on the
    smaller ones, on three at least.
    """
    timed: list[tuple[int, float]] = []
    for side in sides:
        if len(timed) >= 3:
            before, seconds = timed[-1]
            if (repeats + 1) * seconds * (side / before) ** 2 > LONGEST:
                break
        timed.append((side, _median_seconds(rays, frame, side, repeats)))
    chosen, medians = zip(*timed, strict=True)
    return fit_cost_model(np.square(chosen), np.array(medians))


def _median_seconds(rays: LightRays, frame: LightFrame, side: int, repeats: int) -> float:
    windows = TexelWindows(
        face=np.zeros(1, int),
        corner=np.zeros((2, 1)),
        texel=np.full((2, 1), 1.0 / side),
        side=side,
    )
    runs = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        jax.block_until_ready(rays.light_buffer(frame, windows))
        runs.append(time.perf_counter() - start)
    return float(np.median(runs[1:]))
