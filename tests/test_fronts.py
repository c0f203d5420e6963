"""Fronts, equal errors and pooled views against brute force; ranges of settings."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.experiment.comparison import (
    MOST_ERRORS,
    Compared,
    cheapest,
    equal_errors,
    front_of,
    pooled,
    telling_errors,
)
from asmjax.experiment.methods import settings_of
from asmjax.experiment.settings_range import BETWEEN, LAST, VARIANTS, candidates, families_of
from asmjax.experiment.trial import Trial
from asmjax.fronts import cost_of_error, front
from asmjax.shadow import ALGORITHMS, MAPS, AdaptiveShadowMap, SubdividedShadowMap

# Few different values, so that costs and errors are often equal.
LEVELS = st.sampled_from([0.001, 0.03, 0.5, 0.7, 2.0, 11.0])
ERRORS = st.one_of(LEVELS, st.just(0.0))
POINTS = st.lists(st.tuples(LEVELS, ERRORS), min_size=1, max_size=9)


@given(POINTS)
def test_front_is_what_nothing_beats(points):
    costs, errors = map(list, zip(*points, strict=True))
    found = front(costs, errors)

    def beaten(i: int) -> bool:
        return any(
            costs[j] <= costs[i]
            and errors[j] <= errors[i]
            and (costs[j] < costs[i] or errors[j] < errors[i])
            for j in range(len(points))
        )

    assert {points[i] for i in found} == {p for i, p in enumerate(points) if not beaten(i)}
    assert len(found) == len({points[i] for i in found})
    assert [costs[i] for i in found] == sorted(costs[i] for i in found)


def test_front_of_nothing_is_empty():
    assert front([], []) == []


@given(POINTS, st.sampled_from([0.0005, 0.01, 0.03, 0.1, 0.5, 0.6, 3.0, 20.0]))
def test_cost_of_an_error_is_that_of_a_walk_along_the_front(points, wanted):
    """Brute force: 20,001 steps on the logarithmic line from one point of the front to the next;
    the first that is accurate enough."""
    costs, errors = map(list, zip(*points, strict=True))
    found = cost_of_error(costs, errors, wanted)
    kept = sorted({points[i] for i in front(costs, errors)})
    if min(errors) > wanted:
        assert found is None
        return
    assert found is not None
    if kept[0][1] <= wanted:
        assert found == (kept[0][0], kept[0][1] < wanted)
        return
    assert not found.bound
    for (cheap, worse), (dear, better) in zip(kept[:-1], kept[1:], strict=True):
        if better > wanted:
            continue
        if better == 0:
            assert found.cost == dear
            return
        walk = np.linspace(0, 1, 20_001)
        error = np.exp(np.log(worse) + walk * (np.log(better) - np.log(worse)))
        cost = np.exp(np.log(cheap) + walk * (np.log(dear) - np.log(cheap)))
        first = int(np.argmax(error <= wanted * (1 + 1e-12)))
        assert found.cost == pytest.approx(cost[first], rel=2e-3)
        return


def test_costs_without_a_logarithm_are_refused():
    with pytest.raises(UseError, match="logarithm"):
        cost_of_error([1.0, 0.0], [1.0, 0.5], 0.7)
    with pytest.raises(UseError, match="logarithm"):
        cost_of_error([1.0], [1.0], 0.0)


def trial(family: str, seconds: float, memory: int, edge_px: float, **changes: Any) -> Trial:
    """A trial of three runs, whose stages add up to `seconds`."""
    moved = {"mean": edge_px, "p95": 2 * edge_px, "hausdorff": 3.0, "unmatched_fraction": 0.0}
    settings: dict[str, Any] = {
        "name": f"{family}-8",
        "family": family,
        "settings": {},
        "view": "one",
        "samples": 1,
        "error": {
            "misclassified_fraction": edge_px / 100,
            "false_lit_fraction": edge_px / 400,
            "false_dark_fraction": 3 * edge_px / 400,
            "boundary_displacement_px": moved | {"per_edge_length": edge_px},
        },
        "predicted_px": edge_px,
        "seconds": {
            "build": [0.5 * seconds, 0.4 * seconds, 0.6 * seconds],
            "analysis": [0.0, 0.0, 0.0],
            "query": [0.5 * seconds] * 3,
        },
        "yardstick": [0.1, 0.1, 0.1],
        "bytes": memory,
        "texels": memory // 4,
        "rays": memory // 4,
        "status": "complete",
    }
    return Trial(**(settings | changes))


def tried(family: str, seconds: float, memory: int, edge_px: float) -> Compared:
    one = trial(family, seconds, memory, edge_px)
    return Compared(f"{memory} B", one, [one], one.yardstick[0])


FLAT = [tried("uniform", 0.01 * 2**k, 4**k * 100, 1.6 / 2**k) for k in range(4)]
TREE = [tried("adaptive", 0.08, 1600, 0.3), tried("adaptive", 0.1, 6400, 0.0)]


def test_equal_errors_in_closed_form():
    """Seconds double and bytes grow fourfold where errors halve: at 0.566 px, half way between
    0.8 and 0.4 on a logarithm, the flat map takes 0.02 x sqrt(2) s and 400 x 2 bytes."""
    wanted = [2.0, 0.8 / math.sqrt(2), 0.25, 0.1]
    seconds = {
        (found.error_px, found.family): found
        for found in equal_errors([*FLAT, *TREE], "seconds", wanted)
    }
    assert seconds[2.0, "uniform"].reach == (pytest.approx(0.01), True)
    assert seconds[2.0, "uniform"].ratio == 1.0
    assert seconds[2.0, "adaptive"].ratio is None
    half = seconds[wanted[1], "uniform"]
    assert half.reach == (pytest.approx(0.02 * math.sqrt(2)), False) and half.ratio == 1.0
    assert seconds[wanted[1], "adaptive"].reach == (pytest.approx(0.08), True)
    assert seconds[0.1, "uniform"].reach is None and seconds[0.1, "uniform"].ratio is None
    assert seconds[0.25, "adaptive"].reach == (pytest.approx(0.1), False)
    least = 0.04 * 2 ** (math.log(0.4 / 0.25) / math.log(2))
    assert seconds[0.25, "adaptive"].ratio == pytest.approx(0.1 / least)
    bytes = equal_errors(FLAT, "bytes", [wanted[1]])
    assert bytes[0].reach == (pytest.approx(800), False)


def test_round_errors_are_those_that_something_lies_about():
    assert telling_errors(FLAT) == [1, 0.5, 0.25]
    assert telling_errors([*FLAT, *TREE]) == [1, 0.5, 0.25]
    many = telling_errors([tried("tuned", 1.0, 100, 50.0), tried("tuned", 1.0, 400, 0.001)])
    assert len(many) == MOST_ERRORS and (many[0], many[-1]) == (20, 0.001)
    assert telling_errors([]) == telling_errors(TREE[:1]) == telling_errors(TREE[1:]) == []


def test_fronts_of_both_costs():
    everything = [*FLAT, *TREE]
    assert front_of(everything, "bytes") == [*FLAT[:2], TREE[0], TREE[1]]
    assert front_of(everything, "seconds") == [*FLAT[:3], FLAT[3], TREE[1]]


def test_best_within_limits():
    """With a limit of the error the fastest, else the most accurate."""
    everything = [*FLAT, *TREE]
    assert cheapest(everything, error=0.5) is FLAT[2]
    assert cheapest(everything, error=0.9, bytes=1599) is FLAT[1]
    assert cheapest(everything, seconds=0.05) is FLAT[2]
    assert cheapest(everything) is TREE[1]
    with pytest.raises(UseError, match=r"least error was 0 px \(adaptive 6400 B\), asked -1 px"):
        cheapest(everything, error=-1.0)
    with pytest.raises(UseError, match=r"least error was 0\.3 px .* least time was 0\.1 s"):
        cheapest(TREE, error=0.1, seconds=0.09)
    with pytest.raises(UseError, match="no two of them"):
        cheapest(TREE, error=-1.0, seconds=0.01, bytes=1)
    with pytest.raises(UseError, match="nothing was tried"):
        cheapest([])


@given(
    st.lists(
        st.tuples(st.integers(0, 50), st.integers(0, 50), st.floats(5, 900), st.integers(101, 999)),
        min_size=1, max_size=4,
    )
)  # fmt: skip
def test_pooled_views_are_one_large_image(views):
    """Brute force: count wrong pixels, edges and pixels of all views together."""
    trials, edges, pixels = [], [], []
    for k, (lit, dark, edge, count) in enumerate(views):
        one = trial("uniform", 0.1 * (k + 1), 100 * (k + 1), 1.0)
        moved = one.error["boundary_displacement_px"] | {"per_edge_length": (lit + dark) / edge}
        error = {
            "misclassified_fraction": (lit + dark) / count,
            "false_lit_fraction": lit / count,
            "false_dark_fraction": dark / count,
            "boundary_displacement_px": moved | {"p95": float(k)},
        }
        trials.append(replace(one, error=error))
        edges.append(edge)
        pixels.append(count)
    whole = pooled(trials, edges, pixels)
    wrong = sum(lit + dark for lit, dark, _, _ in views)
    assert whole.edge_px == pytest.approx(wrong / sum(edges))
    assert whole.wrong == pytest.approx(wrong / sum(pixels))
    parts = whole.error["false_lit_fraction"] + whole.error["false_dark_fraction"]
    assert parts == pytest.approx(whole.wrong, abs=1e-12)
    assert whole.p95_px == len(views) - 1
    assert whole.bytes == 100 * len(views)
    assert whole.total.value == pytest.approx(0.1 * (len(views) + 1) / 2)
    assert whole.ratio.value == pytest.approx(whole.total.value / 0.1)


def test_pooled_views_say_what_ended_and_what_is_missing():
    full = replace(trial("adaptive", 1.0, 10, 0.5), status="memory_limit", nodes=7)
    done = replace(full, status="complete", nodes=9, predicted_px=None)
    whole = pooled([done, full], [1.0, 1.0], [5, 5])
    assert whole.status == "memory_limit" and whole.nodes == 9
    assert whole.predicted_px is None and whole.view == "2 views"
    assert pooled([done], [1.0], [5]) is done


def test_every_family_has_its_range():
    """Its default comes first, then memory from 1/16 to 4 times, then further settings; nothing
    twice, and a family needs no line here."""
    adaptive = AdaptiveShadowMap()
    found = candidates(families_of(()), adaptive, 1)
    first = [item for item in found if item.rank == 0]
    assert [item.family for item in first] == list(MAPS)
    assert first[1].algorithm == adaptive and first[0].label == "16 MB"
    sides = [settings_of(i.algorithm)["resolution"] for i in found if i.family == "uniform"]  # type: ignore[arg-type]
    assert sides == [2048, 512, 4096, 1024]
    cut = [i for i in found if i.family == "subdivided" and i.rank >= 4]
    labels = ["16 MB, parts 1", "16 MB, parts 4", "16 MB, strength -1"]
    assert [item.label for item in cut] == labels
    assert [item.rank for item in cut] == [LAST - 1, LAST, LAST]
    assert "16 MB, discontinuity 0.01" in [item.label for item in found]
    assert cut[1].algorithm == SubdividedShadowMap(resolution=2048, parts=4)
    assert [i.label for i in found if i.rank == LAST][0] == "16 MB, finest ratio 1/2"
    labels = [(item.family, item.label) for item in found]
    assert len(set(labels)) == len(labels) and {*VARIANTS, *BETWEEN} <= {*ALGORITHMS}
    ranks = [item.rank for item in found]
    assert ranks == sorted(ranks)
    paper = replace(adaptive, finest_ratio=1 / 4)
    again = [i.label for i in candidates(["adaptive"], paper, 1)]
    assert "16 MB, finest ratio 1/4" not in again and "16 MB, finest ratio 1/8" in again


def test_what_is_not_possible_says_why():
    """A sixteenth of the memory holds no node of a cube of faces; a map may be too large."""
    small = candidates(["adaptive", "uniform"], AdaptiveShadowMap(memory_bytes=2**16), 6)
    problems = [item for item in small if item.algorithm is None]
    assert [item.label for item in problems] == ["0.00390625 MB"]
    assert "`memory_bytes`" in problems[0].problem
    with pytest.raises(UseError, match="Did you mean 'uniform'"):
        families_of(["unifrom"])
