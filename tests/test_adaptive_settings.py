"""What `discontinuity` and `least_profit` leave out of an adaptive map, and what they leave alone.

A square floats over a plane under parallel light: the distance of caster and receiver along the
receiver's normal is its height, the same everywhere. Below a ramp it grows from edge to edge.
"""

import functools
import math
from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest
from helpers.analytic_cases import Case
from helpers.effort import examples
from helpers.registry import FAST
from helpers.traced_cases import traced_case
from hypothesis import example, given, settings
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.scene.spec import LightSpec, Rectangle, Vector, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, Status
from asmjax.shadow.adaptive.look import analyse, audience_of
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.comparison import BIAS, CURVATURE_BIAS

HEIGHT = 0.8
"""Of the square above the plane, scene units."""

START = 16
"""Texels a side to begin with."""

PLAIN = AdaptiveShadowMap(
    memory_bytes=2**19, start_resolution=START, cover=False, finest_ratio=1.0, cost_model=FAST
)
"""Refines matched edges, and has memory to spare."""

FLOOR = Rectangle("floor", (0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 3.0, 0.0))
SQUARE = Rectangle("square", (0.0, 0.0, HEIGHT), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
RAMP = Rectangle("ramp", (0.0, 0.0, 0.5), (1.0, 0.0, 0.45), (0.0, 1.0, 0.0))

DOWN: Vector = (0.0, 0.0, -1.0)
ASLANT: Vector = (0.6, 0.2, -1.0)

thresholds = st.floats(0.0, 0.4)
profits = st.floats(3.5, 7.5).map(lambda exponent: 10.0**exponent)


@functools.cache
def case(caster: Rectangle, direction: Vector, step: float = 0.0) -> Case:
    """The caster over the floor, seen by an eye that has gone `step` along x; the frame is that of
    the eye that has not."""
    eye = ViewSpec("eye", (step, -3.0, 6.0), (step, 0.0, 0.0), fov_x_deg=45.0, width=64, height=64)
    sun = LightSpec("sun", "directional", direction=direction)
    frame = case(caster, direction).frame if step else None
    return traced_case((FLOOR, caster), eye, sun, frame)


def depths(view: Case) -> np.ndarray:
    """Axial depth of what the eye sees of the floor, from the frame alone."""
    floor = view.eye.world[:, view.eye.shape == 0]
    return view.frame.rotation[0, 2] @ (floor - view.frame.origin[:, None])


def built(view: Case, **changes):
    """The settings, the state that they build, and its squares."""
    algorithm = replace(PLAIN, **changes)
    state = algorithm.build(view.eye, view.frame, view.rays)
    return algorithm, state, squares_of(state)


def squares_of(state) -> list[tuple[int, ...]]:
    return [tuple(one) for one in state.pool.squares[:, state.pool.held()].T.tolist()]


def levels(squares) -> set[int]:
    return {square[1] for square in squares}


@functools.cache
def plain(caster: Rectangle, direction: Vector):
    return built(case(caster, direction))


@pytest.mark.parametrize("direction", [DOWN, ASLANT], ids=["down", "aslant"])
def test_edges_are_refined_where_the_caster_is_as_far_off_as_asked(direction):
    """Along the normal, whatever the light's direction: just below what the height is in parts of
    the receivers' depths the tree is the same, node by node; just above it, nothing is refined."""
    view = case(SQUARE, direction)
    depth = depths(view)
    # By as much a coarse texel's tolerance is larger.
    texel = CURVATURE_BIAS * view.frame.extent.max() / START
    low, high = (HEIGHT - texel) / depth.max(), HEIGHT / depth.min()
    assert 0.1 < low < 0.95 * high
    _, _, before = plain(SQUARE, direction)
    assert max(levels(before)) >= 3
    algorithm, state, below = built(view, discontinuity=0.99 * float(low))
    assert below == before
    assert algorithm.status(state) is Status.COMPLETE
    algorithm, state, above = built(view, discontinuity=1.01 * float(high))
    assert levels(above) == {0}
    assert algorithm.status(state) is Status.COMPLETE
    # Coarse, not gone: the shadow is there with its first texels.
    assert 0 < view.error(algorithm.visibility(state, view.eye.points)) < 0.05


@given(one=thresholds, other=thresholds)
@settings(max_examples=examples(15, 1_000))
def test_asking_for_more_distance_never_makes_more_nodes(one, other):
    low, high = sorted((one, other))
    few, many = (len(built(case(SQUARE, ASLANT), discontinuity=t)[2]) for t in (high, low))
    assert few <= many


@given(one=thresholds, other=thresholds)
@example(0.0, 0.19)
def test_there_are_no_edges_where_a_caster_comes_nearer_within_its_shadow(one, other):
    """Below a ramp: edges that count are edges, and more distance never makes others count. (That
    its height passes the threshold somewhere in the shadow is no edge of it.)"""
    low, high = sorted((one, other))
    view = case(RAMP, ASLANT)
    algorithm, state, _ = built_coarse()
    looking = audience_of(view.eye, view.frame, "axis")
    none, some, fewer = (
        np.asarray(
            analyse(
                state.tree, looking, *replace(algorithm, discontinuity=t).goals,
                shape=state.shape, perspective=False,
            ).straddles
        )
        for t in (0.0, low, high)
    )  # fmt: skip
    assert not (some & ~none).any()
    assert not (fewer & ~some).any()


@functools.cache
def built_coarse():
    return built(case(RAMP, ASLANT), ratio_target=2.0**50, finest_ratio=2.0**50)


def test_the_far_edge_of_a_ramp_is_refined_and_the_near_one_is_not():
    """Nodes below the first level lie where the ramp is higher than asked for."""
    view, height = case(RAMP, DOWN), 0.5
    depth = float(np.median(depths(view)))
    algorithm, state, squares = built(view, discontinuity=height / depth)
    _, _, all_of_them = plain(RAMP, DOWN)
    assert levels(squares) == levels(all_of_them)
    assert {*squares} < {*all_of_them}
    nodes = algorithm.nodes(state)
    below = nodes.level > 0
    corners = nodes.lo[:, below], nodes.lo[:, below] + nodes.size[below]
    # From the image back to the ground: under a light straight down, along the frame's axes.
    frame = view.frame
    x = [
        frame.origin[0]
        + frame.rotation[0, 0, 0] * (frame.corner[0, 0] + frame.extent[0, 0] * corner[0])
        + frame.rotation[0, 1, 0] * (frame.corner[0, 1] + frame.extent[0, 1] * corner[1])
        for corner in corners
    ]
    # Height over the ground at the farther corner.
    reached = 0.5 + 0.45 * np.minimum(np.maximum(*x), 1.0)
    assert reached.min() > height - 0.2
    assert below.sum() > 5


@pytest.mark.parametrize("threshold", [0.0, BIAS / 2, BIAS])
def test_up_to_the_bias_nothing_changes(threshold):
    """Every texel and every table entry the same, bit by bit."""
    _, before, _ = plain(RAMP, ASLANT)
    algorithm, state, _ = built(case(RAMP, ASLANT), discontinuity=threshold)
    assert eqx.tree_equal(state.tree, before.tree)
    assert algorithm.goals == PLAIN.goals


def test_ids_alone_know_no_distance():
    """Where no depth is stored, nothing is left out."""
    view = case(SQUARE, ASLANT)
    _, _, without = built(view, compare="id")
    assert built(view, compare="id", discontinuity=1.0)[2] == without


@pytest.mark.parametrize("profit", [0.0, 1e-300, 1.0])
def test_a_profit_that_every_node_has_changes_nothing(profit):
    """A node serves a pixel or more and costs much less than a second."""
    _, before, _ = plain(RAMP, ASLANT)
    assert eqx.tree_equal(built(case(RAMP, ASLANT), least_profit=profit)[1].tree, before.tree)


def wanted_at_first(view: Case) -> dict[tuple[int, ...], float]:
    """Pixels per second of each node that the edges of the first texels ask for, pixel by pixel."""
    algorithm, state, squares = built(view, ratio_target=2.0**50, finest_ratio=2.0**50)
    assert levels(squares) == {0}
    shape, looking = state.shape, audience_of(view.eye, view.frame, "axis")
    found = analyse(state.tree, looking, *PLAIN.goals, shape=shape, perspective=False)
    uv = np.asarray(looking.receivers.uv, np.float64)
    pixels: dict[tuple[int, ...], int] = {}
    texels: dict[tuple[int, ...], float] = {}
    for k in np.flatnonzero(found.straddles).tolist():
        # The first level whose texels are no larger than the pixel.
        size = float(np.asarray(looking.log2_ratio)[k])
        level = max(0, math.ceil((size - int(shape.log2_resolution(0))) / shape.log2_cells))
        nodes = 2 ** int(shape.log2_nodes_at(level))
        square = (0, level, int(uv[0, k] * nodes), int(uv[1, k] * nodes))
        if level > 0:
            pixels[square] = pixels.get(square, 0) + 1
            # As many texels a side as it has at its level, times how far they are from matching.
            side = 2**shape.log2_node * 2.0 ** (size - int(shape.log2_resolution(level)))
            texels[square] = max(texels.get(square, 0.0), side**2)
    assert algorithm.cost_model is FAST
    return {
        square: pixels[square] / (FAST.a_seconds_per_texel * texels[square] + FAST.b_seconds)
        for square in pixels
    }


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7])
def test_exactly_the_nodes_that_are_worth_it_are_made(share, monkeypatch):
    """In the first pass those that the pixels ask for one by one, counted; no other one later."""
    view, passes = case(RAMP, ASLANT), []
    wanted = wanted_at_first(view)
    least = float(np.quantile(list(wanted.values()), share)) * 0.999
    admit = NodePool.admit

    def spied(pool, requests, *rest):
        passes.append(requests)
        return admit(pool, requests, *rest)

    monkeypatch.setattr(NodePool, "admit", spied)
    built(view, pixel_share=1, least_profit=least)
    first = {tuple(square) for square in passes[1].squares.T.tolist()}
    assert first == {square for square, profit in wanted.items() if profit >= least}
    assert len(first) == pytest.approx((1 - share) * len(wanted), abs=1.5)
    for requests in passes[1:]:
        assert (requests.benefit / FAST.seconds(requests.n_required) >= least).all()


