"""Integer addresses in the light's image, exact at every level.

Image coordinates become fixed-point integers of `BITS` fractional bits once; node, cell and texel
indices at any power-of-two resolution are then shifts and masks of the same integer, so a point
on a border belongs to one node only, at whatever level it is asked.
Texel numbers beyond 2^31 never appear: a texel is addressed as (node, local).
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

BITS = 30
"""Fractional bits of a fixed-point image coordinate: 2^30 steps per face side."""

DEEPEST_LOG2 = 24
"""log2 of the finest effective resolution: float32 image coordinates and ray directions, which the
addresses are made of, have 24 bits. Leaves 6 bits for the place within a texel in float64."""


def fixed_point(uv: Float[Array, "2 n"]) -> Int[Array, "2 n"]:
    """Image coordinates in [0, 1) as int32 fixed-point numbers; clamped into the image."""
    scaled = jnp.clip(jnp.floor(uv * (1 << BITS)), 0, 1 << BITS)
    # The upper limit in integers: float32 has no number between 2^30 - 64 and 2^30.
    return jnp.minimum(scaled.astype(jnp.int32), (1 << BITS) - 1)


def index_at(at: Int[Array, "2 n"], log2_resolution) -> Int[Array, "2 n"]:
    """Texel, cell or node index (2, n) of fixed-point coordinates on a grid of 2**log2 a side."""
    return at >> (BITS - log2_resolution)


def centre_offset(
    at: Int[Array, "2 n"], index: Int[Array, "2 n"], log2_resolution, dtype
) -> Float[Array, "2 n"]:
    """Image offset (du, dv) from fixed-point coordinates to the centre of texel `index`.

    The difference is formed in integers: no digits cancel, at any level.
    """
    shift = BITS - log2_resolution
    centre = (index << shift) + (1 << (shift - 1))
    return (centre - at).astype(dtype) * (2.0**-BITS)
