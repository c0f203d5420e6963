"""How the best settings move with the price: the implicit function theorem at an optimum."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.numerics import in_float64
from asmjax.tuning.result import Sensitivity
from asmjax.tuning.search import REST, Model, boxed, loss, said_of, unboxed
from asmjax.tuning.space import NAMES
from asmjax.tuning.surrogate import TEMPERATURE

SMALL = 1e-4
"""Steps of central differences, of unconstrained numbers and of log price."""

FLAT = 1e-3
"""Directions in which the objective bends less than this part of the most do not move: settings
that do nothing there have no best value."""


@eqx.filter_jit
def _slope(model, log_price, free, temperature):
    return jax.grad(lambda free: loss(model, "price", log_price, boxed(free), temperature))(free)


def _bends(model: Model, price: float, free: np.ndarray):
    """Slope (knobs,) of the loss, its Hessian, and how the slope moves with log price: central
    differences of the gradient, as second derivatives take two seconds to trace and 40 slopes a
    tenth of one."""

    def slope(log_price: float, free: np.ndarray) -> np.ndarray:
        found = _slope(model, jnp.asarray(log_price), jnp.asarray(free), jnp.asarray(TEMPERATURE))
        return np.asarray(found)

    def change(ahead: np.ndarray, behind: np.ndarray) -> np.ndarray:
        return (ahead - behind) / (2 * SMALL)

    at = float(np.log(price))
    steps = SMALL * np.eye(free.size)
    bend = np.stack([change(slope(at, free + step), slope(at, free - step)) for step in steps])
    pull = change(slope(at + SMALL, free), slope(at - SMALL, free))
    return slope(at, free), bend, pull


@in_float64
def direction(model: Model, price: float, point: np.ndarray) -> tuple[np.ndarray, bool]:
    """d free / d log price (knobs,) at an optimum, by the implicit function theorem; and whether
    it is one.

    Where the gradient G(x, p) of the loss is 0, dx/dp = -H^-1 dG/dp with the Hessian H; of its
    eigenvectors only those count along which the loss bends upwards and not too little (`FLAT`).
    """
    slope, bend, pull = _bends(model, price, unboxed(point))
    if not all(np.isfinite(part).all() for part in (slope, bend, pull)):
        return np.zeros_like(pull), False
    values, vectors = np.linalg.eigh(0.5 * (bend + bend.T))
    least = FLAT * max(values.max(), 1e-12)
    firm = values > least
    step = -vectors[:, firm] @ ((vectors[:, firm].T @ pull) / values[firm])
    return step, bool(np.linalg.norm(slope) < REST and values.min() > -least)


@in_float64
def sensitivity(model: Model, price: float, point: np.ndarray) -> Sensitivity:
    """How the best settings move with the price, at the optimum `point` (knobs,) for it."""
    free = unboxed(point)
    step, settled = direction(model, price, point)
    ahead, behind = (np.asarray(boxed(free + way * SMALL * step)) for way in (1, -1))
    moved = (ahead - behind) / (2 * SMALL)
    logs = np.log(said_of(model, np.stack([ahead, behind])))
    log_edge, log_seconds = (logs[:, 0] - logs[:, 1]) / (2 * SMALL)
    width = np.log(np.asarray(model.high) / np.asarray(model.low))
    return Sensitivity(
        price=price,
        log_settings=dict(zip(NAMES, (moved * width).tolist(), strict=True)),
        log_edge=float(log_edge),
        log_seconds=float(log_seconds),
        settled=settled,
    )
