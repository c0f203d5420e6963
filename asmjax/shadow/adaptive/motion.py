"""Which nodes the motion of casters touches."""

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.shape import GUARD
from asmjax.shadow.adaptive.tree import Tree


def touched(pool: NodePool, tree: Tree, frame: LightFrame, moved: np.ndarray) -> np.ndarray:
    """The pages whose texels may see something else now; a superset of those that do.

    A page is touched where a box lies in front of some of its texels: the box's rectangle in the
    light's image meets the page, guard band included, and its nearest point is not behind all that
    the page's texels see. The latter is only known where depths are stored.

    Args:
        moved: (boxes, 3, 2) float64, world boxes, min and max per axis.
    """
    pages = pool.held()
    face, level, column, row = pool.squares[:, pages].astype(np.int64)
    size = np.ldexp(1.0, -pool.shape.log2_nodes_at(level))
    band = GUARD * np.ldexp(1.0, -pool.shape.log2_resolution(level))
    farthest = np.full(pages.size, np.inf)
    if tree.depth is not None:
        farthest = np.asarray(_farthest(tree.depth))[pages]
    hit = np.zeros(pages.size, bool)
    for box in moved:
        for k in range(frame.faces):
            low, high, nearest = _extent_in_image(frame, k, box)
            meets = (face == k) & (farthest >= nearest)
            for axis, index in enumerate((column, row)):
                meets &= (index + 1) * size + band >= low[axis]
                meets &= index * size - band <= high[axis]
            hit |= meets
    return pages[hit]


@jax.jit
def _farthest(depth):
    return jnp.max(depth, axis=1)


def _extent_in_image(frame: LightFrame, face: int, box: np.ndarray):
    """Smallest rectangle (low, high: u and v) and axial depth of a world box in a face's image.

    A box that reaches behind a perspective light may be anywhere in the image.
    """
    corners = np.stack(np.meshgrid(*box, indexing="ij")).reshape(3, -1)
    x, y, depth = frame.rotation[face] @ (corners - frame.origin[:, None])
    if frame.perspective:
        if depth.max() <= 0:
            return np.full(2, np.inf), np.full(2, -np.inf), np.inf
        if depth.min() <= 0:
            return np.full(2, -np.inf), np.full(2, np.inf), 0.0
        x, y = x / depth, y / depth
    at = (np.stack([x, y]) - frame.corner[face][:, None]) / frame.extent[face][:, None]
    return at.min(axis=1), at.max(axis=1), depth.min() - 1e-6 * np.abs(depth).max()
