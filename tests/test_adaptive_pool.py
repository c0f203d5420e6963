"""Which pages exist and which go when memory is full: against dictionaries and loops.

The rules, one by one, on trees of a few pages; then any sequence of requests against
`helpers.slow_tree.SlowPool`.
"""

import copy

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import effort
from helpers.slow_tree import (
    SlowPool,
    Square,
    address_at,
    deepest_over,
    held_by,
    random_squares,
    requests_for,
    roots_of,
    squares_of,
    tables_needed,
    tree_shape,
    walk_place,
)
from hypothesis import given
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.shadow.adaptive.bounds import page_bounds
from asmjax.shadow.adaptive.page_table import find_entries, level_of, page_of
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.shape import TreeShape, shape_for
from asmjax.shadow.adaptive.tree import empty_tree
from asmjax.shadow.comparison import Compare

NOW = 10
"""The look at hand, in the tests of single rules."""


def planted(shape: TreeShape) -> NodePool:
    """A pool with its level-0 nodes."""
    pool = NodePool(shape)
    pool.admit(pool.roots(), 1, 1, False)
    return pool


def full_pool(squares: dict[Square, tuple[int, float]]) -> NodePool:
    """One root and these squares with their stamps and benefits: memory is full."""
    pool = planted(tree_shape(log2_roots=0, levels=4, pages=1 + len(squares)))
    benefit = [benefit for _, benefit in squares.values()]
    got = pool.admit(requests_for(list(squares), benefit), 1, 1, False)
    pool.stamp[got.pages] = [stamp for stamp, _ in squares.values()]
    assert pool.free_pages == 0
    return pool


def ask(pool: NodePool, squares, benefit=None, oldest=0, replace=False):
    return pool.admit(requests_for(squares, benefit), NOW, oldest, replace)


def gone(pool: NodePool, before: dict) -> set[Square]:
    return set(before) - set(held_by(pool))


A, B, C, D = (0, 1, 0, 0), (0, 1, 1, 0), (0, 1, 0, 1), (0, 1, 1, 1)
IN_A, IN_B, IN_D = (0, 2, 0, 0), (0, 2, 2, 0), (0, 2, 3, 3)
NEW = (0, 3, 7, 7)
ROOT = (0, 0, 0, 0)


def test_the_least_recently_used_go_first():
    squares = {A: (4, 1.0), B: (2, 9.0), C: (3, 1.0)}
    for wanted, expected in (([NEW], {B}), ([NEW, D], {B, C}), ([NEW, D, IN_D], {A, B, C})):
        pool = full_pool(squares)
        got = ask(pool, wanted, oldest=5)
        assert gone(pool, squares) == expected
        assert (got.pages.size, got.evicted, got.refused) == (len(wanted), len(expected), 0)


def test_what_was_used_in_the_last_rotation_stays():
    """A stamp equal to the oldest that counts as used is used; without `replace` nothing else
    makes room, however great the benefit."""
    squares = {A: (5, 1.0), B: (4, 1.0)}
    pool = full_pool(squares)
    got = ask(pool, [NEW, D], [1e9, 1e9], oldest=5)
    assert gone(pool, squares) == {B}
    assert (got.pages.size, got.evicted, got.refused) == (1, 1, 1)
    assert NEW in held_by(pool) and D not in held_by(pool)


def test_no_more_go_than_needed():
    """In a tree whose reserve is less than a page."""
    squares = {A: (2, 1.0), B: (2, 1.0), C: (2, 1.0)}
    pool = full_pool(squares)
    pool.evict(pool.unused(3)[:2])
    assert pool.free_pages == 2
    assert ask(pool, [NEW, D], oldest=5).evicted == 0
    assert ask(pool, [IN_D], oldest=5).evicted == 1


