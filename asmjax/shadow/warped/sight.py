"""What the eye sees of a light's plane, as the error of a map depends on it; in JAX throughout.

Turned plane coordinates of receivers, how they move from pixel to pixel, and the outline of them
all by eye depth: differentiable with respect to the points and to the light's direction.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers import Receivers, SurfacePoints, project
from asmjax.footprint import narrowest_pixel, uv_jacobian
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import dot, least_depth, safe_divide, safe_sqrt
from asmjax.shadow.warped.body import STILL
from asmjax.theory.arguments import held

BINS = 64
"""Bins of log eye depth between the nearest and the farthest receiver; splits move through them."""

DIRECTIONS = 8
"""Directions in the light's plane in which the outermost receivers of each bin are known."""


class Outline(NamedTuple):
    """The outermost receivers of each bin of log depth, by face, in turned plane coordinates.

    Attributes:
        plane: (2, faces, BINS, DIRECTIONS) across and along the axis; any number where `empty`.
        empty: (faces, BINS) bool.
    """

    plane: Float[Array, "2 faces bins directions"]
    empty: Bool[Array, "faces bins"]


class Seen(NamedTuple):
    """Visible receivers as a layout's error depends on them.

    Attributes:
        plane: (2, n) plane coordinates (`LightFrame`) turned so that the axis is the second.
        jacobian: (2, 2, n) [k, i] is d(plane)_k / d(pixel)_i. In place of pixels, the widths of a
            pixel's beam give the perspective factor of m (`beam_jacobian`).
        depth: (n,) eye depth, scene units.
        face: (n,) int.
        weight: (n,) how much each counts, 0 for not at all.
        outline: of all receivers, of which these may be some.
        near, far: least and largest eye depth of all.
        centre: (faces,) place across the axis that warps converge to, see `Body`.
        pace: (faces,) eye depth per plane unit along the axis; 0 where there is no axis.
    """

    plane: Float[Array, "2 n"]
    jacobian: Float[Array, "2 2 n"]
    depth: Float[Array, " n"]
    face: Int[Array, " n"]
    weight: Float[Array, " n"]
    outline: Outline
    near: Float[Array, ""]
    far: Float[Array, ""]
    centre: Float[Array, " faces"]
    pace: Float[Array, " faces"]


def bin_of(depth: Float[Array, " n"], near, far) -> Int[Array, " n"]:
    """The bin of log depth of each eye depth."""
    place = jnp.floor(in_bins(depth, near, far))
    return jnp.clip(place, 0, BINS - 1).astype(jnp.int32)


def outline_of(
    plane: Float[Array, "2 n"],
    cell: Int[Array, " n"],
    counted: Bool[Array, " n"],
    faces: int,
) -> Outline:
    """The outline of all receivers; `cell` is face * BINS + bin, others than `counted` are none."""
    cells = faces * BINS
    cell = jnp.where(counted, cell, cells)
    rank = jnp.arange(plane.shape[1])[:, None]
    angle = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    towards = jnp.asarray(np.stack([np.cos(angle), np.sin(angle)]), plane.dtype)
    x, y = jax.lax.stop_gradient(plane)[:, :, None]
    along = x * towards[0] + y * towards[1]
    most = jax.ops.segment_max(along, cell, cells + 1)[cell]
    index = jax.ops.segment_min(jnp.where(along == most, rank, rank.size), cell, cells + 1)
    index = index[:cells].reshape(faces, BINS, DIRECTIONS)
    empty = jnp.bincount(cell, length=cells + 1)[:cells].reshape(faces, BINS) == 0
    safe = jnp.where(empty[..., None], 0, jnp.minimum(index, rank.size - 1))
    return Outline(plane[:, safe], empty)


def in_bins(depth: Float[Array, " n"], near, far) -> Float[Array, " n"]:
    """Places in 0 .. `BINS` of eye depths, even in log depth; 0 where near and far are one."""
    span = jnp.log(far / near)
    place = jnp.log(jnp.maximum(depth, 0.5 * near) / near)
    return held(safe_divide(BINS * place, jnp.broadcast_to(span, place.shape)), 0.0, float(BINS))


def plane_jacobian(
    points: SurfacePoints, camera: Camera, frame: LightFrame, receivers: Receivers
) -> Float[Array, "2 2 n"]:
    """d(plane)_k / d(pixel)_i of `uv_jacobian`, in plane units; 0 where not facing."""
    jacobian = uv_jacobian(points, camera, frame, receivers)
    return jacobian * _extents(frame, receivers, jacobian.dtype)[:, None]


