"""The host's side of the tree: which pages exist, where new ones go, and which are given up.

A full pool makes room by two rules (Fernando et al. 2001, 3.2): first the least recently used
nodes go, among those that served nobody in the last rotation of the looks; then, for newcomers
that may replace, leaves of a benefit smaller than the newcomer's. A node counts as used as long as
one below it is, so that nodes go leaf by leaf and a subtree's root last. Level 0 stays.
"""

from dataclasses import dataclass, fields

import numpy as np

from asmjax.shadow.adaptive.page_table import LEVEL_BITS, PageTable
from asmjax.shadow.adaptive.shape import TreeShape

_DEEPEST = 24
"""log2 of the squares a side that the order along the curve can tell apart."""

RESERVE_SHARE = 32
"""Room made of unused pages leaves this part of all pages free, so that the next frames of a walk
need not make any: choosing who goes takes as long as placing who comes."""


@dataclass(frozen=True)
class Requests:
    """Nodes that should get a page: each a square of a face at a level.

    Attributes:
        squares: (4, k) int64: face, level, column and row; the last two count nodes of that level.
        benefit: (k,) eye pixels that each page would help.
        n_required: (k,) texels that the square needs to match the eye.
    """

    squares: np.ndarray
    benefit: np.ndarray
    n_required: np.ndarray

    @property
    def count(self) -> int:
        return self.benefit.size

    def take(self, which) -> "Requests":
        """The requests at the given positions, in that order."""
        return Requests(*(getattr(self, f.name)[..., which] for f in fields(self)))

    def and_then(self, others: "Requests") -> "Requests":
        """These requests, and `others` after them."""
        pairs = ((getattr(self, f.name), getattr(others, f.name)) for f in fields(self))
        return Requests(*(np.concatenate(pair, axis=-1) for pair in pairs))


