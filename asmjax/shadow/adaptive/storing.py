"""Texels of new pages go into the tree's arrays in calls of a few sizes, each compiled once."""

import jax
import numpy as np

from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.tree import Tree, store_pages, store_run

BUCKETS = (16, 128, 1024)
"""Numbers of pages that are stored in one call: others are padded, so that nothing retraces."""

STORE_TEXELS = 1 << 19
"""Texels that are stored in one call, at most, or one page: padding stays small beside a map."""


def buckets_of(side: int, capacity: int) -> tuple[int, ...]:
    """Numbers of pages, `side` texels a side, that are stored in one call of a tree with room for
    `capacity`: `BUCKETS` as far as they fit."""
    most = max(1, min(capacity, STORE_TEXELS // side**2, BUCKETS[-1]))
    return (*(bucket for bucket in BUCKETS if bucket < most), most)


def store(shape: TreeShape, tree: Tree, pages, depth, prim) -> Tree:
    """The tree, taken over, with the texels (k, side, side) of `pages` (k,)."""
    most = buckets_of(shape.side, tree.capacity)[-1]
    for start in range(0, pages.size, most):
        some = slice(start, start + most)
        tree = _store(shape, tree, pages[some], depth[some], prim[some])
    return tree


def _store(shape: TreeShape, tree: Tree, pages, depth, prim) -> Tree:
    """The tree, taken over, with the texels of `pages` (k,), k at most the largest bucket."""
    count = pages.size
    bucket = next(b for b in buckets_of(shape.side, tree.capacity) if b >= count)
    texels = (
        None if tree.depth is None else _padded(depth, bucket),
        None if tree.prim is None else _padded(prim, bucket),
    )
    in_a_row = pages[-1] - pages[0] == count - 1 and bool(np.all(np.diff(pages) == 1))
    if in_a_row and pages[0] + bucket <= tree.capacity:
        first = np.int32(pages[0])
        stored = store_run(tree.depth, tree.prim, first, np.int32(count), *texels)
    else:
        places = _padded(pages.astype(np.int32), bucket, tree.capacity)
        stored = store_pages(tree.depth, tree.prim, places, *texels)
    return Tree(tree.entries, *stored)


_compiled: set[tuple] = set()


def stores_compiled(shape: TreeShape, tree: Tree) -> Tree:
    """The tree as it was, every bucket compiled once: a frame with many new nodes must not wait."""
    kinds = tree.depth is None, tree.prim is None, jax.config.read("jax_enable_x64")
    if (shape, tree.capacity, *kinds) not in _compiled:
        nothing = np.int32(0)
        for bucket in buckets_of(shape.side, tree.capacity):
            texels = [
                None if kept is None else np.zeros((bucket, shape.side, shape.side), kind)
                for kept, kind in ((tree.depth, np.float32), (tree.prim, np.int32))
            ]
            spare = np.full(bucket, tree.capacity, np.int32)
            stored = store_pages(tree.depth, tree.prim, spare, *texels)
            stored = store_run(*stored, nothing, nothing, *texels)
            tree = Tree(tree.entries, *stored)
        _compiled.add((shape, tree.capacity, *kinds))
    return tree


def _padded(a: np.ndarray, count: int, fill=0) -> np.ndarray:
    """`a` with its first axis filled up to `count` entries; itself where nothing is missing."""
    if a.shape[0] == count:
        return a
    result = np.empty((count, *a.shape[1:]), a.dtype)
    result[: a.shape[0]], result[a.shape[0] :] = a, fill
    return result
