"""Aliasing of any shadow map under any light: along one axis, and from a Jacobian.

Along one axis, the footprint of a texel on the receiver over that of a pixel is

    m = (r_p / r_s) (dG/ds) (W_l / W_e) (n_e / n_l) (z_l / z_e)
        (cos phi_l / cos phi_e) (cos psi_e / cos psi_l)

(Lloyd's thesis; re-derived as a ratio of footprints). W is the width of an image at the distance n
of its plane, z the axial depth of the point, phi its angle off the axis, psi the angle of incidence
there, and dG/ds the slope of the warp's inverse, 1 without one. The last factor is *projective*
aliasing, due to the receiver; the others are *perspective* aliasing, the ratio of beam widths. For
parallel rays z_l / n_l and cos phi_l are 1.

Ratios are formed as base 2 logarithms: a grazing eye and a grazing light are told apart, and
neither overflows.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from asmjax.footprint.jacobian import LARGEST, singular_values
from asmjax.footprint.ratio import LOG2_WORST
from asmjax.numerics import safe_divide, safe_sqrt
from asmjax.theory.arguments import floating, held

LEAST_COSINE = 1e-4
"""Receivers seen or lit more edge-on than this are taken at this cosine, and marked."""

_OCTAVES = 60.0
"""Lengths and slopes below 2^-60 are not told from 0, ratios of them are at most 2^60: the gradient
of one divided by the other stays in the range of float32."""


class AxisAliasing(eqx.Module):
    """Texel / pixel width along one axis, in its two factors; as powers at most 2^60.

    Attributes:
        log2_perspective: log2 of the ratio of the beams' widths.
        log2_projective: log2 of cos psi_e / cos psi_l.
        grazing: whether eye or light was nearer to edge-on than `LEAST_COSINE`.
    """

    log2_perspective: Float[Array, "..."]
    log2_projective: Float[Array, "..."]
    grazing: Bool[Array, "..."]

    @property
    def perspective(self) -> Float[Array, "..."]:
        """The ratio of beam widths, m~."""
        return _power(self.log2_perspective)

    @property
    def projective(self) -> Float[Array, "..."]:
        """The ratio of the slants of the two beams' footprints."""
        return _power(self.log2_projective)

    @property
    def m(self) -> Float[Array, "..."]:
        """Their product: footprint of a texel / of a pixel."""
        return _power(self.log2_perspective + self.log2_projective)


def log2_point_beam(
    depth: ArrayLike,
    cos_off_axis: ArrayLike,
    width: ArrayLike,
    distance: ArrayLike,
    resolution: ArrayLike,
    slope: ArrayLike = 1.0,
) -> Float[Array, "..."]:
    """log2 of the width of one sample's beam from a pinhole, across the beam, in scene units.

    Args:
        depth: axial depth z of the point, scene units.
        cos_off_axis: cosine of the angle between the ray and the axis.
        width, distance: extent of the image and distance of its plane, in one unit.
        resolution: samples over the extent.
        slope: dG/ds of a warp at the point, G in [0, 1] over the extent.

    Returns:
        The width's logarithm; each factor is 2^-60 at least, also where it is 0 or negative.
    """
    log2_parallel = log2_parallel_beam(width, resolution, slope)
    return log2_parallel + _log2(depth) - _log2(distance) + _log2(cos_off_axis)


def log2_parallel_beam(
    width: ArrayLike, resolution: ArrayLike, slope: ArrayLike = 1.0
) -> Float[Array, "..."]:
    """log2 of the width of one sample's beam of parallel rays; arguments as `log2_point_beam`."""
    return _log2(slope) + _log2(width) - _log2(resolution)


def axis_aliasing(
    log2_eye_beam: ArrayLike,
    log2_light_beam: ArrayLike,
    cos_eye: ArrayLike,
    cos_light: ArrayLike,
) -> AxisAliasing:
    """Aliasing along one axis from the widths of a pixel's and a texel's beam at a receiver.

    Args:
        log2_eye_beam, log2_light_beam: of `log2_point_beam` or `log2_parallel_beam`.
        cos_eye, cos_light: cosines of the incidence of eye ray and light ray, not negative.
    """
    cos_eye, cos_light = floating(cos_eye), floating(cos_light)
    slants = [_log2(cosine, LEAST_COSINE) for cosine in (cos_eye, cos_light)]
    return AxisAliasing(
        floating(log2_light_beam) - floating(log2_eye_beam),
        slants[0] - slants[1],
        (cos_eye < LEAST_COSINE) | (cos_light < LEAST_COSINE),
    )


