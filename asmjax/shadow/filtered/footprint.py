"""Percentage-closer filtering as it began: samples all over a pixel's footprint in the map."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from asmjax.shadow.filtered.pixels import noise
from asmjax.shadow.neighbourhood import Neighbourhood

FARTHEST = 2.0**24
"""Texels that a sample is away at the most: no map has more a side."""


def box_of(texels: Float[Array, "2 2 n"], least: Float[Array, ""] | float) -> Float[Array, "2 n"]:
    """Half the sides, in texels, of the box along columns and rows around a pixel's footprint.

    `texels` is d(texel) / d(pixel): the footprint on the receiver's tangent plane is the
    parallelogram of its columns. No side is shorter than `least` texels.
    """
    return 0.5 * jnp.maximum(jnp.abs(texels[:, 0]) + jnp.abs(texels[:, 1]), least)


def stratified_share(
    around: Neighbourhood,
    half: Float[Array, "2 n"],
    pixel: Int[Array, "2 n"],
    strata: int,
) -> Float[Array, " n"]:
    """Share of light by `strata`^2 samples in the box of half sides `half` (texels) around each
    point, one in each of its equal cells, at a place that the pixel decides."""

    def sample(number, lit):
        cell = jnp.stack([number % strata, number // strata]).astype(half.dtype)
        place = (cell[:, None] + noise(pixel, number, half.dtype)) * (2 / strata) - 1
        step = jnp.floor(around.fraction + half * place)
        columns, rows = jnp.clip(step, -FARTHEST, FARTHEST).astype(jnp.int32)
        return lit + around.lit(columns, rows).astype(lit.dtype)

    none = jnp.zeros_like(half[0])
    return jax.lax.fori_loop(0, strata**2, sample, none) / strata**2
