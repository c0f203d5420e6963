"""Where a receiver lies in the light's image, to a thousandth of a texel at 2^22 texels a side.

float32 image coordinates have 24 bits: one texel of a map of 2^22 is four roundings. Here they are
formed in float64 from float32 positions relative to the eye and an anchor that the host computes
(docs/theory.md, "Addresses"), and become fixed-point integers of `BITS` fractional bits once; node,
cell and texel indices at any power-of-two resolution are then shifts of the same integer, so a
point on a border belongs to one node only, at whatever level it is asked.
Texel numbers beyond 2^31 never appear: a texel is addressed as (page, local).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from asmjax.buffers import Anchor, Receivers, SurfacePoints, image_rows

BITS = 30
"""Fractional bits of a fixed-point image coordinate: 2^30 steps per face side."""

DEEPEST_LOG2 = 24
"""log2 of the finest effective resolution: the renderer's float32 ray directions have 24 bits."""


class Address(NamedTuple):
    """Fixed-point image coordinates and what is left below their last bit.

    Four arrays and not two: stacked, XLA's CPU backend takes twice as long for a lookup.

    Attributes:
        x, y: (n,) int32 from 0 to 2^30 - 1: columns and rows.
        rest_x, rest_y: (n,) in [0, 1), in units of 2^-30.
    """

    x: Int[Array, " n"]
    y: Int[Array, " n"]
    rest_x: Float[Array, " n"]
    rest_y: Float[Array, " n"]

    @property
    def at(self) -> Int[Array, "2 n"]:
        return jnp.stack([self.x, self.y])

    @property
    def rest(self) -> Float[Array, "2 n"]:
        return jnp.stack([self.rest_x, self.rest_y])


def address_of(points: SurfacePoints, anchor: Anchor, receivers: Receivers, perspective: bool):
    """The `Address` of each receiver; the middle of the image where it does not face the light."""
    dtype, facing = points.position.dtype, receivers.facing
    # In float64 whatever the caller computes in: half the time of pairs of float32, and simpler.
    with jax.enable_x64(True):
        x, y, weight = image_rows(points, anchor, receivers.face, perspective)
        scale = jnp.float64(2.0**BITS)
        if perspective:
            scale = scale / jnp.where(facing, weight, 1)
        # Computed once: XLA's CPU backend would form it anew for everything made of it.
        scaled = jax.lax.optimization_barrier([x * scale, y * scale])
        (x, rest_x), (y, rest_y) = (_fixed_point(along, facing) for along in scaled)
    rests = (below_1(rest.astype(dtype)) for rest in (rest_x, rest_y))
    return Address(x, y, *rests)


def below_1(x):
    """`x` (below or at 1, by rounding) kept below it."""
    return jnp.minimum(x, 1 - jnp.finfo(x.dtype).epsneg)


def _fixed_point(scaled, facing):
    """Whole part of a number as int32, clamped into the image, and the fraction below it."""
    scaled = jnp.where(facing, scaled, 0.5 * 2.0**BITS)
    whole = jnp.floor(scaled)
    inside = (whole >= 0) & (whole < 2.0**BITS)
    at = jnp.clip(whole, 0, 2.0**BITS - 1)
    return jax.lax.convert_element_type(at, jnp.int32), jnp.where(inside, scaled - whole, 0)


def index_at(at: Int[Array, "..."], log2_resolution) -> Int[Array, "..."]:
    """Texel, cell or node index of fixed-point coordinates on a grid of 2**log2 a side."""
    return at >> (BITS - log2_resolution)


def centre_offset(
    address: Address,
    index: tuple[Int[Array, " n"], Int[Array, " n"]] | Int[Array, "2 n"],
    log2_resolution,
) -> Float[Array, "2 n"]:
    """Image offset (du, dv) from each receiver to the centre of texel `index`.

    The difference is formed in integers: no digits cancel, at any level.
    """
    shift = BITS - log2_resolution
    parts = zip(index, (address.x, address.y), (address.rest_x, address.rest_y), strict=True)
    return jnp.stack(
        [
            (((i << shift) + (1 << (shift - 1)) - at).astype(rest.dtype) - rest) * (2.0**-BITS)
            for i, at, rest in parts
        ]
    )


def inverse_power(log2, dtype):
    """2**-log2, from the bits of the exponent."""
    bits = jax.lax.bitcast_convert_type((127 - log2) << 23, jnp.float32)
    return bits.astype(dtype)
