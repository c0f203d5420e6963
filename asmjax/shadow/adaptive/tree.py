"""The pages of an adaptive shadow map on the device, and how receivers are served by them.

A node is a square of a face at some level; it is partitioned into c x c cells, each empty or
holding one child that covers exactly that cell. A node that holds texels owns a page: R x R texels
and a guard band of one texel around them. Nodes between a shallow and a deep page need no texels
of their own and own none. Level 0 is a grid of nodes that together make up the starting resolution.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt16

from asmjax.buffers import Receivers
from asmjax.shadow.adaptive.address import Address, centre_offset, index_at, inverse_power
from asmjax.shadow.adaptive.page_table import find_entries, level_of, page_of, take
from asmjax.shadow.adaptive.shape import GUARD, TreeShape
from asmjax.shadow.comparison import Compare, Number, lit_by_texel, pack_prim, stored, texel_bytes

FIRST_BYTES = 16 << 20
"""Memory of the texels that a tree begins with, at most: writing all of a large limit before
anything is cast takes longer than the casting."""

GROWTH = 4
"""Times as much memory where that is not enough."""


class Tree(NamedTuple):
    """The arrays of a tree on the device.

    Attributes:
        entries: (entries,) page tables, see `asmjax.shadow.adaptive.page_table`.
        depth: (capacity + 1, side * side) float32 axial depth of each texel, scene units; None if
            not compared. The last row is the spare page.
        prim: (capacity + 1, side * side) packed primitive of each texel; None if not compared.
    """

    entries: Int[Array, " entries"]
    depth: Float[Array, "pages texels"] | None
    prim: UInt16[Array, "pages texels"] | None

    @property
    def capacity(self) -> int:
        """Pages that there is memory for; the tree's shape says how many there may be."""
        return next(len(texels) for texels in self[1:] if texels is not None) - 1


def empty_tree(shape: TreeShape, compare: Compare) -> Tree:
    """A tree without pages, with memory for `FIRST_BYTES` of them."""
    first = max(FIRST_BYTES // (shape.side**2 * texel_bytes(compare)), 1)
    return _empty(shape, compare, min(shape.pages, first))


@partial(jax.jit, static_argnums=(0, 1, 2))
def _empty(shape: TreeShape, compare: Compare, capacity: int) -> Tree:
    texels = (capacity + 1, shape.side**2)
    depth, prim = stored(compare, jnp.zeros(texels, jnp.float32), jnp.zeros(texels, jnp.int32))
    return Tree(jnp.zeros(shape.entries, jnp.int32), depth, prim)


def with_room(shape: TreeShape, tree: Tree, pages: int) -> Tree:
    """The tree with memory for `pages` pages at least; itself where it has that already.

    While it grows, the old arrays are there beside the new ones. What is compiled for a tree is
    compiled anew for a larger one.
    """
    capacity = tree.capacity
    if capacity >= pages:
        return tree
    while capacity < pages:
        capacity *= GROWTH
    return _with_capacity(tree, min(capacity, shape.pages))


@partial(jax.jit, static_argnums=1)
def _with_capacity(tree: Tree, capacity: int) -> Tree:
    def longer(texels):
        if texels is None:
            return None
        return jnp.pad(texels, ((0, capacity + 1 - len(texels)), (0, 0)))

    return Tree(tree.entries, longer(tree.depth), longer(tree.prim))


def serve(shape: TreeShape, tree: Tree, receivers: Receivers, address: Address):
    """The entry (n,) of the deepest page over each receiver."""
    return find_entries(shape, tree.entries, receivers.face, (address.x, address.y))


@partial(jax.jit, static_argnames=("shape", "perspective"))  # traced once for all taps
def page_outcome(
    shape: TreeShape,
    tree: Tree,
    receivers: Receivers,
    address: Address,
    entry: Int[Array, " n"],
    step: tuple[Int[Array, " n"], Int[Array, " n"]] | None,
    *,
    bias: Number,
    perspective: bool,
    place: Address | None = None,
):
    """Whether the texel `step` (columns, rows; at most the guard band) beside a receiver's own
    texel lights it: (n,) bool. None means its own texel.

    `place` is where the page of `entry` is looked into, if that is not where the receiver lies.
    """
    log2 = shape.log2_resolution(level_of(entry))
    dx, dy = (0, 0) if step is None else step
    place = address if place is None else place
    column, row = index_at(place.x, log2), index_at(place.y, log2)
    mask = (1 << shape.log2_node) - 1
    x, y = (column & mask) + GUARD + dx, (row & mask) + GUARD + dy
    flat = page_of(entry) * shape.side**2 + y * shape.side + x
    return lit_by_texel(
        receivers,
        centre_offset(address, (column + dx, row + dy), log2),
        inverse_power(log2, receivers.depth.dtype),
        None if tree.depth is None else take(tree.depth.reshape(-1), flat),
        None if tree.prim is None else take(tree.prim.reshape(-1), flat),
        bias=bias,
        perspective=perspective,
    )


def lookup(
    shape: TreeShape,
    tree: Tree,
    receivers: Receivers,
    address: Address,
    *,
    bias: Number,
    perspective: bool,
):
    """Visibility (n,) bool by the finest texel over each receiver, and its level (n,)."""
    entry = serve(shape, tree, receivers, address)
    lit = page_outcome(
        shape, tree, receivers, address, entry, None, bias=bias, perspective=perspective
    )
    return lit, level_of(entry)


@partial(jax.jit, donate_argnums=(0, 1))
def store_pages(depth, prim, pages, new_depth, new_prim):
    """Write pages into the texel arrays, which are reused in place; returns (depth, prim).

    Entries of `pages` equal to the tree's capacity are padding and land in the spare page.
    """
    return tuple(
        None if texels is None else texels.at[pages].set(new)
        for texels, new in zip((depth, prim), _as_stored(new_depth, new_prim), strict=True)
    )


@partial(jax.jit, donate_argnums=(0, 1))
def store_run(depth, prim, first, count, new_depth, new_prim):
    """`store_pages` for `count` pages in a row from `first` on, in two thirds of the time.

    What is beyond `count` is padding, and stays as it was; it must not reach beyond the last page.
    """

    def written(texels, new):
        if texels is None:
            return None
        mine = (jnp.arange(len(new)) < count)[:, None]
        old = jax.lax.dynamic_slice_in_dim(texels, first, len(new))
        return jax.lax.dynamic_update_slice_in_dim(texels, jnp.where(mine, new, old), first, 0)

    return tuple(map(written, (depth, prim), _as_stored(new_depth, new_prim)))


def _as_stored(depth, prim):
    """Texels of new pages (k, side, side) as a tree holds them, (k, side * side)."""
    return (
        None if depth is None else depth.reshape(len(depth), -1),
        None if prim is None else pack_prim(prim).reshape(len(prim), -1),
    )
