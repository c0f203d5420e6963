"""The settings of least objective by the surrogate: BFGS with restarts, decisions hardening."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.numerics import in_float64
from asmjax.tuning.evidence import Evidence
from asmjax.tuning.goal import Goal, smooth_objective
from asmjax.tuning.space import Space, node_cost, values_at
from asmjax.tuning.surrogate import Fit, predict

TEMPERATURES = (1.0, 0.5, 0.25)
"""Of the relaxed decisions, one search after the other."""

TEMPERATURE = TEMPERATURES[-1]
"""At which the surrogate speaks in the end."""

STEPS = 40
"""Of BFGS at each temperature."""

EDGE = 4.0
"""Unconstrained numbers end here: 0.982 of the way to either end of the box."""

ROOM = 128
"""Points that are asked about in one call."""

REST = 2e-2
"""Gradient of the log objective below which a search is at rest."""


class Model(NamedTuple):
    """A calibrated surrogate for one or more views; what it says is their mean. Arrays all, so that
    what is compiled for one serves another.

    Attributes:
        evidence: of the views.
        fits: one for each.
        low, high: (knobs,) ends of the ranges that the box stands for.
        believed: (2,) seconds per texel and per launch by the map's cost model.
    """

    evidence: tuple[Evidence, ...]
    fits: tuple[Fit, ...]
    low: Float[Array, " knobs"]
    high: Float[Array, " knobs"]
    believed: Float[Array, "2"]


@in_float64
def model_of(evidence: Sequence[Evidence], fits: Sequence[Fit], space: Space) -> Model:
    """The surrogate of some views over a space."""
    low, high = space.ends
    return Model(
        tuple(evidence),
        tuple(fits),
        jnp.asarray(low),
        jnp.asarray(high),
        jnp.asarray(node_cost(space.base)),
    )


class Found(NamedTuple):
    """Ends of searches (k,), best first.

    Attributes:
        points: (k, knobs) in the unit box.
        losses: (k,) log objective.
        settled: (k,) whether the search came to rest.
    """

    points: Float[np.ndarray, "k knobs"]
    losses: Float[np.ndarray, " k"]
    settled: np.ndarray


def said(model: Model, point: Float[Array, " knobs"], temperature):
    """Mean (edge_px, seconds) of the views at a point of the box; differentiable."""
    values = values_at(point, model.low, model.high)
    each = [
        predict(evidence, values, fit, temperature, model.believed)
        for evidence, fit in zip(model.evidence, model.fits, strict=True)
    ]
    edge, seconds, _ = jax.tree.map(lambda *views: sum(views) / len(views), *each)
    return edge, seconds


def loss(model: Model, kind: str, log_value, point, temperature):
    """Log objective at a point of the box; differentiable in the point and in `log_value`."""
    return smooth_objective(kind, log_value, *said(model, point, temperature))


def unboxed(point):
    """Unconstrained numbers of points strictly within the box."""
    point = np.clip(point, 1 / (1 + np.exp(EDGE)), 1 / (1 + np.exp(-EDGE)))
    return np.log(point / (1 - point))


def boxed(free):
    """Points of the box of unconstrained numbers."""
    return jax.nn.sigmoid(EDGE * jnp.tanh(free / EDGE))


@eqx.filter_jit
def _descend(model, kind: str, log_value, start, temperatures, steps: int):
    import optimistix as optx  # 0.3 s: only who tunes pays for it

    solver = optx.BFGS(rtol=1e-4, atol=1e-4)

    def at(free, temperature):
        return loss(model, kind, log_value, boxed(free), temperature)

    def cooler(free, temperature):
        found = optx.minimise(at, solver, free, args=temperature, max_steps=steps, throw=False)
        better = at(found.value, temperature) <= at(free, temperature)
        return jnp.where(better, found.value, free), None

    end, _ = jax.lax.scan(cooler, start, temperatures)
    value, slope = jax.value_and_grad(at)(end, temperatures[-1])
    return end, value, jnp.linalg.norm(slope)


@in_float64
def search(
    model: Model,
    goal: Goal,
    starts: Sequence[np.ndarray],
    temperatures: Sequence[float] = TEMPERATURES,
) -> Found:
    """Search from each start (knobs,); ends that are no number are left out."""
    cooling = jnp.asarray(temperatures)
    ends = [
        _descend(
            model, goal.kind, jnp.log(goal.value), jnp.asarray(unboxed(start)), cooling, STEPS
        )
        for start in starts
    ]  # fmt: skip
    free, losses, slopes = (np.stack([np.asarray(end[k]) for end in ends]) for k in range(3))
    order = np.argsort(np.where(np.isfinite(losses), losses, np.inf), kind="stable")
    order = order[np.isfinite(losses[order])]
    points = np.asarray(boxed(free[order]))
    return Found(points, losses[order], slopes[order] < REST)


@eqx.filter_jit
def _said_of(model, points, temperature):
    return jax.lax.map(lambda point: jnp.stack(said(model, point, temperature)), points)


@in_float64
def said_of(model: Model, points: np.ndarray) -> np.ndarray:
    """(2, k) edge_px and seconds at points (k, knobs)."""
    # Filled up, so that few shapes are ever compiled.
    count = len(points)
    padded = np.pad(points, ((0, -count % ROOM), (0, 0)), mode="edge")
    return np.asarray(_said_of(model, jnp.asarray(padded), jnp.asarray(TEMPERATURE)))[:count].T
