"""The settings of least objective by the surrogate: BFGS with restarts, decisions hardening."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.machine import usable_cores
from asmjax.numerics import in_float64
from asmjax.tuning.calibrate import Calibration
from asmjax.tuning.correction import Correction, corrected
from asmjax.tuning.evidence import Evidence
from asmjax.tuning.goal import Goal, smooth_objective
from asmjax.tuning.space import Space, values_at
from asmjax.tuning.surrogate import TEMPERATURE, Fit, Rules, predict, rules_of

TEMPERATURES = (1.0, 0.5, TEMPERATURE)
"""Of the relaxed decisions, one search after the other; the surrogate's own is the last."""

STEPS = 40
"""Of BFGS at each temperature."""

RESTARTS = 2
"""Of a search that is not at rest after its last steps, with nothing remembered of the bends of its
way there: narrow valleys turn."""

EDGE = 4.0
"""Unconstrained numbers act as if they ended here, where 0.982 of the way to an end of the box is
made. The last bit is left out: there a search would creep, and an end itself is tried as such."""

INNERMOST = 1e-3
"""How far from `EDGE`, in parts of it, `unboxed` keeps points at or beyond the ends."""

ROOM = 128
"""Points that are asked about in one call."""

REST = 2e-2
"""Gradient of the log objective below which a search is at rest."""

CREEP = 1e-3
"""Part of the objective below which what a restart gains is nothing: the search is at rest too."""


_T = TypeVar("_T")
_R = TypeVar("_R")


def _side_by_side(function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
    """`function` of each, one to a core. The first goes ahead, so that it alone compiles."""
    first, *rest = items
    results = [function(first)]
    with ThreadPoolExecutor(usable_cores()) as pool:
        # JAX's precision is each thread's own.
        return results + list(pool.map(in_float64(function), rest))


class Model(NamedTuple):
    """A calibrated surrogate for one or more views; what it says is their mean. Arrays all, so that
    what is compiled for one serves another.

    Attributes:
        evidence: of the views.
        fits, corrections: one for each.
        shares: (views,) of all edges, by which errors count.
        low, high: (knobs,) ends of the ranges that the box stands for.
        rules: that the map goes by.
    """

    evidence: tuple[Evidence, ...]
    fits: tuple[Fit, ...]
    corrections: tuple[Correction, ...]
    shares: Float[Array, " views"]
    low: Float[Array, " knobs"]
    high: Float[Array, " knobs"]
    rules: Rules


@in_float64
def model_of(
    evidence: Sequence[Evidence], calibrations: Sequence[Calibration], space: Space
) -> Model:
    """The surrogate of some views over a space."""
    low, high = space.ends
    edges = np.array([float(one.edges) for one in evidence])
    return Model(
        tuple(evidence),
        tuple(one.fit for one in calibrations),
        tuple(one.correction for one in calibrations),
        jnp.asarray(edges / edges.sum()),
        jnp.asarray(low),
        jnp.asarray(high),
        Rules(*(jnp.asarray(number) for number in rules_of(space.base))),
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


@jax.jit
def said(model: Model, point: Float[Array, " knobs"], temperature):
    """(edge_px, seconds) of all views together at a point of the box; differentiable."""
    values = values_at(point, model.low, model.high)
    each = []
    for evidence, fit, correction in zip(
        model.evidence, model.fits, model.corrections, strict=True
    ):
        rules = predict(evidence, values, fit, temperature, model.rules)
        each.append(corrected(correction, point, rules.edge_px, rules.seconds))
    edges, seconds = zip(*each, strict=True)
    return model.shares @ jnp.stack(edges), sum(seconds) / len(seconds)


def loss(model: Model, kind: str, log_value, point, temperature):
    """Log objective at a point of the box; differentiable in the point and in `log_value`."""
    return smooth_objective(kind, log_value, *said(model, point, temperature))


def unboxed(point):
    """Unconstrained numbers of points of the box: the inverse of `boxed`, up to where that ends."""
    point = np.clip(point, 1e-9, 1 - 1e-9)
    bent = np.log(point / (1 - point)) / EDGE
    return EDGE * np.arctanh(np.clip(bent, INNERMOST - 1, 1 - INNERMOST))


def boxed(free):
    """Points of the box, between 0.018 and 0.982, of unconstrained numbers."""
    return jax.nn.sigmoid(EDGE * jnp.tanh(free / EDGE))


@eqx.filter_jit
def _descend(model, kind: str, log_value, start, temperature):
    """Where a search at one temperature ends, the loss there, and how steep it is."""
    import optimistix as optx  # 0.3 s: only who tunes pays for it

    solver = optx.BFGS(rtol=1e-4, atol=1e-4)

    def at(free, _):
        return loss(model, kind, log_value, boxed(free), temperature)

    found = optx.minimise(at, solver, start, max_steps=STEPS, throw=False)
    end = jnp.where(at(found.value, None) <= at(start, None), found.value, start)
    value, slope = jax.value_and_grad(at)(end, None)
    return end, value, jnp.linalg.norm(slope)


@in_float64
def search(
    model: Model,
    goal: Goal,
    starts: Sequence[np.ndarray],
    temperatures: Sequence[float] = TEMPERATURES,
    followed: int | None = None,
) -> Found:
    """Search from each start (knobs,). An end where the objective is no number comes last, with a
    loss of infinity, and is not settled.

    Args:
        followed: how many of the searches, the best ones, are gone on with after the first
            temperature; all if None.
    """
    log_value = jnp.log(goal.value)

    def descend(free, temperature):
        end = _descend(model, goal.kind, log_value, free, jnp.asarray(temperature))
        return jax.block_until_ready(end)

    def cooled(free):
        end = descend(free, temperatures[0])
        for temperature in temperatures[1:]:
            end = descend(end[0], temperature)
        still = bool(end[2] < REST)
        for _ in range(RESTARTS):
            if still or not jnp.isfinite(end[1]):
                break
            before, end = end[1], descend(end[0], temperatures[-1])
            still = bool(end[2] < REST) or bool(before - end[1] < CREEP)
        return *end[:2], still

    free = [jnp.asarray(unboxed(start)) for start in starts]
    if followed is not None:
        ends = _side_by_side(lambda start: descend(start, temperatures[0]), free)
        losses = np.array([float(end[1]) for end in ends])
        order = np.argsort(np.where(np.isfinite(losses), losses, np.inf), kind="stable")
        free, temperatures = [ends[k][0] for k in order[:followed]], temperatures[1:]
    ends = _side_by_side(cooled, free)
    free, losses, still = (np.stack([np.asarray(end[k]) for end in ends]) for k in range(3))
    losses = np.where(np.isfinite(losses), losses, np.inf)
    order = np.argsort(losses, kind="stable")
    settled = np.isfinite(losses) & still
    return Found(np.asarray(boxed(free[order])), losses[order], settled[order])


@eqx.filter_jit
def _said_of(model, points, temperature):
    return jax.vmap(lambda point: jnp.stack(said(model, point, temperature)))(points)


@in_float64
def said_of(model: Model, points: np.ndarray) -> np.ndarray:
    """(2, k) edge_px and seconds at points (k, knobs)."""
    # Filled up, and never more at once, so that one shape is ever compiled.
    count, temperature = len(points), jnp.asarray(TEMPERATURE)
    padded = np.pad(points, ((0, -count % ROOM), (0, 0)), mode="edge")
    parts = _side_by_side(
        lambda part: np.asarray(_said_of(model, jnp.asarray(part), temperature)),
        list(padded.reshape(-1, ROOM, points.shape[1])),
    )
    return np.concatenate(parts)[:count].T
