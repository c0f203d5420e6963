"""The tree of an adaptive shadow map: nodes with cells, pages of texels, and how to find them.

A node is a square of a face at some level; it is partitioned into c x c cells, each empty or
holding one child that covers exactly that cell. A node may own a page: R x R texels and a guard
band of one texel around them, so that a stencil never leaves the page. Nodes between a shallow
and a deep page need no texels of their own and own none (page -1). Level 0 is a grid of nodes
that together make up the starting resolution.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt16

from asmjax.buffers import Receivers, TexelWindows
from asmjax.shadow.adaptive.address import centre_offset, fixed_point, index_at
from asmjax.shadow.comparison import Compare, lit_by_texel, pack_prim, stored

GUARD = 1
"""Texels of the guard band on each side of a page."""


class TreeShape(eqx.Module):
    """The static sizes of a tree; all of them powers of two where they are log2.

    Attributes:
        log2_node: log2 of R, texels per node side.
        log2_cells: log2 of c, cells per node side; each level multiplies the resolution by c.
        log2_roots: log2 of the level-0 nodes per face side.
        levels: number of levels below level 0 that may exist.
        faces: faces of the light frame.
        pages: pages that fit, one more is kept for writing padding.
        nodes: nodes that fit.
    """

    log2_node: int = eqx.field(static=True)
    log2_cells: int = eqx.field(static=True)
    log2_roots: int = eqx.field(static=True)
    levels: int = eqx.field(static=True)
    faces: int = eqx.field(static=True)
    pages: int = eqx.field(static=True)
    nodes: int = eqx.field(static=True)

    @property
    def side(self) -> int:
        """Texels per page side, guard band included."""
        return (1 << self.log2_node) + 2 * GUARD

    @property
    def cells_per_node(self) -> int:
        return 1 << (2 * self.log2_cells)

    @property
    def roots(self) -> int:
        """Number of level-0 nodes over all faces; they are the first nodes and pages."""
        return self.faces << (2 * self.log2_roots)

    def log2_nodes_at(self, level):
        """log2 of the nodes per face side at a level."""
        return self.log2_roots + level * self.log2_cells

    def log2_resolution(self, level):
        """log2 of the effective resolution at a level."""
        return self.log2_nodes_at(level) + self.log2_node


class Tree(eqx.Module):
    """The arrays of a tree on the device.

    Attributes:
        child: (nodes * c * c,) node in each cell, -1 for an empty cell.
        page: (nodes,) page of each node, -1 for none.
        level: (pages + 1,) level of each page.
        depth: (pages + 1, side * side) float32 axial depth of each texel, scene units; None if
            not compared.
        prim: (pages + 1, side * side) packed primitive of each texel; None if not compared.
    """

    child: Int[Array, " cells"]
    page: Int[Array, " nodes"]
    level: Int[Array, " pages"]
    depth: Float[Array, "pages texels"] | None
    prim: UInt16[Array, "pages texels"] | None


def empty_tree(shape: TreeShape, compare: Compare) -> Tree:
    """A tree without nodes."""
    texels = (shape.pages + 1, shape.side**2)
    depth, prim = stored(compare, jnp.zeros(texels, jnp.float32), jnp.zeros(texels, jnp.int32))
    return Tree(
        child=jnp.full(shape.nodes * shape.cells_per_node, -1, jnp.int32),
        page=jnp.full(shape.nodes, -1, jnp.int32),
        level=jnp.zeros(shape.pages + 1, jnp.int32),
        depth=depth,
        prim=prim,
    )


def find_pages(
    shape: TreeShape, tree: Tree, receivers: Receivers, at: Int[Array, "2 n"]
) -> Int[Array, " n"]:
    """The deepest page (n,) that covers each receiver at fixed-point coordinates `at`."""
    column, row = index_at(at, shape.log2_roots)
    node = (((receivers.face << shape.log2_roots) + row) << shape.log2_roots) + column
    mask = (1 << shape.log2_cells) - 1

    def going(carry):
        level, active, _, _ = carry
        return (level <= shape.levels) & active.any()

    def descend(carry):
        level, active, node, page = carry
        x, y = index_at(at, shape.log2_nodes_at(level)) & mask
        child = tree.child[node * shape.cells_per_node + (y << shape.log2_cells) + x]
        active &= child >= 0
        node = jnp.where(active, child, node)
        own = tree.page[node]
        return level + 1, active, node, jnp.where(own >= 0, own, page)

    start = (jnp.int32(1), jnp.ones(at.shape[1], bool), node, tree.page[node])
    return jax.lax.while_loop(going, descend, start)[3]


def texel_of(shape: TreeShape, tree: Tree, at: Int[Array, "2 n"], page: Int[Array, " n"]):
    """Each receiver's own texel (2, n) in its page, and log2 of the page's resolution (n,)."""
    log2 = shape.log2_resolution(tree.level[page])
    return index_at(at, log2), log2


def page_outcome(
    shape: TreeShape,
    tree: Tree,
    receivers: Receivers,
    at: Int[Array, "2 n"],
    page: Int[Array, " n"],
    step: Int[Array, "2 n"],
    *,
    bias: float,
    perspective: bool,
):
    """Whether the texel `step` (columns, rows; at most the guard band) beside a receiver's own
    texel lights it: (n,) bool."""
    texel, log2 = texel_of(shape, tree, at, page)
    local = (texel & ((1 << shape.log2_node) - 1)) + GUARD + step
    flat = page * shape.side**2 + local[1] * shape.side + local[0]
    return lit_by_texel(
        receivers,
        centre_offset(at, texel + step, log2, receivers.depth.dtype),
        jnp.exp2(-log2.astype(receivers.depth.dtype)),
        None if tree.depth is None else tree.depth.reshape(-1)[flat],
        None if tree.prim is None else tree.prim.reshape(-1)[flat],
        bias=bias,
        perspective=perspective,
    )


def lookup(
    shape: TreeShape,
    tree: Tree,
    receivers: Receivers,
    *,
    bias: float,
    perspective: bool,
):
    """Visibility (n,) bool by the finest texel over each receiver, and its level (n,)."""
    at = fixed_point(receivers.uv)
    page = find_pages(shape, tree, receivers, at)
    lit = page_outcome(
        shape, tree, receivers, at, page, jnp.zeros_like(at),
        bias=bias, perspective=perspective,
    )  # fmt: skip
    return lit, tree.level[page]


def page_windows(
    shape: TreeShape, face: np.ndarray, level: np.ndarray, column: np.ndarray, row: np.ndarray
) -> TexelWindows:
    """The texel windows of nodes, guard bands included, for one launch of light rays."""
    texel = np.ldexp(1.0, -(shape.log2_resolution(level)))
    corner = np.stack([column, row]) * np.ldexp(1.0, -shape.log2_nodes_at(level)) - GUARD * texel
    return TexelWindows(face=face, corner=corner, texel=np.stack([texel, texel]), side=shape.side)


@partial(jax.jit, donate_argnums=(0, 1, 2))
def store_pages(level, depth, prim, pages, new_level, new_depth, new_prim):
    """Write pages into the texel arrays, which are reused in place; returns (level, depth, prim).

    Entries of `pages` equal to the number of pages are padding and land in the spare page.
    """
    k = pages.shape[0]
    if depth is not None:
        depth = depth.at[pages].set(new_depth.reshape(k, -1))
    if prim is not None:
        prim = prim.at[pages].set(pack_prim(new_prim).reshape(k, -1))
    return level.at[pages].set(new_level), depth, prim
