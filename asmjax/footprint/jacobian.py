"""The pixel-to-texel Jacobian, in closed form per surface point (docs/theory.md).

Computed from position and normal of each pixel alone; never from neighbouring pixels, whose
differences are meaningless across silhouettes.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from asmjax.buffers import Receivers, SurfacePoints
from asmjax.buffers.receivers import of_face
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import dot, least_depth, safe_divide, safe_sqrt

OFF_AXIS = 1e-4
"""Points whose axial depth is a smaller part of their distance are not in any camera's image."""

LARGEST = 2.0**40
"""Entries of a Jacobian are clipped here: squares of them stay in the range of float32."""


def surface_tangents(points: SurfacePoints, camera: Camera) -> Float[Array, "2 3 n"]:
    """World motion of the seen point per pixel step right and down: (2, 3, n), scene units.

    Points must be relative to the camera's own position. 0 where not valid or not in front. A
    surface seen more edge-on than the square root of the rounding unit is taken at that angle:
    beyond, the difference of two such tangents has lost half of its digits.
    """
    return jnp.stack([jnp.stack(rows) for rows in _tangents(points, camera)])


def _tangents(points: SurfacePoints, camera: Camera):
    """Rows of `surface_tangents`: dX/du_i = (z e_i - X (n . e_i) z / (n . X)) / F_i.

    The quotient rule with D = X / z multiplied out: one division is left.
    """
    dtype = points.position.dtype
    right, down, forward = (jnp.asarray(row, dtype) for row in camera.rotation)
    scale = 1 / jnp.asarray(camera.focal, dtype)
    x, y, z = points.position
    depth = dot(forward, (x, y, z))
    farthest = jnp.maximum(jnp.maximum(jnp.abs(x), jnp.abs(y)), jnp.abs(z))
    seen = points.valid & (depth > jnp.maximum(OFF_AXIS * farthest, least_depth(dtype)))
    depth = jnp.where(seen, depth, 1)
    ray = [jnp.where(seen, x, 0) for x in (x, y, z)]
    along = dot(points.normal, ray)
    least = jnp.finfo(dtype).eps ** 0.5 * depth
    along = jnp.where(along < 0, jnp.minimum(along, -least), jnp.maximum(along, least))
    stretch = depth / along
    depth = jnp.where(seen, depth, 0)

    def step(axis, scale):
        slide = dot(points.normal, axis) * stretch
        return [scale * (axis[j] * depth - ray[j] * slide) for j in range(3)]

    return step(right, scale[0]), step(down, scale[1])


def uv_jacobian(
    points: SurfacePoints, camera: Camera, frame: LightFrame, receivers: Receivers
) -> Float[Array, "2 2 n"]:
    """d(u, v) / d(pixel right, pixel down): (2, 2, n); multiply by a resolution for texels.

    For a perspective light J_ki = (e_k - p_k e_w) . dX/du_i / (z_l extent_k), for an orthographic
    one e_k . dX/du_i / extent_k. 0 where not facing.
    """
    dtype = points.position.dtype
    tangents = _tangents(points, camera)
    axes, corner, extent = of_face(frame, receivers.face, lambda a: jnp.asarray(a, dtype))
    scale = safe_divide(jnp.ones_like(extent), extent)
    nearness = 1 / receivers.depth

    def entry(k, i):
        along = dot(axes[k], tangents[i])
        if frame.perspective:
            plane = corner[k] + receivers.uv[k] * extent[k]
            along = (along - plane * dot(axes[2], tangents[i])) * nearness
        value = jnp.clip(along * scale[k], -LARGEST, LARGEST)
        return jnp.where(receivers.facing, value, 0)

    # Without the barrier XLA's CPU fusions compute all of this again for everything made of it.
    return jax.lax.optimization_barrier(
        jnp.stack([jnp.stack([entry(k, i) for i in range(2)]) for k in range(2)])
    )


def determinant(jacobian: Float[Array, "2 2 n"]) -> Float[Array, " n"]:
    """Image area per pixel area: the texels that one eye pixel covers."""
    return jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]


def singular_values(
    jacobian: Float[Array, "2 2 n"],
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Largest and smallest singular value of each 2 x 2 matrix.

    The smallest is |det| / largest: the difference of two near-equal roots would lose all digits
    of a very stretched footprint.
    """
    (a, b), (c, d) = jacobian
    largest = 0.5 * (
        safe_sqrt((a + d) ** 2 + (c - b) ** 2) + safe_sqrt((a - d) ** 2 + (c + b) ** 2)
    )
    area = jnp.abs(determinant(jacobian))
    # Below, the determinant is rounding, and the matrix flat.
    flat = area <= (jnp.finfo(area.dtype).eps * largest) ** 2
    return largest, safe_divide(jnp.where(flat, 0, area), largest)
