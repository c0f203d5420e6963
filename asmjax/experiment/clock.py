"""Times that can be trusted on a shared machine: taken in turns, with intervals, and as ratios.

A time is that of a call after one to warm up, until all its arrays are computed. A machine that
others use is slower for a while, not for one call: whatever is compared is measured in turns, so
that a slow while meets all of it. A median forgives turns that something disturbed, and its
interval is that of order statistics, which asks nothing of how times are distributed.
"""

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import jax

from asmjax.errors import require

T = TypeVar("T")

CONFIDENCE = 0.95
"""Of the intervals, where there are runs enough: six. Of fewer they are the whole range."""


def timed(call: Callable[[], T]) -> tuple[T, float]:
    """The result of `call`, all its arrays computed, and the seconds it took."""
    start = time.perf_counter()
    result = jax.block_until_ready(call())
    return result, time.perf_counter() - start


def repeated(call: Callable[[], T], repeats: int) -> tuple[T, float]:
    """The last result of `call`, and the median seconds of `repeats` runs after one to warm up."""
    jax.block_until_ready(call())
    runs = [timed(call) for _ in range(repeats)]
    return runs[-1][0], statistics.median(seconds for _, seconds in runs)


def median_by_stage(runs: Sequence[dict[str, float]]) -> dict[str, float]:
    """The median of each stage over several runs."""
    return {stage: statistics.median(run[stage] for run in runs) for stage in runs[0]}


@dataclass(frozen=True)
class Median:
    """A median and its interval.

    Attributes:
        value: the median of the runs.
        low, high: with `CONFIDENCE` the median of all runs there could be lies between them; the
            least and the largest of fewer than six runs.
        runs: how many.
    """

    value: float
    low: float
    high: float
    runs: int

    @property
    def coverage(self) -> float:
        """How sure it is that the median of all runs there could be lies in the interval."""
        misses = sum(math.comb(self.runs, k) for k in range(interval_rank(self.runs)))
        return 1 - 2 * misses / 2**self.runs

    @property
    def words(self) -> str:
        """What the interval is, for captions."""
        if interval_rank(self.runs) == 1:
            return f"range of {self.runs} runs" if self.runs > 1 else "one run"
        return f"{100 * self.coverage:.0f} % interval of the median of {self.runs} runs"

    def scaled(self, by: float) -> "Median":
        """The same in another unit."""
        return Median(by * self.value, by * self.low, by * self.high, self.runs)

    def record(self) -> dict:
        """As plain values."""
        return {
            "median": self.value,
            "low": self.low,
            "high": self.high,
            "runs": self.runs,
            "coverage": self.coverage,
        }


def median_of(runs: Sequence[float]) -> Median:
    """The median of some runs, and its interval.

    The interval from the k-th smallest to the k-th largest of n runs misses the median with
    probability 2 P(B <= k - 1), B binomial of n fair coins; k is the largest that keeps to
    `CONFIDENCE`.

    Raises:
        UseError: no run, or one that is no finite number.
    """
    require(
        len(runs) > 0 and all(math.isfinite(run) for run in runs),
        f"a median of the runs {list(runs)} does not exist; give one finite number or more.",
    )
    ordered = sorted(runs)
    rank = interval_rank(len(ordered))
    return Median(statistics.median(ordered), ordered[rank - 1], ordered[-rank], len(ordered))


def interval_rank(runs: int) -> int:
    """k of `median_of`, 1 or more."""
    # Whole numbers: of 2^runs ways that coins fall, those that miss on one side.
    rank, ways = 1, 1
    while True:
        ways += math.comb(runs, rank)
        if 2 * ways / 2**runs > 1 - CONFIDENCE or 2 * (rank + 1) > runs + 1:
            return rank
        rank += 1


def ratio_of(over: Sequence[float], under: Sequence[float]) -> Median:
    """The median of ratios, turn by turn: what slows down a turn slows down both.

    Raises:
        UseError: as many turns of one as of the other there are not, or a time is not positive.
    """
    require(
        len(over) == len(under) and all(run > 0 for run in (*over, *under)),
        f"ratios of {len(over)} runs to {len(under)} are not possible; give as many positive times "
        "of one as of the other, taken in turns.",
    )
    return median_of([a / b for a, b in zip(over, under, strict=True)])


def in_turns(
    calls: Mapping[str, Callable[[], T]], rounds: int, warm_ups: int = 1
) -> dict[str, list[T]]:
    """What each call gave in each of `rounds` turns, after `warm_ups` that are forgotten.

    A turn calls all of them, every other one in reverse order: none always follows the same one.

    Raises:
        UseError: no turn, or a number of warm-ups below 0.
    """
    require(rounds >= 1, f"{rounds} rounds measure nothing; allowed: 1 or more.")
    require(warm_ups >= 0, f"{warm_ups} warm-ups are not possible; allowed: 0 or more.")
    forwards = list(calls)
    gathered: dict[str, list[T]] = {name: [] for name in calls}
    for turn in range(warm_ups + rounds):
        for name in forwards if turn % 2 == 0 else forwards[::-1]:
            result = calls[name]()
            if turn >= warm_ups:
                gathered[name].append(result)
    return gathered
