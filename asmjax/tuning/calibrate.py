"""Fitting the surrogate to trials of the real map: its rules, then what they leave.

The rules' numbers are found by Levenberg and Marquardt's method on logarithms; what is left of the
misfits goes into a correction.
"""

import functools
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.numerics import in_float64
from asmjax.tuning.correction import Correction, fitted_correction, place_of
from asmjax.tuning.evidence import Evidence
from asmjax.tuning.goal import LEAST_PX
from asmjax.tuning.space import Space, values_at
from asmjax.tuning.surrogate import TEMPERATURE, Fit, Rules, predict, rules_of

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

WIDE = 0.5
"""Temperature at which the rules' numbers are fitted: harder decisions do not feel what is far from
tipping, and the search gets stuck. The correction is of what the rules say at `TEMPERATURE`."""

CLOSE = 3e-3
"""A fit is at rest when a step changes its numbers, or its misfits, by less than this part."""

MAX_STEPS = 80

ROOM = 96
"""Trials are filled up to a multiple of this, so that few shapes are ever compiled: one, for as
many evaluations as are usual."""


@dataclass(frozen=True)
class Calibration:
    """A fit, and how well it explains its trials.

    Attributes:
        fit: float64 numbers of the rules.
        correction: of what the rules say.
        error_misfit, seconds_misfit: median of abs(log(predicted / measured)), each trial predicted
            by a correction that does not know it.
        trials: how many.
        settled: whether the search for the rules' numbers came to rest.
    """

    fit: Fit
    correction: Correction
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


def _said(evidence, settings, fit, temperature, rules):
    """(k,) error and seconds by the rules."""

    def one(settings):
        said = predict(evidence, settings, fit, temperature, rules)
        return said.edge_px, said.seconds

    return jax.vmap(one)(settings)


@functools.partial(jax.jit, static_argnames="max_steps")
def _fitted(
    evidence: Evidence, sample: Sample, start: Fit, rules: Rules, max_steps: int = MAX_STEPS
):
    import optimistix as optx  # 0.3 s: only who tunes pays for it

    def misfits(fit, _):
        edge, seconds = _said(evidence, sample.settings, fit, WIDE, rules)
        error = jnp.log(edge + LEAST_PX) - sample.log_error
        time = jnp.log(seconds) - sample.log_seconds
        return (
            sample.weight * _forgiving(error / TRUSTED),
            sample.weight * _forgiving(time / TRUSTED_SECONDS),
            jnp.stack(fit) / jnp.asarray(PRIORS),
        )

    solver = optx.LevenbergMarquardt(rtol=CLOSE, atol=CLOSE)
    found = optx.least_squares(misfits, solver, start, max_steps=max_steps, throw=False)
    numbers = jnp.all(jnp.isfinite(jnp.stack(found.value)))
    end = jax.tree.map(lambda end, first: jnp.where(numbers, end, first), found.value, start)
    said = _said(evidence, sample.settings, end, TEMPERATURE, rules)
    return end, jnp.stack(said), numbers & (found.result == optx.RESULTS.successful)


def _forgiving(x):
    """Square root of the soft-L1 loss 2 (sqrt(1 + x^2) - 1), smooth at 0."""
    return x * jnp.sqrt(2 / (1 + jnp.sqrt(1 + x**2)))


@in_float64
def calibrated_fit(
    evidence: Evidence,
    space: Space,
    points: np.ndarray,
    edge_px: np.ndarray,
    seconds: np.ndarray,
    start: Fit | None = None,
    weight: np.ndarray | None = None,
) -> Calibration:
    """The fit to trials of one view.

    Args:
        points: (k, knobs) of the box.
        edge_px, seconds: (k,) measured.
        start: an earlier fit; None for the expected numbers.
        weight: (k,) of the trials; None for equal ones.
    """
    count = len(edge_px)
    room = ROOM * -(-count // ROOM)
    weight = np.ones(count) if weight is None else weight

    def filled(numbers):
        return jnp.asarray(np.pad(np.asarray(numbers, np.float64), (0, room - count), mode="edge"))

    low, high = (end[:, None] for end in space.ends)
    sample = Sample(
        {name: filled(value) for name, value in values_at(points.T, low, high).items()},
        jnp.log(filled(edge_px) + LEAST_PX),
        jnp.log(filled(seconds)),
        jnp.asarray(np.pad(weight, (0, room - count))),
    )
    rules = Rules(*(jnp.asarray(number) for number in rules_of(space.base)))
    fit = Fit(*(jnp.zeros(()) for _ in Fit._fields)) if start is None else start
    fit = Fit(*(jnp.asarray(number) for number in fit))
    fit, said, settled = _fitted(evidence, sample, fit, rules)
    edge, time = said[:, :count]
    misfits = np.stack([
        np.asarray(sample.log_error[:count] - jnp.log(edge + LEAST_PX)),
        np.asarray(sample.log_seconds[:count] - jnp.log(time)),
    ])  # fmt: skip
    # What is no number says nothing; the fit has not settled then.
    misfits = np.nan_to_num(misfits, nan=0.0, posinf=0.0, neginf=0.0)
    places = np.asarray(jax.vmap(place_of)(jnp.asarray(points), edge, time))
    correction, left = fitted_correction(places, misfits, weight, room)
    return Calibration(
        fit=Fit(*(np.asarray(number) for number in fit)),
        correction=correction,
        error_misfit=float(np.median(np.abs(left[0]))),
        seconds_misfit=float(np.median(np.abs(left[1]))),
        trials=count,
        settled=bool(settled),
    )
