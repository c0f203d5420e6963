"""Receivers: surface points as one light sees them."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers.points import SurfacePoints
from asmjax.geometry import LightFrame
from asmjax.numerics import dot, least_depth, safe_divide, safe_sqrt

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
        reach: (n,) world size of the whole image, its longer side, across the light's axis at the
            receiver's depth: a texel at resolution N is reach / N wide, scene units.
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


def light_offset(points: SurfacePoints, frame: LightFrame) -> np.ndarray | Float[Array, "faces 3"]:
    """(faces, 3) the points' origin as seen from the light's, in the axes of each face.

    In float64 before any rounding: of a lamp far away only the depth is large, and what is across
    its rays keeps its digits.
    """
    parts = points.origin, frame.origin, frame.rotation
    if all(isinstance(part, np.ndarray) for part in parts):
        return frame.rotation @ (np.asarray(points.origin, np.float64) - frame.origin)
    # Inside a transformation of the caller's the difference is formed in its own precision.
    origin, light, rotation = (jnp.asarray(part) for part in parts)
    return rotation @ (origin - light)


def project(points: SurfacePoints, frame: LightFrame, offset) -> Receivers:
    """Surface points in the light's image; pure, in the dtype of `points.position`.

    `offset` is `light_offset(points, frame)`. The plane form is that of a tap-based receiver
    plane (docs/theory.md, "The shadow test"): z_plane = n.(X - L) / (n.D) at a texel-centre ray D.
    """

    def cast(a):
        return jnp.asarray(a, points.position.dtype)

    offset = cast(offset)
    local = [_in_axes(points, cast(frame.rotation[k]), offset[k]) for k in range(frame.faces)]
    face = jnp.zeros_like(points.prim)
    shone_on = _in_face(frame, 0, local[0], cast)
    for other in range(1, frame.faces):
        found = _in_face(frame, other, local[other], cast) & ~shone_on
        face = jnp.where(found, other, face)
        shone_on |= found
    shone_on &= points.valid
    if frame.perspective:
        axial = dot(cast(frame.rotation[0] @ frame.cone_axis), local[0])
        cosine = cast(frame.cos_cutoff)
        shone_on &= (cosine <= -1) | (axial > cosine * safe_sqrt(dot(local[0], local[0])))
    chosen = local[0]
    for other in range(1, frame.faces):
        pairs = zip(local[other], chosen, strict=True)
        chosen = [jnp.where(face == other, mine, before) for mine, before in pairs]
    return _on_face(points, frame.perspective, chosen, face, shone_on, of_face(frame, face, cast))


def _in_axes(points: SurfacePoints, rotation, offset):
    """Coordinates (n,) along each of the axes, from the light on."""
    pairs = zip(rotation, offset, strict=True)
    return [dot(axis, points.position) + start for axis, start in pairs]


def of_face(frame: LightFrame, face: Int[Array, " n"], cast):
    """Rotation, corner and extent of one face; of more faces that of each point, its index last."""

    def chosen(table):
        table = cast(table)
        if frame.faces == 1:
            return table[0]
        rows = table.reshape(frame.faces, -1).T[:, face]
        return rows.reshape(*table.shape[1:], face.shape[0])

    return chosen(frame.rotation), chosen(frame.corner), chosen(frame.extent)


def _in_face(frame: LightFrame, face: int, local, cast) -> Bool[Array, " n"]:
    """Which points lie in front of a face and inside its rectangle; nothing is divided."""
    corner, extent = (cast(a[face]) for a in (frame.corner, frame.extent))
    depth = local[2]
    inside = depth > cast(frame.near)
    scale = jnp.ones_like(depth)
    if frame.perspective:
        inside &= depth > least_depth(depth.dtype)
        scale = depth
    for k in range(2):
        along = local[k] - corner[k] * scale
        inside &= (along >= 0) & (along < extent[k] * scale)
    return inside


def _on_face(points: SurfacePoints, perspective: bool, local, face, shone_on, of_face) -> Receivers:
    """The points on the faces that they lie in; `local` are their coordinates in its axes."""
    axes, corner, extent = of_face
    # Nothing that is not lit reaches a quotient, in value or gradient.
    x, y, depth = (
        jnp.where(shone_on, along, safe) for along, safe in zip(local, (0, 0, 1), strict=True)
    )
    normal = [dot(axis, points.normal) for axis in axes]
    reach = jnp.maximum(extent[0], extent[1]) * jnp.ones_like(depth)
    if perspective:
        x, y = x / depth, y / depth
        along = normal[0] * x + normal[1] * y + normal[2]
        length = jnp.sqrt(x * x + y * y + 1)
        reach = reach * depth
    else:
        along, length = normal[2], jnp.ones_like(depth)
    facing = shone_on & (along < 0)
    edge_on = jnp.abs(along) < GRAZING * length
    steepness = jnp.where(edge_on, 0, 1 / jnp.where(edge_on, 1, along))
    if not perspective:
        steepness = -steepness
    secant = length / jnp.maximum(jnp.abs(along), GRAZING * length)
    below_1 = 1 - jnp.finfo(depth.dtype).epsneg

    def image(k, plane):
        inside = jnp.clip(safe_divide(plane - corner[k], extent[k]), 0, below_1)
        return jnp.where(facing, inside, 0.5)

    return Receivers(
        face=jnp.where(facing, face, 0),
        uv=jnp.stack([image(0, x), image(1, y)]),
        depth=jnp.where(facing, depth, 1),
        slope=jnp.stack(
            [jnp.where(facing, normal[k] * extent[k] * steepness, 0) for k in range(2)]
        ),
        secant=jnp.where(facing, secant, 1),
        reach=reach,
        prim=points.prim,
        facing=facing,
    )
