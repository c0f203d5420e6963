"""The texels of charts around points."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, UInt16

from asmjax.buffers import Receivers
from asmjax.shadow.comparison import lit_by_texel
from asmjax.shadow.neighbourhood import Neighbourhood, Step, beside, is_own
from asmjax.shadow.warped.table import Place


class ChartNeighbourhood(Neighbourhood):
    """Texels of charts; what is beyond a chart's border is its last texel.

    Another chart may hold that place, but for other receivers: of other depths, or of another part
    of the view.

    Attributes:
        width: (n,) longer side of each point's texel, as a fraction of the image's longer side.
        found: (n,) whether a chart holds the point.
        depth, prim: of all texels, as `Drawn` has them.
    """

    receivers: Receivers
    fraction: Float[Array, "2 n"]
    place: Place
    width: Float[Array, " n"]
    found: Bool[Array, " n"]
    depth: Float[Array, " texels"] | None
    prim: UInt16[Array, " texels"] | None
    bias: np.ndarray | Array
    perspective: bool = eqx.field(static=True)

    def lit(
        self, columns: Step = 0, rows: Step = 0, *, most: int | None = None
    ) -> Bool[Array, " n"]:
        place, flat, offset = self.place, self.place.flat, self.place.offset
        if not is_own(columns, rows):
            (column, row), (across, down) = place.texel, place.size
            x = beside(column, columns, across - 1) - column
            y = beside(row, rows, down - 1) - row
            flat = flat + y * across + x
            offset = offset + step_to(place, x, y)
        lit = lit_by_texel(
            self.receivers,
            offset,
            self.width,
            None if self.depth is None else self.depth[flat],
            None if self.prim is None else self.prim[flat],
            bias=self.bias,
            perspective=self.perspective,
        )
        return lit & self.found


def step_to(place: Place, columns, rows):
    """Image offset (2, n) from one texel's centre to another one's, without loss of digits.

    With c = A / w the homogeneous form of a centre and F d the change of (A, w) over the step d,
    the next centre is away by (F d - c F_w d) / (w + F_w d). Rows of a logarithmic chart grow by a
    constant part, so d there is a geometric sum.
    """
    dtype = place.offset.dtype
    grown = jnp.where(place.rate == 0, 1, place.rate)
    s, t = columns.astype(dtype), rows.astype(dtype)
    t = jnp.where(place.rate == 0, t, jnp.expm1(grown * t) / grown)
    scale = 1 + place.nearing[0] * s + place.nearing[1] * t
    scale = jnp.where(scale > 0, scale, 1)
    return jnp.stack([(du * s + dv * t) / scale for du, dv in place.per_texel])
