"""How the best settings move with the price: sensitivity, and a front by continuation."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.numerics import in_float64
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import FrontPoint, Sensitivity
from asmjax.tuning.search import (
    TEMPERATURE,
    Model,
    boxed,
    loss,
    said,
    said_of,
    search,
    unboxed,
)
from asmjax.tuning.space import NAMES, values_at

SPAN = 4.0
"""The front goes from the price / this to the price * this."""

POINTS = 5
"""Prices of the front, evenly in the logarithm."""

FLAT = 1e-3
"""Directions in which the objective bends less than this part of the most do not move: settings
that do nothing there have no best value."""


@eqx.filter_jit
def _bends(model, log_price, free, temperature):
    def at(free, log_price):
        return loss(model, "price", log_price, boxed(free), temperature)

    bend = jax.hessian(at)(free, log_price)
    pull = jax.jacfwd(jax.grad(at), argnums=1)(free, log_price)
    return bend, pull


@eqx.filter_jit
def _moves(model, free, step, temperature):
    """How point, log error and log seconds move with a step of unconstrained numbers."""

    def at(free):
        point = boxed(free)
        edge, seconds = said(model, point, temperature)
        return point, jnp.log(edge), jnp.log(seconds)

    return jax.jvp(at, (free,), (step,))[1]


@in_float64
def direction(model: Model, price: float, point: np.ndarray) -> np.ndarray:
    """d free / d log price (knobs,) at an optimum, by the implicit function theorem.

    Where the gradient G(x, p) of the loss is 0, dx/dp = -H^-1 dG/dp with the Hessian H; of its
    eigenvectors only those count along which the loss bends upwards and not too little (`FLAT`).
    """
    free = jnp.asarray(unboxed(point))
    bend, pull = _bends(model, jnp.log(jnp.asarray(price)), free, jnp.asarray(TEMPERATURE))
    bend, pull = np.asarray(bend, np.float64), np.asarray(pull, np.float64)
    values, vectors = np.linalg.eigh(0.5 * (bend + bend.T))
    firm = values > FLAT * max(values.max(), 1e-12)
    return -vectors[:, firm] @ ((vectors[:, firm].T @ pull) / values[firm])


@in_float64
def sensitivity(model: Model, price: float, point: np.ndarray) -> Sensitivity:
    """How the best settings move with the price, at the optimum `point` (knobs,) for it."""
    free = jnp.asarray(unboxed(point))
    step = jnp.asarray(direction(model, price, point))
    moved, log_edge, log_seconds = _moves(model, free, step, jnp.asarray(TEMPERATURE))
    width = np.log(np.asarray(model.high) / np.asarray(model.low))
    return Sensitivity(
        price=price,
        log_settings=dict(zip(NAMES, (np.asarray(moved) * width).tolist(), strict=True)),
        log_edge=float(log_edge),
        log_seconds=float(log_seconds),
    )


@in_float64
def trace_front(
    model: Model, price: float, point: np.ndarray, others: Sequence[np.ndarray]
) -> tuple[Sensitivity, tuple[FrontPoint, ...]]:
    """The front about a price, from its optimum `point` outwards and back again; and how the best
    settings move with the price there.

    Each next optimum is predicted by the last one's sensitivity and corrected by a search from
    there. On the way back neighbours take over where they are better: a curve may fold.

    Args:
        others: (knobs,) starts of a second search at each price, with which the curve is compared.
    """
    prices = price * np.geomspace(1 / SPAN, SPAN, POINTS)
    middle = POINTS // 2
    curve: dict[int, tuple[np.ndarray, float]] = {}
    out = [*range(middle, POINTS), *range(middle - 1, -1, -1)]
    # Out to either end from the middle, then all the way back and forth.
    walk = [(k, k - (k > middle) + (k < middle)) for k in out]
    walk += [(k, k - 1) for k in range(1, POINTS)] + [(k, k + 1) for k in range(POINTS - 2, -1, -1)]
    for k, beside in walk:
        here, last = (curve[beside][0], prices[beside]) if beside in curve else (point, price)
        ahead = here
        if prices[k] != last and k not in curve:
            step = np.log(prices[k] / last)
            ahead = np.asarray(boxed(unboxed(here) + step * direction(model, last, here)))
        found = search(model, Goal(price=float(prices[k])), [ahead])
        if k not in curve or found.losses[0] < curve[k][1]:
            curve[k] = found.points[0], float(found.losses[0])
    front = [_front_point(model, float(prices[k]), *curve[k], others) for k in range(POINTS)]
    return sensitivity(model, price, curve[middle][0]), tuple(front)


def _front_point(
    model: Model, price: float, point: np.ndarray, loss: float, others: Sequence[np.ndarray]
) -> FrontPoint:
    again = search(model, Goal(price=price), others)
    edge, seconds = said_of(model, point[None])[:, 0]
    values = values_at(point, np.asarray(model.low), np.asarray(model.high))
    return FrontPoint(
        price=price,
        settings={name: float(value) for name, value in values.items()},
        edge_px=float(edge),
        seconds=float(seconds),
        loss=loss,
        loss_again=float(again.losses[0]),
    )
