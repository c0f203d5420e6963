"""Logarithmic parameterizations along z: the optimum, and what perspective adds to it (LogPSM).

Texels that widen in proportion to z match the eye at every depth (TR05-024, section 3.1). The
logarithm alone leaves the error across the view at alpha; a perspective projection about the same
centre, then a logarithm of its depth, is optimal in both (Lloyd's logarithmic perspective shadow
maps). The logarithm alone is the case u = 1 of that s, with m_x(..., u=0).

Arguments, limits and errors are those of `asmjax.theory.parameterization`.
"""

import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.theory.arguments import (
    FAR_OUTSIDE,
    LEAST_AHEAD,
    beyond_near,
    depth_range,
    floating,
    half_angle_tangent,
    held,
    resolutions,
    seen_depth,
    warp_strength,
)
from asmjax.theory.limits import expm1_over, log1p_over, over_range

_FARTHEST = 40.0
"""Largest exponent of a depth: e^40 and its square stay in the range of float32."""


def logarithmic_s(z: ArrayLike, alpha: ArrayLike) -> Float[Array, "..."]:
    """s = ln z / ln alpha: 0 on the near plane, 1 on the far plane.

    Section 3.1 integrates to s = ln z, which is not normalised: with it texel widths would be
    too large by ln alpha.
    """
    return log_perspective_s(z, alpha, 1.0)


def logarithmic_z(s: ArrayLike, alpha: ArrayLike) -> Float[Array, "..."]:
    """z = alpha^s, the inverse of `logarithmic_s`."""
    return log_perspective_z(s, alpha, 1.0)


def logarithmic_m_z(
    alpha: ArrayLike, theta: ArrayLike, resolution_ratio: ArrayLike = 1
) -> Float[Array, "..."]:
    """Error along z, the same at every depth: (r_p / r_s) ln(alpha) / (2 tan theta).

    The limit of equation 7 for many subdivisions, and the least error that any s can have.
    """
    ratio = resolutions(resolution_ratio)
    return ratio * (jnp.log1p(depth_range(alpha)) / (2 * half_angle_tangent(theta)))


def log_perspective_s(z: ArrayLike, alpha: ArrayLike, u: ArrayLike) -> Float[Array, "..."]:
    """s = log(1 + u q) / log(1 + u a) with q = z - 1 and a = alpha - 1; q / a at u = 0.

    The hardware form c_0 log(c_1 y + 1) of Lloyd's thesis for y of the perspective projection.
    """
    q, a1, u = beyond_near(z), depth_range(alpha), warp_strength(u)
    # Behind the centre: as in s_of_z. Written with quotients, u = 0 is an ordinary number.
    along = held(u * q, LEAST_AHEAD - 1)
    return over_range(q, a1) * (log1p_over(along) / log1p_over(u * a1))


def log_perspective_z(s: ArrayLike, alpha: ArrayLike, u: ArrayLike) -> Float[Array, "..."]:
    """The inverse of `log_perspective_s`: z = 1 + ((1 + u a)^s - 1) / u."""
    s, a1, u = held(floating(s), -FAR_OUTSIDE, FAR_OUTSIDE), depth_range(alpha), warp_strength(u)
    rate = log1p_over(u * a1)
    exponent = held(s * (u * a1) * rate, -_FARTHEST, _FARTHEST)
    return 1 + s * a1 * rate * expm1_over(exponent)


def log_perspective_m_z(
    z: ArrayLike, alpha: ArrayLike, u: ArrayLike, theta: ArrayLike, resolution_ratio: ArrayLike = 1
) -> Float[Array, "..."]:
    """Error along z: (r_p / r_s) (1 + u q) log(1 + u a) / (2 u z tan theta), largest at z = 1."""
    depth, a1, strength = seen_depth(z), depth_range(alpha), warp_strength(u)
    spacing = a1 * log1p_over(strength * a1) * ((1 - strength + strength * depth) / depth)
    ratio = resolutions(resolution_ratio)
    return ratio * spacing / (2 * half_angle_tangent(theta))