def texel_edges(jacobian: Float[Array, "2 2 n"], resolution: ArrayLike) -> Float[Array, "2 2 n"]:
    """The edges of a texel in the eye's image, in pixels: columns of J^-1 / resolution.

    Args:
        jacobian: d(u, v) / d(pixel right, pixel down), of `asmjax.footprint.uv_jacobian`.
        resolution: texels per side of the light's image.

    Returns:
        (2, 2, n): [0] is right and [1] down, [:, 0] the edge along u and [:, 1] the one along v.
        A footprint flatter than 2^-`LOG2_WORST` is lengthened to that (`asmjax.footprint.m` does
        the same), so edges stay finite; 0 where the Jacobian is 0.
    """
    dtype, jacobian = jacobian.dtype, held(jacobian, -LARGEST, LARGEST)
    # The result does not depend on the scale, so no gradient has to flow through it.
    scale = jnp.abs(jacobian).max(axis=(0, 1))
    usable = scale > jnp.finfo(dtype).tiny ** 0.5
    scale = jax.lax.stop_gradient(jnp.where(usable, scale, 1.0))
    (a, b), (c, d) = scaled = jnp.where(usable, jacobian, 0.0) / scale
    area = a * d - b * c
    largest, _ = singular_values(scaled)
    least = jnp.exp2(jnp.asarray(-LOG2_WORST, dtype)) * jnp.where(usable, largest, 1.0)
    signed = jnp.where(area < 0, -1.0, 1.0) * jnp.maximum(jnp.abs(area) * scale, least)
    inverse = jnp.stack([jnp.stack([d, -b]), jnp.stack([-c, a])]) / signed
    return inverse / jnp.asarray(resolution, dtype)


def edge_lengths(edges: Float[Array, "2 2 n"]) -> Float[Array, "2 n"]:
    """m_s and m_t: lengths in pixels of the texel's edges along u and along v."""
    edges = held(edges, -LARGEST, LARGEST)
    return safe_sqrt(edges[0] ** 2 + edges[1] ** 2)


def mean_displacement(
    edges: Float[Array, "2 2 n"], normal: Float[Array, "2 n"]
) -> Float[Array, " n"]:
    """Expected distance in pixels of a shadow's edge from the true one (M4 of docs/theory.md).

    With A >= B the two of abs(a . normal), abs(b . normal), a and b a texel's edges: the mean of
    abs over a texel of a linear function that falls by A and by B along its edges,
    A/4 + B^2 / (12 A). At most m / 4, for any Jacobian.

    Args:
        edges: of `texel_edges`.
        normal: (2, n) unit normals of the shadow's edge in the image, right and down.
    """
    longer, ratio = _falls(edges, normal)
    return longer * (0.25 + ratio**2 / 12)


def rms_displacement(
    edges: Float[Array, "2 2 n"], normal: Float[Array, "2 n"]
) -> Float[Array, " n"]:
    """Root mean square of the same distance, sqrt((A^2 + B^2) / 12); at most m / sqrt(12)."""
    longer, ratio = _falls(edges, normal)
    return longer * jnp.sqrt((1 + ratio**2) / 12)


def displacement_bounds(m: ArrayLike) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """m / 4 and m / sqrt(12): the most that `mean_displacement` and `rms_displacement` can be.

    m is that of `asmjax.footprint.m`. The second is reached by the worst direction of the shadow's
    edge, the first if that direction is also a texel edge's.
    """
    m = floating(m)
    return m / 4, m / math.sqrt(12)


def _falls(edges, normal):
    """A, and B / A."""
    # What is no edge of `texel_edges` and no unit normal must not overflow.
    edges, normal = held(edges, -LARGEST, LARGEST), held(normal, -1.0, 1.0)
    one, other = (jnp.abs(edges[0, k] * normal[0] + edges[1, k] * normal[1]) for k in range(2))
    longer, shorter = jnp.maximum(one, other), jnp.minimum(one, other)
    return longer, safe_divide(shorter, longer)


def _log2(x: ArrayLike, least: float = 2.0**-_OCTAVES) -> Float[Array, "..."]:
    """log2 of `least` and more; Python numbers take the precision of what they meet."""
    x = floating(x)
    known = x > least
    # jnp.log2 would fix the precision of a Python number.
    return jnp.where(known, jnp.log(jnp.where(known, x, 1.0)) / math.log(2.0), math.log2(least))


def _power(log2: Float[Array, "..."]) -> Float[Array, "..."]:
    return jnp.exp2(held(log2, -_OCTAVES, _OCTAVES))
