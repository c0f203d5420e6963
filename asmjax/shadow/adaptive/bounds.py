"""What is known of all texels of a page and of those below it: a pyramid over the tree.

The 2001 paper keeps a pyramid of the farthest and nearest depths of each node. Here its finest
level is a whole page, guard band included: 18 x 18 texels, of which a block of 8 x 8 pixels covers
about as many. Its coarser levels are the tree's own: a page's bounds hold for its whole subtree, so
one place in a page tells of all deeper pages beside it. Of the nearest depth nothing would follow
(see `asmjax.shadow.adaptive.blocks`); primitives take its place.
"""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, UInt16


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
        farthest: (pages,) largest depth of all texels.
        least, most: (pages,) smallest and largest packed primitive of all texels.
    """

    farthest: Float[Array, " pages"]
    least: UInt16[Array, " pages"]
    most: UInt16[Array, " pages"]


def pyramid(bounds: PageBounds, pages: np.ndarray, ends: np.ndarray) -> Pyramid:
    """The pyramid over a tree, whose `pages` (k,) stand in the order of a depth-first walk; `ends`
    (k,) say where the subtree of each ends in it."""
    between = np.stack([np.arange(pages.size), ends], axis=1).reshape(-1)

    def subtree(own: np.ndarray, extreme: np.ufunc) -> np.ndarray:
        result = own.copy()
        # One more element, so that every end is a place; what stands there counts for nobody.
        walk = np.append(own[pages], own[:1])
        result[pages] = extreme.reduceat(walk, between)[::2]
        return result

    farthest = subtree(bounds.farthest, np.maximum)
    least, most = subtree(bounds.least, np.minimum), subtree(bounds.most, np.maximum)
    return Pyramid(*jax.device_put((farthest, least, most)))
