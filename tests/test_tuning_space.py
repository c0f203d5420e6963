"""The box of settings: places and settings are inverse, and every point is possible."""

import itertools
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from helpers.registry import FAST
from helpers.tuning import BASE, made_space
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asmjax.errors import UseError
from asmjax.shadow import AdaptiveShadowMap, preset
from asmjax.shadow.comparison import BIAS
from asmjax.tuning.proposals import at_ends, distinct, extremes
from asmjax.tuning.space import BALANCED, NAMES, Space, node_cost, space_of, values_at

SPACE = made_space()
STEPPED = [knob for knob in SPACE.knobs if knob.steps]
SMOOTH = [knob for knob in SPACE.knobs if not knob.steps]
UNIT = st.floats(0, 1)
POINTS = hnp.arrays(np.float64, len(NAMES), elements=UNIT | st.sampled_from([0.0, 0.5, 1.0]))


def steps_of(space: Space, name: str) -> tuple[int, ...]:
    return space.knobs[NAMES.index(name)].steps or ()


def test_knobs_are_settings_in_order():
    assert tuple(knob.name for knob in SPACE.knobs) == NAMES
    assert all(0 < knob.low <= knob.high for knob in SPACE.knobs)
    assert {knob.name for knob in STEPPED} == {
        "node_resolution", "cells", "pixel_share", "memory_bytes"
    }  # fmt: skip


@given(POINTS)
def test_every_point_gives_a_possible_map(point):
    """The constructor refuses impossible ones; what is not tuned stays."""
    algorithm = SPACE.algorithm(point)
    assert algorithm.finest_ratio <= algorithm.ratio_target
    assert (algorithm.compare, algorithm.measure) == (BASE.compare, BASE.measure)
    assert algorithm.memory_bytes <= BASE.memory_bytes
    algorithm.tree_shape(1)


@pytest.mark.parametrize("knob", SMOOTH, ids=lambda knob: knob.name)
@given(x=st.floats(0.01, 0.99))
def test_place_and_setting_are_inverse(knob, x):
    value = knob.at(x)
    assert knob.low < value < knob.high
    assert knob.place(value) == pytest.approx(x, abs=1e-12)
    # Linear in the logarithm: the middle is the geometric mean.
    assert knob.continuous(0.5) == pytest.approx(math.sqrt(knob.low * knob.high))
    assert knob.continuous(x) == pytest.approx(knob.low ** (1 - x) * knob.high**x)


@pytest.mark.parametrize("knob", STEPPED, ids=lambda knob: knob.name)
@given(x=UNIT)
def test_steps_are_rounded_to_the_nearest_in_the_logarithm(knob, x):
    distance = [abs(knob.place(step) - x) for step in knob.steps]
    chosen = knob.at(x)
    assert chosen in knob.steps and type(chosen) is int
    assert distance[knob.steps.index(chosen)] <= min(distance) + 1e-12
    assert knob.at(knob.place(chosen)) == chosen


@given(POINTS)
def test_snapped_points_stay_and_have_the_same_settings(point):
    # Within roundings of where a setting is off, it may be off or not.
    ends = np.minimum(point, 1 - point)
    assume(((ends < 9e-4) | (ends > 1.1e-3)).all())
    snapped = SPACE.snapped(point)
    assert ((snapped >= 0) & (snapped <= 1)).all()
    again = SPACE.settings(snapped)
    for name, value in SPACE.settings(point).items():
        assert again[name] == (pytest.approx(value) if isinstance(value, float) else value)
    np.testing.assert_allclose(SPACE.snapped(snapped), snapped, atol=1e-12)


def test_what_is_off_lies_at_an_end():
    """A gap and a profit of 0, and no limit of time; just beside it the setting acts."""
    ends = {"discontinuity": (0.0, 0.0), "least_profit": (0.0, 0.0), "time_limit": (1.0, None)}
    for knob in SPACE.knobs:
        if knob.name not in ends:
            assert knob.off is None
            continue
        x, value = ends[knob.name]
        assert knob.at(x) == value and knob.place(value) == x
        beside = knob.at(abs(x - 0.002))
        assert beside is not None and beside > 0
    assert SPACE.settings(SPACE.point(BASE)) == pytest.approx(
        {name: getattr(BASE, name) for name in NAMES}
    )


