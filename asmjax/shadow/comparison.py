"""The shadow test of one receiver against one texel, shared by all maps.

A texel stores what its centre's ray hits, so it is compared with the receiver's tangent plane
met by *that* ray, not with the receiver's own depth (docs/theory.md, "The shadow test"): a plane at
any slope then has no acne. A bias of a few roundings covers what is left. It is a distance along
the normal in parts of that to the light, hence a depth that grows with the secant of the light's
incidence, as the rounding of a depth on an inclined plane does.
"""

import math
from typing import Literal, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt16

from asmjax.buffers import Receivers
from asmjax.errors import check_choice, require
from asmjax.geometry import LightFrame

Compare = Literal["depth", "id", "both"]
"""What decides: depth alone, primitive id alone, or lit if either says so (Fernando et al. 2001,
4.2: the id test has no bias, the depth test mends it along mesh edges)."""

Number = Float[Array, ""] | Float[np.ndarray, ""] | float
"""A number, as the host or a jitted function has it."""

BIAS = 5e-6
"""Distance along the receiver's normal by which a caster must be nearer, as a fraction of the
distance to the light (of parallel light: of the depth): 5e-5 units at 10 units. A few float32
roundings; see `lit_by_texel`."""

CURVATURE_BIAS = 0.2
"""Further distance along the normal, in texel widths: within half a texel a surface that curves
towards the light (or a concave edge of up to 0.2 radians between triangles) rises this far above
the tangent plane. Shrinks with the texels, so it vanishes where a map is refined."""

FLATTEST = 1 / 16
"""A plane that leaves [1/16, 16] times the receiver's depth within a texel is not trusted."""


class Tested(Protocol):
    """The settings of the shadow test, which every algorithm has.

    Attributes:
        compare: what is stored and compared.
        bias: distance along the receiver's normal by which a caster must be nearer, in parts of the
            distance to the light; under parallel light, of the receiver's depth.
    """

    compare: Compare
    bias: float


def check_test(compare: str, bias: float) -> None:
    """Raise `UseError` for an unknown comparison or a bias that is no length."""
    require(
        math.isfinite(bias) and bias >= 0,
        f"a bias of {bias} is not possible; allowed: a finite number, 0 or more.",
    )
    check_choice("compare", compare, Compare)


def plane_depth(
    receivers: Receivers, offset_uv: Float[Array, "2 n"], perspective: bool
) -> Float[Array, " n"]:
    """Axial depth of each receiver's tangent plane at an image offset (du, dv) from it.

    Where the plane is not trusted there (see `plane_is_trusted`), the receiver's own depth.
    """
    along = _along(receivers, offset_uv)
    if not perspective:
        return receivers.depth + along
    trusted = plane_is_trusted(receivers, offset_uv, perspective)
    return receivers.depth / jnp.where(trusted, 1 + along, 1)


def _along(receivers: Receivers, offset_uv) -> Float[Array, " n"]:
    # Written out: a reduction over the first axis takes XLA's CPU backend seven times as long.
    (du, dv), (slope_u, slope_v) = offset_uv, receivers.slope
    return slope_u * du + slope_v * dv


def plane_is_trusted(
    receivers: Receivers, offset_uv: Float[Array, "2 n"], perspective: bool
) -> Bool[Array, " n"]:
    """Whether a texel `offset_uv` away can decide about each receiver at all.

    On a plane seen nearly edge-on a coarse texel's ray meets it far away, or never.
    """
    if not perspective:
        return jnp.ones_like(receivers.facing)
    scale = 1 + _along(receivers, offset_uv)
    return (scale > FLATTEST) & (scale < 1 / FLATTEST)


def depth_tolerance(
    receivers: Receivers, texel: Float[Array, "..."] | float, bias: Number
) -> Float[Array, " n"]:
    """By how much a texel's axial depth may be less than that of each receiver's tangent plane and
    still be taken for it, scene units: (n,)."""
    bias = jnp.asarray(bias, receivers.depth.dtype)
    return receivers.secant * (bias * receivers.depth + CURVATURE_BIAS * texel * receivers.reach)


def bias_distance(
    receivers: Receivers, frame: LightFrame, texel: Float[Array, "..."] | float, bias: Number
) -> Float[Array, " n"]:
    """How far along its normal a caster may stand above each receiver's tangent plane and still be
    taken for the receiver, scene units: (n,). What is thicker than that casts its shadow.

    A distance h along the normal is an axial depth of h sec(psi) cos(phi), psi the incidence of the
    light and phi the angle between ray and axis: `depth_tolerance` without the two.
    """
    distance = depth_tolerance(receivers, texel, bias) / receivers.secant
    if not frame.perspective:
        return distance
    corner, extent = (
        jnp.asarray(a, distance.dtype)[receivers.face].T for a in (frame.corner, frame.extent)
    )
    x, y = corner + receivers.uv * extent
    return distance * jnp.sqrt(x * x + y * y + 1)


def lit_by_texel(
    receivers: Receivers,
    offset_uv: Float[Array, "2 n"],
    texel: Float[Array, "..."] | float,
    map_depth: Float[Array, " n"] | None,
    map_prim: UInt16[Array, " n"] | None,
    *,
    bias: Number,
    perspective: bool,
) -> Bool[Array, " n"]:
    """Whether the texel `offset_uv` away lets light through to each receiver.

    False where the receiver does not face the light: the same primitive's back side is dark. Ids
    count for flat primitives only (others are -1): the inside of a sphere is shaded by its outside.
    `texel` is the texel's size in u and v, one number or (n,). `map_depth` and `map_prim` may be
    None where the map does not store them.
    """
    lit = jnp.zeros_like(receivers.facing)
    if map_depth is not None:
        tolerance = depth_tolerance(receivers, texel, bias)
        lit |= map_depth >= plane_depth(receivers, offset_uv, perspective) - tolerance
    if map_prim is not None:
        lit |= (map_prim == pack_prim(receivers.prim)) & (receivers.prim >= 0)
    return receivers.facing & lit


def stored(compare: Compare, depth, prim):
    """What a map keeps of a light buffer: (depth or None, packed primitive or None)."""
    return (
        None if compare == "id" else depth,
        None if compare == "depth" else pack_prim(prim),
    )


def texel_bytes(compare: Compare) -> int:
    """Bytes per texel: depth in float32, the packed primitive in two bytes."""
    return {"depth": 4, "id": 2, "both": 6}[compare]


@jax.jit
def pack_prim(prim: Int[Array, "..."]) -> UInt16[Array, "..."]:
    """Primitive ids as they are stored: 16 bits, in which up to 65,536 primitives differ
    (`asmjax.buffers.EXACT_IDS`).

    Beyond that, each run of 65,536 ids is shifted by a number drawn for it: neighbours in the
    scene's order differ, and keep their order. Of primitives of different runs one pair in 65,536
    is alike, whatever their distance: such a caster lets light through to such a receiver.
    """
    drawn = jnp.maximum(prim, 0).astype(jnp.uint32) >> 16
    # The integer hash `lowbias32` (Wellons 2018); of run 0 it is 0.
    drawn = (drawn ^ (drawn >> 16)) * jnp.uint32(0x7FEB352D)
    drawn = (drawn ^ (drawn >> 15)) * jnp.uint32(0x846CA68B)
    drawn ^= drawn >> 16
    return (prim.astype(jnp.uint32) + drawn).astype(jnp.uint16)
