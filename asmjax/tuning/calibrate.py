"""Fitting the surrogate to trials of the real map: Levenberg-Marquardt on logarithms."""

import functools
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.numerics import in_float64
from asmjax.tuning.evidence import Evidence
from asmjax.tuning.goal import LEAST_PX
from asmjax.tuning.surrogate import Fit, predict

TRUSTED = 0.25
"""Log misfit of an error beyond which a trial counts in proportion and no longer squared."""

TRUSTED_SECONDS = 0.1
"""The same of seconds."""

PRIORS = Fit(
    fixed=1.0, look=1.0, turn=1.0, texel=1.0, node=1.5, launch=1.0,
    reach=0.5, miss=0.7, scale=0.5, floor=1.0, memory=0.05, tables=0.1,
    profit=0.5, greed=0.3, gap=1.0, hurry=1.5,
)  # fmt: skip
"""Natural logarithm by which a fitted number may stray as easily as a trial by its `TRUSTED`:
costs are the machine's, the others are known to a factor of two."""

TEMPERATURE = 0.5
"""Of the decisions while fitting."""

MAX_STEPS = 25


@dataclass(frozen=True)
class Calibration:
    """A fit, and how well it explains its trials.

    Attributes:
        fit: float64 numbers.
        error_misfit, seconds_misfit: median of abs(log(predicted / measured)).
        trials: how many.
        settled: whether the search came to rest.
    """

    fit: Fit
    error_misfit: float
    seconds_misfit: float
    trials: int
    settled: bool


class Sample(NamedTuple):
    """Trials as the fit sees them, (k,) each; those of weight 0 fill up."""

    settings: dict[str, Float[Array, " k"]]
    log_error: Float[Array, " k"]
    log_seconds: Float[Array, " k"]
    weight: Float[Array, " k"]


ROOM = 20
"""Trials are filled up to a multiple of this, so that few shapes are ever compiled."""


@functools.partial(jax.jit, static_argnames="max_steps")
def _fitted(evidence: Evidence, sample: Sample, start: Fit, believed, max_steps: int = MAX_STEPS):
    import optimistix as optx  # 0.3 s: only who tunes pays for it

    def off(fit):
        def one(settings):
            said = predict(evidence, settings, fit, TEMPERATURE, believed)
            return jnp.log(said.edge_px + LEAST_PX), jnp.log(said.seconds)

        error, seconds = jax.vmap(one)(sample.settings)
        return error - sample.log_error, seconds - sample.log_seconds

    def misfits(fit, _):
        error, seconds = off(fit)
        return (
            sample.weight * _forgiving(error / TRUSTED),
            sample.weight * _forgiving(seconds / TRUSTED_SECONDS),
            jnp.stack(fit) / jnp.asarray(PRIORS),
        )

    solver = optx.LevenbergMarquardt(rtol=1e-5, atol=1e-5)
    found = optx.least_squares(misfits, solver, start, max_steps=max_steps, throw=False)
    return found.value, *off(found.value), found.result == optx.RESULTS.successful


def _forgiving(x):
    """Square root of the soft-L1 loss 2 (sqrt(1 + x^2) - 1), smooth at 0."""
    return x * jnp.sqrt(2 / (1 + jnp.sqrt(1 + x**2)))


@in_float64
def calibrated_fit(
    evidence: Evidence,
    values: dict[str, np.ndarray],
    edge_px: np.ndarray,
    seconds: np.ndarray,
    believed: np.ndarray,
    start: Fit | None = None,
    weight: np.ndarray | None = None,
) -> Calibration:
    """The fit to trials of one view.

    Args:
        values: continuous settings (k,) by name, as `asmjax.tuning.space.values_at` gives them.
        edge_px, seconds: (k,) measured.
        believed: (2,) seconds per texel and per launch by the map's cost model.
        start: an earlier fit; None for the expected numbers.
        weight: (k,) of the trials; None for equal ones.
    """
    count = len(edge_px)
    room = ROOM * -(-count // ROOM)

    def filled(numbers):
        return jnp.asarray(np.pad(np.asarray(numbers, np.float64), (0, room - count), mode="edge"))

    sample = Sample(
        {name: filled(value) for name, value in values.items()},
        jnp.log(filled(edge_px) + LEAST_PX),
        jnp.log(filled(seconds)),
        jnp.asarray(np.pad(np.ones(count) if weight is None else weight, (0, room - count))),
    )
    first = Fit(*(np.zeros(()) for _ in Fit._fields)) if start is None else start
    first = Fit(*(jnp.asarray(number) for number in first))
    fit, error, time, settled = _fitted(evidence, sample, first, jnp.asarray(believed))
    return Calibration(
        fit=Fit(*(np.asarray(number) for number in fit)),
        error_misfit=float(jnp.median(jnp.abs(error[:count]))),
        seconds_misfit=float(jnp.median(jnp.abs(time[:count]))),
        trials=count,
        settled=bool(settled),
    )
