"""Which page serves a place: page tables against a search of all pages (`helpers.slow_tree`)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import examples
from helpers.slow_tree import (
    Square,
    address_at,
    array_of,
    deepest_over,
    parent_of,
    random_squares,
    roots_of,
    squares_of,
    tables_needed,
    tree_shape,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from asmjax.shadow.adaptive.page_table import LEVEL_BITS, PageTable, find_entries, level_of, page_of
from asmjax.shadow.adaptive.shape import LOG2_TABLE, TreeShape

COUNT = 64
"""Places per look."""

PAGES = 60

SHAPES = {
    "c2": tree_shape(pages=PAGES, levels=8, tables=200),
    "c2-deep": tree_shape(3, 1, 0, levels=21, faces=2, pages=PAGES, log2_top=0, tables=800),
    "c4": tree_shape(3, 2, 0, levels=5, faces=3, pages=PAGES, log2_top=2, tables=200),
    "c8": tree_shape(6, 3, 1, levels=5, faces=2, pages=PAGES, log2_top=3, tables=300),
    "all in the top table": tree_shape(3, 1, 1, levels=3, faces=2, pages=PAGES, log2_top=4),
}
"""c = 2, 4, 8 cells a side and one to six faces; borders of pages on those of tables, and not."""

each_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)

_find_entries = eqx.filter_jit(find_entries)


def covered(shape: TreeShape, squares: list[Square], groups: int = 1) -> PageTable:
    """Tables that serve the roots and `squares`, page k square k, given in so many calls."""
    table, roots = PageTable(shape), len(roots_of(shape))
    everything = [*roots_of(shape), *squares]
    bounds = [0, roots, *np.linspace(roots, len(everything), groups + 1).astype(int)[1:].tolist()]
    for start, stop in zip(bounds, bounds[1:], strict=False):
        placed = table.cover(np.arange(start, stop), array_of(everything[start:stop]))
        assert placed.all()
    return table


def probes(shape: TreeShape, squares: list[Square], rng):
    """Faces (n,) and places (2, n) in [0, 1): on the borders of squares, beside them, anywhere."""
    some = array_of(squares[k] for k in rng.choice(len(squares), COUNT))
    face, level, *index = some
    size = np.ldexp(1.0, -shape.log2_nodes_at(level))
    step = rng.choice([0.0, 1.0, 0.5, -(2.0**-30), 1 - 2.0**-28], (2, COUNT))
    uv = (np.stack(index) + step) * size
    uv = np.where(rng.random(COUNT) < 0.2, rng.random((2, COUNT)), uv)
    return face, np.floor(np.clip(uv, 0, 1 - 2.0**-30) * 2.0**30) / 2.0**30


def check_served(table: PageTable, held: dict[Square, int], rng) -> None:
    """Every place is served by the deepest page over it: page `held[square]` of a square."""
    shape, squares = table.shape, list(held)
    face, uv = probes(shape, squares, rng)
    at = address_at(uv).at
    entry = _find_entries(shape, jnp.array(table.entries), jnp.asarray(face, jnp.int32), at)
    expected = [
        deepest_over(shape, squares, int(f), x, y)
        for f, (x, y) in zip(face, uv.T.tolist(), strict=True)
    ]
    np.testing.assert_array_equal(page_of(entry), [held[square] for square in expected])
    np.testing.assert_array_equal(level_of(entry), [square[1] for square in expected])


def numbered(shape: TreeShape, squares: list[Square]) -> dict[Square, int]:
    return {square: page for page, square in enumerate([*roots_of(shape), *squares])}


@each_shape
@given(seed=st.integers(0, 2**32 - 1), groups=st.integers(1, 5))
@settings(max_examples=examples(15, 1_000))
def test_every_place_is_served_by_the_deepest_page_over_it(shape, seed, groups):
    """Pages in any order, deep ones before those above them too."""
    rng = np.random.default_rng(seed)
    squares = random_squares(rng, shape, int(rng.integers(1, PAGES - shape.roots)))
    table = covered(shape, squares, groups)
    check_served(table, numbered(shape, squares), rng)
    assert table.used == tables_needed(shape, squares)


@each_shape
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=examples(15, 1_000))
def test_the_page_above_answers_where_pages_are_given_up(shape, seed):
    """Evicted pages' entries go to the nearest page above that is left; tables stay."""
    rng = np.random.default_rng(seed)
    squares = random_squares(rng, shape, PAGES - shape.roots)
    table, held = covered(shape, squares), numbered(shape, squares)
    before = table.used
    for _ in range(3):
        below = [square for square in held if square[1] > 0]
        gone = [square for square in below if rng.random() < 0.3]
        heirs = []
        for square in gone:
            above = parent_of(shape, square)
            while above not in held or above in gone:
                above = parent_of(shape, above)
            heirs.append((held[above] << LEVEL_BITS) | above[1])
        table.replace(np.array([held[square] for square in gone], int), np.array(heirs, int))
        held = {square: page for square, page in held.items() if square not in gone}
        check_served(table, held, rng)
        # Freed pages are given to other squares.
        new = [s for s in random_squares(rng, shape, 5) if s not in held]
        free = [page for page in range(shape.pages) if page not in held.values()][: len(new)]
        if free:
            assert table.cover(np.array(free), array_of(new[: len(free)])).all()
            held |= dict(zip(new, free, strict=False))
        check_served(table, held, rng)
    assert table.used >= before