def no_requests() -> Requests:
    """None at all."""
    return Requests(np.zeros((4, 0), np.int64), np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Admitted:
    """What became of requests.

    Attributes:
        pages: (k',) pages of those that found room, their squares are in the pool.
        evicted: pages given up for them.
        refused: requests left over because the memory is full.
        no_table: requests left over because the page tables are full.
    """

    pages: np.ndarray
    evicted: int
    refused: int
    no_table: int


class NodePool:
    """All pages of one tree on the host, mutable.

    Attributes:
        table: the page tables.
        squares: (4, pages) int32: face, level, column, row of each page.
        key: (pages,) int64: place of each page in the order of a depth-first walk; -1 where free.
        stamp: (pages,) int32: the last look that the page answered in, or was made in.
        waiting: requests of earlier looks that were too few for a launch of their own.
        waited: looks since the first of them.
        benefit: (pages,) float32: eye pixels that it was made for, or the most that it
            served in one look.
    """

    def __init__(self, shape: TreeShape):
        self.shape = shape
        self.table = PageTable(shape)
        self.squares = np.zeros((4, shape.pages), np.int32)
        self.key = np.full(shape.pages, -1, np.int64)
        self.stamp = np.zeros(shape.pages, np.int32)
        self.benefit = np.zeros(shape.pages, np.float32)
        self.waiting, self.waited = no_requests(), 0
        self._free = np.arange(shape.pages, dtype=np.int32)[::-1].copy()
        self.free_pages = shape.pages
        # Keys in ascending order, and their pages: a depth-first walk, parents before children.
        self._keys = np.zeros(0, np.int64)
        self._pages = np.zeros(0, np.int32)

    @property
    def bytes(self) -> int:
        """Bytes of the tables."""
        own = (self.squares, self.key, self.stamp, self.benefit, self._free)
        order = (self._keys, self._pages)
        waiting = (self.waiting.squares, self.waiting.benefit, self.waiting.n_required)
        return self.table.bytes + sum(a.nbytes for a in own + order + waiting)

    @property
    def used_pages(self) -> int:
        return self.shape.pages - self.free_pages

    def held(self) -> np.ndarray:
        """All pages in use, in the order of a depth-first walk."""
        return self._pages

    def ends(self) -> np.ndarray:
        """For each of `held`, where its subtree ends in that order."""
        return self._ends(self._keys)

    def roots(self) -> Requests:
        """All level-0 nodes, face by face and row by row."""
        side = 1 << self.shape.log2_roots
        index = np.arange(self.shape.roots)
        squares = np.stack([index // side**2, 0 * index, index % side, index // side % side])
        full = np.full(index.size, np.inf)
        return Requests(squares, full, np.zeros(index.size))

    def admit(self, requests: Requests, now: int, oldest: int, replace: bool) -> Admitted:
        """Give requested nodes pages, in order, as far as there is or can be made room.

        Args:
            now: number of this look; stamps the new pages.
            oldest: pages with a stamp below were not used lately and may go.
            replace: whether used leaves of a smaller benefit may go too.
        """
        key = self.key_of(requests.squares)
        new = ~self._holds(key)
        # Each square once, the first request for it counts.
        first = np.zeros(key.size, bool)
        first[np.unique(key, return_index=True)[1]] = True
        requests, key = requests.take(new & first), key[new & first]
        wins, gone = np.ones(requests.count, bool), self._pages[:0]
        missing = requests.count - self.free_pages
        if missing > 0:
            gone = self.unused(oldest)[: missing + self.shape.pages // RESERVE_SHARE]
            room = self.free_pages + gone.size
            wins = np.arange(requests.count) < room
            if replace and room < requests.count:
                wins, losers = self._contest(requests.benefit, gone)
                gone = np.concatenate([gone, losers])
        evicted = self.evict(gone)
        refused = int((~wins).sum())
        requests, key = requests.take(wins), key[wins]
        self.free_pages -= key.size
        order = np.argsort(key)
        pages = np.empty(key.size, np.int32)
        # Pages that are near each other in the image have numbers in a row where those are free.
        pages[order] = np.sort(self._free[self.free_pages : self.free_pages + key.size])
        placed = self.table.cover(pages, requests.squares)
        if not placed.all():
            # Tables that lost their last page are given back by building them anew.
            self.table.clear()
            self.table.cover(self._pages, self.squares[:, self._pages])
            placed = self.table.cover(pages, requests.squares)
        self._give_back(pages[~placed])
        pages, requests, key = pages[placed], requests.take(placed), key[placed]
        self.squares[:, pages], self.key[pages] = requests.squares, key
        self.stamp[pages], self.benefit[pages] = now, requests.benefit
        order = np.argsort(key)
        at = np.searchsorted(self._keys, key[order])
        self._keys = np.insert(self._keys, at, key[order])
        self._pages = np.insert(self._pages, at, pages[order])
        return Admitted(pages, evicted, refused, int((~placed).sum()))

    def gather(self, requests: Requests, least: int, longest: int) -> Requests:
        """Requests together with those that wait, each square once, as soon as they are `least` or
        the first has waited `longest` looks; until then none, and all wait."""
        together = self.waiting.and_then(requests)
        first = np.unique(self.key_of(together.squares), return_index=True)[1]
        together = together.take(np.sort(first))
        if together.count < least and self.waited < longest:
            self.waiting, self.waited = together, self.waited + 1 if together.count else 0
            return no_requests()
        self.waiting, self.waited = no_requests(), 0
        return together

    def use(self, pages: np.ndarray, now: int, weight: int) -> None:
        """Note that each of `pages` (k,) serves `weight` eye pixels in this look: that it was used,
        and that it is worth as many as it serves."""
        served = np.bincount(pages, minlength=self.shape.pages)
        self.stamp[served > 0] = now
        np.maximum(self.benefit, served * np.float32(weight), out=self.benefit)

    def unused(self, oldest: int) -> np.ndarray:
        """Pages whose whole subtree has a stamp below `oldest`, in the order in which they may go:
        least recently used first, children before their parents."""
        if not self._pages.size:
            return self._pages
        last = self._last_use().astype(np.int64)
        level = self.squares[1, self._pages]
        may = np.flatnonzero((last < oldest) & (level > 0))
        # One number each: last use, then depth, then place in the walk.
        return self._pages[np.sort(((last[may] << 5) - level[may] << 32) + may) & 0xFFFFFFFF]

    def evict(self, pages: np.ndarray) -> int:
        """Give up `pages`: the nearest pages above them answer in their place. Returns how many."""
        if not pages.size:
            return 0
        gone = np.zeros(self.shape.pages, bool)
        gone[pages] = True
        keep = ~gone[self._pages]
        self._keys, self._pages = self._keys[keep], self._pages[keep]
        self.table.replace(pages, self._above(self.squares[:, pages]))
        self.key[pages] = -1
        self._give_back(pages)
        return pages.size

    def _give_back(self, pages: np.ndarray) -> None:
        self._free[self.free_pages : self.free_pages + pages.size] = pages
        self.free_pages += pages.size

    def key_of(self, squares: np.ndarray) -> np.ndarray:
        """(k,) int64 place in a depth-first walk: face, then a Z-curve, parents before children."""
        face, level, column, row = squares.astype(np.int64)
        shift = _DEEPEST - self.shape.log2_nodes_at(level)
        curve = _spread(column << shift) | (_spread(row << shift) << 1)
        return (((face << (2 * _DEEPEST)) | curve) << LEVEL_BITS) | level

    def _ends(self, keys: np.ndarray) -> np.ndarray:
        """For each page of a walk, given as its keys, where its subtree ends in it."""
        level = keys & ((1 << LEVEL_BITS) - 1)
        size = np.int64(1) << (2 * (_DEEPEST - self.shape.log2_nodes_at(level)) + LEVEL_BITS)
        return np.searchsorted(keys, keys - level + size)

    def _last_use(self) -> np.ndarray:
        """For each page of the walk, the latest stamp of its subtree."""
        stamp = np.append(self.stamp[self._pages], 0)
        ends = self.ends()
        between = np.stack([np.arange(ends.size), ends], axis=1).reshape(-1)
        return np.maximum.reduceat(stamp, between)[::2]

    def _contest(self, benefit: np.ndarray, gone: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newcomers in order, each free page first, then each against the weakest leaf left.

        The pages `gone` count as free. Returns (k,) bool: which newcomers win; and the pages of the
        leaves that lose.
        """
        stays = np.ones(self.shape.pages, bool)
        stays[gone] = False
        stays = stays[self._pages]
        keys, pages = self._keys[stays], self._pages[stays]
        leaf = (self._ends(keys) - np.arange(keys.size)) == 1
        leaf &= self.squares[1, pages] > 0
        keys, pages = keys[leaf], pages[leaf]
        weakest = pages[np.lexsort((keys, -self.squares[1, pages], self.benefit[pages]))]
        wins, lost = np.arange(benefit.size) < self.free_pages + gone.size, 0
        for k in np.flatnonzero(~wins):
            if lost == weakest.size:
                break
            wins[k] = benefit[k] > self.benefit[weakest[lost]]
            lost += int(wins[k])
        return wins, weakest[:lost]

    def _holds(self, key: np.ndarray) -> np.ndarray:
        if not self._keys.size:
            return np.zeros(key.size, bool)
        return self._keys[np.minimum(np.searchsorted(self._keys, key), self._keys.size - 1)] == key

    def _above(self, squares: np.ndarray) -> np.ndarray:
        """The entry of the nearest page above each square, evicted ones not counted."""
        face, level, column, row = squares.astype(np.int64)
        entry = np.full(face.size, -1, np.int64)
        while (looking := np.flatnonzero(entry < 0)).size:
            level[looking] -= 1
            column[looking] >>= self.shape.log2_cells
            row[looking] >>= self.shape.log2_cells
            key = self.key_of(np.stack([face, level, column, row])[:, looking])
            at = np.minimum(np.searchsorted(self._keys, key), self._keys.size - 1)
            found = self._keys[at] == key
            pages = self._pages[at[found]].astype(np.int64)
            entry[looking[found]] = (pages << LEVEL_BITS) | level[looking[found]]
        return entry


def _spread(x: np.ndarray) -> np.ndarray:
    """The low 24 bits of each number on the even bits of the result."""
    x = (x | (x << 16)) & 0x0000FFFF0000FFFF
    x = (x | (x << 8)) & 0x00FF00FF00FF00FF
    x = (x | (x << 4)) & 0x0F0F0F0F0F0F0F0F
    x = (x | (x << 2)) & 0x3333333333333333
    return (x | (x << 1)) & 0x5555555555555555