def test_settings_beyond_the_range_lie_at_its_end():
    far = replace(BASE, ratio_target=99.0, finest_ratio=1e-5, discontinuity=BIAS / 2)
    point = dict(zip(NAMES, SPACE.point(far), strict=True))
    assert (point["ratio_target"], point["finest_ratio"], point["discontinuity"]) == (1, 0, 0)


@given(POINTS)
def test_continuous_values_are_the_knobs_own(point):
    low, high = SPACE.ends
    values = values_at(point, low, high)
    for knob, x in zip(SPACE.knobs, point, strict=True):
        assert float(values[knob.name]) == pytest.approx(knob.continuous(float(x)))
    table = np.stack([point, point[::-1]], axis=1)
    columns = values_at(table, low[:, None], high[:, None])
    assert float(columns[NAMES[3]][0]) == pytest.approx(float(values[NAMES[3]]))


@given(POINTS)
def test_other_steps_are_the_product_of_all_steps(point):
    """As often as there are combinations, each once, and the rest unchanged."""
    names = [knob.name for knob in STEPPED]
    found = [SPACE.settings(other) for other in SPACE.other_steps(point)]
    combinations = {tuple(settings[name] for name in names) for settings in found}
    expected = set(itertools.product(*(knob.steps or () for knob in STEPPED)))
    assert combinations == expected and len(found) == len(expected)
    mine = SPACE.settings(point)
    for settings in found:
        assert all(settings[knob.name] == mine[knob.name] for knob in SMOOTH)


@given(POINTS, st.sampled_from([0.12, 0.3]))
def test_neighbours_differ_in_one_setting_by_one_step(point, step):
    """Against trying each: the step before and after, and `step` to both sides within the box."""
    point = SPACE.snapped(point)
    expected = set()
    for k, knob in enumerate(SPACE.knobs):
        for way in (-1, 1):
            if knob.steps is None:
                x = min(max(point[k] + way * step, 0.0), 1.0)
            else:
                here = knob.steps.index(knob.at(float(point[k]))) + way
                if not 0 <= here < len(knob.steps):
                    continue
                x = knob.place(knob.steps[here])
            if abs(x - point[k]) > 1e-9:
                expected.add((k, round(x, 9)))
    found = set()
    for other in SPACE.neighbours(point, step):
        (changed,) = np.flatnonzero(other != point)
        found.add((int(changed), round(float(other[changed]), 9)))
    assert found == expected


def test_one_step_of_memory_is_fixed():
    """A limit that holds a node, but a quarter of which does not."""
    memory = next(m for m in range(2**10, 2**20, 2**10) if _holds(m))
    space = space_of(replace(BASE, memory_bytes=memory), 1, 0.05)
    knob = space.knobs[NAMES.index("memory_bytes")]
    assert knob.steps == (memory,) and knob.fixed
    assert {knob.at(x) for x in (0.0, 0.3, 1.0)} == {memory}
    assert (knob.place(memory), knob.place(2 * memory)) == (0.0, 0.0)
    middle = np.full(len(NAMES), 0.5)
    others = space.neighbours(space.snapped(middle), 0.1) + space.other_steps(middle)
    assert all(space.algorithm(point).memory_bytes == memory for point in others)
    assert np.isfinite([*space.ends]).all()


def _holds(memory: int) -> bool:
    try:
        replace(BASE, memory_bytes=memory, node_resolution=32).tree_shape(1)
    except UseError:
        return False
    return True


@pytest.mark.parametrize("memory", [1, 100, 2**12])
def test_limits_below_one_node_are_refused(memory):
    with pytest.raises(UseError) as refused:
        space_of(replace(BASE, memory_bytes=memory), 6, 0.05)
    text = str(refused.value)
    assert "\n" not in text and f"{memory / 2**20:g} MB" in text and "raise" in text


def test_the_largest_nodes_are_possible_at_the_least_memory():
    """Steps of memory that hold no node of the largest kind are left out, one by one."""
    for memory in (2**16, 2**18, 2**20, 2**24):
        space = space_of(replace(BASE, memory_bytes=memory), 6, 0.05)
        for size in steps_of(space, "memory_bytes"):
            largest = steps_of(space, "node_resolution")[-1]
            replace(BASE, memory_bytes=size, node_resolution=largest).tree_shape(6)


