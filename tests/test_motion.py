"""Casters and lights that move: nothing stale is kept, and nothing is cast that cannot differ."""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import Case, analytic_case, case_of, unit_frame
from helpers.counting import CountingRays
from helpers.poses import KINDS, Kind, random_pose
from helpers.registry import FAST
from helpers.slow_tree import Square, held_by, random_squares, requests_for, squares_of, tree_shape

from asmjax.geometry import LightFrame
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import a4_disc_light
from asmjax.scene.spec import Mesh, Rectangle, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, NodeCounts
from asmjax.shadow.adaptive.motion import touched
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.shape import GUARD, page_windows
from asmjax.shadow.adaptive.tree import empty_tree
from asmjax.shadow.comparison import pack_prim

SIDE = 64
"""Pixels a side."""

LIGHTS = ("a4_disc_light", "a6_sphere", "a6_sphere_sun")
"""A point light with one face, one with three, and parallel rays."""

each_light = pytest.mark.parametrize("name", LIGHTS)


def asm(**settings) -> AdaptiveShadowMap:
    known: dict[str, Any] = {
        "memory_bytes": 2**18, "node_resolution": 8, "start_resolution": 32, "pixel_share": 1,
    }  # fmt: skip
    return AdaptiveShadowMap(**known | settings, cost_model=FAST)


def counted(algorithm: AdaptiveShadowMap, state) -> NodeCounts:
    """What became of the state's nodes."""
    nodes = algorithm.cost(state).nodes
    assert nodes is not None
    return nodes


def shifted(case: Case, shift) -> tuple[Case, np.ndarray]:
    """The case with its casters moved, light frame and view as they were; and the box (1, 3, 2)
    that holds them where they were and where they are."""
    casters = [
        replace(shape, centre=tuple((np.asarray(shape.centre) + shift).tolist()))
        for shape in case.shapes[1:]
        if not isinstance(shape, Mesh)
    ]
    shapes = (case.shapes[0], *casters)
    box = scene_bounds([*case.shapes[1:], *casters])[None]
    eye = analytic_eye(shapes, case.view)
    return replace(case, shapes=shapes, eye=eye, rays=AnalyticRays(shapes)), box


def texels_of(state) -> dict[Square, tuple[np.ndarray, np.ndarray]]:
    """Depth and packed primitive of every page that is held."""
    pages = state.pool.held()
    depth, prim = np.asarray(state.tree.depth)[pages], np.asarray(state.tree.prim)[pages]
    squares = squares_of(state.pool.squares[:, pages])
    return {square: (depth[k], prim[k]) for k, square in enumerate(squares)}


def stale_pages(state, rays) -> list[Square]:
    """The pages whose texels are not what casting them now gives, bit for bit."""
    held = texels_of(state)
    windows = page_windows(state.shape, np.array(list(held)).T)
    now = rays.light_buffer(state.frame, windows)
    depth, prim = now.depth, np.asarray(pack_prim(jnp.asarray(now.prim)))
    stale = []
    for k, (square, (old_depth, old_prim)) in enumerate(held.items()):
        if (old_depth != depth[k].ravel()).any() or (old_prim != prim[k].ravel()).any():
            stale.append(square)
    return stale


def check_tables(state) -> None:
    """The device is told of every page that was made or given up."""
    np.testing.assert_array_equal(state.tree.entries, state.pool.table.entries)


def ref_image(frame: LightFrame, face: int, box: np.ndarray, steps: int = 9):
    """Places (2, n) and axial depths (n,) of a grid of points of a box, in front of the light."""
    axes = [np.linspace(low, high, steps) for low, high in box]
    points = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    x, y, depth = frame.rotation[face] @ (points - frame.origin[:, None])
    front = depth > 0
    scale = depth[front] if frame.perspective else 1.0
    plane = np.stack([x[front], y[front]]) / scale
    return (plane - frame.corner[face][:, None]) / frame.extent[face][:, None], depth[front]


