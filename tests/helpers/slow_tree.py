"""Pages of a tree in dictionaries and loops: the slow, obvious twin of pool and page tables."""

import functools
from collections.abc import Iterable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from asmjax.buffers import Receivers
from asmjax.shadow.adaptive.address import BITS, Address
from asmjax.shadow.adaptive.pool import RESERVE_SHARE, NodePool, Requests
from asmjax.shadow.adaptive.shape import LOG2_TABLE, TreeShape

Square = tuple[int, int, int, int]
"""face, level, column, row."""


def tree_shape(
    log2_node=4, log2_cells=1, log2_roots=1, levels=4, faces=1, pages=40, log2_top=1, tables=40
) -> TreeShape:
    """A small tree; by default 2 x 2 roots, 2 x 2 cells, 16 x 16 texels."""
    return TreeShape(log2_node, log2_cells, log2_roots, levels, faces, pages, log2_top, tables)


def array_of(squares: Iterable[Square]) -> np.ndarray:
    """(4, k) int64 of squares, in their order."""
    return np.array(list(squares), np.int64).reshape(-1, 4).T


def squares_of(array: np.ndarray) -> list[Square]:
    """The squares of a (4, k) array."""
    return [(f, v, c, r) for f, v, c, r in array.T.tolist()]


def requests_for(squares: list[Square], benefit=None) -> Requests:
    """Requests for squares, in their order; of benefit 1 by default."""
    one = np.ones(len(squares))
    return Requests(array_of(squares), one if benefit is None else np.asarray(benefit, float), one)


def roots_of(shape: TreeShape) -> list[Square]:
    """Level 0, face by face and row by row."""
    side = range(2**shape.log2_roots)
    return [
        (face, 0, column, row) for face in range(shape.faces) for row in side for column in side
    ]


def parent_of(shape: TreeShape, square: Square) -> Square:
    face, level, column, row = square
    c = 2**shape.log2_cells
    return face, level - 1, column // c, row // c


def is_below(shape: TreeShape, square: Square, other: Square) -> bool:
    """Whether `square` lies in `other`, deeper."""
    while square[1] > other[1]:
        square = parent_of(shape, square)
        if square == other:
            return True
    return False


@functools.cache
def width_at(shape: TreeShape, level: int) -> float:
    """Of a square, in parts of the face."""
    return 2.0 ** -int(shape.log2_nodes_at(level))


def deepest_over(shape: TreeShape, squares: Iterable[Square], face: int, x: float, y: float):
    """The deepest of `squares` over a point of a face: all are tried."""
    over = []
    for square in squares:
        on, level, column, row = square
        size = width_at(shape, level)
        inside = column * size <= x < (column + 1) * size and row * size <= y < (row + 1) * size
        if on == face and inside:
            over.append(square)
    return max(over, key=lambda square: square[1])


def walk_place(shape: TreeShape, square: Square):
    """Sorts squares into a depth-first walk: by face, then row and column bit by bit from the
    coarsest, parents before children."""
    face, level, column, row = square
    bits = int(shape.log2_nodes_at(level))
    path = [((row >> b) & 1, (column >> b) & 1) for b in reversed(range(bits))]
    return face, path + [(0, 0)] * (24 - bits), level


def tables_needed(shape: TreeShape, squares: Iterable[Square]) -> int:
    """Page tables below the top one that a set of pages takes: one for each square of 8 x 8
    entries that a deeper page lies in."""
    tables = set()
    for face, level, column, row in squares:
        bits, done = int(shape.log2_nodes_at(level)), shape.log2_top
        while bits > done:
            tables.add((face, done, column >> (bits - done), row >> (bits - done)))
            done += LOG2_TABLE
    return len(tables)


@dataclass
class Page:
    """What is known of a page."""

    stamp: int
    benefit: float


