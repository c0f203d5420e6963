"""Which pixel sees a point, and numbers that look random but belong to a pixel."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from asmjax.buffers import SurfacePoints
from asmjax.geometry import Camera
from asmjax.numerics import dot, least_depth

FARTHEST = 2.0**24
"""Pixels off the image's corner at the most: float32 counts them one by one up to here."""


def pixel_of(points: SurfacePoints, camera: Camera) -> Int[Array, "2 n"]:
    """Column and row of the pixel of `camera` that each point is seen through; 0 behind it.

    Points must be relative to the camera's own position. Those of pixel centres are half a pixel
    away from any border, so rounding decides nothing, and neither do the order of the points and
    which of them are asked about together.
    """
    dtype = points.position.dtype
    right, down, forward = (jnp.asarray(row, dtype) for row in camera.rotation)
    focal, principal = (jnp.asarray(a, dtype) for a in (camera.focal, camera.principal))
    depth = dot(forward, points.position)
    seen = points.valid & (depth > least_depth(dtype))
    depth = jnp.where(seen, depth, 1)
    at = [
        jnp.where(seen, dot(axis, points.position) / depth * focal[k] + principal[k], 0)
        for k, axis in enumerate((right, down))
    ]
    return jnp.clip(jnp.floor(jnp.stack(at)), -FARTHEST, FARTHEST).astype(jnp.int32)


def noise(pixel: Int[Array, "2 n"], number: Int[Array, ""] | int, dtype) -> Float[Array, "2 n"]:
    """Two numbers in [0, 1) for each pixel and number, the same in both precisions.

    The hash `pcg3d` of Jarzynski and Olano (2020), Hash Functions for GPU Rendering.
    """
    x, y = pixel.astype(jnp.uint32)
    z = jnp.asarray(number, jnp.uint32)
    x, y, z = (v * jnp.uint32(1664525) + jnp.uint32(1013904223) for v in (x, y, z))
    x = x + y * z
    y = y + z * x
    z = z + x * y
    x, y, z = (v ^ (v >> 16) for v in (x, y, z))
    x = x + y * z
    y = y + z * x
    return (jnp.stack([x, y]) >> 8).astype(dtype) * 2.0**-24
