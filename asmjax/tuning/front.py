"""How the best settings move with the price: sensitivity, and a front by continuation."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.stats import qmc

from asmjax.numerics import in_float64
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import FrontPoint, Sensitivity
from asmjax.tuning.search import (
    REST,
    Model,
    boxed,
    loss,
    said_of,
    search,
    unboxed,
)
from asmjax.tuning.space import NAMES, values_at
from asmjax.tuning.surrogate import TEMPERATURE

SPAN = 4.0
"""The front goes from the price / this to the price * this."""

POINTS = 5
"""Prices of the front, evenly in the logarithm."""

SMALL = 1e-4
"""Steps of central differences, of unconstrained numbers and of log price."""

FLAT = 1e-3
"""Directions in which the objective bends less than this part of the most do not move: settings
that do nothing there have no best value."""

STARTS = 6
"""Of the searches at each price that continuation is compared with."""

FOLLOWED = 2
"""Of those, how many are gone on with."""

OWN_STARTS, OWN_FOLLOWED = 24, 8
"""The same of continuation's searches."""

VALLEYS = 3
"""Ends of searches for other prices that are tried at each."""

APART = (0.2, 0.6)
"""Least distance of starts, in sides of the box, half of them each: near ones mostly end in the
same valley, but the best points lie close together, and not all in the best valley."""

SCREENED = 512
"""Random points of which those searches start from the best."""

OWN_SCREENED = 4096
"""The same of continuation's searches: valleys are narrow."""

STILL = (TEMPERATURE,)
"""Temperatures of a search that keeps to the valley where it begins."""

COOLING = (2 * TEMPERATURE, TEMPERATURE)
"""Temperatures of a search that may leave it."""


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


@in_float64
def trace_front(
    model: Model, price: float, tried: np.ndarray, seed: int = 0
) -> tuple[Sensitivity, tuple[FrontPoint, ...]]:
    """The front about a price, from its optimum outwards; and how the best settings move with the
    price there.

    Each next optimum is predicted by the last one's sensitivity and corrected by searches, from
    there and from the best known points for its price. Then the ends of all searches for other
    prices are tried at each, as a curve may fold. At last each is compared with searches from
    points that the curve knows nothing of, and where those are better they stand in its place.

    Args:
        tried: (k, knobs) points that may be good.
        seed: of random points.
    """
    prices = price * np.geomspace(1 / SPAN, SPAN, POINTS)
    drawn = qmc.Sobol(len(NAMES), seed=seed)  # pyright: ignore[reportCallIssue]
    own, others = drawn.random(OWN_SCREENED), drawn.random(SCREENED)
    known = _Screened(model, np.concatenate([tried, own]))
    curve = _curve(model, prices, known)
    elsewhere = _Screened(model, others)
    front = [
        _front_point(model, float(price), *curve[k], elsewhere) for k, price in enumerate(prices)
    ]
    return sensitivity(model, price, curve[POINTS // 2][0]), tuple(front)


class _Screened:
    """Points (k, knobs), and what the surrogate says of them."""

    def __init__(self, model: Model, points: np.ndarray):
        self.points, self.said = points, said_of(model, points)

    def best(self, price: float, count: int) -> list[np.ndarray]:
        """So many of the best for a price, `APART` from one another."""
        objective = self.said[0] + price * self.said[1]
        ordered = self.points[np.argsort(objective, kind="stable")]
        chosen: list[np.ndarray] = []
        for part, apart in enumerate(APART, start=1):
            for point in ordered:
                if len(chosen) >= part * count // len(APART):
                    break
                if all(np.linalg.norm(point - other) >= apart for other in chosen):
                    chosen.append(point)
        return chosen


def _curve(
    model: Model, prices: np.ndarray, known: _Screened
) -> dict[int, tuple[np.ndarray, float]]:
    """Optima and their log objectives by the number of their price, by continuation."""
    middle = len(prices) // 2
    curve: dict[int, tuple[np.ndarray, float]] = {}
    ends: list[np.ndarray] = []

    def correct(k: int, starts: list[np.ndarray], temperatures=STILL, followed=None) -> None:
        found = search(model, Goal(price=float(prices[k])), starts, temperatures, followed)
        ends.extend(found.points)
        if k not in curve or found.losses[0] < curve[k][1]:
            curve[k] = found.points[0], float(found.losses[0])

    # Out to either end from the middle.
    correct(middle, known.best(prices[middle], OWN_STARTS), COOLING, OWN_FOLLOWED)
    for k in (*range(middle + 1, len(prices)), *range(middle - 1, -1, -1)):
        beside = k - 1 if k > middle else k + 1
        here, ratio = curve[beside][0], np.log(prices[k] / prices[beside])
        step, _ = direction(model, float(prices[beside]), here)
        predicted = np.asarray(boxed(unboxed(here) + ratio * step))
        correct(k, [predicted])
        correct(k, known.best(prices[k], OWN_STARTS), COOLING, OWN_FOLLOWED)
    # A valley that is second best at one price may be the best at another.
    valleys = _Screened(model, np.stack(ends))
    for k, price in enumerate(prices):
        correct(k, valleys.best(float(price), VALLEYS))
    return curve


def _front_point(
    model: Model, price: float, point: np.ndarray, loss: float, elsewhere: _Screened
) -> FrontPoint:
    again = search(model, Goal(price=price), elsewhere.best(price, STARTS), COOLING, FOLLOWED)
    if again.losses[0] < loss:
        point = again.points[0]
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