def is_in_front(frame: LightFrame, box: np.ndarray, face: int) -> bool:
    """Whether all of a box lies in front of the plane through the light."""
    axis, half = frame.rotation[face, 2], 0.5 * (box[:, 1] - box[:, 0])
    return axis @ (box.mean(axis=1) - frame.origin) > np.abs(axis) @ half


def meets(frame: LightFrame, box: np.ndarray, face: int, low, high) -> bool:
    """Whether the rectangle around a box's image meets [low, high], a rounding wider; a box that
    reaches behind a point light may be anywhere."""
    uv, _ = ref_image(frame, face, box)
    if not uv.size:
        return False
    if frame.perspective and not is_in_front(frame, box, face):
        return True
    return bool(((uv.min(axis=1) <= high + 1e-9) & (uv.max(axis=1) >= low - 1e-9)).all())


def window_rectangle(windows, k: int):
    low = windows.corner[:, k]
    return int(windows.face[k]), low, low + windows.side * windows.texel[:, k]


@each_light
def test_after_motion_every_page_is_as_if_cast_now(name):
    """Frame by frame, with a memory that is full: the visibility is that of truth but for texels
    on edges, and every texel that is kept is what its ray sees now."""
    case = analytic_case(name, SIDE)
    algorithm = asm()
    state = algorithm.build(case.eye, case.frame, case.rays)
    for k in range(1, 5):
        case, box = shifted(case, [0.15, 0.1 * (-1) ** k, -0.1])
        assert stale_pages(state, case.rays), "nothing moved"
        state = algorithm.update(state, case.eye, case.frame, case.rays, moved=box)
        assert stale_pages(state, case.rays) == []
        check_tables(state)
        assert counted(algorithm, state).recast > 0


@each_light
def test_only_pages_in_the_image_of_the_boxes_are_cast_again(name):
    """All others keep their texels, and no ray is cast for them."""
    case = analytic_case(name, SIDE)
    algorithm = asm()
    state = algorithm.build(case.eye, case.frame, case.rays)
    # At rest, pages away from the edges are made too.
    state = algorithm.update(state, case.eye, case.frame, case.rays)
    before = texels_of(state)
    after, box = shifted(case, [0.1, 0.05, -0.05])
    rays = CountingRays(after.rays)
    state = algorithm.update(state, after.eye, after.frame, rays, moved=box)
    recast = rays.windows[0]
    for k in range(recast.count):
        assert meets(case.frame, box[0], *window_rectangle(recast, k))
    windows = page_windows(state.shape, np.array(list(before)).T)
    outside = [
        square
        for k, square in enumerate(before)
        if not meets(case.frame, box[0], *window_rectangle(windows, k))
    ]
    now = texels_of(state)
    assert 10 < len(outside) < len(before) - 10
    kept = [square for square in outside if square in now]
    assert len(kept) > 10
    for square in kept:
        np.testing.assert_array_equal(now[square][0], before[square][0])
        np.testing.assert_array_equal(now[square][1], before[square][1])
    nodes = counted(algorithm, state)
    assert nodes.recast == recast.count <= len(before) - len(outside)
    assert nodes.dropped == 0


@each_light
def test_where_nothing_moved_nothing_is_cast_again(name):
    """No boxes, an empty list of them, and boxes that cast no shadow into the image."""
    case = analytic_case(name, SIDE)
    algorithm = asm()
    state = algorithm.build(case.eye, case.frame, case.rays)
    boxes = [None, np.zeros((0, 3, 2))]
    if case.frame.faces == 1:
        boxes.append(np.array([[[-1.0, 1.0], [-1.0, 1.0], [-3.0, -2.0]]]))
        # Behind a point light, beside the image of parallel rays.
        boxes.append(np.array([[[300.0, 301.0], [-1.0, 1.0], [9.0, 10.0]]]))
    for moved in boxes:
        before, rays = texels_of(state), CountingRays(case.rays)
        state = algorithm.update(state, case.eye, case.frame, rays, moved=moved)
        nodes = counted(algorithm, state)
        assert (nodes.recast, nodes.dropped) == (0, 0)
        now = texels_of(state)
        for square in before.keys() & now.keys():
            np.testing.assert_array_equal(now[square][0], before[square][0])
        check_tables(state)


