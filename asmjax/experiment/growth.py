"""How time grows: with pixels, with triangles, and with the memory that a map may use."""

import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from asmjax.errors import require
from asmjax.experiment.methods import Measured, measure
from asmjax.experiment.walkthrough import FrameInput, FrameResult
from asmjax.shadow import AdaptiveShadowMap

SERIES = ("cold", "warm", "query", "uniform", "rays")
"""What is timed at each size: the adaptive map from nothing, its next frame, that frame's query,
the flat map drawn anew and queried, and one shadow ray per pixel."""

SAME_NODES = 0.9
"""Two maps that hold as many nodes as this part of each other's have converged to the same."""


@dataclass(frozen=True)
class GrowthPoint:
    """Times at one size.

    Attributes:
        size: pixels, triangles or bytes.
        seconds: `SERIES` to medians; what was not timed is left out.
        converged: whether the adaptive map gained all that its settings ask for, that is, did not
            end at a limit.
        nodes: nodes that it held.
        bytes: memory of all its arrays.
    """

    size: int
    seconds: Mapping[str, float]
    converged: bool
    nodes: int
    bytes: int


@dataclass(frozen=True)
class Growth:
    """Times along one axis, sizes increasing.

    Attributes:
        axis: "pixels", "triangles" or "memory".
        points: one per size.
    """

    axis: str
    points: tuple[GrowthPoint, ...]

    def converged(self) -> tuple[GrowthPoint, ...]:
        """The points whose map has all that it would have with more memory: it ended at no limit
        and, where memory is what grows, holds as many nodes as any, within a tenth."""
        points = [point for point in self.points if point.converged]
        most = max((point.nodes for point in points), default=0)
        alike = self.axis != "memory"
        return tuple(point for point in points if alike or point.nodes >= SAME_NODES * most)

    def times(self, series: str, converged_only: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Sizes and seconds (k,) of the points where that series was timed."""
        points = self.converged() if converged_only else self.points
        kept = [point for point in points if series in point.seconds]
        return (
            np.array([point.size for point in kept], np.float64),
            np.array([point.seconds[series] for point in kept], np.float64),
        )

    def slope(self, series: str, converged_only: bool = False) -> float | None:
        """Fitted exponent: 1 for a time that is proportional to the size, 0 for one that rests.

        None where fewer than two points are left.
        """
        sizes, seconds = self.times(series, converged_only)
        return fitted_slope(sizes, seconds) if sizes.size >= 2 else None

    @property
    def series(self) -> tuple[str, ...]:
        """The series that were timed at two sizes or more."""
        return tuple(name for name in SERIES if self.times(name)[0].size >= 2)

    def record(self) -> dict:
        """Points and exponents as plain values; `slopes_converged` are of converged maps alone."""
        return {
            "points": [asdict(point) for point in self.points],
            "converged": [point.size for point in self.converged()],
            "slopes": {name: self.slope(name) for name in SERIES},
            "slopes_converged": {name: self.slope(name, converged_only=True) for name in SERIES},
        }


def fitted_slope(
    sizes: Sequence[float] | np.ndarray, seconds: Sequence[float] | np.ndarray
) -> float:
    """Exponent p of the power law seconds = c sizes^p, by least squares in the logarithms.

    Raises:
        UseError: fewer than two different sizes, or anything that is not positive.
    """
    x, y = np.asarray(sizes, np.float64), np.asarray(seconds, np.float64)
    require(
        x.shape == y.shape and np.unique(x).size >= 2,
        f"a slope needs two different sizes at least, with a time each; got {x.tolist()}.",
    )
    require(
        bool(np.all(x > 0) and np.all(y > 0)),
        "a slope in logarithms needs positive sizes and times; leave the others out.",
    )
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def growth_point(
    size: int, walk: Iterable[FrameResult], adaptive: AdaptiveShadowMap, repeats: int
) -> GrowthPoint:
    """Times of a short walk: the first frame from nothing, each other one from the one before.

    Args:
        walk: two frames at least, a small step of the camera apart.
        adaptive: the walk's, with its cost model calibrated.
        repeats: timed builds from nothing after one that warms up.
    """
    results = iter(walk)
    first = next(results)
    frame = first.input
    cold = measure(adaptive, frame.eyes, frame.kept, frame.rays, repeats)
    totals: dict[str, list[float]] = {name: [] for name in SERIES if name != "cold"}
    mine = []
    for kind in ("uniform", "rays"):
        totals[kind].append(_of_kind(first, kind).cost.seconds["total"])
    for result in results:
        for kind in ("uniform", "rays"):
            totals[kind].append(_of_kind(result, kind).cost.seconds["total"])
        # What is kept of a frame is little: its map goes on into the next.
        adapted = _of_kind(result, "adaptive")
        totals["warm"].append(adapted.cost.seconds["total"])
        totals["query"].append(adapted.cost.seconds["query"])
        mine.append((adapted.cost, adapted.status))
    require(len(mine) > 0, "a walk of 1 frame has no next frame; give it 2 or more.")
    nodes = mine[-1][0].nodes
    return GrowthPoint(
        size=size,
        seconds={"cold": sum(cold.cost.seconds.values())}
        | {name: statistics.median(values) for name, values in totals.items()},
        converged=not any(status.is_limit for status in (cold.status, *(s for _, s in mine))),
        nodes=0 if nodes is None else nodes.held,
        bytes=max(cost.bytes for cost in (cold.cost, *(c for c, _ in mine))),
    )


def with_cold_in_turns(
    growth: Growth, maps: Sequence[AdaptiveShadowMap], first: FrameInput, repeats: int
) -> Growth:
    """The growth with its times from nothing taken anew, the maps of all points in turns, `repeats`
    each: a machine that slows down meanwhile stays out of the exponent.
    """
    seconds: list[list[float]] = [[] for _ in maps]
    for _ in range(repeats):
        for mine, adaptive in zip(seconds, maps, strict=True):
            cost = measure(adaptive, first.eyes, first.kept, first.rays, 1).cost
            mine.append(sum(cost.seconds.values()))
    points = [
        replace(point, seconds={**point.seconds, "cold": statistics.median(mine)})
        for point, mine in zip(growth.points, seconds, strict=True)
    ]
    return replace(growth, points=tuple(points))


def _of_kind(result: FrameResult, kind: str) -> Measured:
    """The first method of a kind: of the two uniform maps, the one drawn anew."""
    return next(method for method in result.methods if method.name.startswith(kind))
