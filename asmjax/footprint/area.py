"""World area of one pixel or texel on a surface (hard_shadows reference 1.5)."""

import jax.numpy as jnp

from asmjax.numerics import dot, safe_divide


def perspective_area(position, normal, axis, focal):
    """Area that one pixel of a pinhole covers on the tangent plane of a point, scene units squared.

    A = z^3 / (F_x F_y |n . (X - C)|), with axial depth z. Frames that image a plane rectangle
    with `resolution` texels a side have F = resolution / extent.

    Args:
        position: (3, n) points relative to the pinhole.
        normal: (3, n) unit normals, same axes.
        axis: (3,) unit forward axis.
        focal: (2,) focal lengths in pixels.

    Returns:
        (n,) area; +inf where the plane is seen edge-on.
    """
    depth = dot(axis[:, None], position)
    along = jnp.abs(dot(normal, position))
    return safe_divide(depth**3, focal[0] * focal[1] * along, jnp.inf)


def orthographic_area(normal, axis, texel):
    """Area that one texel of a parallel projection covers: w_s w_t / |n . l|, scene units squared.

    Args:
        normal: (3, n) unit normals.
        axis: (3,) unit direction of the rays.
        texel: (2,) texel size in scene units.
    """
    return safe_divide(texel[0] * texel[1], jnp.abs(dot(normal, axis[:, None])), jnp.inf)
