"""What a new node costs in time: cost = a N + b, calibrated on this machine and scene."""

import functools
import logging
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import LightRays, TexelWindows
from asmjax.errors import require
from asmjax.geometry import LightFrame

SIDES = (16, 32, 64, 128, 256, 512, 1024)
"""Texels a side of the square maps that are timed, evenly spaced in the logarithm."""

REPEATS = 5
"""Timed runs of each size after one to warm up."""

LONGEST = 2.0
"""Seconds that timing one size may take."""

TRUSTED = 0.03
"""Log misfit beyond which a size counts in proportion and no longer squared. Medians of 5 runs
scatter by about this much; a size that something disturbed is off by far more."""

MAX_STEPS = 1024
"""Levenberg-Marquardt steps; clean timings take 10 to 50, random numbers some hundreds."""

_log = logging.getLogger("asmjax")


@dataclass(frozen=True)
class CostModel:
    """cost(N) = a_seconds_per_texel * N + b_seconds (Fernando et al. 2001, 3.1).

    Attributes:
        residual: root mean square of (fit - measured) / measured over the calibration.
        converged: whether the fit came to rest.
        measured_at: when its sizes were timed, UTC as ISO 8601; None for a model made by hand.
        kept: whether that was in an earlier run.
    """

    a_seconds_per_texel: float
    b_seconds: float
    residual: float
    converged: bool = True
    measured_at: str | None = None
    kept: bool = False

    def seconds(self, texels):
        """Predicted seconds to cast `texels` texels in one launch."""
        return self.a_seconds_per_texel * texels + self.b_seconds


TYPICAL = CostModel(a_seconds_per_texel=1.2e-8, b_seconds=1.6e-4, residual=0.0)
"""Of two cores: 2048 x 2048 texels in 50 ms, a launch of a few in 0.16 ms. Where no time is to be
kept, costs only decide which nodes come first: the same ones every time."""


def fit_cost_model(texels: np.ndarray, seconds: np.ndarray) -> CostModel:
    """The a, b >= 0 of a N + b whose relative misfit is least; wild sizes hardly count.

    Minimises the soft-L1 loss 2 d^2 (sqrt(1 + (r/d)^2) - 1), d = `TRUSTED`, of the log misfits
    r = log((a N + b) / t): small misfits count as in least squares with weights 1 / t^2, and one
    size ten times too slow moves a coefficient by some percent only. Where a trend asks for a
    negative coefficient, it is exactly 0. A fit that does not come to rest is a status of the
    model, and logged as a warning; a and b are the best found then.

    Args:
        texels: (k,) numbers of texels N, at least two different ones.
        seconds: (k,) measured times t.

    Raises:
        UseError: fewer than two different sizes, or a size or time that is not positive and finite.
    """
    texels, seconds = np.asarray(texels, np.float64), np.asarray(seconds, np.float64)
    for name, values in (("texels", texels), ("seconds", seconds)):
        require(
            bool(np.all(np.isfinite(values) & (values > 0))),
            f"{name} to fit a cost model to are {values}; allowed: positive finite numbers; "
            "measure those sizes again.",
        )
    require(
        np.unique(texels).size > 1,
        f"a cost model was asked for from the size(s) {np.unique(texels)}; a line a N + b needs "
        "two different ones; time more sizes.",
    )
    typical, level = np.exp(np.log(texels).mean()), np.exp(np.log(seconds).mean())
    log_seconds, scaled = np.log(seconds / level), texels / typical
    # For this call alone: 1e-5 of the largest time may be all that tells of a coefficient.
    with jax.enable_x64(True):
        found = _least_misfits(log_seconds, scaled, _starts(log_seconds, scaled), MAX_STEPS)
        roots, losses, settled = (np.asarray(part) for part in found)
    best = int(np.argmax(losses <= np.nanmin(losses) * (1 + 1e-9) + 1e-24))
    a, b = np.square(roots[best]) * level / np.array([typical, 1.0])
    relative = (a * texels + b) / seconds - 1
    model = CostModel(float(a), float(b), float(np.sqrt(np.mean(relative**2))), bool(settled[best]))
    if not model.converged:
        _log.warning(
            "the cost model did not settle in %d steps and misses its timings by %.0f %%: node "
            "costs, and so time limits, are a guess. Calibrate again on a quieter machine "
            "(`recalibrate`).",
            MAX_STEPS,
            100 * model.residual,
        )
    return model


def _starts(log_seconds: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Square roots (p, q) to start from, (9, 2): a loss that forgives has minima of its own.

    Lines whose overhead equals their texels' cost at one of seven sizes, at the median height. A
    coefficient of 0 stays 0; these two come first, for of equal fits the first is taken.
    """
    even = np.geomspace(texels.min(), texels.max(), 7)
    lines = np.array([(1.0, 0.0), (0.0, 1.0), *((1.0, size) for size in even)])
    logs = np.log(lines[:, :1] * texels + lines[:, 1:])
    height = np.median(log_seconds - logs, axis=1)
    return np.sqrt(lines * np.exp(height)[:, None])


@functools.partial(jax.jit, static_argnames="max_steps")
def _least_misfits(log_seconds, texels, starts, max_steps: int):
    """Square roots (p, q) of the coefficients in p^2 N + q^2, losses, and convergence, by start.

    Squares keep both coefficients from below 0 and leave 0 within reach. A sequential map, because
    compiling a batched solver takes twice as long as all of its steps.
    """
    import optimistix as optx  # 0.3 s: only who calibrates pays for it

    def misfits(roots, _):
        p, q = roots
        log_ratio = jnp.log(p**2 * texels + q**2) - log_seconds
        # The square root of soft-L1, smooth at 0: its square is the loss.
        return log_ratio * jnp.sqrt(2 / (1 + jnp.sqrt(1 + (log_ratio / TRUSTED) ** 2)))

    def descend(start):
        solver = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
        solution = optx.least_squares(misfits, solver, start, max_steps=max_steps, throw=False)
        loss = jnp.sum(misfits(solution.value, None) ** 2)
        return solution.value, loss, solution.result == optx.RESULTS.successful

    return jax.lax.map(descend, starts)


def calibrate(
    rays: LightRays, frame: LightFrame, sides: tuple[int, ...] = SIDES, repeats: int = REPEATS
) -> CostModel:
    """Time square maps of several sizes (`time_sizes`) and fit."""
    return dated(fit_cost_model(*time_sizes(rays, frame, sides, repeats)))


def dated(model: CostModel) -> CostModel:
    """`model` as measured now."""
    return replace(model, measured_at=datetime.now(UTC).isoformat(timespec="seconds"))


def time_sizes(
    rays: LightRays, frame: LightFrame, sides: tuple[int, ...] = SIDES, repeats: int = REPEATS
) -> tuple[np.ndarray, np.ndarray]:
    """Texels (k,) and seconds (k,) to cast square maps: medians of `repeats` runs after a warm-up.

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
    return np.square(np.array(chosen, np.float64)), np.array(medians)


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
        rays.light_buffer(frame, windows)
        runs.append(time.perf_counter() - start)
    return float(np.median(runs[1:]))
