"""What is known of all texels of a page and of those below it: a pyramid over the tree.

The 2001 paper keeps a pyramid of the farthest and nearest depths of each node. Here its finest
level is a whole page, guard band included: 18 x 18 texels, of which a block of 8 x 8 pixels covers
about as many. Its coarser levels are the tree's own: a page's bounds hold for its whole subtree, so
one place in a page tells of all deeper pages beside it. Of the nearest depth nothing would follow
(see `asmjax.shadow.adaptive.blocks`); primitives take its place.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt16

from asmjax.shadow.adaptive.tree import Tree


class Bounds(NamedTuple):
    """Bounds of each page's texels, guard band included. Free pages hold anything.

    Attributes:
        farthest: (pages,) largest depth; None where depths are not stored.
        least, most: (pages,) smallest and largest packed primitive; None where not stored.
    """

    farthest: Float[Array, " pages"] | None
    least: UInt16[Array, " pages"] | None
    most: UInt16[Array, " pages"] | None


@jax.jit
def page_bounds(tree: Tree) -> Bounds:
    """Bounds of each page's own texels, without the spare page, which is the last one."""
    return Bounds(
        None if tree.depth is None else jnp.max(tree.depth[:-1], axis=1),
        None if tree.prim is None else jnp.min(tree.prim[:-1], axis=1),
        None if tree.prim is None else jnp.max(tree.prim[:-1], axis=1),
    )


def pyramid(own: Bounds, pages: np.ndarray, ends: np.ndarray) -> Bounds:
    """Bounds of each page's subtree, itself included, on the device: the pyramid over a tree.

    `pages` (k,) stand in the order of a depth-first walk; `ends` (k,) say where the subtree of
    each ends in it.
    """
    between = np.stack([np.arange(pages.size), ends], axis=1).reshape(-1)

    def subtree(bound, extreme: np.ufunc):
        if bound is None:
            return None
        result = np.array(bound)
        # One more element, so that every end is a place; what stands there counts for nobody.
        walk = np.append(result[pages], result[:1])
        result[pages] = extreme.reduceat(walk, between)[::2]
        return jax.device_put(result)

    return Bounds(
        subtree(own.farthest, np.maximum),
        subtree(own.least, np.minimum),
        subtree(own.most, np.maximum),
    )
