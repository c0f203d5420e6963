"""The pixel-to-texel Jacobian, in closed form per surface point (hard_shadows reference 1.5).

Computed from position and normal of each pixel alone; never from neighbouring pixels, whose
differences are meaningless across silhouettes.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from asmjax.buffers import Receivers, SurfacePoints
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import dot, safe_divide, safe_sqrt


def surface_tangents(points: SurfacePoints, camera: Camera) -> Float[Array, "2 3 n"]:
    """World motion of the seen point per pixel step right and down: (2, 3, n), scene units.

    dX/du_i = (z / F_i) (e_i - D (n . e_i) / (n . D)), D = (X - C) / z. Points must be relative to
    the camera's own position. 0 where the surface is seen edge-on or not valid.
    """
    dtype = points.position.dtype
    right, down, forward = (jnp.asarray(row, dtype)[:, None] for row in camera.rotation)
    focal = jnp.asarray(camera.focal, dtype)
    depth = dot(forward, points.position)
    depth = jnp.where(points.valid, depth, 1)
    ray = points.position / depth
    along = dot(points.normal, ray)

    def step(axis, f):
        slide = safe_divide(dot(points.normal, axis), along)
        return jnp.where(along == 0, 0, (depth / f) * (axis - ray * slide))

    return jnp.stack([step(right, focal[0]), step(down, focal[1])])


def uv_jacobian(
    points: SurfacePoints, camera: Camera, frame: LightFrame, offset, receivers: Receivers
) -> Float[Array, "2 2 n"]:
    """d(u, v) / d(pixel right, pixel down): (2, 2, n); multiply by a resolution for texels.

    For a perspective light J_ki = (e_k - p_k e_w) . dX/du_i / (z_l extent_k), for an orthographic
    one e_k . dX/du_i / extent_k. `offset` is `light_offset(points, frame)`. 0 where not facing.
    """
    dtype = points.position.dtype
    tangents = surface_tangents(points, camera)
    result = jnp.zeros((2, 2, points.count), dtype)
    for face in range(frame.faces):
        axes = [jnp.asarray(frame.rotation[face, i], dtype)[:, None] for i in range(3)]
        extent = jnp.asarray(frame.extent[face], dtype)
        corner = jnp.asarray(frame.corner[face], dtype)
        rows = []
        for k in range(2):
            along = jnp.stack([dot(axes[k], tangents[i]) for i in range(2)])
            if frame.perspective:
                plane = corner[k] + receivers.uv[k] * extent[k]
                axial = jnp.stack([dot(axes[2], tangents[i]) for i in range(2)])
                along = (along - plane * axial) / receivers.depth
            rows.append(along / extent[k])
        mine = receivers.facing & (receivers.face == face)
        result = jnp.where(mine, jnp.stack(rows), result)
    return result


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
    return largest, safe_divide(jnp.abs(determinant(jacobian)), largest)