def test_room_is_made_for_the_next_looks_too():
    """A 32nd of all pages beyond those asked for, of unused ones only."""
    squares = {(0, 4, k % 16, k // 16): (2 if k < 40 else 9, 1.0) for k in range(95)}
    pool = full_pool(squares)
    assert ask(pool, [NEW], oldest=5).evicted == 1 + 96 // 32 and pool.free_pages == 3
    assert ask(pool, [(0, 3, k, 7) for k in range(3)], oldest=5).evicted == 0
    assert ask(pool, [(0, 3, k, 6) for k in range(8)], oldest=5).evicted == 8 + 3
    ask(pool, [(0, 3, k % 8, k // 8) for k in range(32)], oldest=5)
    assert all(k < 40 for k, square in enumerate(squares) if square not in held_by(pool))


def test_children_go_before_their_parents():
    """Of equal age; and a parent that was used earlier than its child waits for it."""
    for stamp_above, stamp_below in ((2, 2), (2, 3), (3, 2)):
        squares = {A: (stamp_above, 1.0), IN_A: (stamp_below, 1.0)}
        pool = full_pool(squares)
        ask(pool, [NEW], oldest=5)
        assert gone(pool, squares) == {IN_A}


def test_a_page_stays_while_one_below_it_is_used():
    squares = {A: (2, 1.0), IN_A: (7, 1.0), B: (4, 1.0)}
    pool = full_pool(squares)
    assert squares_of(pool.squares[:, pool.unused(5)]) == [B]
    got = ask(pool, [NEW, D], oldest=5)
    assert gone(pool, squares) == {B}
    assert got.refused == 1


def test_roots_never_go():
    shape = tree_shape(log2_roots=1, pages=4)
    pool = planted(shape)
    pool.stamp[:] = 0
    got = ask(pool, [NEW], [1e9], oldest=5, replace=True)
    assert (got.pages.size, got.evicted, got.refused) == (0, 0, 1)
    assert set(held_by(pool)) == set(roots_of(shape))
    assert pool.unused(1000).size == 0


@pytest.mark.parametrize(("benefit", "wins"), [(2.9, False), (3.0, False), (3.1, True)])
def test_a_used_leaf_goes_only_for_a_greater_benefit(benefit, wins):
    squares = {A: (9, 3.0), B: (9, 5.0)}
    pool = full_pool(squares)
    got = ask(pool, [NEW], [benefit], oldest=5, replace=True)
    assert gone(pool, squares) == ({A} if wins else set())
    assert (got.pages.size, got.evicted, got.refused) == (wins, wins, not wins)
    assert not wins or held_by(pool)[NEW].benefit == np.float32(benefit)


def test_benefit_never_replaces_where_it_may_not():
    squares = {A: (9, 3.0)}
    pool = full_pool(squares)
    got = ask(pool, [NEW], [100.0], oldest=5, replace=False)
    assert (got.evicted, got.refused) == (0, 1) and gone(pool, squares) == set()


def test_pages_with_pages_below_them_are_not_contested():
    squares = {A: (9, 1.0), IN_A: (9, 8.0), B: (9, 5.0)}
    pool = full_pool(squares)
    got = ask(pool, [NEW, D, IN_D], [6.0, 6.0, 9.0], oldest=5, replace=True)
    assert gone(pool, squares) == {B, IN_A}
    assert [s in held_by(pool) for s in (NEW, D, IN_D)] == [True, False, True]
    assert got.refused == 1


def test_unused_pages_go_before_any_contest():
    squares = {A: (2, 100.0), B: (9, 1.0)}
    pool = full_pool(squares)
    ask(pool, [NEW], [5.0], oldest=5, replace=True)
    assert gone(pool, squares) == {A}
    ask(pool, [D], [5.0], oldest=5, replace=True)
    assert gone(pool, squares) == {A, B}


def test_ties_go_by_depth_and_then_by_place():
    """Deeper first, then the walk: face, then rows and columns bit by bit."""
    squares = {D: (2, 1.0), IN_B: (2, 1.0), C: (2, 1.0), A: (2, 1.0), IN_D: (2, 1.0)}
    pool = full_pool(squares)
    expected = [IN_B, IN_D, A, C, D]
    assert squares_of(pool.squares[:, pool.unused(5)]) == expected
    for count in range(1, 5):
        pool = full_pool(squares)
        more = [(0, 4, k, 8) for k in range(count)]
        ask(pool, more, oldest=5)
        assert gone(pool, squares) == set(expected[:count])
    # Leaves alone are contested: D has a page below it.
    pool = full_pool(squares)
    ask(pool, [(0, 4, k, 8) for k in range(5)], [2.0] * 5, replace=True)
    assert gone(pool, squares) == {IN_B, IN_D, A, C}


def test_a_square_is_given_one_page_and_its_first_benefit():
    pool = planted(tree_shape(log2_roots=0))
    got = ask(pool, [A, B, A, A, ROOT, B], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert got.pages.size == 2 and pool.used_pages == 3 and got.refused == 0
    held = held_by(pool)
    assert (held[A].benefit, held[B].benefit) == (1.0, 2.0)
    again = ask(pool, [B, A], [7.0, 8.0])
    assert again.pages.size == 0 and held_by(pool) == held


def test_a_full_memory_takes_the_first_requests():
    pool = planted(tree_shape(log2_roots=0, pages=3))
    got = ask(pool, [D, B, C, A])
    assert got.pages.size == 2 and got.refused == 2 and pool.free_pages == 0
    assert set(held_by(pool)) == {ROOT, D, B}
    # What is held asks for no room.
    assert ask(pool, [B, D, ROOT]).refused == 0


def test_no_requests_change_nothing():
    pool = full_pool({A: (2, 1.0)})
    before = held_by(pool)
    got = ask(pool, [], oldest=100, replace=True)
    assert (got.pages.size, got.evicted, got.refused, got.no_table) == (0, 0, 0, 0)
    assert held_by(pool) == before and pool.evict(np.zeros(0, np.int32)) == 0


def test_few_requests_wait_for_more_or_for_long_enough():
    pool = planted(tree_shape(log2_roots=0))

    def gathered(squares):
        return squares_of(pool.gather(requests_for(squares), 3, 2).squares)

    assert gathered([A]) == [] and gathered([]) == []
    assert gathered([B]) == [A, B], "the first has waited for two looks"
    assert gathered([C]) == [] and gathered([D, A]) == [C, D, A], "three are enough"
    assert gathered([B]) == [] and pool.waiting.count == 1
    assert squares_of(pool.gather(requests_for([]), 0, 0).squares) == [B]
    assert pool.waiting.count == pool.waited == 0


def test_pages_are_stamped_with_the_look_that_made_them():
    pool = planted(tree_shape(log2_roots=0))
    got = ask(pool, [A])
    assert pool.stamp[got.pages].tolist() == [NOW]
    assert pool.stamp[pool.held()].tolist() == [1, NOW]


def test_tables_without_a_page_are_used_again():
    """A deep page takes four tables, all that there are; once it is gone, another one has them."""
    shape = tree_shape(3, 1, 0, levels=10, pages=9, log2_top=0, tables=4)
    near, far = (0, 10, 0, 0), (0, 10, 1023, 1023)
    pool = planted(shape)
    assert ask(pool, [near]).pages.size == 1
    refused = ask(pool, [far, A])
    assert refused.no_table == 1 and set(held_by(pool)) == {ROOT, near, A}
    pool.evict(pool.held()[[square == near for square in held_by(pool)]])
    got = ask(pool, [far])
    assert (got.pages.size, got.no_table) == (1, 0)
    assert set(held_by(pool)) == {ROOT, A, far}
    check_consistent(pool)


# Any sequence of requests.


def check_consistent(pool: NodePool) -> None:
    """What the arrays of a pool promise about each other."""
    held = pool.held()
    shape, squares = pool.shape, squares_of(pool.squares[:, held])
    assert squares == sorted(squares, key=lambda s: walk_place(shape, s))
    assert len(set(squares)) == held.size == pool.used_pages <= shape.pages
    assert np.unique(held).size == held.size
    free = np.setdiff1d(np.arange(shape.pages), held)
    assert pool.free_pages == free.size and (pool.key[free] == -1).all()
    assert (pool.key[held] == pool.key_of(pool.squares[:, held])).all()


def step(rng: np.random.Generator, pool: NodePool, slow: SlowPool, now: int, most: int) -> None:
    """One look: some pages are used, perhaps some evicted, and nodes are asked for."""
    shape = pool.shape
    for page, square in zip(pool.held(), held_by(pool), strict=True):
        if rng.random() < 0.4:
            pool.stamp[page] = slow.held[square].stamp = now
    oldest = now - int(rng.integers(0, 3))
    if rng.random() < 0.2:
        # As for casters that moved: some of the unused ones go, whatever is below them.
        unused = pool.unused(oldest)
        some = unused[rng.random(unused.size) < 0.5]
        assert pool.evict(some) == slow.evict(squares_of(pool.squares[:, some]))
    squares = random_squares(rng, shape, int(rng.integers(0, most + 1)))
    squares += [squares[k] for k in rng.integers(0, len(squares), 2)] if squares else []
    benefit = rng.integers(1, 5, len(squares)).astype(float)
    replace = bool(rng.integers(2))
    got = pool.admit(requests_for(squares, benefit), now, oldest, replace)
    asked = list(zip(squares, benefit.tolist(), strict=True))
    winners, evicted, refused = slow.admit(asked, now, oldest, replace)
    held = held_by(pool)
    without = [s for s in winners if s not in held]
    assert got.no_table == len(without)
    if without:
        assert tables_needed(shape, slow.held) > shape.tables
        slow.evict(without)
        winners = [s for s in winners if s not in without]
    assert squares_of(pool.squares[:, got.pages]) == winners
    assert (got.evicted, got.refused) == (evicted, refused)
    assert held == slow.held


def both(shape: TreeShape) -> tuple[NodePool, SlowPool]:
    """Pool and twin, with their roots."""
    pool, slow = planted(shape), SlowPool(shape)
    slow.admit([(square, np.inf) for square in roots_of(shape)], 1, 1, False)
    assert held_by(pool) == slow.held
    return pool, slow


TINY = (
    tree_shape(3, 1, 0, levels=3, pages=8, log2_top=1, tables=20),
    tree_shape(3, 1, 1, levels=2, pages=9, log2_top=3, tables=1),
    tree_shape(3, 2, 0, levels=2, faces=2, pages=7, log2_top=0, tables=20),
    tree_shape(3, 3, 0, levels=1, pages=6, log2_top=0, tables=20),
)
"""8 or 16 places a side; the third has two faces."""

LOG2_PLACES = 4


def places(shape: TreeShape):
    """Face, u and v of the middle of 16 x 16 places of each face."""
    side = 1 << LOG2_PLACES
    index = np.arange(shape.faces * side * side)
    middle = np.stack([index % side, index // side % side]) + 0.5
    return index // side**2, middle / side


def painted(shape: TreeShape, pool: NodePool) -> tuple[np.ndarray, np.ndarray]:
    """The page and level over each of `places`: all pages painted, deeper ones over others."""
    side = 1 << LOG2_PLACES
    page, level = np.zeros((2, shape.faces, side, side), int)
    numbers = zip(squares_of(pool.squares[:, pool.held()]), pool.held().tolist(), strict=True)
    for (face, depth, column, row), number in sorted(numbers, key=lambda item: item[0][1]):
        size = side >> int(shape.log2_nodes_at(depth))
        over = (
            face,
            slice(row * size, (row + 1) * size),
            slice(column * size, (column + 1) * size),
        )
        page[over], level[over] = number, depth
    return page.ravel(), level.ravel()


@eqx.filter_jit
def _all_entries(shape, tables, face, at):
    return jax.lax.map(lambda entries: find_entries(shape, entries, face, at), tables)


@pytest.mark.parametrize("shape", TINY, ids=["c2", "c2-roots", "c4", "c8"])
def test_short_sequences_are_those_of_the_slow_pool(shape):
    """Of each of four trees 400, or in the long run 2,500: 10,000 in all. Held squares, stamps and
    benefits after every look, what was evicted and refused, and who serves every place."""
    tables, expected = [], []
    start = both(shape)
    for seed in range(effort(400, 2_500)):
        rng = np.random.default_rng(seed)
        pool, slow = copy.deepcopy(start)
        # The first look fills the memory, or nearly; the next ones have to make room.
        for now in (2, 3):
            step(rng, pool, slow, now, 2 * shape.pages)
        if seed % 10 == 0:
            check_consistent(pool)
        tables.append(pool.table.entries)
        expected.append(painted(shape, pool))
    face, uv = places(shape)
    entries = _all_entries(
        shape, jnp.array(np.stack(tables)), jnp.asarray(face, jnp.int32), address_at(uv).at
    )
    page, level = np.stack(expected, axis=1)
    np.testing.assert_array_equal(page_of(entries), page)
    np.testing.assert_array_equal(level_of(entries), level)


shapes = st.builds(
    tree_shape,
    log2_node=st.integers(3, 6),
    log2_cells=st.integers(1, 3),
    log2_roots=st.integers(0, 1),
    levels=st.integers(1, 5),
    faces=st.integers(1, 3),
    pages=st.integers(12, 40),
    log2_top=st.integers(1, 3),
    tables=st.sampled_from([0, 3, 10, 200, 200]),
)


@given(shape=shapes, seed=st.integers(0, 2**32 - 1), looks=st.integers(1, 8))
def test_any_sequence_is_that_of_the_slow_pool(shape, seed, looks):
    """Longer ones in larger trees, where page tables run out too."""
    rng = np.random.default_rng(seed)
    pool, slow = both(shape)
    for now in range(2, 2 + looks):
        step(rng, pool, slow, now, 25)
        check_consistent(pool)
    index = rng.integers(0, 2**10, (2, 40)) / 2**10
    face = rng.integers(0, shape.faces, 40)
    at, numbers = address_at(index).at, dict(zip(held_by(pool), pool.held().tolist(), strict=True))
    with jax.disable_jit():
        entry = find_entries(shape, jnp.array(pool.table.entries), jnp.asarray(face, jnp.int32), at)
    for k in range(40):
        square = deepest_over(shape, numbers, int(face[k]), *index[:, k].tolist())
        assert (int(page_of(entry)[k]), int(level_of(entry)[k])) == (numbers[square], square[1])


@given(
    kilobytes=st.integers(1, 400),
    faces=st.integers(1, 6),
    log2_node=st.integers(3, 6),
    cells=st.sampled_from([2, 4, 8]),
    compare=st.sampled_from(["depth", "id", "both"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_arrays_never_take_more_than_the_limit(kilobytes, faces, log2_node, cells, compare, seed):
    """Device and host together, with the pool filled to the brim."""
    memory, node = kilobytes * 1024, 1 << log2_node
    kind: Compare = compare
    try:
        shape = shape_for(
            memory, faces, node_resolution=node, cells=cells, start_resolution=None, compare=kind
        )
    except UseError:
        # One page a face and one spare take more than half of it, tables included.
        assert (faces + 1) * (node + 2) ** 2 * 6 + faces * 2000 > memory / 2
        return
    pool = planted(shape)
    squares = random_squares(np.random.default_rng(seed), shape, min(2 * shape.pages, 2000))
    pool.admit(requests_for(squares), 2, 1, False)
    tree = jax.eval_shape(lambda: empty_tree(shape, kind))
    on_device = jax.tree.leaves((tree, jax.eval_shape(page_bounds, tree)))
    taken = sum(x.size * x.dtype.itemsize for x in on_device) + pool.bytes
    assert taken <= memory
    assert shape.pages < 20 or taken > 0.7 * memory
