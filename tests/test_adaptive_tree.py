"""Texels of a tree: what a receiver reads, and that pages side by side are one flat map."""

from fractions import Fraction

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.poses import projected
from helpers.registry import FAST, NEVER
from helpers.slow_tree import (
    address_at,
    deepest_over,
    held_by,
    random_squares,
    receivers_at,
    requests_for,
    tree_shape,
)

from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap
from asmjax.shadow.adaptive.look import analyse, audience_of
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.shape import GUARD, TreeShape, page_windows
from asmjax.shadow.adaptive.tree import Tree, empty_tree, lookup, store_pages
from asmjax.shadow.comparison import BIAS, Compare, pack_prim

COUNT = 64
SHAPES = (
    tree_shape(pages=60),
    tree_shape(3, 2, 0, levels=5, faces=3, pages=50, log2_top=2, tables=60),
    tree_shape(6, 3, 1, levels=5, faces=2, pages=48, log2_top=3, tables=80),
)
"""c = 2, 4, 8 cells a side; nodes of 16, 8, 64 texels; the last reaches 2^22 texels a side."""

each_shape = pytest.mark.parametrize("shape", SHAPES, ids=["c2", "c4", "c8"])

_lookup = eqx.filter_jit(lookup)


def grown(shape: TreeShape, seed: int) -> NodePool:
    pool = NodePool(shape)
    pool.admit(pool.roots(), 1, 1, False)
    pool.admit(requests_for(random_squares(np.random.default_rng(seed), shape, 30)), 1, 1, False)
    return pool


def probes(shape: TreeShape, squares, rng):
    """Faces (n,) and places (2, n) in [0, 1): on the borders of texels, beside them, anywhere."""
    face, level, *index = np.array([squares[k] for k in rng.choice(len(squares), COUNT)]).T
    texels = np.exp2(shape.log2_resolution(level))
    at = np.stack(index) * 2**shape.log2_node + rng.integers(0, 2**shape.log2_node, (2, COUNT))
    uv = (at + rng.choice([0.0, 0.5, 2.0**-12, 1 - 2.0**-5], (2, COUNT))) / texels
    uv = np.where(rng.random(COUNT) < 0.2, rng.random((2, COUNT)), uv)
    return face, np.floor(np.clip(uv, 0, 1 - 2.0**-30) * 2.0**30) / 2.0**30


@each_shape
@pytest.mark.parametrize("seed", range(4))
def test_lookup_reads_the_one_texel_that_holds_the_point(shape, seed):
    """All texels are dark but those that the slow search says the points lie in: all points are
    lit, and none with the texels beside them lit instead."""
    pool = grown(shape, seed)
    numbers = dict(zip(held_by(pool), pool.held().tolist(), strict=True))
    face, uv = probes(shape, list(numbers), np.random.default_rng(seed))
    side = shape.side
    own = np.zeros((shape.pages + 1, side, side), np.float32)
    levels = []
    for f, (x, y) in zip(face, uv.T.tolist(), strict=True):
        square = deepest_over(shape, numbers, int(f), x, y)
        _, level, column, row = square
        texels = 2 ** int(shape.log2_resolution(level))
        local = [int(x * texels) - (column << shape.log2_node) + GUARD]
        local += [int(y * texels) - (row << shape.log2_node) + GUARD]
        own[numbers[square], local[1], local[0]] = 2.0
        levels.append(level)
    receivers, address = receivers_at(face, uv.astype(np.float32)), address_at(uv)
    assert len(set(levels)) > 2
    for depth, lit in ((own, True), (2.0 - own, False)):
        texels = jnp.array(depth.reshape(shape.pages + 1, -1))
        tree = Tree(jnp.array(pool.table.entries), texels, None)
        got, level = _lookup(shape, tree, receivers, address, bias=BIAS, perspective=False)
        assert (np.asarray(got) == lit).all()
        np.testing.assert_array_equal(level, levels)


@each_shape
def test_windows_cover_their_squares_and_one_texel_more(shape):
    """First and last texel centre of each page, exactly, at every level."""
    level = np.arange(shape.levels + 1)
    last = (1 << shape.log2_nodes_at(level)) - 1
    windows = page_windows(shape, np.stack([0 * level, level, last, 0 * level]))
    for k in range(level.size):
        texel = Fraction(1, 2 ** int(shape.log2_resolution(level[k])))
        assert Fraction(windows.texel[0, k]) == Fraction(windows.texel[1, k]) == texel
        begin = Fraction(int(last[k]), int(last[k]) + 1)
        assert Fraction(windows.corner[0, k]) == begin - GUARD * texel
        assert Fraction(windows.corner[1, k]) == -GUARD * texel
        assert Fraction(windows.corner[0, k]) + windows.side * texel == 1 + GUARD * texel


def test_store_pages_writes_its_pages_and_no_others():
    """Padding lands in the spare page; ids are packed."""
    shape = tree_shape(log2_node=3, pages=5)
    tree = empty_tree(shape, "both")
    rng = np.random.default_rng(0)
    depth = rng.random((4, shape.side, shape.side), np.float32)
    prim = rng.integers(0, 2**20, (4, shape.side, shape.side)).astype(np.int32)
    pages = np.array([3, 1, 5, 5], np.int32)
    got_depth, got_prim = store_pages(tree.depth, tree.prim, pages, depth, prim)
    for page, k in ((3, 0), (1, 1)):
        np.testing.assert_array_equal(got_depth[page], depth[k].ravel())
        np.testing.assert_array_equal(got_prim[page], pack_prim(prim[k].ravel()))
    for array in (got_depth, got_prim):
        assert not np.asarray(array)[[0, 2, 4]].any()


def flat_twin(case, resolution):
    """What the flat map says about the receivers' stencils, and whose stencils are comparable."""
    receivers = projected(case.eye.points, case.frame)
    flat = UniformShadowMap(resolution, compare="both")
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
        memory_bytes=2**21,
        node_resolution=node,
        start_resolution=256,
        cover=False,
        ratio_target=NEVER,
        finest_ratio=NEVER,
        cost_model=FAST,
    )
    state = algorithm.build(case.eye, case.frame, case.rays)
    receivers, expected, inside = flat_twin(case, 256)
    got = analyse(
        state.tree,
        audience_of(case.eye, case.frame, "axis"),
        0.0,
        0.0,
        BIAS,
        shape=state.shape,
        perspective=case.frame.perspective,
    )
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
    assert (found <= 11).sum() >= 3
    # Finer flat maps take longer than they tell.
    for level in found[found <= 11]:
        flat = UniformShadowMap(1 << int(level), compare="both")
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
        assert tree.entries.shape == (shape.entries,) and not np.asarray(tree.entries).any()
        assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(tree))
