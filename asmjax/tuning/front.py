"""The best settings over the price: a front by continuation, beside searches at each price."""

import numpy as np
from scipy.stats import qmc

from asmjax.numerics import in_float64
from asmjax.tuning.goal import Goal
from asmjax.tuning.proposals import fresh_search
from asmjax.tuning.result import FrontPoint, Sensitivity
from asmjax.tuning.search import Found, Model, boxed, said_of, search, unboxed
from asmjax.tuning.sensitivity import direction, sensitivity
from asmjax.tuning.space import NAMES, values_at
from asmjax.tuning.surrogate import TEMPERATURE

SPAN = 4.0
"""The front goes from the price / this to the price * this."""

POINTS = 5
"""Prices of the front, evenly in the logarithm."""

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


@in_float64
def trace_front(
    model: Model, price: float, tried: np.ndarray, seed: int = 0
) -> tuple[Sensitivity, tuple[FrontPoint, ...]]:
    """The front about a price, from its optimum outwards; and how the best settings move with the
    price there.

    Each next optimum is predicted by the last one's sensitivity and corrected by searches, from
    there and from the best known points for its price, and the ends of all searches for other
    prices are tried at each, as a curve may fold. It is compared with searching each price anew
    as tuning does, from those measured that the surrogate prefers; of what that finds the curve
    knows the middle and, at each price, that of the others. Where the search anew is better it
    stands in the curve's place.

    Args:
        tried: (k, knobs) points that were measured.
        seed: of random points.
    """
    prices = price * np.geomspace(1 / SPAN, SPAN, POINTS)
    drawn = qmc.Sobol(len(NAMES), seed=seed)  # pyright: ignore[reportCallIssue]
    known = _Screened(model, tried)
    again = [
        fresh_search(model, Goal(price=one), [*known.points[known.ordered(one)]], seed)
        for one in prices.tolist()
    ]
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
