"""Which page serves a place of the light's image: page tables instead of a descent node by node.

The top table has an entry for each square of a regular grid; an entry names the deepest page that
covers its square, or a table of 8 x 8 entries for it where deeper pages exist. One step passes
three levels of a tree with c = 2; the deepest trees take five steps where a descent takes one a
level, up to twenty (`tests/bench_adaptive.py -k finding_pages`). An entry below a deep page is
filled with the nearest page above it, so nothing is remembered on the way down.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from asmjax.shadow.adaptive.address import BITS, index_at
from asmjax.shadow.adaptive.shape import LOG2_TABLE, TreeShape

LEVEL_BITS = 5
"""Low bits of an entry: the level of the page that it names. The page is in the bits above."""

CHANGES = 8192
"""Changed entries that are written one by one; more of them mean a new copy of all in use."""

BLOCK = 1 << 16
"""Entries that are copied to the device in one call."""

_SIDE = 1 << LOG2_TABLE
_ENTRIES = 1 << (2 * LOG2_TABLE)


def level_of(entry):
    """Level of the page that a non-negative entry names."""
    return entry & ((1 << LEVEL_BITS) - 1)


def page_of(entry):
    """Page that a non-negative entry names."""
    return entry >> LEVEL_BITS


def find_entries(
    shape: TreeShape,
    entries: Int[Array, " entries"],
    face: Int[Array, " n"],
    at: tuple[Int[Array, " n"], Int[Array, " n"]] | Int[Array, "2 n"],
) -> Int[Array, " n"]:
    """The entry (n,) that names the deepest page over each fixed-point place `at` of `face`."""
    x, y = at
    row, column = index_at(y, shape.log2_top), index_at(x, shape.log2_top)
    entry = take(entries, (((face << shape.log2_top) + row) << shape.log2_top) + column)
    for k in range(1, shape.steps + 1):
        shift = np.int32(BITS - shape.log2_top - LOG2_TABLE * k)
        entry = _entry_below(entries, entry, x, y, shift, first=shape.top_entries)
    return entry


@partial(jax.jit, static_argnames="first")  # traced once for all steps
def _entry_below(entries, entry, x, y, shift, *, first: int):
    inside = (((y >> shift) & (_SIDE - 1)) << LOG2_TABLE) + ((x >> shift) & (_SIDE - 1))
    table = first + (~entry << (2 * LOG2_TABLE))
    # Where a page is found already, the same entry is read again and again: it is in the cache.
    below = take(entries, jnp.where(entry < 0, table + inside, 0))
    return jnp.where(entry < 0, below, entry)


def take(table, index):
    """`table[index]` for indices that are known to lie inside: nothing is checked."""
    return table.at[index].get(mode="promise_in_bounds", wrap_negative_indices=False)


@partial(jax.jit, donate_argnums=0)
def _write(entries, at, values):
    return entries.at[at].set(values)


@partial(jax.jit, donate_argnums=0)
def _write_block(entries, first, values):
    return jax.lax.dynamic_update_slice(entries, values, (first,))


def warm_tables(shape: TreeShape) -> None:
    """Have the writing of few changes and of many compiled."""
    nowhere = np.zeros(CHANGES, np.int32)
    entries = _write(jnp.zeros(shape.entries, jnp.int32), nowhere, nowhere)
    if shape.entries > BLOCK:
        _write_block(entries, np.int32(0), np.zeros(BLOCK, np.int32))


class PageTable:
    """The host's copy of the tables, which is changed; the device gets a copy of it.

    Attributes:
        entries: (shape.entries,) int32: page << 5 | level, or ~table.
        used: tables taken.
    """

    def __init__(self, shape: TreeShape):
        self.shape = shape
        self.entries = np.zeros(shape.entries, np.int32)
        self.used = 0
        self._changed: list[np.ndarray] | None = None

    @property
    def bytes(self) -> int:
        return self.entries.nbytes

    def clear(self) -> None:
        """Forget all pages."""
        self.entries[:] = 0
        self.used = 0
        self._changed = None

    def on_device(self, device: Int[Array, " entries"]) -> Int[Array, " entries"]:
        """The device's copy brought up to date: written in place where little has changed.

        `device` is what this returned before, or zeros; it is taken over. Tables beyond those in
        use are not copied: nothing names them.
        """
        changed, self._changed = self._changed, []
        count = 0 if changed is None else sum(at.size for at in changed)
        if changed is None or count > CHANGES:
            return self._copied_over(device)
        if count == 0:
            return device
        at = np.zeros(CHANGES, np.int32)
        at[:count] = np.concatenate(changed)
        return _write(device, at, self.entries[at])

    def _copied_over(self, device: Int[Array, " entries"]) -> Int[Array, " entries"]:
        last = self.shape.entries - BLOCK
        if last <= 0:
            return jnp.array(self.entries)
        for start in range(0, self.shape.top_entries + self.used * _ENTRIES, BLOCK):
            first = min(start, last)
            device = _write_block(device, np.int32(first), self.entries[first : first + BLOCK])
        # What is handed over may be read in place, and changes with the next pass.
        return jax.block_until_ready(device)

    def cover(self, pages: np.ndarray, squares: np.ndarray) -> np.ndarray:
        """Let `pages` (k,) serve their squares (4, k) where nothing deeper does.

        Level-0 pages must come first, before any other. Returns (k,) bool: which found room; the
        others are not served.
        """
        level = squares[1].astype(np.int64)
        value = (pages.astype(np.int32) << LEVEL_BITS) | level.astype(np.int32)
        face, _, column, row = squares.astype(np.int64)
        bits, done = self.shape.log2_nodes_at(level), self.shape.log2_top
        placed = np.ones(pages.size, bool)
        # Number of the first of the entries that a square covers, log2 of how many a side.
        corner, spread = np.zeros((2, pages.size), np.int64)
        base, log2_side, left = (face << done) << done, done, np.arange(pages.size)
        while True:
            # All squares at once go down one table; some end in it, the others in tables below.
            shift, mask = bits[left] - done, (1 << log2_side) - 1
            down = np.maximum(shift, 0)
            x, y = (column[left] >> down) & mask, (row[left] >> down) & mask
            ends = shift <= 0
            up = np.maximum(-shift, 0)
            at = base + (((y << up) & mask) << log2_side) + ((x << up) & mask)
            corner[left[ends]], spread[left[ends]] = at[ends], up[ends]
            left, at = left[~ends], at[~ends]
            if not left.size:
                break
            table = self._tables(at)
            placed[left[table < 0]] = False
            left, table = left[table >= 0], table[table >= 0].astype(np.int64)
            base = self.shape.top_entries + table * _ENTRIES
            done, log2_side = done + LOG2_TABLE, LOG2_TABLE
        self._fill(*self._blocks(corner[placed], spread[placed], bits[placed], value[placed]))
        return placed

    def _blocks(self, corner, spread, bits, value) -> tuple[np.ndarray, np.ndarray]:
        """All entries of squares of `1 << spread` entries a side, and their values, deepest last.

        Where two squares meet in an entry, the later one is written over the other.
        """
        at, values = [], []
        inside = bits > self.shape.log2_top
        for below in (False, True):
            log2_side = LOG2_TABLE if below else self.shape.log2_top
            for log2 in np.unique(spread[inside == below]):
                which = np.flatnonzero((inside == below) & (spread == log2))
                step = np.arange(1 << log2)
                block = ((step[:, None] << log2_side) + step).reshape(-1)
                at.append((corner[which, None] + block).reshape(-1))
                values.append(np.repeat(value[which], block.size))
        if not at:
            return np.zeros(0, np.int64), np.zeros(0, np.int32)
        at, values = np.concatenate(at), np.concatenate(values)
        order = np.argsort(level_of(values).astype(np.uint8), kind="stable")
        return at[order], values[order]

    def replace(self, pages: np.ndarray, heirs: np.ndarray) -> None:
        """Pages (k,) are given up: entries that name one name its heir's entry (k,) instead."""
        used = self.entries[: self.shape.top_entries + self.used * _ENTRIES]
        heir = np.full(self.shape.pages, -1, np.int32)
        heir[pages] = heirs
        # Entries of tables are negative: they look at the end, where nobody is gone.
        gone = np.zeros(self.shape.pages + 1 + (self.shape.tables >> LEVEL_BITS), bool)
        gone[pages] = True
        at = np.flatnonzero(gone[page_of(used)])
        used[at] = heir[page_of(used[at])]
        self._note(at)

    def _note(self, at: np.ndarray) -> None:
        if self._changed is not None:
            self._changed.append(at.reshape(-1))

    def _tables(self, entry: np.ndarray) -> np.ndarray:
        """The table of each entry, made where it names a page; -1 where none is left."""
        value = self.entries[entry]
        if (value < 0).all():
            return ~value
        missing = np.unique(entry[value >= 0])[: self.shape.tables - self.used]
        if missing.size:
            made = self.used + np.arange(missing.size)
            at = self.shape.top_entries + made[:, None] * _ENTRIES + np.arange(_ENTRIES)
            self.entries[at] = self.entries[missing][:, None]
            self.entries[missing] = ~made
            self._note(at)
            self._note(missing)
            self.used += missing.size
            value = self.entries[entry]
        return np.where(value < 0, ~value, -1)

    def _fill(self, at: np.ndarray, value: np.ndarray) -> None:
        """Write values into entries, and into all tables below them, where no deeper page is."""
        while at.size:
            held = self.entries[at]
            leaf = held >= 0
            shallower = leaf & (level_of(held) <= level_of(value))
            self.entries[at[shallower]] = value[shallower]
            self._note(at[shallower])
            tables = ~held[~leaf].astype(np.int64)
            value = np.repeat(value[~leaf], _ENTRIES)
            at = (
                self.shape.top_entries + tables[:, None] * _ENTRIES + np.arange(_ENTRIES)
            ).reshape(-1)
