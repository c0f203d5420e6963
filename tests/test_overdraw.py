"""Overdraw against brute force: linear programs, clipped polygons, and triangle by triangle."""

import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from scipy.optimize import linprog

from asmjax.errors import UseError
from asmjax.experiment.overdraw import (
    CasterBoxes,
    Overdraw,
    Part,
    caster_boxes,
    chunks,
    drawn_by,
    meets,
    overdraw,
    parts_of,
)
from asmjax.shadow import SubdividedShadowMap, TrapezoidalShadowMap


def ref_meets(corners: np.ndarray, low, high) -> bool:
    """Whether some weights of the corners give a point inside the box."""
    found = linprog(
        np.zeros(corners.shape[1]),
        A_ub=np.vstack([corners, -corners]),
        b_ub=np.concatenate([high, -np.asarray(low)]),
        A_eq=np.ones((1, corners.shape[1])),
        b_eq=[1.0],
    )
    return found.status == 0


@pytest.mark.parametrize("seed", range(6))
def test_boxes_meet_polygons_as_linear_programs_say(seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 4 + seed % 3))
    corners = np.stack([np.cos(angle), 0.4 * np.sin(angle)])
    turn = rng.uniform(0, np.pi)
    corners = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ corners
    if seed % 2:
        corners = corners[:, ::-1]
    low = rng.uniform(-1.6, 1.2, (2, 40))
    boxes = CasterBoxes(low, low + rng.uniform(0, 0.7, (2, 40)), np.zeros(40))
    expected = [ref_meets(corners, boxes.low[:, k], boxes.high[:, k]) for k in range(40)]
    assert 5 < sum(expected) < 38
    np.testing.assert_array_equal(meets(corners, boxes), expected)


def test_what_lies_behind_all_receivers_is_not_drawn():
    square = np.array([[0.0, 1, 1, 0], [0, 0, 1, 1]])
    low = np.array([[0.2, 0.2, 3.0], [0.2, 0.2, 0.2]])
    boxes = CasterBoxes(low, low + 0.1, np.array([1.0, 9.0, 1.0]))
    parts = [Part(square, 5.0), Part(square + 0.25, 20.0), Part(square, -np.inf)]
    expected = [[True, False, False], [True, True, False], [False, False, False]]
    np.testing.assert_array_equal(drawn_by(parts, boxes), expected)
    found = overdraw(parts, parts[:1], boxes)
    assert found == Overdraw(parts=3, renderings=3, drawn=2, one_map=1)
    assert (found.factor, found.against_one_map) == (1.5, 3.0)
    assert set(found.record()) >= {"factor", "against_one_map", "renderings"}


def test_bounds_are_those_of_the_triangles_one_by_one():
    case = analytic_case("a6_sphere_sun", 24)
    rng = np.random.default_rng(3)
    corners = [rng.normal(size=(3, 60)) for _ in range(3)]
    owner = rng.integers(0, 7, 60)
    boxes = caster_boxes(corners, owner, case.frame)
    assert boxes.count == np.unique(owner).size
    for k, number in enumerate(np.unique(owner)):
        own = np.concatenate([c[:, owner == number] for c in corners], axis=1)
        seen = case.frame.rotation[0] @ (own - case.frame.origin[:, None])
        np.testing.assert_allclose(boxes.low[:, k], seen[:2].min(axis=1), rtol=1e-12)
        np.testing.assert_allclose(boxes.high[:, k], seen[:2].max(axis=1), rtol=1e-12)
        np.testing.assert_allclose(boxes.depth[k], seen[2].min(), rtol=1e-12)


@pytest.mark.parametrize("parts", [1, 3])
def test_every_receiver_lies_in_a_part_as_a_tiny_object(parts):
    """Objects of a point's size: each visible receiver is drawn, by few parts more than one."""
    case = analytic_case("a6_sphere_sun", 48)
    frame, view = case.frame, case.eye
    world = view.world[:, view.valid & (view.normal.T @ frame.rotation[0, 2] < 0)]
    # A rounding nearer to the light, as the deepest one is at the limit itself.
    world = world - 1e-9 * frame.rotation[0, 2][:, None]
    boxes = caster_boxes([world] * 3, np.arange(world.shape[1]), frame)
    one = parts_of(TrapezoidalShadowMap(64).charts(view, frame), view, frame)
    several = parts_of(SubdividedShadowMap(64, parts=parts).charts(view, frame), view, frame)
    assert len(one) == 1 < len(several)
    found = overdraw(several, one, boxes)
    assert found.drawn == found.one_map == world.shape[1]
    # Charts are fitted rectangles: beyond their neighbours' lines only the last one reaches.
    assert 1 <= found.factor < 2


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_chunks_hold_neighbours_of_one_shape(size):
    rng = np.random.default_rng(5)
    middle, shape = rng.uniform(-3, 5, (3, 400)), rng.integers(0, 3, 400)
    chunk = chunks(middle, shape, size)
    counts = np.bincount(chunk)
    assert counts.max() <= size and counts.size == sum(
        -(-int(n) // size) for n in np.bincount(shape)
    )
    assert all(np.unique(shape[chunk == k]).size == 1 for k in range(counts.size))
    if size == 7:
        spread = [np.ptp(middle[:, chunk == k], axis=1).max() for k in range(counts.size)]
        assert np.median(spread) < 0.7 * 8


def test_lamps_and_empty_chunks_are_refused():
    lamp = analytic_case("a6_sphere", 16)
    with pytest.raises(UseError, match="parallel"):
        parts_of(TrapezoidalShadowMap(64).charts(lamp.eye, lamp.frame), lamp.eye, lamp.frame)
    with pytest.raises(UseError, match="parallel"):
        caster_boxes([np.zeros((3, 1))] * 3, np.zeros(1, int), lamp.frame)
    with pytest.raises(UseError, match="1 or more"):
        chunks(np.zeros((3, 2)), np.zeros(2, int), 0)