class SlowPool:
    """The rules of `NodePool`, one page and one newcomer at a time; page tables without end."""

    def __init__(self, shape: TreeShape):
        self.shape = shape
        self.held: dict[Square, Page] = {}

    @property
    def free(self) -> int:
        return self.shape.pages - len(self.held)

    def below(self, square: Square) -> list[Square]:
        return [other for other in self.held if is_below(self.shape, other, square)]

    def unused(self, oldest: int) -> list[Square]:
        """Pages that may go, in order: the last use of the subtree decides, then depth."""
        found = []
        for square, page in self.held.items():
            last = max([page.stamp, *(self.held[other].stamp for other in self.below(square))])
            if square[1] > 0 and last < oldest:
                found.append((last, -square[1], walk_place(self.shape, square), square))
        return [square for *_, square in sorted(found)]

    def weakest_leaves(self) -> list[Square]:
        leaves = [s for s in self.held if s[1] > 0 and not self.below(s)]
        return sorted(
            leaves, key=lambda s: (self.held[s].benefit, -s[1], walk_place(self.shape, s))
        )

    def evict(self, squares: Iterable[Square]) -> int:
        gone = list(squares)
        for square in gone:
            del self.held[square]
        return len(gone)

    def admit(self, requests: list[tuple[Square, float]], now: int, oldest: int, replace: bool):
        """As `NodePool.admit`: (squares that got pages, evicted, refused)."""
        wanted: dict[Square, float] = {}
        for square, benefit in requests:
            if square not in self.held and square not in wanted:
                wanted[square] = benefit
        missing = len(wanted) - self.free
        reserve = self.shape.pages // RESERVE_SHARE
        evicted = self.evict(self.unused(oldest)[: missing + reserve]) if missing > 0 else 0
        free, leaves, losers, winners, refused = self.free, self.weakest_leaves(), [], [], 0
        for square, benefit in wanted.items():
            if free > 0:
                free -= 1
            elif replace and leaves and benefit > self.held[leaves[0]].benefit:
                losers.append(leaves.pop(0))
            else:
                refused += 1
                continue
            winners.append(square)
        evicted += self.evict(losers)
        for square in winners:
            self.held[square] = Page(now, wanted[square])
        return winners, evicted, refused


def held_by(pool: NodePool) -> dict[Square, Page]:
    """What a pool holds, in the order of its walk."""
    pages = pool.held()
    return {
        square: Page(stamp, benefit)
        for square, stamp, benefit in zip(
            squares_of(pool.squares[:, pages]),
            pool.stamp[pages].tolist(),
            pool.benefit[pages].tolist(),
            strict=True,
        )
    }


def random_squares(rng: np.random.Generator, shape: TreeShape, count: int) -> list[Square]:
    """At most `count` different squares below level 0, at random levels, clustered so that many
    share ancestors."""
    tries = 4 * count
    level = rng.integers(1, shape.levels + 1, tries)
    face = rng.integers(shape.faces, size=tries)
    side = 2 ** shape.log2_nodes_at(level)
    column, row = np.minimum((rng.random((2, tries)) ** 3 * side).astype(int), side - 1)
    return list(dict.fromkeys(squares_of(np.stack([face, level, column, row]))))[:count]


def receivers_at(face, uv) -> Receivers:
    """Receivers at image coordinates, on planes across the light ray at depth 1."""
    n = len(face)
    uv = jnp.asarray(uv)
    one = jnp.ones(n, uv.dtype)
    return Receivers(
        face=jnp.asarray(face, jnp.int32),
        uv=uv,
        depth=one,
        slope=jnp.zeros((2, n), uv.dtype),
        secant=one,
        reach=one,
        prim=jnp.full(n, 7, jnp.int32),
        facing=jnp.ones(n, bool),
    )


def address_at(uv) -> Address:
    """The fixed-point address of image coordinates (2, n), cut to 30 bits."""
    at = np.floor(np.asarray(uv, np.float64) * 2.0**BITS).astype(np.int32)
    return Address(*jnp.asarray(at), *jnp.zeros(at.shape, jnp.float32))
