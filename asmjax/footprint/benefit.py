"""Benefit: where refinement can pay, and how many eye pixels a finer map of a cell would help."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from asmjax.errors import require

MOST_CELLS = 2**14
"""Cells a side: those of six faces still have numbers of 31 bits."""


def straddles_discontinuity(
    lit_taps: Bool[Array, "taps n"] | Sequence[Bool[Array, " n"]],
) -> Bool[Array, " n"]:
    """Whether the taps around a pixel see both outcomes for *this* receiver: 0 < PCF < 1.

    Relative to the receiver, unlike a threshold on depth gaps: free of scale, and it marks
    exactly the pixels whose visibility more texels could change.
    """
    # Written out: a reduction over the first axis takes XLA's CPU backend several times as long.
    some, every = lit_taps[0], lit_taps[0]
    for lit in lit_taps[1:]:
        some, every = some | lit, every & lit
    return some & ~every


def cell_index(uv: Float[Array, "2 n"], face: Int[Array, " n"], cells: int) -> Int[Array, " n"]:
    """Flat index of each receiver's cell in a grid of `cells` x `cells` per face.

    Raises:
        UseError: more cells a side than int32 can number.
    """
    require(
        1 <= cells <= MOST_CELLS,
        f"{cells} cells a side are not possible; allowed: 1 to {MOST_CELLS}.",
    )
    column, row = (jnp.clip((x * cells).astype(jnp.int32), 0, cells - 1) for x in uv)
    return (face * cells + row) * cells + column


def cell_benefit(
    index: Int[Array, " n"], counted: Bool[Array, " n"], cells_in_all: int
) -> Float[Array, " cells"]:
    """Pixels of each cell that straddle a discontinuity and are mismatched (`counted`).

    Fernando et al. 2001, 3.1: "the number of transformed eye pixels within the cell that straddle
    a depth discontinuity and whose shadow map resolution is lower than the eye view resolution".
    """
    return jax.ops.segment_sum(counted.astype(jnp.float32), index, cells_in_all)


def cell_worst(
    index: Int[Array, " n"], counted: Bool[Array, " n"], ratio, cells_in_all: int
) -> Float[Array, " cells"]:
    """Largest ratio over the counted pixels of each cell; 0 for a cell that has none."""
    return jax.ops.segment_max(jnp.where(counted, ratio, 0), index, cells_in_all).clip(0)
