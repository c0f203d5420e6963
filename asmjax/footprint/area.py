"""World area of one pixel or texel on a surface (docs/theory.md)."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from asmjax.numerics import dot, safe_divide

EDGE_ON = 64
"""Cosines of so many rounding units have lost all but two or three of their digits."""


def perspective_area(
    position: Float[Array, "3 n"],
    normal: Float[Array, "3 n"],
    axis: Float[Array, " 3"],
    focal: Float[Array, " 2"],
) -> Float[Array, " n"]:
    """Area that one pixel of a pinhole covers on the tangent plane of a point, scene units squared.

    A = z^3 / (F_x F_y |n . (X - C)|), with axial depth z. Frames that image a plane rectangle
    with `resolution` texels a side have F = resolution / extent.

    Args:
        position: (3, n) points relative to the pinhole.
        normal: (3, n) unit normals, same axes.
        axis: (3,) unit forward axis.
        focal: (2,) focal lengths in pixels.

    Returns:
        (n,) area; +inf where the plane is seen edge-on, to within `EDGE_ON` rounding units, or the
        point is not in front.
    """
    depth = dot(axis[:, None], position)
    along = jnp.abs(dot(normal, position))
    seen = (depth > 0) & (along > EDGE_ON * jnp.finfo(depth.dtype).eps * depth)
    depth = jnp.where(seen, depth, 1)
    # z / (n . X) first: z^3 alone leaves the range of float32 in large and in small scenes.
    slant = safe_divide(depth, jnp.where(seen, along, 1))
    pixel = depth / focal[0] * (depth / focal[1])
    return jnp.where(seen, slant * pixel, jnp.inf)


def orthographic_area(
    normal: Float[Array, "3 n"], axis: Float[Array, " 3"], texel: Float[Array, " 2"]
) -> Float[Array, " n"]:
    """Area that one texel of a parallel projection covers: w_s w_t / |n . l|, scene units squared.

    Args:
        normal: (3, n) unit normals.
        axis: (3,) unit direction of the rays.
        texel: (2,) texel size in scene units.

    Returns:
        (n,) area; +inf where the plane is parallel to the rays, to within rounding.
    """
    cosine = jnp.abs(dot(normal, axis[:, None]))
    seen = cosine > jnp.finfo(cosine.dtype).eps
    return jnp.where(seen, texel[0] * texel[1] / jnp.where(seen, cosine, 1), jnp.inf)