def test_ranges_of_profit_and_time_go_by_the_machine():
    """Twice the cost of a node halves the profits; twice the time of a frame doubles the limits."""
    slow = replace(FAST, a_seconds_per_texel=2e-8, b_seconds=2e-5)
    costs = node_cost(AdaptiveShadowMap(cost_model=slow))
    np.testing.assert_allclose(costs, 2 * np.asarray(node_cost(BASE)))
    one, two = made_space(), space_of(replace(BASE, cost_model=slow), 1, 0.1)
    for name, factor in (("least_profit", 0.5), ("time_limit", 2), ("finest_ratio", 1)):
        k = NAMES.index(name)
        for before, after in zip(one.ends, two.ends, strict=True):
            assert after[k] == pytest.approx(factor * before[k])


@given(POINTS)
def test_steps_come_round(point):
    """`BALANCED` numbers in a row have each step of each kind as often, and no two kinds go
    together; all else stays."""
    found = [SPACE.settings(SPACE.with_steps(point, k)) for k in range(BALANCED, 2 * BALANCED)]
    for knob in STEPPED:
        times = Counter(settings[knob.name] for settings in found)
        assert set(times) == set(knob.steps or ())
        assert max(times.values()) == min(times.values())
    for one, other in itertools.combinations(STEPPED, 2):
        pairs = {(settings[one.name], settings[other.name]) for settings in found}
        assert len(pairs) > max(len(one.steps or ()), len(other.steps or ()))
    mine = SPACE.settings(point)
    assert all(one[knob.name] == mine[knob.name] for one in found for knob in SMOOTH)


def test_the_papers_settings_can_be_tuned():
    """512 texels a side at the start fit the paper's nodes, but not all that are tried: of six
    faces, in a quarter of the memory. Tuning starts as every map does that does not say."""
    paper = preset("paper_2001", memory_bytes=2**23)
    assert paper.start_resolution is not None
    box = space_of(replace(paper, cost_model=FAST), 6, 0.05)
    for point in box.other_steps(np.full(len(NAMES), 0.5)):
        box.algorithm(point).tree_shape(6)


def test_what_is_near_an_end_is_tried_at_it():
    """Off where it can be, at the end elsewhere, and all else as it is."""
    off = {knob.name: knob.off for knob in SPACE.knobs if knob.off is not None}
    places = {name: 0.02 if end == 0 else 0.98 for name, (end, _) in off.items()}
    point = np.array([places.get(knob.name, 0.5) for knob in SPACE.knobs])
    point[NAMES.index("finest_ratio")] = 0.018
    found = SPACE.settings(at_ends(SPACE, point))
    assert {name: found[name] for name in off} == {name: value for name, (_, value) in off.items()}
    assert found["finest_ratio"] == SPACE.knobs[NAMES.index("finest_ratio")].low
    assert found["ratio_target"] == SPACE.settings(point)["ratio_target"]
    inside = np.full(len(NAMES), 0.5)
    np.testing.assert_array_equal(at_ends(SPACE, inside), inside)


def test_extremes_differ_in_one_setting_at_an_end():
    point = np.full(len(NAMES), 0.5)
    found = extremes(SPACE, point)
    free = [knob for knob in SPACE.knobs if not knob.fixed]
    assert len(found) == 2 * len(free)
    for one in found:
        (moved,) = np.flatnonzero(one != point)
        assert one[moved] in (0, 1)


def test_proposals_are_new_and_differ():
    """In order, none twice, none that is known; a few of other sizes of nodes or memory first."""
    point = SPACE.snapped(np.full(len(NAMES), 0.5))
    near = [point + 0.01 * k * (np.arange(len(NAMES)) == 0) for k in range(6)]
    other = point.copy()
    other[NAMES.index("node_resolution")] = 0.0
    known = SPACE.algorithm(near[1])
    found = distinct(SPACE, [*near, near[0], other], lambda p: SPACE.algorithm(p) == known, count=5)
    sizes = [SPACE.settings(one)["node_resolution"] for one in found]
    assert sizes[0] == SPACE.settings(point)["node_resolution"] != sizes[1] == 8
    algorithms = [SPACE.algorithm(one) for one in found]
    assert len(found) == 5 and known not in algorithms
    assert len({repr(one) for one in algorithms}) == 5


def test_a_limit_of_time_is_no_base():
    """Of the default settings with a limit, the limit is not kept: it is tuned."""
    hurried = replace(BASE, time_limit=0.01)
    assert space_of(hurried, 1, 0.05).base.time_limit is None
