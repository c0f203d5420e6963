"""Wall times that mean something: warmed up, blocked until ready, the median of several runs."""

import statistics
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import jax

T = TypeVar("T")


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