def beam_jacobian(
    points: SurfacePoints, camera: Camera, frame: LightFrame, receivers: Receivers
) -> Float[Array, "2 2 n"]:
    """(2, 2, n) in place of `plane_jacobian`: steps of the width of a pixel's beam, where it is
    narrowest, across the light's ray. Texels in these steps are the perspective factor of m
    (`asmjax.footprint.log2_perspective_error`). 0 where not facing.

    Across the ray (x, y, 1) at depth d, a step a in plane coordinates is d |G a| long, with
    G^2 = 1 - r r^T / (1 + r^2) and r = (x, y); so the steps are the columns of
    (width / d) (1 + r r^T / (1 + sqrt(1 + r^2))).
    """
    width = narrowest_pixel(points, camera)
    # A point that the eye has not before it counts for nothing; its logarithm must exist.
    width = jnp.where(width > 0, width, 1)
    one = jnp.ones_like(width)
    if frame.perspective:
        x, y = plane_of(frame, receivers)
        bend = 1 / (1 + jnp.sqrt(1 + x * x + y * y))
        steps = jnp.stack([
            jnp.stack([1 + bend * x * x, bend * x * y]), jnp.stack([bend * x * y, 1 + bend * y * y])
        ]) / receivers.depth  # fmt: skip
    else:
        steps = jnp.stack([jnp.stack([one, 0 * one]), jnp.stack([0 * one, one])])
    return jnp.where(receivers.facing, width * steps, 0)


def plane_of(frame: LightFrame, receivers: Receivers) -> Float[Array, "2 n"]:
    """Plane coordinates of receivers in their faces."""
    uv = receivers.uv
    corner = jnp.asarray(frame.corner, uv.dtype)[receivers.face].T
    return corner + uv * _extents(frame, receivers, uv.dtype)


def turned(axis: Float[Array, "2 n"], vectors: Float[Array, "2 *any n"]):
    """`vectors` in axes of which `axis` is the second; see `Body.turn`."""
    x, y = axis
    return jnp.stack([y * vectors[0] - x * vectors[1], x * vectors[0] + y * vectors[1]])


def parallel_sight(
    direction: Float[Array, " 3"], points: SurfacePoints, camera: Camera, beams: bool = False
) -> Seen:
    """`Seen` of points under parallel light, differentiable in its direction and in the points.

    As `bodies` and `Seen` of a built map have it: the axis is where the view goes to across the
    light, with none within `STILL` of the view. Which points face the light, and which are
    outermost, is held.

    Args:
        direction: that light travels in, world, any length above 0.
        points: relative to the camera's position; those that are not lit weigh nothing.
        beams: `beam_jacobian` in place of `plane_jacobian`.
    """
    dtype = points.position.dtype
    direction = jnp.asarray(direction, dtype)
    ray = direction / jnp.sqrt(dot(direction, direction))
    forward = jnp.asarray(camera.rotation[2], dtype)
    going = forward - dot(forward, ray) * ray
    sine = safe_sqrt(dot(going, going))
    still = sine < STILL
    # Some direction across the light, where the view has none.
    other = jnp.eye(3, dtype=dtype)[jnp.argmin(jnp.abs(ray))]
    other = other - dot(other, ray) * ray
    along = jnp.where(still, other, going)
    along = along / jnp.sqrt(dot(along, along))
    rotation = jnp.stack([jnp.cross(along, ray), along, ray])
    plane = rotation[:2] @ points.position
    corner = jnp.where(points.valid, plane, jnp.inf).min(axis=1)
    reach = jnp.where(points.valid, plane, -jnp.inf).max(axis=1)
    some = points.valid.any()
    corner = jnp.where(some, corner, 0)
    extent = jnp.where(some, jnp.where(some, reach, 1) - corner, 1)
    # In parts of the places themselves, where they have no extent; of the unit at the very origin.
    largest = jnp.abs(jnp.concatenate([corner, corner + extent])).max()
    margin = 0.01 * extent + 1e-6 * jnp.where(largest > 0, largest, 1)
    corner, extent = corner - margin, extent + 2 * margin
    frame = eqx.tree_at(
        lambda f: (f.rotation, f.corner, f.extent),
        _ANY_FRAME,
        (rotation[None], corner[None], extent[None]),
    )
    receivers = project(points, frame, jnp.zeros((1, 3), dtype))
    jacobian = (beam_jacobian if beams else plane_jacobian)(points, camera, frame, receivers)
    depth = dot(forward, points.position)
    # Depths have logarithms: what the eye cannot see has none.
    lit = receivers.facing & (depth > least_depth(dtype))
    near = jnp.where(lit, depth, jnp.inf).min()
    near, far = (
        jnp.where(lit.any(), value, 1) for value in (near, jnp.where(lit, depth, -jnp.inf).max())
    )
    depth = jnp.where(lit, depth, near)
    bins = bin_of(depth, near, far)
    pace = jnp.where(still, 0, sine)[None]
    return Seen(
        plane=jnp.where(lit, plane, 0),
        jacobian=jacobian,
        depth=depth,
        face=jnp.zeros_like(bins),
        weight=lit.astype(dtype),
        outline=outline_of(plane, bins, lit, 1),
        near=near,
        far=far,
        centre=jnp.zeros_like(pace),
        pace=pace,
    )


_ANY_FRAME = LightFrame(
    origin=np.zeros(3),
    rotation=np.eye(3)[None],
    corner=np.zeros((1, 2)),
    extent=np.ones((1, 2)),
    cone_axis=np.array([0.0, 0.0, 1.0]),
    cos_cutoff=-1.0,
    near=-np.inf,
    perspective=False,
)


def _extents(frame: LightFrame, receivers: Receivers, dtype):
    return jnp.asarray(frame.extent, dtype)[receivers.face].T
