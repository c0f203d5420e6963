"""Widths of the beams of pixels and texels, across their rays: error without the surface's slant.

Of the error m = (w_l / w_e) (cos psi_e / cos psi_l) of Lloyd et al. (TR05-024, section 2.2) this is
the first factor, in two dimensions: the widest direction of a texel's beam beside the narrowest of
the pixel's. Unlike m it depends on where a receiver lies, not on how it is turned, so it is what a
parameterization can be blamed for.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from asmjax.buffers import Receivers, SurfacePoints
from asmjax.buffers.receivers import of_face
from asmjax.footprint.jacobian import OFF_AXIS
from asmjax.footprint.ratio import LOG2_WORST
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import dot, least_depth, safe_divide, safe_sqrt


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
    width, log2_fineness, held = _widest_texel(frame, receivers, density)
    pixel = narrowest_pixel(points, camera)
    known = receivers.facing & held & (pixel > 0)
    # Divided first: logarithms of widths in scene units would lose digits to the unit.
    widths = jnp.where(known, width, 1) / jnp.where(known, pixel, 1)
    ratio = jnp.log2(widths) - log2_fineness
    return jnp.where(known, jnp.minimum(ratio, LOG2_WORST), LOG2_WORST)


def narrowest_pixel(points: SurfacePoints, camera: Camera) -> Float[Array, " n"]:
    """Width (n,) of a pixel's beam where narrowest, scene units; 0 where there is none."""
    dtype = points.position.dtype
    x, y, z = (dot(jnp.asarray(row, dtype), points.position) for row in camera.rotation)
    farthest = jnp.maximum(jnp.maximum(jnp.abs(x), jnp.abs(y)), jnp.abs(z))
    seen = points.valid & (z > jnp.maximum(OFF_AXIS * farthest, least_depth(dtype)))
    z = jnp.where(seen, z, 1)
    focal = jnp.asarray(camera.focal, dtype)
    steps = (
        jnp.stack([z / focal[0], jnp.zeros_like(z)]),
        jnp.stack([jnp.zeros_like(z), z / focal[1]]),
    )
    _, narrowest = _extremes(*steps, jnp.where(seen, x, 0) / z, jnp.where(seen, y, 0) / z)
    return jnp.where(seen, narrowest, 0)


def _widest_texel(frame: LightFrame, receivers: Receivers, density):
    """Width (n,) of a texel's beam in its widest direction, as a width in scene units and log2 of
    what that is divided by; and whether there is a texel of any width.

    Its steps are those of the inverse of `density`: by adjugate and determinant, in parts of the
    largest entry. Both are left to the logarithm, so no product leaves the range of float32.
    """
    dtype = density.dtype
    _, corner, extent = of_face(frame, receivers.face, lambda a: jnp.asarray(a, dtype))
    largest, ((a, b), (c, d)) = _in_parts(density)
    area = jnp.abs(a * d - b * c)
    depth = receivers.depth if frame.perspective else jnp.ones_like(receivers.depth)
    scale = jnp.stack([extent[0] * jnp.ones_like(a), extent[1] * jnp.ones_like(a)])
    x, y = jnp.zeros_like(a), jnp.zeros_like(a)
    if frame.perspective:
        x, y = (corner[k] + receivers.uv[k] * extent[k] for k in range(2))
    widest, _ = _extremes(scale * jnp.stack([d, -c]), scale * jnp.stack([-b, a]), x, y)
    held = (area > jnp.finfo(dtype).eps ** 2) & (widest > 0)
    log2_fineness = sum(jnp.log2(jnp.where(held, part, 1)) for part in (area, largest))
    return widest * depth, log2_fineness, held


def _extremes(first, second, x, y):
    """Largest and smallest width across the ray (x, y, 1) of the parallelogram of two steps (2, n)
    in the plane z = const that it meets: the singular values of the steps' parts across the ray."""
    # Fourth powers of widths follow, which leave float32 below 1e-10 and above 1e9.
    largest, (first, second) = _in_parts(jnp.stack([first, second]))
    square = x * x + y * y + 1

    def across(a, b):
        return a[0] * b[0] + a[1] * b[1] - (a[0] * x + a[1] * y) * (b[0] * x + b[1] * y) / square

    p, q, r = across(first, first), across(first, second), across(second, second)
    widest = safe_sqrt(0.5 * (p + r + safe_sqrt((p - r) ** 2 + 4 * q * q)))
    # Area / widest: the difference of two near-equal numbers would lose its digits.
    area = jnp.abs(first[0] * second[1] - first[1] * second[0]) / jnp.sqrt(square)
    return largest * widest, largest * safe_divide(area, widest)


def _in_parts(values):
    """The largest (n,) of the absolute values (., ., n), and the values in parts of it.

    Ones so small that their squares underflow stay as they are. What is made of both does not
    depend on the first, so no gradient has to flow through it.
    """
    largest = jax.lax.stop_gradient(jnp.abs(values).max(axis=(0, 1)))
    largest = jnp.where(largest > jnp.finfo(values.dtype).tiny ** 0.5, largest, 1)
    return largest, values / largest
