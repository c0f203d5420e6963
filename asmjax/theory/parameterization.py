"""Perspective warps of a shadow map along z, and their errors (Lloyd et al., TR05-024, section 3).

The light is overhead: perpendicular to the view. Depth z is axial, in units of the near distance;
the view frustum is 1 <= z <= alpha, and theta is half its field of view. The warp is a perspective
projection whose centre lies n in front of the near plane.

| the paper's | here |
| --- | --- |
| n, from 1 to infinity | u = 1/n, from 1 to 0: the uniform map is an ordinary number |
| f, z' | n + alpha - 1, and z - 1 + n = (1 + u q) / u with q = z - 1 |
| xi | `xi`: -1 is u = 0, 0 is u = 1 / (1 + sqrt(alpha)) (LiSPSM), 1 is u = 1 (PSM) |
| r_p / r_s, r_p / r_t | `resolution_ratio`: pixels / texels along that axis |
| m, m_x | `m_z`, `m_x`: width of a texel's beam / of a pixel's; above 1 the map is too coarse |

In u nothing is divided by n, nothing cancels and no square overflows. Two limits: at alpha = 1 the
frustum is flat, and there every s is 0, g = 1/z, m_z = 0 and m_x = 1/z; at large alpha, 1e8 or up
to 1e9, float32 still gives all but one or two of its digits.

Arguments broadcast. A concrete alpha, u, xi, theta or resolution_ratio that is not finite or not
allowed is a `UseError`; theta is in radians. Depths behind the eye have the errors of those just in
front of it.
"""

from types import ModuleType
from typing import Any

import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.theory.arguments import (
    FAR_OUTSIDE,
    LARGEST_ALPHA,
    ahead,
    beyond_near,
    depth_range,
    floating,
    half_angle_tangent,
    held,
    resolutions,
    seen_depth,
    setting,
    signed_strength,
    warp_strength,
)
from asmjax.theory.limits import over_range


def u_from_n(n: ArrayLike) -> Float[Array, "..."]:
    """u = 1/n of a centre n near distances in front of the near plane; 0 for an infinite n.

    Raises:
        UseError: a concrete n is below 1 or NaN.
    """
    return 1 / setting("n", n, 1.0, jnp.inf, "1 is the PSM, infinity the uniform map.")


def n_from_u(u: ArrayLike) -> Float[Array, "..."]:
    """n = 1/u; infinite, with a gradient of 0, for the uniform map and where 1/u^2 overflows."""
    u = warp_strength(u)
    uniform = u < jnp.finfo(u.dtype).tiny ** 0.5
    return jnp.where(uniform, jnp.inf, 1 / jnp.where(uniform, 1.0, u))


def u_lispsm(alpha: ArrayLike) -> Float[Array, "..."]:
    """u of the least largest z error: n_opt = 1 + sqrt(alpha) (section 3.1; Wimmer et al. 2004)."""
    return 1 / (1 + jnp.sqrt(1 + depth_range(alpha)))


def u_from_xi(xi: ArrayLike, alpha: ArrayLike) -> Float[Array, "..."]:
    """Equation 4 for u = 1/n. At xi = 0, where its branches meet, continuous with its derivative,
    sqrt(alpha) / (1 + sqrt(alpha)); the second one jumps.

    xi is the largest z error on a scale from g_0 = 1/sqrt(alpha) (0) to 1: below 0 it is reached
    on the near plane, above 0 on the far plane.
    """
    return equation_4(signed_strength(xi), depth_range(alpha), jnp)


def equation_4(xi: Any, a1: Any, xp: ModuleType) -> Any:
    """`u_from_xi` of arguments known to be allowed, with a1 = alpha - 1: of NumPy's or JAX's
    numbers, by the functions of that module."""
    root = xp.sqrt(1 + a1)
    negative = xi <= 0
    weak = (1 + xi) / (1 + root - xp.where(negative, xi, 0.0) * a1)
    return xp.where(negative, weak, (1 + xi * root) / (1 + root))


def xi_from_u(u: ArrayLike, alpha: ArrayLike) -> Float[Array, "..."]:
    """The inverse of `u_from_xi`: section 3.2, before equation 4, in its simplified form.

    (The other form there, a difference of two g, cancels where alpha is near 1.)
    """
    u, a1 = warp_strength(u), depth_range(alpha)
    root = jnp.sqrt(1 + a1)
    excess = u * (1 + root) - 1
    return excess / jnp.where(excess <= 0, 1 + u * a1, root)