@each_shape
def test_the_order_of_pages_does_not_matter(shape):
    rng = np.random.default_rng(7)
    squares = random_squares(rng, shape, PAGES - shape.roots)
    one = covered(shape, squares)
    for _ in range(4):
        order = rng.permutation(len(squares))
        other = PageTable(shape)
        pages = np.r_[: shape.roots, shape.roots + order]
        other.cover(pages[: shape.roots], array_of(roots_of(shape)))
        for k in range(0, len(squares), 7):
            some = order[k : k + 7]
            assert other.cover(shape.roots + some, array_of(squares[j] for j in some)).all()
        held = numbered(shape, squares)
        check_served(other, held, rng)
        assert other.used == one.used


@given(seed=st.integers(0, 2**32 - 1), tables=st.integers(0, 30))
@settings(max_examples=examples(30, 1_000))
def test_a_page_without_a_table_is_told_and_harms_no_other(seed, tables):
    rng = np.random.default_rng(seed)
    shape = tree_shape(3, 1, 0, levels=10, faces=2, pages=PAGES, log2_top=1, tables=tables)
    squares = random_squares(rng, shape, PAGES - shape.roots)
    table = PageTable(shape)
    table.cover(np.arange(2), array_of(roots_of(shape)))
    held = numbered(shape, [])
    for k in range(0, len(squares), 10):
        some = squares[k : k + 10]
        pages = shape.roots + k + np.arange(len(some))
        placed = table.cover(pages, array_of(some))
        held |= {s: int(p) for s, p, ok in zip(some, pages, placed, strict=True) if ok}
        if not placed.all():
            assert table.used == tables
        assert table.used <= tables
        check_served(table, held, rng)
    assert tables_needed(shape, held) <= table.used
    if tables_needed(shape, squares) <= tables:
        assert len(held) == len(squares) + shape.roots


def test_shallow_pages_need_no_table():
    """Without any table below the top one, pages as fine as its entries fit, deeper ones do not."""
    shape = tree_shape(3, 1, 1, levels=6, pages=PAGES, log2_top=3, tables=0)
    squares = random_squares(np.random.default_rng(0), shape, 40)
    table = PageTable(shape)
    table.cover(np.arange(4), array_of(roots_of(shape)))
    placed = table.cover(4 + np.arange(40), array_of(squares))
    np.testing.assert_array_equal(placed, [level <= 2 for _, level, _, _ in squares])
    assert 5 < placed.sum() < 40
    held = {s: 4 + k for k, s in enumerate(squares) if placed[k]}
    check_served(table, numbered(shape, []) | held, np.random.default_rng(1))


def test_clearing_gives_all_tables_back():
    shape = tree_shape(3, 1, 0, levels=10, pages=PAGES, log2_top=0, tables=4)
    deep = (0, 10, 0, 0)
    table = PageTable(shape)
    for _ in range(3):
        table.cover(np.zeros(1, int), array_of(roots_of(shape)))
        assert table.cover(np.ones(1, int), array_of([deep])).all()
        assert table.used == tables_needed(shape, [deep]) == 4
        far = (0, 10, 2**10 - 1, 0)
        assert not table.cover(np.full(1, 2), array_of([far])).any()
        check_served(table, {(0, 0, 0, 0): 0, deep: 1}, np.random.default_rng(0))
        table.clear()
        assert table.used == 0


def test_a_lookup_takes_one_step_for_three_levels():
    for levels in range(12):
        for log2_top in range(6):
            shape = tree_shape(levels=levels, log2_roots=0, log2_top=log2_top)
            deeper = max(levels - log2_top, 0)
            assert shape.steps == (deeper + LOG2_TABLE - 1) // LOG2_TABLE


def test_entries_hold_every_page_and_level():
    """The greatest page and level that a shape may have come back as they went in."""
    shape = tree_shape(3, 1, 0, levels=21, pages=2**26 - 1, log2_top=0, tables=7)
    table = PageTable(shape)
    deep = (0, 21, 2**21 - 1, 2**21 - 1)
    table.cover(np.zeros(1, int), array_of(roots_of(shape)))
    assert table.cover(np.array([2**26 - 1]), array_of([deep])).all()
    at = jnp.full((2, 1), 2**30 - 1, jnp.int32)
    entry = _find_entries(shape, jnp.array(table.entries), jnp.zeros(1, jnp.int32), at)
    assert int(page_of(entry)[0]) == 2**26 - 1 and int(level_of(entry)[0]) == 21
    assert squares_of(array_of([deep])) == [deep]
