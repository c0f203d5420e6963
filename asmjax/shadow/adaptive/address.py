"""Where a receiver lies in the light's image, to a thousandth of a texel at 2^22 texels a side.

float32 image coordinates have 24 bits: one texel of a map of 2^22 is four roundings. Here they are
formed in pairs of floats, "high" and "low" part, from an anchor that the host computes in float64
(docs/theory.md, "Addresses"), and become fixed-point integers of `BITS` fractional bits once; node,
cell and texel indices at any power-of-two resolution are then shifts of the same integer, so a
point on a border belongs to one node only, at whatever level it is asked.
Texel numbers beyond 2^31 never appear: a texel is addressed as (page, local).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from asmjax.buffers import Receivers, SurfacePoints
from asmjax.geometry import LightFrame

BITS = 30
"""Fractional bits of a fixed-point image coordinate: 2^30 steps per face side."""

DEEPEST_LOG2 = 24
"""log2 of the finest effective resolution: the renderer's float32 ray directions have 24 bits."""

_UPPER_HALF = np.int32(-4096)
"""Keeps 12 of float32's 24 significant bits: the product of two such halves is exact."""


class Anchor(eqx.Module):
    """The map from positions to image coordinates, u = row_u(p) / row_w(p), in two parts a number.

    Each row is a base, its value at the points' origin, and three weights. `high` + `low` is the
    float64 number; weights in `high` have 12 bits.

    Attributes:
        high, low: (3, 4, faces): rows u, v, w; base and weights of x, y, z. For parallel light the
            row w is not used.
    """

    high: np.ndarray | Array
    low: np.ndarray | Array


def anchor(points: SurfacePoints, frame: LightFrame) -> Anchor:
    """The anchor of these points in `frame`, computed in float64 on the host."""
    concrete = isinstance(points.origin, np.ndarray) and isinstance(frame.origin, np.ndarray)
    # Inside a transformation of the caller's it is computed there, in the precision at hand.
    xp = np if concrete else jnp
    offset = xp.asarray(points.origin) - xp.asarray(frame.origin)
    e_u, e_v, e_w = (frame.rotation[:, k] for k in range(3))
    rows = []
    for k, axis in enumerate((e_u, e_v)):
        corner, extent = frame.corner[:, k, None], frame.extent[:, k, None]
        if frame.perspective:
            weights = (axis - corner * e_w) / extent
            base = weights @ offset
        else:
            weights = axis / extent
            base = weights @ offset - (corner / extent)[:, 0]
        rows.append(xp.concatenate([base[:, None], weights], axis=1))
    rows.append(xp.concatenate([(e_w @ offset)[:, None], e_w], axis=1))
    exact = xp.stack(rows).transpose(0, 2, 1)
    if points.position.dtype == jnp.float64 or not concrete:
        return Anchor(exact, xp.zeros_like(exact))
    high = exact.astype(np.float32)
    weights = np.ascontiguousarray(high[:, 1:]).view(np.int32) & _UPPER_HALF
    high[:, 1:] = weights.view(np.float32)
    return Anchor(high, (exact - high).astype(np.float32))


class Address(eqx.Module):
    """Fixed-point image coordinates and what is left below their last bit.

    Attributes:
        at: (2, n) int32 from 0 to 2^30 - 1.
        rest: (2, n) in [0, 1), in units of 2^-30.
    """

    at: Int[Array, "2 n"]
    rest: Float[Array, "2 n"]


def address_of(points: SurfacePoints, anchor: Anchor, receivers: Receivers, perspective: bool):
    """The `Address` of each receiver; the middle of the image where it does not face the light."""
    rows = _rows(points.position, anchor, receivers.face)
    facing = receivers.facing
    if perspective:
        rows = [_quotient(row, rows[2], facing) for row in rows[:2]]
    addresses = [_fixed_point(*row, facing) for row in rows[:2]]
    at, rest = zip(*addresses, strict=True)
    return Address(jnp.stack(at), jnp.stack(rest))