def s_of_z(z: ArrayLike, alpha: ArrayLike, u: ArrayLike) -> Float[Array, "..."]:
    """Image coordinate s of a depth: 0 on the near plane, 1 on the far plane.

    s = q (1 + u a) / (a (1 + u q)), with a = alpha - 1. Section 3.1 prints
    1/2 + (f + n) / (2 (f - n)) + f n / (z' (f - n)): the last sign must be a minus. Depths that are
    not in front of the warp's centre, q <= -n, have large negative coordinates that mean nothing.
    """
    q, a1, u = beyond_near(z), depth_range(alpha), warp_strength(u)
    # 1 + u q without its cancellation in front of the near plane.
    depth = held(floating(z), -LARGEST_ALPHA, LARGEST_ALPHA)
    share, w = over_range(q, a1), ahead(1 - u + u * depth)
    # Of two equal forms each takes the half in which neither its value nor its gradient, two
    # terms of one sign, cancels: at the far end of a PSM the first one's would be off by alpha
    # rounding units.
    return jnp.where(u * q <= 1, share * ((1 + u * a1) / w), 1 - (1 - share) / w)


def z_of_s(s: ArrayLike, alpha: ArrayLike, u: ArrayLike) -> Float[Array, "..."]:
    """Depth at an image coordinate, the inverse of `s_of_z`: z = 1 + s a / (1 + u a (1 - s)).

    The warp maps infinity to s = 1 + 1 / (u a); from there on depths are large and mean nothing.
    """
    s, a1, u = held(floating(s), -FAR_OUTSIDE, FAR_OUTSIDE), depth_range(alpha), warp_strength(u)
    return 1 + s * (a1 / ahead(1 + u * a1 * (1 - s)))


def g(z: ArrayLike, alpha: ArrayLike, u: ArrayLike) -> Float[Array, "..."]:
    """The error distribution along z, at most 1 (equation 3): (1 + u q)^2 / (z (1 + u a)).

    Convex in z, so largest at an end.
    """
    z, a1, u = seen_depth(z), depth_range(alpha), warp_strength(u)
    # 1 + u (z - 1) without its cancellation near the eye.
    w = 1 - u + u * z
    return (w / z) * (w / (1 + u * a1))


def m_z(
    z: ArrayLike, alpha: ArrayLike, u: ArrayLike, theta: ArrayLike, resolution_ratio: ArrayLike = 1
) -> Float[Array, "..."]:
    """Error along z (equation 2): (r_p / r_s) (alpha - 1) / (2 tan theta) g."""
    return _z_scale(alpha, theta, resolution_ratio) * g(z, alpha, u)


def m_x(
    z: ArrayLike, alpha: ArrayLike, u: ArrayLike, resolution_ratio: ArrayLike = 1
) -> Float[Array, "..."]:
    """Error across the view (equation 8): (r_p / r_t) alpha (1 + u q) / (z (1 + u a)).

    The map is as wide as the far plane; falls with z, and is 1 everywhere for u = 1 at r_p = r_t.
    """
    depth, a1, u = seen_depth(z), depth_range(alpha), warp_strength(u)
    widest = (1 + a1) / (1 + u * a1)
    return resolutions(resolution_ratio) * widest * ((1 - u + u * depth) / depth)


def g_max(alpha: ArrayLike, u: ArrayLike) -> Float[Array, "..."]:
    """Largest g of the frustum: on the near plane 1 / (1 + u a), on the far one (1 + u a) / alpha.

    Equal to (1 + |xi| (sqrt(alpha) - 1)) / sqrt(alpha), the last factor of equation 5. Which plane:
    near for xi <= 0, far for xi > 0; the text before equation 5 has the two exchanged.
    """
    a1, u = depth_range(alpha), warp_strength(u)
    return jnp.maximum(1 / (1 + u * a1), (1 + u * a1) / (1 + a1))


def m_z_max(
    alpha: ArrayLike, u: ArrayLike, theta: ArrayLike, resolution_ratio: ArrayLike = 1
) -> Float[Array, "..."]:
    """Largest error along z over the frustum (equation 5)."""
    return _z_scale(alpha, theta, resolution_ratio) * g_max(alpha, u)


def m_x_max(alpha: ArrayLike, u: ArrayLike, resolution_ratio: ArrayLike = 1) -> Float[Array, "..."]:
    """Largest error across the view, on the near plane (equation 9): (r_p/r_t) alpha / (1 + u a).

    Least at xi = +1 (u = 1, the PSM) and largest at xi = -1; section 4.1 names the wrong end.
    """
    return m_x(1.0, alpha, u, resolution_ratio)


def _z_scale(
    alpha: ArrayLike, theta: ArrayLike, resolution_ratio: ArrayLike = 1
) -> Float[Array, "..."]:
    """(r_p / r_s) (alpha - 1) / (2 tan theta): the factors of equation 2 before g."""
    ratio = resolutions(resolution_ratio)
    return ratio * (depth_range(alpha) / (2 * half_angle_tangent(theta)))
