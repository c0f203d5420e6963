"""The texels of an adaptive map around points, whatever pages they are in.

A step counts in the point's own texels. Within the guard band the point's page answers; further
away whatever page serves that place, so across the border of a finer or coarser page a filter's
window stays as wide as it is, and a tap is answered by a smaller or larger texel, compared at that
texel's own centre.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers import Receivers, SurfacePoints, project
from asmjax.shadow.adaptive.address import (
    BITS,
    Address,
    address_of,
    below_1,
    index_at,
    inverse_power,
)
from asmjax.shadow.adaptive.page_table import level_of
from asmjax.shadow.adaptive.shape import GUARD, TreeShape
from asmjax.shadow.adaptive.tree import Tree, page_outcome, serve
from asmjax.shadow.neighbourhood import Neighbourhood, Step, beside, is_own


class PagedNeighbourhood(Neighbourhood):
    """Texels of a tree; what is beyond a face's border is its last texel.

    Attributes:
        entry: (n,) page table entry of the page that serves each point.
    """

    receivers: Receivers
    fraction: Float[Array, "2 n"]
    address: Address
    entry: Int[Array, " n"]
    tree: Tree
    bias: np.ndarray | Array
    shape: TreeShape = eqx.field(static=True)
    perspective: bool = eqx.field(static=True)

    def lit(
        self, columns: Step = 0, rows: Step = 0, *, most: int | None = None
    ) -> Bool[Array, " n"]:
        address, log2 = self.address, self.shape.log2_resolution(level_of(self.entry))
        outcome = partial(
            page_outcome, self.shape, self.tree, self.receivers, address,
            bias=self.bias, perspective=self.perspective,
        )  # fmt: skip
        if is_own(columns, rows):
            return outcome(self.entry, None)
        column, row = index_at(address.x, log2), index_at(address.y, log2)
        last = (1 << log2) - 1
        step = beside(column, columns, last) - column, beside(row, rows, last) - row
        if most is not None and most <= GUARD:
            return outcome(self.entry, step)
        shift = BITS - log2
        place = address._replace(x=address.x + (step[0] << shift), y=address.y + (step[1] << shift))
        return outcome(serve(self.shape, self.tree, self.receivers, place), None, place=place)


@partial(jax.jit, static_argnames="shape")
def placed(tree: Tree, points: SurfacePoints, frame, offset, anchor, *, shape: TreeShape):
    """What `PagedNeighbourhood` begins with: receivers, fraction, address and entry."""
    receivers = project(points, frame, offset)
    address = address_of(points, anchor, receivers, frame.perspective)
    entry = serve(shape, tree, receivers, address)
    log2 = shape.log2_resolution(level_of(entry))
    texel = (1 << (BITS - log2)) - 1
    scale = inverse_power(BITS - log2, points.position.dtype)
    parts = (
        below_1(((at & texel).astype(rest.dtype) + rest) * scale)
        for at, rest in ((address.x, address.rest_x), (address.y, address.rest_y))
    )
    return receivers, jnp.stack(list(parts)), address, entry
