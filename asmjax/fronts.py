"""Fronts of error and cost, and what a given error costs along one."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from asmjax.errors import require


class Reach(NamedTuple):
    """What a given error costs.

    Attributes:
        cost: as measured or interpolated.
        bound: whether it is an upper bound only: the cheapest that was measured is better already.
    """

    cost: float
    bound: bool


def front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Indices of what nothing else beats in both, by rising cost and so by falling error.

    Of equal ones the first counts.
    """
    kept: list[int] = []
    for i in sorted(range(len(costs)), key=lambda i: (costs[i], errors[i])):
        if not kept or errors[i] < errors[kept[-1]]:
            kept.append(i)
    return kept


def cost_of_error(costs: Sequence[float], errors: Sequence[float], wanted: float) -> Reach | None:
    """What an error of `wanted` costs along the front of those points, None where none reaches it.

    Between two neighbours of the front, the logarithm of the cost is linear in that of the error.
    Nothing is extrapolated. No point lies between one and its neighbour without any error: there
    the neighbour's cost counts.

    Raises:
        UseError: a cost or `wanted` is not positive.
    """
    require(
        wanted > 0 and all(cost > 0 for cost in costs),
        f"costs {list(costs)} of an error of {wanted} have no logarithm; give positive numbers.",
    )
    kept = front(costs, errors)
    after = next((k for k, i in enumerate(kept) if errors[i] <= wanted), None)
    if after is None:
        return None
    cost, error = costs[kept[after]], errors[kept[after]]
    if after == 0:
        return Reach(cost, bound=error < wanted)
    if error in (0, wanted):
        return Reach(cost, bound=False)
    cheaper, worse = costs[kept[after - 1]], errors[kept[after - 1]]
    part = math.log(worse / wanted) / math.log(worse / error)
    return Reach(math.exp((1 - part) * math.log(cheaper) + part * math.log(cost)), bound=False)
