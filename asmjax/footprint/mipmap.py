"""Projected pixel area as the 2001 authors measured it: by a mip-map that holds its resolutions.

"The smallest level has a 1 in every texel, the second smallest level has a 2, the third smallest
level has a 4, and so on. Texture coordinates are set up so that world-space texel sizes are
uniform" (Fernando et al. 2001, 4.1). Drawn with such a texture, a pixel shows the inverse of its
linear footprint, so the area ratio is (value in the eye's image / value in the light's)^2. Beside
the exact footprint of `uv_jacobian` this shows what graphics hardware got wrong, and by how much
(docs/theory.md).
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from asmjax.buffers import Receivers, SurfacePoints
from asmjax.errors import require
from asmjax.footprint.jacobian import surface_tangents, uv_jacobian
from asmjax.footprint.ratio import LOG2_WORST
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import safe_log2

LARGEST_BYTE = 255
"""What an alpha channel of eight bits holds at most; at least it holds 1 here."""

_LEAST_SQUARE = -120.0
"""log2 of the smallest square of a length, beside the longest one at the point, that is looked at:
still a normal number of float32."""


def log2_mipmap_ratio(
    points: SurfacePoints,
    camera: Camera,
    frame: LightFrame,
    receivers: Receivers,
    resolution: ArrayLike = 1,
    *,
    max_anisotropy: ArrayLike = 1.0,
    tile: ArrayLike = 1.0,
    eight_bit: bool = False,
) -> Float[Array, " n"]:
    """log2 of the side of a texel / side of a pixel, as a mip-mapped texture tells it.

    Stands in for `log2_linear_ratio(uv_jacobian(...), resolution)`. Not quantised, doubling the
    resolution takes off exactly 1, as there.

    Args:
        resolution: texels per side of the light's image.
        max_anisotropy: how many times longer than wide a footprint may be before its width no
            longer decides; 1 filters isotropically, by the longer axis alone.
        tile: world width of the texture, scene units: where in it footprints fall between levels.
        eight_bit: round values to 1 .. 255, as the alpha channel does that the authors read back.
            Footprints outside tile/255 .. tile then read as if they lay at the end.

    Returns:
        (n,); `LOG2_WORST` - log2(resolution) where not facing or where the footprint is flat.

    Raises:
        UseError: a plain number as `max_anisotropy` below 1, or as `tile` not above 0.
    """
    require(
        not isinstance(max_anisotropy, int | float) or max_anisotropy >= 1,
        f"max_anisotropy is {max_anisotropy}; allowed: 1 (isotropic) or more; choose 2 to 16.",
    )
    require(
        not isinstance(tile, int | float) or tile > 0,
        f"tile is {tile}; allowed: a width above 0 in scene units; choose 1.",
    )
    pixel, texel, known = log2_footprint_axes(points, camera, frame, receivers)
    fineness, stretch, width = (
        jnp.log2(jnp.asarray(x, points.position.dtype)) for x in (resolution, max_anisotropy, tile)
    )
    in_eye = log2_mip_value(width - log2_sampled_length(pixel, stretch), eight_bit)
    in_light = log2_mip_value(width + fineness - log2_sampled_length(texel, stretch), eight_bit)
    worst = LOG2_WORST - fineness
    return jnp.where(known, jnp.minimum(in_eye - in_light, worst), worst)


def log2_sampled_length(
    log2_axes: Float[Array, " 2 *points"] | Sequence[Float[Array, " *points"]],
    log2_max_anisotropy: Float[Array, "..."] | float,
) -> Float[Array, " *points"]:
    """log2 of the length by which the hardware chooses a level: longest / min(stretch, most).

    The rule of OpenGL's EXT_texture_filter_anisotropic, P_max / N with N the stretch P_max / P_min
    up to the most that is allowed, but without rounding N up: that would only add jumps.

    Args:
        log2_axes: log2 of the two footprint axes, one along each direction of the image.
        log2_max_anisotropy: log2 of the most; 0 gives the longest axis.
    """
    one, other = log2_axes
    longest = jnp.maximum(one, other)
    return jnp.maximum(jnp.minimum(one, other), longest - log2_max_anisotropy)


def log2_mip_value(
    level: Float[Array, " *points"], eight_bit: bool = False
) -> Float[Array, " *points"]:
    """log2 of what trilinear filtering reads at a real-valued level, 0 being the coarsest.

    Level k holds 2^k, and between levels the value is linear: 2^k (1 + f) at k + f. That is too
    large by (1 + f) / 2^f: 4.07 % on average, 6.15 % at most (f = 0.4427).
    """
    below = jnp.floor(level)
    value = below + jnp.log2(1 + (level - below))
    if not eight_bit:
        return value
    return jnp.log2(jnp.clip(jnp.round(jnp.exp2(jnp.minimum(value, 8))), 1, LARGEST_BYTE))


def log2_footprint_axes(
    points: SurfacePoints, camera: Camera, frame: LightFrame, receivers: Receivers
) -> tuple[Float[Array, "2 n"], Float[Array, "2 n"], Bool[Array, " n"]]:
    """log2 of the world lengths of the two axes of an eye pixel, and of a texel of a face of one
    texel a side, (2, n) each along right and down or u and v; and whether they are known (n,).

    A pixel's axes are its tangents T, a texel's T J^-1, here by adjugate and determinant. Both are
    scaled by their largest entries first: squares of them then stay in the range of float32. Where
    the footprint is flat or nothing faces the light, lengths are finite and mean nothing.
    """
    (a, b), (c, d), size = _scaled(uv_jacobian(points, camera, frame, receivers))
    area = jnp.abs(a * d - b * c)
    known = area > jnp.finfo(area.dtype).eps ** 2
    right, down, length = _scaled(surface_tangents(points, camera))
    pixel = [length + _log2_norm(axis) for axis in (right, down)]
    shrink = length - size - safe_log2(jnp.where(known, area, 1), _LEAST_SQUARE)
    texel = [
        shrink + _log2_norm([first * x - second * y for x, y in zip(right, down, strict=True)])
        for first, second in ((d, c), (b, a))
    ]
    return jnp.stack(pixel), jnp.stack(texel), known


def _scaled(rows):
    """Two rows of arrays divided by the largest of all entries, and log2 of that.

    Ones so small that their squares underflow stay as they are. What is made of the rows does not
    depend on the scale, so no gradient needs to flow through it.
    """
    entries = [jnp.abs(x) for row in rows for x in row]
    largest = entries[0]
    for entry in entries[1:]:
        largest = jnp.maximum(largest, entry)
    seen = largest > jnp.finfo(largest.dtype).tiny ** 0.5
    largest = jax.lax.stop_gradient(jnp.where(seen, largest, 1))
    first, second = ([x / largest for x in row] for row in rows)
    return first, second, jnp.log2(largest)


def _log2_norm(vector):
    x, y, z = vector
    return 0.5 * safe_log2(x * x + y * y + z * z, _LEAST_SQUARE)
