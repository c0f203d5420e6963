"""What is known of all texels of a page and of those below it: a pyramid over the tree.

The 2001 paper keeps a pyramid of the farthest and nearest depths of each node. Here its finest
level is a whole page (16 x 16 texels and their guard band; a block of 8 x 8 pixels covers about as
many), and its coarser levels are the tree's own: a page's bounds hold for its whole subtree, so
that a block that is wider than the pages under it is answered by one above them. They are not worth
leaving out: without them a fifth of the blocks is decided that is decided with them
(docs/benchmarks.md, "Queries: what pays").

Of the nearest depth nothing would follow (see `asmjax.shadow.adaptive.blocks`); primitives take its
place.
"""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, Int, UInt16

from asmjax.shadow.adaptive.page_table import LEVEL_BITS


class PageBounds:
    """Bounds of each page's own texels, guard band included, on the host; mutable.

    Attributes:
        farthest: (pages,) float32: largest depth.
        least, most: (pages,) uint16: smallest and largest packed primitive.
    """

    def __init__(self, pages: int):
        self.farthest = np.zeros(pages, np.float32)
        self.least = np.zeros(pages, np.uint16)
        self.most = np.zeros(pages, np.uint16)

    @property
    def bytes(self) -> int:
        return self.farthest.nbytes + self.least.nbytes + self.most.nbytes

    def note(self, pages: np.ndarray, depth: np.ndarray, prim: np.ndarray) -> None:
        """Remember what was cast for `pages` (k,): depth and prim (k, side, side)."""
        # As `pack_prim` does it: the low 16 bits.
        packed = prim.reshape(pages.size, -1).astype(np.uint16)
        self.farthest[pages] = depth.reshape(pages.size, -1).max(axis=1)
        self.least[pages], self.most[pages] = packed.min(axis=1), packed.max(axis=1)


class Pyramid(eqx.Module):
    """Bounds of each page's subtree, itself included, on the device. Free pages hold anything.

    Attributes:
        above: (pages,) entry of the nearest page above each; -1 at level 0.
        farthest: (pages,) largest depth of all texels.
        least, most: (pages,) smallest and largest packed primitive of all texels.
    """

    above: Int[Array, " pages"]
    farthest: Float[Array, " pages"]
    least: UInt16[Array, " pages"]
    most: UInt16[Array, " pages"]


def pyramid(bounds: PageBounds, pages: np.ndarray, keys: np.ndarray, ends: np.ndarray) -> Pyramid:
    """The pyramid over a tree, whose `pages` (k,) stand in the order of a depth-first walk, `keys`
    are their places in it and `ends` say where the subtree of each ends."""
    start = np.arange(pages.size)
    between = np.stack([start, ends], axis=1).reshape(-1)

    def subtree(own: np.ndarray, extreme: np.ufunc) -> np.ndarray:
        result = own.copy()
        # One more element, so that every end is a place; what stands there counts for nobody.
        walk = np.append(own[pages], own[:1])
        result[pages] = extreme.reduceat(walk, between)[::2]
        return result

    return jax.device_put(
        Pyramid(
            above=_above(bounds.farthest.size, pages, keys & ((1 << LEVEL_BITS) - 1), ends),
            farthest=subtree(bounds.farthest, np.maximum),
            least=subtree(bounds.least, np.minimum),
            most=subtree(bounds.most, np.maximum),
        )
    )


def _above(count: int, pages: np.ndarray, level: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(count,) int32 entry of the nearest page above each of `pages`; -1 where there is none."""
    start = np.arange(pages.size)
    parent = np.full(pages.size, -1)
    below = ends - start - 1
    # Level by level from the top: the last one to claim a place is the nearest.
    for k in np.unique(level[below > 0]):
        chosen = np.flatnonzero((level == k) & (below > 0))
        many = below[chosen]
        within = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
        parent[np.repeat(chosen + 1, many) + within] = np.repeat(chosen, many)
    result = np.full(count, -1, np.int32)
    entry = (pages[parent].astype(np.int64) << LEVEL_BITS) | level[parent]
    result[pages] = np.where(parent >= 0, entry, -1)
    return result
