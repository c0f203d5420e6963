"""Finding pages and texels of a tree: against dictionaries, rational numbers and flat maps."""

from fractions import Fraction

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.registry import FAST, NEVER
from helpers.slow_tree import (
    SlowTree,
    random_squares,
    receivers_at,
    requests_for,
    tree_shape,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from asmjax.buffers import light_offset, project
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap
from asmjax.shadow.adaptive.address import fixed_point
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.refine import analyse
from asmjax.shadow.adaptive.tree import (
    GUARD,
    empty_tree,
    find_pages,
    lookup,
    page_windows,
    store_pages,
)
from asmjax.shadow.comparison import BIAS, Compare

COUNT = 64
SHAPES = (
    tree_shape(pages=60),
    tree_shape(log2_node=3, log2_cells=2, log2_roots=0, levels=5, faces=3, pages=50),
    tree_shape(log2_node=6, log2_cells=3, log2_roots=1, levels=6, faces=2, pages=48),
)
"""c = 2, 4, 8 cells a side; nodes of 16, 8, 64 texels; the last reaches 2^25 texels a side."""

_find_pages = eqx.filter_jit(find_pages)
_lookup = eqx.filter_jit(lookup)


def grown(shape, seed):
    """A random tree: device tables, and its twin."""
    pool, slow = NodePool(shape), SlowTree(shape)
    roots = pool.roots()
    pool.insert(roots)
    rows = zip(roots.face, roots.level, roots.column, roots.row, strict=True)
    slow.insert([(int(f), int(v), int(c), int(r)) for f, v, c, r in rows])
    wanted = random_squares(np.random.default_rng(seed), shape, 30)
    pool.insert(requests_for(wanted))
    slow.insert(wanted)
    tree = empty_tree(shape, "both")
    level = np.zeros(shape.pages + 1, np.int32)
    level[: pool.used_pages] = pool.squares[1, : pool.used_pages]
    tree = eqx.tree_at(
        lambda t: (t.child, t.page, t.level),
        tree,
        (jnp.array(pool.child), jnp.array(pool.page), jnp.array(level)),
    )
    return tree, slow


def probes(shape, slow, rng):
    """Faces (n,) and float32 points (2, n): on the borders of pages, beside them, and anywhere."""
    chosen = rng.choice(len(slow.pages), COUNT)
    squares = np.array(sorted(slow.pages, key=slow.pages.__getitem__))[chosen].T
    face, level, column, row = squares
    size = np.ldexp(1.0, -shape.log2_nodes_at(level))
    corner = np.stack([column, row]) * size
    inside = rng.choice([0.0, 1.0, 0.5, -1e-9], (2, COUNT)) * size + corner
    uv = np.float32(inside)
    uv = np.nextafter(uv, uv + rng.choice([-1, 0, 1], uv.shape)).astype(np.float32)
    anywhere = rng.random((2, COUNT), np.float32)
    uv = np.where(rng.random(COUNT) < 0.2, anywhere, uv)
    return face, np.clip(uv, 0, np.nextafter(np.float32(1), np.float32(0)))


@pytest.mark.parametrize("shape", SHAPES, ids=["c2", "c4", "c8"])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_find_pages_is_the_slow_descent(shape, seed):
    """Every point is served by the deepest page over it, borders included."""
    tree, slow = grown(shape, seed)
    face, uv = probes(shape, slow, np.random.default_rng(seed))
    receivers = receivers_at(face, uv)
    got = _find_pages(shape, tree, receivers, fixed_point(receivers.uv))
    expected = [
        slow.find(int(f), Fraction(float(x)), Fraction(float(y)))
        for f, (x, y) in zip(face, uv.T, strict=True)
    ]
    np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("shape", SHAPES, ids=["c2", "c4", "c8"])
@pytest.mark.parametrize("seed", range(4))
def test_lookup_reads_the_one_texel_that_holds_the_point(shape, seed):
    """All texels are dark but those that the twin says the points lie in: all points are lit, and
    none with the texels beside them lit instead."""
    tree, slow = grown(shape, seed)
    face, uv = probes(shape, slow, np.random.default_rng(seed))
    side, squares = shape.side, sorted(slow.pages, key=slow.pages.__getitem__)
    own = np.zeros((shape.pages + 1, side, side), np.float32)
    levels = []
    for f, (x, y) in zip(face, uv.T, strict=True):
        page = slow.find(int(f), Fraction(float(x)), Fraction(float(y)))
        _, level, column, row = squares[page]
        texels = 2 ** int(shape.log2_resolution(level))
        at = [int(Fraction(float(t)) * texels) for t in (x, y)]
        own[page, at[1] - (row << shape.log2_node) + GUARD, at[0] - (column << shape.log2_node)
            + GUARD] = 2.0  # fmt: skip
        levels.append(level)
    for depth, lit in ((own, True), (2.0 - own, False)):
        full = eqx.tree_at(lambda t: t.depth, tree, jnp.array(depth.reshape(shape.pages + 1, -1)))
        full = eqx.tree_at(lambda t: t.prim, full, None)
        got, level = _lookup(shape, full, receivers_at(face, uv), bias=BIAS, perspective=False)
        assert (np.asarray(got) == lit).all()
        np.testing.assert_array_equal(level, levels)


@pytest.mark.parametrize("shape", SHAPES, ids=["c2", "c4", "c8"])
def test_windows_cover_their_squares_and_one_texel_more(shape):
    """First and last texel centre of each page, exactly, at every level."""
    level = np.arange(shape.levels + 1)
    last = (1 << shape.log2_nodes_at(level)) - 1
    windows = page_windows(shape, np.zeros_like(level), level, last, 0 * level)
    for k in range(level.size):
        texel = Fraction(1, 2 ** int(shape.log2_resolution(level[k])))
        assert Fraction(windows.texel[0, k]) == Fraction(windows.texel[1, k]) == texel
        begin = Fraction(int(last[k]), int(last[k]) + 1)
        assert Fraction(windows.corner[0, k]) == begin - GUARD * texel
        assert Fraction(windows.corner[1, k]) == -GUARD * texel
        assert Fraction(windows.corner[0, k]) + windows.side * texel == 1 + GUARD * texel


def test_store_pages_writes_its_pages_and_no_others():
    """Padding lands in the spare page; ids keep their low 16 bits."""
    shape = tree_shape(log2_node=3, pages=5)
    tree = empty_tree(shape, "both")
    rng = np.random.default_rng(0)
    depth = rng.random((4, shape.side, shape.side), np.float32)
    prim = rng.integers(0, 2**20, (4, shape.side, shape.side)).astype(np.int32)
    pages = np.array([3, 1, 5, 5], np.int32)
    new_level = np.array([2, 4, 0, 0], np.int32)
    level, got_depth, got_prim = store_pages(
        tree.level, tree.depth, tree.prim, pages, new_level, depth, prim
    )
    np.testing.assert_array_equal(level[:5], [0, 4, 0, 2, 0])
    for page, k in ((3, 0), (1, 1)):
        np.testing.assert_array_equal(got_depth[page], depth[k].ravel())
        np.testing.assert_array_equal(got_prim[page], prim[k].ravel() & 0xFFFF)
    assert not np.asarray(got_depth)[[0, 2, 4]].any()


def flat_twin(case, resolution):
    """Receivers, what the flat map says about their stencils, and whose stencils are comparable."""
    receivers = project(case.eye.points, case.frame, light_offset(case.eye.points, case.frame))
    flat = UniformShadowMap(resolution, "both")
    straddles = flat.straddling(flat.build(case.eye, case.frame, case.rays), receivers)
    # The flat map repeats its border texels where the tree has a guard band; and receivers within
    # half a degree of edge-on turn a rounding of an offset into another depth.
    at = np.asarray(receivers.uv) * resolution
    inside = ((at > 1) & (at < resolution - 1)).all(axis=0) & (np.asarray(receivers.secant) < 100)
    return receivers, np.asarray(straddles), inside


@pytest.mark.parametrize(
    ("name", "node", "least"), [("a4_disc_light", 8, 20), ("a6_sphere", 32, 2)]
)
def test_stencils_across_page_borders_are_those_of_a_flat_map(name, node, least):
    """256 texels a side in pages of 8 or 32: many 2 x 2 stencils lie across borders of pages, and
    the guard band gives them the same texels as one flat map."""
    case = analytic_case(name, 128)
    algorithm = AdaptiveShadowMap(
        node_resolution=node,
        start_resolution=256,
        cover=False,
        ratio_target=NEVER,
        finest_ratio=NEVER,
        cost_model=FAST,
    )
    state = algorithm.build(case.eye, case.frame, case.rays)
    receivers, expected, inside = flat_twin(case, 256)
    zero = jnp.zeros(case.eye.points.count)
    got = analyse(
        state.shape, state.tree, receivers, zero, 0.0, 0.0, BIAS, case.frame.perspective
    )  # fmt: skip
    np.testing.assert_array_equal(np.asarray(got.straddles)[inside], expected[inside])
    near = np.abs((np.asarray(receivers.uv) * 256 / node + 0.5) % 1 - 0.5).min(axis=0) < 0.5 / node
    assert (near & inside & expected).sum() > least, "no stencil lies across a border"


def test_each_level_of_a_refined_tree_is_the_flat_map_of_its_resolution():
    """Pages of all levels side by side: each receiver's answer is that of the flat map with as
    many texels as the page that serves it."""
    case = analytic_case("a4_disc_light", 128)
    algorithm = AdaptiveShadowMap(
        memory_bytes=2**20, start_resolution=64, cover=False, finest_ratio=1 / 4, cost_model=FAST
    )
    state = algorithm.build(case.eye, case.frame, case.rays)
    lit, log2 = (np.asarray(x) for x in algorithm.lookup(state, case.eye.points))
    found = np.unique(log2[case.eye.valid])
    assert found.size >= 3
    for level in found:
        flat = UniformShadowMap(1 << int(level), "both")
        expected = flat.visibility(flat.build(case.eye, case.frame, case.rays), case.eye.points)
        served = log2 == level
        np.testing.assert_array_equal(lit[served], np.asarray(expected)[served])


def test_empty_trees_hold_what_is_compared():
    shape = tree_shape()
    cases: tuple[tuple[Compare, bool, bool], ...] = (
        ("depth", True, False),
        ("id", False, True),
        ("both", True, True),
    )
    for compare, depth, prim in cases:
        tree = empty_tree(shape, compare)
        assert ((tree.depth is not None), (tree.prim is not None)) == (depth, prim)
        assert not (np.asarray(tree.child) >= 0).any() and not (np.asarray(tree.page) >= 0).any()
        assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(tree))