def _rows(position, anchor: Anchor, face):
    """The three linear forms at each point, as pairs (high, low) of (n,)."""
    dtype = position.dtype
    parts = [_halves(x) for x in position]
    rows = []
    for k in range(3):
        high, low = (
            [_of_face(jnp.asarray(table, dtype)[k, j], face) for j in range(4)]
            for table in (anchor.high, anchor.low)
        )
        total, rest = high[0] * jnp.ones_like(position[0]), low[0]
        for j, (x, (upper, lower)) in enumerate(zip(position, parts, strict=True), start=1):
            total, lost = _two_sum(total, high[j] * upper)
            rest = rest + (lost + (high[j] * lower + low[j] * x))
        rows.append(_two_sum(total, rest))
    return rows


def _of_face(values, face):
    return values[0] if values.shape[0] == 1 else values[face]


def _halves(x):
    """Upper half of each number's bits, and the rest; float64 is precise enough whole."""
    if x.dtype != jnp.float32:
        return x, jnp.zeros_like(x)
    bits = jax.lax.bitcast_convert_type(x, jnp.int32) & _UPPER_HALF
    upper = jax.lax.bitcast_convert_type(bits, jnp.float32)
    return upper, x - upper


def _two_sum(a, b):
    """a + b rounded, and what the rounding lost (Knuth)."""
    total = a + b
    b_part = total - a
    return total, (a - (total - b_part)) + (b - b_part)


def _quotient(a, b, where):
    """a / b of two pairs: a float quotient, and the remainder that it leaves divided once more."""
    (a_high, a_low), (b_high, b_low) = a, b
    b_high = jnp.where(where, b_high, 1)
    a_high, a_low = jnp.where(where, a_high, 0.5), jnp.where(where, a_low, 0)
    quotient = a_high / b_high
    product = quotient * b_high
    (q_up, q_lo), (b_up, b_lo) = _halves(quotient), _halves(b_high)
    if quotient.dtype == jnp.float32:
        lost = ((q_up * b_up - product) + q_up * b_lo + q_lo * b_up) + q_lo * b_lo
    else:
        lost = jnp.zeros_like(product)
    remainder = ((a_high - product) - lost) + (a_low - quotient * b_low)
    return quotient, remainder / b_high


def _fixed_point(high, low, facing):
    """Floor of (high + low) * 2^30 as int32, clamped into the image, and the fraction below it."""
    scale = jnp.asarray(2.0**BITS, high.dtype)
    high, low = jnp.where(facing, high, 0.5) * scale, jnp.where(facing, low, 0) * scale
    whole = jnp.floor(jnp.clip(high, 0, scale))
    fraction = (high - whole) + low
    carry = jnp.floor(fraction)
    # The upper limit in integers: float32 has no number between 2^30 - 64 and 2^30.
    at = whole.astype(jnp.int32) + jnp.clip(carry, -(2.0**24), 2.0**24).astype(jnp.int32)
    inside = (at >= 0) & (at < 1 << BITS)
    return jnp.clip(at, 0, (1 << BITS) - 1), jnp.where(inside, fraction - carry, 0)


def index_at(at: Int[Array, "..."], log2_resolution) -> Int[Array, "..."]:
    """Texel, cell or node index of fixed-point coordinates on a grid of 2**log2 a side."""
    return at >> (BITS - log2_resolution)


def centre_offset(
    address: Address, index: Int[Array, "2 n"], log2_resolution
) -> Float[Array, "2 n"]:
    """Image offset (du, dv) from each receiver to the centre of texel `index`.

    The difference is formed in integers: no digits cancel, at any level.
    """
    shift = BITS - log2_resolution
    centre = (index << shift) + (1 << (shift - 1))
    dtype = address.rest.dtype
    return ((centre - address.at).astype(dtype) - address.rest) * (2.0**-BITS)
