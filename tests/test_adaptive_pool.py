"""Node and page tables against a tree in dictionaries (`helpers.slow_tree`)."""

import numpy as np
import pytest
from helpers.slow_tree import SlowTree, random_squares, requests_for, tree_shape, walked
from hypothesis import given
from hypothesis import strategies as st

from asmjax.shadow.adaptive.pool import NodePool


def both(shape):
    """Pool and twin, with their roots."""
    pool, slow = NodePool(shape), SlowTree(shape)
    roots = pool.roots()
    pages, left = pool.insert(roots)
    squares = list(zip(*(x.tolist() for x in (roots.face, roots.level, roots.column, roots.row)),
                       strict=True))  # fmt: skip
    assert slow.insert(squares) == (pages.tolist(), left)
    return pool, slow


def check_equal(pool, slow):
    squares = walked(pool)
    assert set(squares) == slow.nodes
    assert {s: page for s, page in squares.items() if page >= 0} == slow.pages
    assert pool.used_pages == len(slow.pages) and pool.used_nodes == len(slow.nodes)
    assert pool.free_pages == pool.shape.pages - pool.used_pages
    listed = [tuple(x) for x in pool.squares[:, : pool.used_pages].T.tolist()]
    assert listed == sorted(slow.pages, key=slow.pages.__getitem__)


shapes = st.builds(
    tree_shape,
    log2_node=st.integers(3, 6),
    log2_cells=st.integers(1, 3),
    log2_roots=st.integers(0, 2),
    levels=st.integers(1, 5),
    faces=st.integers(1, 6),
    # Six faces of 4 x 4 roots need 96 pages; the tables are filled to the brim in some examples.
    pages=st.integers(100, 140),
    nodes=st.integers(100, 200),
)


@given(shape=shapes, seed=st.integers(0, 2**32 - 1), sizes=st.lists(st.integers(0, 60), max_size=5))
def test_insert_is_the_slow_tree(shape, seed, sizes):
    """Any sequence of requests: same nodes, each once, same pages in the same order, and the same
    count of what did not fit into the node table."""
    pool, slow = both(shape)
    most = sum(4 ** int(shape.log2_nodes_at(level)) for level in range(1, shape.levels + 1))
    squares = random_squares(
        np.random.default_rng(seed), shape, min(sum(sizes), shape.faces * most // 4)
    )
    for size in sizes:
        some, squares = squares[:size], squares[size:]
        some = [square for square in some if square not in slow.pages]
        pages, left = pool.insert(requests_for(some))
        assert (pages.tolist(), left) == slow.insert(some)
        check_equal(pool, slow)


def test_roots_come_first_and_in_node_order():
    shape = tree_shape(log2_roots=1, faces=3)
    pool, _ = both(shape)
    np.testing.assert_array_equal(pool.page[: shape.roots], np.arange(shape.roots))
    np.testing.assert_array_equal(pool.squares[:, 6], [1, 0, 0, 1])


def test_ancestors_are_made_once_and_own_no_page():
    """Two neighbours at level 4 share three ancestors; one of these gets its page later."""
    pool, slow = both(tree_shape())
    pool.insert(requests_for([(0, 4, 0, 0), (0, 4, 1, 0)]))
    slow.insert([(0, 4, 0, 0), (0, 4, 1, 0)])
    assert pool.used_nodes == 4 + 3 + 2 and pool.used_pages == 4 + 2
    pool.insert(requests_for([(0, 2, 0, 0)]))
    slow.insert([(0, 2, 0, 0)])
    assert pool.used_nodes == 4 + 3 + 2 and pool.used_pages == 4 + 3
    check_equal(pool, slow)


def test_full_pages_take_the_first_requests():
    pool, slow = both(tree_shape(pages=6))
    squares = [(0, 1, k, 0) for k in range(4)]
    pages, left = pool.insert(requests_for(squares))
    assert pages.tolist() == [4, 5] and left == 0 and pool.free_pages == 0
    slow.insert(squares)
    check_equal(pool, slow)
    pages, left = pool.insert(requests_for([(0, 1, 3, 3)]))
    assert pages.size == 0 and left == 0
    check_equal(pool, slow)


@pytest.mark.parametrize(("nodes", "made"), [(6, 0), (9, 0), (10, 0), (11, 1), (12, 2)])
def test_full_node_table_is_counted(nodes, made):
    """Two chains of four nodes below different roots, made level by level beside the 4 roots."""
    pool, slow = both(tree_shape(nodes=nodes))
    squares = [(0, 4, 0, 0), (0, 4, 31, 31)]
    pages, over = pool.insert(requests_for(squares))
    assert (pages.tolist(), over) == slow.insert(squares)
    assert (pages.size, over) == (made, 2 - made)
    check_equal(pool, slow)


def test_no_requests_change_nothing():
    pool, slow = both(tree_shape())
    pages, left = pool.insert(requests_for([]))
    assert pages.size == 0 and left == 0
    check_equal(pool, slow)
