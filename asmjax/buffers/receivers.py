"""Receivers: surface points as one light sees them."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers.points import SurfacePoints
from asmjax.geometry import LightFrame
from asmjax.numerics import LEAST_DEPTH, dot, safe_divide, safe_sqrt

GRAZING = 1e-4
"""Below this cosine between normal and light ray the receiver plane says nothing about depth."""


class Receivers(eqx.Module):
    """Surface points in a light's image.

    Attributes:
        face: (n,) face of the light frame, 0 where `facing` is False.
        uv: (2, n) image coordinates in [0, 1).
        depth: (n,) axial depth in scene units; 1 where `facing` is False.
        slope: (2, n) the receiver plane, per unit of u and v. Perspective: the plane's depth at
            an offset (du, dv) is depth / (1 + slope . (du, dv)). Orthographic: depth + slope .
            (du, dv). 0 where the plane is seen edge-on.
        secant: (n,) 1 / cosine of the angle between normal and light ray, at most 1 / GRAZING; 1
            where `facing` is False. Rounding moves a depth on the plane by about this much more.
        reach: (n,) world size of the whole image, its longer side, across the light ray at the
            receiver: a texel at resolution N is reach / N wide, scene units.
        prim: (n,) primitive id.
        facing: (n,) whether the light shines on the seen side of a valid point of its domain;
            everything else is dark whatever the shadow map holds.
    """

    face: Int[Array, " n"]
    uv: Float[Array, "2 n"]
    depth: Float[Array, " n"]
    slope: Float[Array, "2 n"]
    secant: Float[Array, " n"]
    reach: Float[Array, " n"]
    prim: Int[Array, " n"]
    facing: Bool[Array, " n"]


def light_offset(points: SurfacePoints, frame: LightFrame) -> np.ndarray:
    """(3,) float64: the points' origin as seen from the light's, formed before any rounding."""
    return np.asarray(points.origin, np.float64) - frame.origin


def project(points: SurfacePoints, frame: LightFrame, offset) -> Receivers:
    """Surface points in the light's image; pure, in the dtype of `points.position`.

    `offset` is `light_offset(points, frame)`. The plane form is that of a tap-based receiver
    plane (soft_and_hybrid reference 0.1): z_plane = n.(X - L) / (n.D) at a texel-centre ray D.
    """
    world = points.position + jnp.asarray(offset, points.position.dtype)[:, None]
    result = _on_face(points, frame, 0, world)
    for face in range(1, frame.faces):
        result = _either(result, _on_face(points, frame, face, world))
    return result


def _on_face(points: SurfacePoints, frame: LightFrame, face: int, world) -> Receivers:
    """The points as one face sees them; `world` (3, n) are positions relative to the light."""

    def cast(a):
        return jnp.asarray(a, world.dtype)

    axes, extent, corner = (cast(a[face]) for a in (frame.rotation, frame.extent, frame.corner))
    position = [dot(axis, world) for axis in axes]
    normal = [dot(axis, points.normal) for axis in axes]
    x, y, depth = position
    shone_on = points.valid & (depth > cast(frame.near))
    if frame.perspective:
        scale = depth
        shone_on &= depth > LEAST_DEPTH
        axial = dot(cast(frame.cone_axis), world)
        shone_on &= axial > cast(frame.cos_cutoff) * safe_sqrt(dot(world, world))
    else:
        scale = jnp.ones_like(depth)
    # Inside before dividing: nothing outside reaches a quotient, in value or gradient.
    for k in range(2):
        along = position[k] - corner[k] * scale
        shone_on &= (along >= 0) & (along < extent[k] * scale)
    x, y = jnp.where(shone_on, x, 0), jnp.where(shone_on, y, 0)
    depth = jnp.where(shone_on, depth, 1)
    reach = jnp.maximum(extent[0], extent[1]) * jnp.ones_like(depth)
    if frame.perspective:
        x, y = x / depth, y / depth
        along = normal[0] * x + normal[1] * y + normal[2]
        length = jnp.sqrt(x * x + y * y + 1)
        reach = reach * depth
    else:
        along, length = normal[2], jnp.ones_like(depth)
    u, v = (safe_divide(p - corner[k], extent[k]) for k, p in enumerate((x, y)))
    facing = shone_on & (u >= 0) & (u < 1) & (v >= 0) & (v < 1) & (along < 0)
    edge_on = jnp.abs(along) < GRAZING * length
    steepness = jnp.where(edge_on, 0, 1 / jnp.where(edge_on, 1, along))
    if not frame.perspective:
        steepness = -steepness
    secant = length / jnp.maximum(jnp.abs(along), GRAZING * length)
    return Receivers(
        face=jnp.full_like(points.prim, face),
        uv=jnp.stack([jnp.where(facing, u, 0.5), jnp.where(facing, v, 0.5)]),
        depth=jnp.where(facing, depth, 1),
        slope=jnp.stack(
            [jnp.where(facing, normal[k] * extent[k] * steepness, 0) for k in range(2)]
        ),
        secant=jnp.where(facing, secant, 1),
        reach=reach,
        prim=points.prim,
        facing=facing,
    )


def _either(first: Receivers, second: Receivers) -> Receivers:
    """`first` where the point lies in one of its faces, else `second`."""
    take = first.facing
    return Receivers(
        face=jnp.where(take, first.face, jnp.where(second.facing, second.face, 0)),
        uv=jnp.where(take, first.uv, second.uv),
        depth=jnp.where(take, first.depth, second.depth),
        slope=jnp.where(take, first.slope, second.slope),
        secant=jnp.where(take, first.secant, second.secant),
        reach=jnp.where(take, first.reach, second.reach),
        prim=first.prim,
        facing=take | second.facing,
    )