@given(one=profits, other=profits)
@settings(max_examples=examples(15, 1_000))
def test_asking_for_more_profit_never_makes_more_nodes(one, other):
    """Where memory does not limit them."""
    low, high = sorted((one, other))
    few, many = (len(built(case(RAMP, ASLANT), least_profit=p)[2]) for p in (high, low))
    assert few <= many


def test_nothing_but_unprofitable_nodes_left_is_complete():
    """With all stages of refinement, coverage and finer edges too: there is nothing more to do."""
    view = case(RAMP, ASLANT)
    algorithm, state, squares = built(view, least_profit=1e12, cover=True, finest_ratio=1 / 16)
    assert levels(squares) == {0}
    assert algorithm.status(state) is Status.COMPLETE
    state = algorithm.update(state, view.eye, view.frame, view.rays)
    assert (levels(squares_of(state)), algorithm.status(state)) == ({0}, Status.COMPLETE)


@pytest.mark.parametrize("setting", [{"discontinuity": 1.0}, {"least_profit": 1e12}, {}])
def test_updates_for_a_moving_view_keep_to_them(setting):
    """An eye goes on for eight frames: no node is made where the settings ask for none; without
    them some are."""
    view = case(SQUARE, ASLANT)
    algorithm, state, _ = built(view, **({**setting} or {"ratio_target": 16.0}))
    algorithm = replace(PLAIN, **setting)
    for k in range(8):
        there = case(SQUARE, ASLANT, 0.05 * (k + 1))
        state = algorithm.update(state, there.eye, view.frame, there.rays)
        assert algorithm.status(state) is Status.FOLLOWED
    assert (levels(squares_of(state)) == {0}) == bool(setting)


@pytest.mark.parametrize("name", ["discontinuity", "least_profit"])
@pytest.mark.parametrize("value", [-1e-9, math.nan, math.inf, -math.inf])
def test_no_distance_and_no_profit_are_told_in_one_line(name, value):
    with pytest.raises(UseError, match=f"{name}=.* allowed: a finite number, 0 or more") as caught:
        AdaptiveShadowMap(**{name: value})
    assert "\n" not in str(caught.value)