def near_view(x: float) -> ViewSpec:
    """A close look at the shadow's edge of `a4_disc_light` on one side."""
    return ViewSpec("near", (x, 0.0, 1.0), (x, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0, SIDE, SIDE)


def test_touched_pages_that_nobody_used_lately_are_dropped():
    """The eye looks at one side of the shadow, then at the other one for more than a turn."""
    case = analytic_case("a4_disc_light", SIDE)
    edge = 5.0 / 3.0
    algorithm = asm(pixel_share=2)
    left, right = (analytic_eye(case.shapes, near_view(x)) for x in (-edge, edge))
    state = algorithm.build(left, case.frame, case.rays)
    for _ in range(4):
        state = algorithm.update(state, right, case.frame, case.rays)
    after, box = shifted(case, [0.01, 0.0, 0.0])
    before = set(texels_of(state))
    hit = set(squares_of(state.pool.squares[:, touched(state.pool, state.tree, case.frame, box)]))
    rays = CountingRays(after.rays)
    eye = analytic_eye(after.shapes, near_view(edge))
    state = algorithm.update(state, eye, case.frame, rays, moved=box)
    nodes = counted(algorithm, state)
    assert nodes.recast + nodes.dropped == len(hit) and nodes.recast > 0 and nodes.dropped > 0
    assert rays.windows[0].count == nodes.recast
    assert len(before - set(texels_of(state))) >= nodes.dropped
    assert stale_pages(state, after.rays) == []
    check_tables(state)
    # Level 0 is never given up: it answers wherever nothing else does.
    assert sum(square[1] == 0 for square in texels_of(state)) == state.shape.roots


def slit_scene() -> tuple[tuple[Rectangle, ...], LightFrame]:
    """Parallel light straight down on a plate with a slit of 0.02, above a floor; a small caster
    between them, beside the slit's light. Level-0 texels (1 / 8 wide) miss the slit."""
    floor = Rectangle("floor", (0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0))
    halves = [
        Rectangle(f"plate{k}", (x, 0.0, 2.0), (w, 0.0, 0.0), (0.0, 2.0, 0.0))
        for k, (x, w) in enumerate(((-2.01, 2.0), (2.01, 2.0)))
    ]
    caster = Rectangle("caster", (0.05, 0.0, 1.0), (0.03, 0.0, 0.0), (0.0, 0.5, 0.0))
    down = np.array([[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]])
    frame = LightFrame(
        origin=np.array([0.0, 0.0, 3.0]),
        rotation=down,
        corner=np.full((1, 2), -0.5),
        extent=np.full((1, 2), 1.0),
        cone_axis=np.array([0.0, 0.0, -1.0]),
        cos_cutoff=-1.0,
        near=0.0,
        perspective=False,
    )
    return (floor, *halves, caster), frame


def test_pages_given_up_serve_nobody_even_where_none_is_cast():
    """All pages that see through a slit are old, and a caster moves below it. Level 0 sees the
    plate alone, so nothing is cast again; and the eye comes back in the same frame."""
    shapes, frame = slit_scene()
    below = ViewSpec("below", (0.0, -0.01, 0.6), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, SIDE, SIDE)
    away = replace(below, target=(0.0, -0.01, 9.0))
    algorithm = asm(start_resolution=8)
    eye, nothing = analytic_eye(shapes, below), analytic_eye(shapes, away)
    state = algorithm.build(eye, frame, AnalyticRays(shapes))
    lit = np.asarray(algorithm.visibility(state, eye.points))
    assert 0.02 < lit.mean() < 0.2
    for _ in range(3):
        state = algorithm.update(state, nothing, frame, AnalyticRays(shapes))
    caster = replace(shapes[-1], centre=(0.0, 0.0, 1.0))
    box = scene_bounds([shapes[-1], caster])[None]
    shapes = (*shapes[:-1], caster)
    rays = CountingRays(AnalyticRays(shapes))
    eye = analytic_eye(shapes, below)
    hit = touched(state.pool, state.tree, frame, box)
    assert hit.size and (state.pool.squares[1, hit] > 0).all()
    state = algorithm.update(state, eye, frame, rays, moved=box)
    check_tables(state)
    assert counted(algorithm, state).dropped == hit.size
    assert stale_pages(state, rays) == []
    assert not np.asarray(algorithm.visibility(state, eye.points)).any()


def truth_of(scene_factory, view: ViewSpec, **changes) -> Case:
    scene = scene_factory(**changes)
    return case_of(scene, scene.spec.shapes, view, next(iter(scene.spec.lights.values())))


def test_a_light_that_moved_starts_anew():
    """Every node is given up; the image is that of the new light at once, and as good as a new
    build's once the view rests."""
    before = analytic_case("a4_disc_light", SIDE)
    after = truth_of(a4_disc_light, before.view, light_height=6.0)
    algorithm = asm()
    state = algorithm.build(before.eye, before.frame, before.rays)
    held = counted(algorithm, state).held
    for k in range(4):
        state = algorithm.update(state, after.eye, after.frame, after.rays)
        lit, log2 = algorithm.lookup(state, after.eye.points)
        wrong = after.wrong(lit)
        assert (after.edge_distance[wrong] < after.texel_width(log2)[wrong]).all()
        nodes = counted(algorithm, state)
        assert (nodes.dropped, nodes.recast) == (0 if k else held, 0)
        assert k or nodes.made >= state.shape.roots
        assert stale_pages(state, after.rays) == []
        check_tables(state)
    new = algorithm.build(after.eye, after.frame, after.rays)
    usual = after.error(algorithm.visibility(new, after.eye.points))
    assert after.error(lit) <= 1.5 * usual + 2 / after.judged.sum()
    assert after.error(algorithm.visibility(new, before.eye.points)) < 0.1


def test_a_light_that_needs_other_faces_starts_anew():
    """From one face to three: the tree has another shape."""
    before, after = (analytic_case(name, SIDE) for name in ("a4_disc_light", "a6_sphere"))
    assert before.frame.faces != after.frame.faces
    algorithm = asm()
    state = algorithm.build(before.eye, before.frame, before.rays)
    held = state.pool.used_pages
    state = algorithm.update(state, after.eye, after.frame, after.rays)
    nodes = algorithm.cost(state).nodes
    assert nodes is not None and nodes.dropped == held
    lit, log2 = algorithm.lookup(state, after.eye.points)
    wrong = after.wrong(lit)
    assert (after.edge_distance[wrong] < after.texel_width(log2)[wrong]).all()
    assert after.error(lit) < 0.02


# Which pages are touched.


def filled(shape, depth=5.0, seed=None):
    """A pool with roots (and random pages), and a tree whose texels are all at `depth`."""
    pool = NodePool(shape)
    pool.admit(pool.roots(), 1, 1, False)
    if seed is not None:
        squares = random_squares(np.random.default_rng(seed), shape, 30)
        pool.admit(requests_for(squares), 1, 1, False)
    tree = empty_tree(shape, "both")
    assert tree.depth is not None
    return pool, eqx.tree_at(lambda t: t.depth, tree, jnp.full_like(tree.depth, depth))


ROOTS = tree_shape(log2_node=3, log2_roots=2, log2_top=2)
"""4 x 4 roots of 8 x 8 texels: the guard band is 1 / 32 wide."""


@pytest.mark.parametrize(
    ("x", "y", "z", "expected"),
    [
        ((0.30, 0.45), (0.55, 0.60), (1, 2), {(1, 2)}),
        # Up to the guard band of the next column: [0.46875, ...].
        ((0.30, 0.468), (0.55, 0.60), (1, 2), {(1, 2)}),
        ((0.30, 0.470), (0.55, 0.60), (1, 2), {(1, 2), (2, 2)}),
        ((-1.0, 2.0), (0.10, 0.15), (1, 2), {(0, 0), (1, 0), (2, 0), (3, 0)}),
        # Behind all texels; at their depth; before the plane from which depth counts.
        ((0.30, 0.45), (0.55, 0.60), (5.1, 9), set()),
        ((0.30, 0.45), (0.55, 0.60), (5, 9), {(1, 2)}),
        ((0.30, 0.45), (0.55, 0.60), (-2, -1), {(1, 2)}),
        ((1.1, 1.2), (0.55, 0.60), (1, 2), set()),
    ],
)
def test_parallel_light_touches_the_pages_below_a_box(x, y, z, expected):
    pool, tree = filled(ROOTS)
    box = np.array([x, y, z], float)
    for boxes in (box[None], np.stack([box, box])):
        pages = touched(pool, tree, unit_frame(False), boxes)
        assert {(c, r) for _, _, c, r in squares_of(pool.squares[:, pages])} == expected


@pytest.mark.parametrize(
    ("z", "expected"),
    [
        # x / z from 0.6 / 2 to 0.9 / 1, y / z from 0.1 / 2 to 0.2 / 1.
        ((1, 2), {(1, 0), (2, 0), (3, 0)}),
        ((2, 2), {(1, 0)}),
        ((-2, -1), set()),
        ((-2, 0), set()),
        # It reaches behind the light: anywhere in the image.
        ((-1, 1), {(c, r) for c in range(4) for r in range(4)}),
        ((6, 7), set()),
    ],
)
def test_a_point_light_touches_the_pages_behind_a_box(z, expected):
    pool, tree = filled(ROOTS)
    box = np.array([[[0.6, 0.9], [0.1, 0.2], z]], float)
    pages = touched(pool, tree, unit_frame(True), box)
    assert {(c, r) for _, _, c, r in squares_of(pool.squares[:, pages])} == expected


def test_depths_that_are_not_known_or_endless_touch():
    """Texels that see nothing, and a map of primitives alone."""
    box = np.array([[[0.3, 0.45], [0.55, 0.6], [100.0, 101.0]]])
    pool, tree = filled(ROOTS)
    assert touched(pool, tree, unit_frame(False), box).size == 0
    pool, tree = filled(ROOTS, depth=np.inf)
    assert touched(pool, tree, unit_frame(False), box).size == 1
    assert touched(pool, empty_tree(ROOTS, "id"), unit_frame(False), box).size == 1


@pytest.mark.parametrize("kind", KINDS)
def test_no_page_that_a_box_may_darken_is_missed(kind: Kind):
    """Points of random boxes, near the light and behind it too: a page that one of them lies over,
    no farther away than some texel of the page, is touched. Of a box in front of the light no
    page is touched beside the rectangle around its image."""
    missed_none = spared = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        pose = random_pose(seed % 5, kind)
        frame = pose.frame
        shape = tree_shape(3, 1, 0, levels=5, faces=frame.faces, pages=60, log2_top=1)
        pool, tree = filled(shape, depth=rng.uniform(2, 9), seed=seed)
        centre = pose.world[:, rng.integers(pose.world.shape[1])]
        towards = frame.origin if frame.perspective else centre
        centre = centre + (towards - centre) * rng.choice([0.0, 0.5, 1.0]) * rng.random()
        half = rng.uniform(0.01, 0.5, 3)
        box = np.stack([centre - half, centre + half], axis=1)
        found = set(squares_of(pool.squares[:, touched(pool, tree, frame, box[None])]))
        for square in held_by(pool):
            face, level, column, row = square
            size = np.ldexp(1.0, -int(shape.log2_nodes_at(level)))
            band = GUARD * np.ldexp(1.0, -int(shape.log2_resolution(level)))
            low = np.array([column, row]) * size - band
            high = low + size + 2 * band
            uv, depth = ref_image(frame, face, box, 7)
            inside = ((uv >= low[:, None]) & (uv <= high[:, None])).all(axis=0)
            if (inside & (depth <= float(tree.depth[0, 0]))).any():
                assert square in found
                missed_none += 1
            if not meets(frame, box, face, low, high):
                assert square not in found
                spared += 1
    assert missed_none > 100 and spared > 100
