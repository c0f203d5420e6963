"""How the best settings move with the price: sensitivity, and a front by continuation."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.stats import qmc

from asmjax.numerics import in_float64
from asmjax.tuning.goal import Goal
from asmjax.tuning.proposals import promising
from asmjax.tuning.result import FrontPoint, Sensitivity
from asmjax.tuning.search import (
    REST,
    Found,
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

STARTS = 2
"""Of the searches at each price that continuation is compared with, as of tuning's own: of the best
measured, and of the best by the surrogate."""

OWN_STARTS, OWN_FOLLOWED = 12, 4
"""Of continuation's searches at each price, and how many are gone on with."""

VALLEYS = 3
"""Ends of searches for other prices that are tried at each."""

APART = (0.2, 0.6)
"""Least distance of starts, in sides of the box, half of them each: near ones mostly end in the
same valley, but the best points lie close together, and not all in the best valley."""

SCREENED = 2048
"""Random points that the surrogate is asked about before the best of them breed."""

ENDS = 0.5
"""Part of the numbers of those points moved to an end, where the best have most of theirs."""

GENERATIONS, CHILDREN, PARENTS = 10, 256, 24
"""Of what the surrogate is asked besides, children of a generation, and their parents for each
price: valleys are too narrow for random points alone."""

JUMP, JUMPS = 0.15, 0.2
"""Spread of random changes of children, in sides of the box, and the part of numbers so changed;
half as many go to an end."""

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
    there and from the best known points for its price, and the ends of all searches for other
    prices are tried at each, as a curve may fold. It is compared with searching each price anew
    as tuning does; of what that finds the curve knows the middle and, at each price, that of the
    others. Where the search anew is better it stands in the curve's place.

    Args:
        tried: (k, knobs) points that were measured.
        seed: of random points.
    """
    prices = price * np.geomspace(1 / SPAN, SPAN, POINTS)
    drawn = qmc.Sobol(len(NAMES), seed=seed)  # pyright: ignore[reportCallIssue]
    known = _Screened(model, tried)
    again = [_anew(model, known, one, seed) for one in prices.tolist()]
    generator = np.random.default_rng(seed)
    known.add(model, _to_ends(drawn.random(SCREENED), ENDS, generator))
    _breed(model, known, prices, generator)
    curve = _Curve(model, prices)
    curve.correct(POINTS // 2, [again[POINTS // 2].points[0]])
    curve.follow(known)
    for k in range(POINTS):
        curve.correct(k, [found.points[0] for j, found in enumerate(again) if j != k])
    front = [_front_point(model, *curve.at(k), again[k]) for k in range(POINTS)]
    return sensitivity(model, price, curve.points[POINTS // 2]), tuple(front)


class _Screened:
    """Points (k, knobs), and what the surrogate says of them."""

    def __init__(self, model: Model, points: np.ndarray):
        self.points, self.said = points, said_of(model, points)

    def ordered(self, price: float) -> np.ndarray:
        """Numbers of all, the best for a price first."""
        return np.argsort(self.said[0] + price * self.said[1], kind="stable")

    def add(self, model: Model, points: np.ndarray) -> None:
        self.points = np.concatenate([self.points, points])
        self.said = np.concatenate([self.said, said_of(model, points)], axis=1)

    def best(self, price: float, count: int) -> list[np.ndarray]:
        """So many of the best for a price, `APART` from one another."""
        ordered = self.points[self.ordered(price)]
        chosen: list[np.ndarray] = []
        for part, apart in enumerate(APART, start=1):
            for point in ordered:
                if len(chosen) >= part * count // len(APART):
                    break
                if all(np.linalg.norm(point - other) >= apart for other in chosen):
                    chosen.append(point)
        return chosen


def _anew(model: Model, tried: _Screened, price: float, seed: int) -> Found:
    """The search that tuning would do for a price."""
    goal = Goal(price=price)
    best = tried.points[tried.ordered(price)[:STARTS]]
    return search(model, goal, [*best, *promising(model, goal, STARTS, seed)])


def _breed(
    model: Model, known: _Screened, prices: np.ndarray, generator: np.random.Generator
) -> None:
    """Add `GENERATIONS` of children of what is best for any of the prices: each number is one of
    two parents', and some jump or go to an end."""
    for _ in range(GENERATIONS):
        best = np.concatenate([known.ordered(price)[:PARENTS] for price in prices.tolist()])
        parents = known.points[np.unique(best)]
        one, other = generator.integers(len(parents), size=(2, CHILDREN))
        shape = CHILDREN, parents.shape[1]
        children = np.where(generator.random(shape) < 0.5, parents[one], parents[other])
        jumps = JUMP * generator.standard_normal(shape) * (generator.random(shape) < JUMPS)
        known.add(model, _to_ends(np.clip(children + jumps, 0.0, 1.0), JUMPS / 2, generator))


def _to_ends(points: np.ndarray, part: float, generator: np.random.Generator) -> np.ndarray:
    """Points (k, knobs) with that part of their numbers at 0 or 1, whichever is nearer."""
    return np.where(generator.random(points.shape) < part, np.round(points), points)


class _Curve:
    """Optima along prices, by continuation.

    Attributes:
        points: (knobs,) the best found for the price of each number.
        losses: their log objectives.
    """

    def __init__(self, model: Model, prices: np.ndarray):
        self.model, self.prices = model, prices.tolist()
        self.points: dict[int, np.ndarray] = {}
        self.losses: dict[int, float] = {}
        self._ends: list[np.ndarray] = []

    def at(self, k: int) -> tuple[float, np.ndarray, float]:
        """Price, point and loss."""
        return self.prices[k], self.points[k], self.losses[k]

    def correct(self, k: int, starts: list[np.ndarray], temperatures=STILL, followed=None) -> None:
        """Search for one price, and keep what is better than what is known."""
        found = search(self.model, Goal(price=self.prices[k]), starts, temperatures, followed)
        self._ends.extend(found.points)
        if k not in self.losses or found.losses[0] < self.losses[k]:
            self.points[k], self.losses[k] = found.points[0], float(found.losses[0])

    def follow(self, known: _Screened) -> None:
        """From the middle price out to either end."""

        def search_afresh(k: int) -> None:
            self.correct(k, known.best(self.prices[k], OWN_STARTS), COOLING, OWN_FOLLOWED)

        middle = len(self.prices) // 2
        search_afresh(middle)
        for k in (*range(middle + 1, len(self.prices)), *range(middle - 1, -1, -1)):
            self.correct(k, [self._predicted(k, beside=k - 1 if k > middle else k + 1)])
            search_afresh(k)
        # A valley that is second best at one price may be the best at another.
        valleys = _Screened(self.model, np.stack(self._ends))
        for k, price in enumerate(self.prices):
            self.correct(k, valleys.best(price, VALLEYS))

    def _predicted(self, k: int, beside: int) -> np.ndarray:
        """The optimum at one price by the sensitivity of that beside it."""
        here, price = self.points[beside], self.prices[beside]
        step, _ = direction(self.model, price, here)
        return np.asarray(boxed(unboxed(here) + np.log(self.prices[k] / price) * step))


def _front_point(
    model: Model, price: float, point: np.ndarray, loss: float, again: Found
) -> FrontPoint:
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
