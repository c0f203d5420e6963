"""Medians, intervals, ratios and turns: against simulation, SciPy, and a clock that drifts."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from asmjax.errors import UseError
from asmjax.experiment.clock import CONFIDENCE, in_turns, interval_rank, median_of, ratio_of

TIMES = st.floats(1e-6, 1e3)

DRAWS = 2000


def rank_by_scipy(runs: int) -> int:
    """The largest k of which P(B < k) is at most half of what may be missed, or 1."""
    below = binom.cdf(np.arange(runs // 2 + 1), runs, 0.5)
    allowed = np.flatnonzero(below <= (1 - CONFIDENCE) / 2)
    return max(1, min(allowed.size, (runs + 1) // 2))


def test_the_rank_is_that_of_the_binomial():
    """For 1 to 200 runs; the first that leaves out an extreme one are nine."""
    ranks = [interval_rank(runs) for runs in range(1, 201)]
    assert ranks == [rank_by_scipy(runs) for runs in range(1, 201)]
    assert ranks[:9] == [1] * 8 + [2]


def test_very_many_runs_have_an_interval_too():
    """Beyond what 2^-n holds: half the width tends to 0.98 sqrt(n) runs."""
    assert interval_rank(4000) == pytest.approx(2000 - 0.98 * math.sqrt(4000), abs=2)


def skewed(rng, shape) -> np.ndarray:
    """Most runs take 1 to 1.5 and one in ten up to 40 times as long; their median by quantile."""
    slow = rng.random(shape) < 0.1
    return (1 + 0.2 * rng.exponential(size=shape)) * np.where(slow, 1 + 39 * rng.random(shape), 1)


@pytest.mark.parametrize("runs", [6, 7, 9, 15, 30])
def test_intervals_cover_the_median_as_often_as_promised(runs):
    """In 2,000 repetitions, at least 95 % but for 3 standard deviations; and they use it up:
    the next narrower interval would not."""
    rng = np.random.default_rng(runs)
    median = np.median(skewed(rng, 10**6))
    draws = skewed(rng, (DRAWS, runs))
    found = [median_of(row.tolist()) for row in draws]
    covered = np.mean([one.low <= median <= one.high for one in found])
    assert covered > CONFIDENCE - 3 * math.sqrt(CONFIDENCE * (1 - CONFIDENCE) / DRAWS)
    rank = interval_rank(runs) + 1
    ordered = np.sort(draws, axis=1)
    narrower = (ordered[:, rank - 1] <= median) & (median <= ordered[:, -rank])
    assert narrower.mean() < CONFIDENCE
    assert all(one.low <= one.value <= one.high for one in found)


def test_few_runs_give_their_whole_range():
    one = median_of([3.0, 1.0, 2.0, 9.0, 2.5])
    assert one.record() == {
        "median": 2.5, "low": 1.0, "high": 9.0, "runs": 5, "coverage": 1 - 2 / 2**5,
    }  # fmt: skip
    assert median_of([4.0]).record() == {
        "median": 4.0, "low": 4.0, "high": 4.0, "runs": 1, "coverage": 0.0,
    }  # fmt: skip


def test_one_disturbed_run_in_nine_leaves_no_trace():
    """However late it came back."""
    calm = [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7]
    assert median_of([*calm, 2.0]) == median_of([*calm, 1e9])


@pytest.mark.parametrize("runs", [[], [1.0, math.nan], [math.inf]])
def test_no_median_of_nothing_and_of_no_numbers(runs):
    with pytest.raises(UseError, match="give one finite number or more"):
        median_of(runs)


@given(
    times=st.lists(st.tuples(TIMES, TIMES, st.integers(-8, 8)), min_size=1, max_size=12),
)
def test_what_slows_both_of_a_turn_cancels(times):
    """Exactly, where the slow-down is a power of two: the interval is the same too."""
    over, under, slower = zip(*times, strict=True)
    calm = ratio_of(over, under)
    slow = ratio_of(
        [a * 2.0**k for a, k in zip(over, slower, strict=True)],
        [b * 2.0**k for b, k in zip(under, slower, strict=True)],
    )
    assert slow == calm
    assert calm.runs == len(times)


@pytest.mark.parametrize(
    ("over", "under"),
    [([1.0], [1.0, 2.0]), ([1.0], [0.0]), ([-1.0], [1.0]), ([math.nan], [1.0]), ([1.0], [])],
)
def test_ratios_of_what_was_not_taken_in_turns_are_refused(over, under):
    with pytest.raises(UseError, match="as many positive times"):
        ratio_of(over, under)


@given(calls=st.integers(0, 4), rounds=st.integers(1, 5), warm_ups=st.integers(0, 3))
def test_turns_call_everything_in_both_orders_and_forget_the_warm_ups(calls, rounds, warm_ups):
    """Forwards, backwards, forwards...; each result is that of its own call in its own turn."""
    log: list[tuple[str, int]] = []

    def call(name):
        log.append((name, sum(name == other for other, _ in log)))
        return log[-1]

    names = [f"call {k}" for k in range(calls)]
    got = in_turns({name: lambda name=name: call(name) for name in names}, rounds, warm_ups)
    turns = range(warm_ups + rounds)
    order = [names if turn % 2 == 0 else names[::-1] for turn in turns]
    assert [name for name, _ in log] == list(itertools.chain(*order))
    assert got == {name: [(name, turn) for turn in turns[warm_ups:]] for name in names}


@pytest.mark.parametrize(("rounds", "warm_ups"), [(0, 1), (-1, 0), (1, -1)])
def test_no_turn_is_refused(rounds, warm_ups):
    with pytest.raises(UseError, match="allowed: "):
        in_turns({}, rounds, warm_ups)


def test_what_a_call_raises_passes_through():
    """At once: nothing else is called after it."""
    called = []

    def fail():
        raise ZeroDivisionError("in the call")

    with pytest.raises(ZeroDivisionError, match="in the call"):
        in_turns({"good": lambda: called.append(1), "bad": fail, "next": called.clear}, 2)
    assert called == [1]


class Machine:
    """Gets slower and slower by 2 % of the first call's speed with each call, whatever is called;
    a call of length `work` returns the time that it took."""

    def __init__(self):
        self.calls = 0

    def take(self, work: float) -> float:
        self.calls += 1
        return work * (1 + 0.02 * self.calls)


def test_a_machine_that_gets_slower_leaves_the_ratio_alone():
    """Three jobs of 5 : 2 : 1 in turns keep their ratios to 0.2 %; one after the other, the first
    looks 30 % quicker than it is. Every other turn in reverse does it: always in the same order,
    ratios are off by the drift between two calls, and their intervals miss the truth."""
    work = {"five": 5.0, "two": 2.0, "one": 1.0}
    rounds = 20
    machine = Machine()
    calls = {name: lambda w=w: machine.take(w) for name, w in work.items()}
    turns = in_turns(calls, rounds)
    machine.calls = 0
    in_a_row = {name: in_turns({name: call}, rounds)[name] for name, call in calls.items()}
    machine.calls = 0
    same_order = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            same_order[name].append(call())

    def bias(times):
        ratio = ratio_of(times["five"], times["one"])
        return abs(ratio.value / 5 - 1), ratio.low <= 5 <= ratio.high

    assert bias(turns)[0] < 2e-3 and bias(turns)[1]
    assert bias(in_a_row)[0] > 0.3 and not bias(in_a_row)[1]
    assert bias(same_order)[0] > 5e-3 and not bias(same_order)[1]
