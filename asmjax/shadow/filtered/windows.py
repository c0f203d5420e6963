"""Filters of fixed weights around a point: outcomes of shadow tests, averaged over a window.

The hardware's 2 x 2 is the exact average over a window of one texel, and sixteen of those, one
texel apart, are the one over four texels (docs/theory.md, "Filtering"). All of them are products of
weights along columns and along rows, so k x k tests do.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from asmjax.shadow.neighbourhood import Neighbourhood, Step

UNROLLED = 5
"""Rows of tests that are written out; more of them are a loop, which compiles in less time."""


def box(around: Neighbourhood, width: float) -> Float[Array, " n"]:
    """The exact share of light over a window of `width` x `width` texels centred at each point.

    Piecewise linear along each axis in where the point lies. A width of 0 asks the point's own
    texel: what the map itself says.
    """
    if width == 0:
        return around.lit().astype(around.fraction.dtype)
    half, count = width / 2, math.ceil(width) + 1
    whole = half.is_integer()
    most = int(half) if whole else max(math.ceil(half), math.floor(1 - half) + count - 1)
    first, weights = [], []
    for along in around.fraction:
        low, high = along - half, along + half
        start = jnp.full_like(low, -half) if whole else jnp.floor(low)
        first.append(-int(half) if whole else start.astype(jnp.int32))
        weights.append([
            jnp.maximum(jnp.minimum(high, start + (k + 1)) - jnp.maximum(low, start + k), 0)
            for k in range(count)
        ])  # fmt: skip
    return _separable(around, first, weights, most)


def dithered(around: Neighbourhood, pixel: Int[Array, "2 n"]) -> Float[Array, " n"]:
    """Four of the sixteen hardware tests, which four depends on the pixel (Bunnell and Pellacini
    2004, 11.4): the four pixels of a 2 x 2 block take all of them.

    Taps stand two texels apart, so their 2 x 2 tests share no texel: 4 x 4 in all, whose weights
    along each axis are 1 - f, f, 1 - f, f from `pixel`'s offset on.
    """
    x, y = pixel & 1
    first = [x - 2, (x ^ y) - 2]
    weights = [[1 - along, along, 1 - along, along] for along in around.fraction]
    return _separable(around, first, weights, 2)


def _separable(
    around: Neighbourhood,
    first: Sequence[Step],
    weights: Sequence[Sequence[Float[Array, " n"]]],
    most: int,
) -> Float[Array, " n"]:
    """Weighted share of light; exactly 1 where all tests are lit, exactly 0 where none is.

    Args:
        first: columns and rows to the first texel.
        weights: along columns and along rows.
        most: no step is larger.
    """
    across, down = weights

    def row(j, weight, sums):
        lit_row = dark_row = jnp.zeros_like(weight)
        for i, share in enumerate(across):
            lit = around.lit(first[0] + i, first[1] + j, most=most)
            lit_row += jnp.where(lit, share, 0)
            dark_row += jnp.where(lit, 0, share)
        return sums[0] + weight * lit_row, sums[1] + weight * dark_row

    sums = (jnp.zeros_like(down[0]),) * 2
    if len(down) <= UNROLLED:
        for j, weight in enumerate(down):
            sums = row(j, weight, sums)
    else:
        numbered = jnp.arange(len(down), dtype=jnp.int32), jnp.stack(list(down))
        sums, _ = jax.lax.scan(lambda sums, each: (row(*each, sums), None), sums, numbered)
    lit, dark = sums
    return lit / (lit + dark)
