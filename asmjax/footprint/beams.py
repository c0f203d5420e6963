"""Widths of the beams of pixels and texels, across their rays: error without the surface's slant.

Of the error m = (w_l / w_e) (cos psi_e / cos psi_l) of Lloyd et al. (TR05-024, section 2.2) this is
the first factor, in two dimensions: the widest direction of a texel's beam beside the narrowest of
the pixel's. Unlike m it depends on where a receiver lies, not on how it is turned, so it is what a
parameterization can be blamed for.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from asmjax.buffers import Receivers, SurfacePoints
from asmjax.buffers.receivers import of_face
from asmjax.footprint.jacobian import LARGEST, OFF_AXIS
from asmjax.footprint.ratio import LOG2_WORST
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import LEAST_DEPTH, dot, safe_divide, safe_log2, safe_sqrt


def log2_perspective_error(
    points: SurfacePoints,
    camera: Camera,
    frame: LightFrame,
    receivers: Receivers,
    density: Float[Array, "2 2 n"],
) -> Float[Array, " n"]:
    """log2 of the texel's widest beam / the pixel's narrowest, (n,).

    Args:
        points: relative to the camera's own position.
        receivers: `points` in the light's image.
        density: texels per image size, of `ShadowAlgorithm.density`.

    Returns:
        Where nothing is known, `LOG2_WORST`: not facing, not in front of the camera, no texel.
    """
    texel = _widest_texel(frame, receivers, density)
    pixel = _narrowest_pixel(points, camera)
    known = receivers.facing & (texel > 0) & (pixel > 0)
    ratio = safe_log2(texel, -LOG2_WORST) - safe_log2(pixel, -LOG2_WORST)
    return jnp.where(known, jnp.minimum(ratio, LOG2_WORST), LOG2_WORST)


def _narrowest_pixel(points: SurfacePoints, camera: Camera):
    """Width (n,) of a pixel's beam where narrowest, scene units; 0 where there is none."""
    dtype = points.position.dtype
    x, y, z = (dot(jnp.asarray(row, dtype), points.position) for row in camera.rotation)
    farthest = jnp.maximum(jnp.maximum(jnp.abs(x), jnp.abs(y)), jnp.abs(z))
    seen = points.valid & (z > jnp.maximum(OFF_AXIS * farthest, LEAST_DEPTH))
    z = jnp.where(seen, z, 1)
    focal = jnp.asarray(camera.focal, dtype)
    steps = (
        jnp.stack([z / focal[0], jnp.zeros_like(z)]),
        jnp.stack([jnp.zeros_like(z), z / focal[1]]),
    )
    _, narrowest = _extremes(*steps, jnp.where(seen, x, 0) / z, jnp.where(seen, y, 0) / z)
    return jnp.where(seen, narrowest, 0)


def _widest_texel(frame: LightFrame, receivers: Receivers, density):
    """Width (n,) of a texel's beam in its widest direction, scene units; 0 where there is none."""
    dtype = density.dtype
    _, corner, extent = of_face(frame, receivers.face, lambda a: jnp.asarray(a, dtype))
    (a, b), (c, d) = jnp.clip(density, -LARGEST, LARGEST)
    determinant = a * d - b * c
    per_s = jnp.stack([safe_divide(d, determinant), safe_divide(-c, determinant)])
    per_t = jnp.stack([safe_divide(-b, determinant), safe_divide(a, determinant)])
    scale = jnp.stack([extent[0] * jnp.ones_like(a), extent[1] * jnp.ones_like(a)])
    if not frame.perspective:
        return _extremes(per_s * scale, per_t * scale, jnp.zeros_like(a), jnp.zeros_like(a))[0]
    x, y = (corner[k] + receivers.uv[k] * extent[k] for k in range(2))
    return _extremes(
        per_s * scale * receivers.depth, per_t * scale * receivers.depth, x, y
    )[0]  # fmt: skip


def _extremes(first, second, x, y):
    """Largest and smallest width across the ray (x, y, 1) of the parallelogram of two steps (2, n)
    in the plane z = const that it meets: the singular values of the steps' parts across the ray."""
    square = x * x + y * y + 1

    def across(a, b):
        return a[0] * b[0] + a[1] * b[1] - (a[0] * x + a[1] * y) * (b[0] * x + b[1] * y) / square

    p, q, r = across(first, first), across(first, second), across(second, second)
    widest = safe_sqrt(0.5 * (p + r + safe_sqrt((p - r) ** 2 + 4 * q * q)))
    # Area / widest: the difference of two near-equal numbers would lose its digits.
    area = jnp.abs(first[0] * second[1] - first[1] * second[0]) / jnp.sqrt(square)
    return widest, safe_divide(area, widest)
