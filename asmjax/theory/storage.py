"""How many texels a map needs to be no coarser than the image: overhead light, closed forms.

The critical resolution factor of an axis is its largest error over the view volume at
r_s = r_p: with R times as many texels as pixels along that axis, no error is above 1. The
storage factor S = R_s R_t counts texels in units of the image's pixels, added up over maps
(Lloyd's thesis; here from TR05-024, equations 5, 7 and 9).

| map | S, with F = 1 / (2 tan theta) and a = alpha - 1 |
| --- | --- |
| uniform | alpha a F |
| perspective, u from u_lispsm to 1 (xi in [0, 1]) | a F, whatever u |
| perspective, xi in [-1, 0] | a F (1 + abs(xi) (sqrt(alpha) - 1))^2 |
| logarithmic in z only | alpha ln(alpha) F |
| logarithmic perspective, u = 1 | ln(alpha) F |
| k parts z_i = alpha^(i/k), each uniform | k alpha^(1/k) (alpha^(1/k) - 1) F |
| k parts, each with a perspective warp of xi in [0, 1] | k (alpha^(1/k) - 1) F |

The equivalence of all warps from LiSPSM to PSM holds for this light only; for others see
`asmjax.theory.light_direction`.
"""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.errors import unknown_name
from asmjax.theory.arguments import depth_range, half_angle_tangent, held, parts, warp_strength
from asmjax.theory.limits import log1p_over

WARPS = ("uniform", "perspective", "logarithmic", "log_perspective")
"""Parameterizations of a map; "logarithmic" along z only, "log_perspective" in both axes."""


_MOST = 1e26
"""Largest storage factor: gradients then stay in the range of float32."""


class ResolutionFactors(eqx.Module):
    """Critical resolution factors of one map, texels / pixels along each axis.

    Attributes:
        s: along the projected view direction.
        t: across it.
        maps: how many such maps, of equal factors, cover the view.
    """

    s: Float[Array, "..."]
    t: Float[Array, "..."]
    maps: Float[Array, "..."]

    @property
    def storage(self) -> Float[Array, "..."]:
        """Texels of all maps / pixels of the image; 1e26 if more, with a gradient of 0."""
        return self.maps * held(self.s * self.t, 0.0, _MOST)


def overhead_factors(
    alpha: ArrayLike,
    theta: ArrayLike,
    warp: str = "uniform",
    u: ArrayLike | None = None,
    k: ArrayLike = 1,
) -> ResolutionFactors:
    """Critical resolution factors under a directional light perpendicular to the view.

    Args:
        alpha: far / near.
        theta: half the field of view, radians; the same in both directions.
        warp: parameterization of each part, one of `WARPS`.
        u: strength of a "perspective" or "log_perspective" warp, for each part in units of its
            own near distance; 1, the frustum's own perspective, if None. The others have none.
        k: parts, split at z_i = alpha^(i/k).

    Raises:
        UseError: an unknown warp, or a concrete argument that is not finite or not allowed.
    """
    if warp not in WARPS:
        raise unknown_name("warp", warp, WARPS)
    k = parts(k)
    exponent = jnp.log1p(depth_range(alpha)) / k
    a1 = jnp.expm1(exponent)
    half_inverse = 1 / (2 * half_angle_tangent(theta))
    strength = warp_strength(1.0 if u is None else u)
    narrowed = 1 + strength * a1
    along, across = {
        "uniform": (a1, 1 + a1),
        "perspective": (
            a1 * jnp.maximum(1 / narrowed, narrowed / (1 + a1)),
            (1 + a1) / narrowed,
        ),
        "logarithmic": (exponent, 1 + a1),
        "log_perspective": (a1 * log1p_over(strength * a1), (1 + a1) / narrowed),
    }[warp]
    return ResolutionFactors(along * half_inverse, across, k)
