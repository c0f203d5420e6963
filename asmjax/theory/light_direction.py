"""Critical resolution factors for a directional light at any angle to the view.

The light lies in the plane of view direction and image vertical, gamma radians from the view
direction (gamma and pi - gamma are the same: a map does not tell the two ends of a ray apart). The
map's axis s is the view direction projected on the map, t is horizontal. A warp acts along s, its
centre n in front of the frustum's nearest edge, and the map is the trapezoid that the warp makes a
rectangle, fitted to the view frustum.

With v along s from that edge, in units of the near distance, W the frustum's extent in v, u = 1/n
and w = 1 + u v, a texel (of one per side) is

    along s:  W w^2 / (1 + u W)           perspective
              W w log(1 + u W) / (u W)    logarithmic perspective
    along t:  2 w max(z tan(theta) / w)   the maximum is over the frustum

wide, and its error is width / (2 z tan(theta)): perspective aliasing for equal resolutions. z and w
are linear in position, so each of these quotients is convex or quasi-convex, and the largest error
of the whole view volume is found at a vertex of it.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.errors import unknown_name
from asmjax.theory.arguments import (
    LARGEST_ALPHA,
    depth_range,
    floating,
    half_angle,
    half_angle_tangent,
    held,
    parts,
    setting,
    warp_strength,
)
from asmjax.theory.limits import log1p_over
from asmjax.theory.storage import ResolutionFactors

DIRECTION_WARPS = ("uniform", "lispsm", "perspective", "log_perspective")
"""No warp, that of LiSPSM, or the best perspective or logarithmic perspective one."""

STRONGEST = 1e6
"""Largest u here: a centre a millionth of the near distance in front of the frustum's edge."""

_WEAKEST = 1e-3
"""u W of the weakest warp that the search tries besides none: texels differ by 0.1 %."""

_STEPS, _ROUNDS = 128, 3
"""Strengths tried in each round of the search; each round is two steps of the one before."""


class _Silhouette(NamedTuple):
    """The view volume as the light sees it from the side.

    Attributes:
        z: (4, ...) depth of its vertices; those left and right are alike.
        v: (4, ...) their place along s.
        extent: W, of the whole volume along s.
        tangent: tan(theta).
    """

    z: Float[Array, "4 ..."]
    v: Float[Array, "4 ..."]
    extent: Float[Array, "..."]
    tangent: Float[Array, "..."]


def direction_factors(
    alpha: ArrayLike,
    theta: ArrayLike,
    gamma: ArrayLike,
    u: ArrayLike = 0.0,
    *,
    logarithmic: bool = False,
    k: ArrayLike = 1,
) -> ResolutionFactors:
    """Largest errors along s and t over the view volume, for maps with that warp.

    Args:
        alpha: far / near.
        theta: half the field of view, radians; the same in both directions.
        gamma: angle between light and view direction, radians, 0 to pi.
        u: strength of the warp in 1 / (near distance of each part); 0 does not warp. Unlike under
            an overhead light it may exceed 1, up to `STRONGEST`, and u W up to `LARGEST_ALPHA`.
        logarithmic: whether the warp's s is logarithmic.
        k: parts of the view, split at z_i = alpha^(i/k), each with maps of its own.

    Raises:
        UseError: a concrete argument is not finite or not allowed.
    """
    k = parts(k)
    seen = _silhouette(_part_range(alpha, k), theta, gamma)
    # Squares of what follows stay in the range of float32.
    most = jax.lax.stop_gradient(LARGEST_ALPHA / jnp.where(seen.extent > 1, seen.extent, 1.0))
    s, t = _factors(seen, held(warp_strength(u, STRONGEST), 0.0, most), logarithmic)
    return ResolutionFactors(s, t, k)


def direction_storage(
    alpha: ArrayLike,
    theta: ArrayLike,
    gamma: ArrayLike,
    warp: str = "uniform",
    k: ArrayLike = 1,
) -> ResolutionFactors:
    """`direction_factors` with the warp of `DIRECTION_WARPS` that is named, for that light.

    Raises:
        UseError: an unknown warp, or a concrete argument that is not finite or not allowed.
    """
    if warp not in DIRECTION_WARPS:
        raise unknown_name("warp", warp, DIRECTION_WARPS)
    a1, logarithmic = _part_range(alpha, parts(k)), warp == "log_perspective"
    if warp == "uniform":
        u: ArrayLike = 0.0
    elif warp == "lispsm":
        u = _lispsm(a1, theta, gamma)
    else:
        u = _best(a1, theta, gamma, logarithmic)
    return direction_factors(alpha, theta, gamma, u, logarithmic=logarithmic, k=k)


def lispsm_strength(alpha: ArrayLike, theta: ArrayLike, gamma: ArrayLike) -> Float[Array, "..."]:
    """1/n of LiSPSM: n = (1 + sqrt(1 + W sin gamma)) / sin gamma (Wimmer et al. 2004).

    z_n = 1 and z_f = z_n + W sin gamma, with W the extent of the view volume along s. Falls to 0
    with gamma, but too slowly: below gamma of about 0.6 to 0.95 theta worse than no warp.
    """
    return _lispsm(depth_range(alpha), theta, gamma)


def _lispsm(a1, theta, gamma):
    seen = _silhouette(a1, theta, gamma)
    sine = jnp.sin(_angle(gamma))
    return sine / (1 + jnp.sqrt(1 + seen.extent * sine))


def best_strength(
    alpha: ArrayLike, theta: ArrayLike, gamma: ArrayLike, *, logarithmic: bool = False
) -> Float[Array, "..."]:
    """The u of least storage, by search over n; 0 where no warp is better than none.

    Within 0.1 % of the least storage. It carries no gradient, so storage at the best u has the
    gradient at a fixed u. That is the derivative of the least storage only where the best u is not
    in a kink of the maxima (at alpha = 1000, theta = 30 and gamma = 45 degrees it is, and 5 % off).
    """
    return _best(depth_range(alpha), theta, gamma, logarithmic)


def _best(a1, theta, gamma, logarithmic):
    a1, theta, gamma = jnp.broadcast_arrays(
        *(jax.lax.stop_gradient(floating(x)) for x in (a1, theta, gamma))
    )
    seen = _silhouette(a1[..., None], theta[..., None], gamma[..., None])
    extent = jnp.where(seen.extent > 0, seen.extent, 1.0)

    def storage(u):
        s, t = _factors(seen, u, logarithmic)
        return s * t

    at = jnp.asarray(np.linspace(0, 1, _STEPS + 1), extent.dtype)

    def search(_, around):
        low, high = around
        tried = low + (high - low) * at
        chosen = jnp.argmin(storage(jnp.exp(tried) / extent), axis=-1, keepdims=True)
        best, step = jnp.take_along_axis(tried, chosen, -1), (high - low) / _STEPS
        return best - step, best + step

    strongest = jnp.log(jnp.minimum(STRONGEST * extent, LARGEST_ALPHA))
    widest = jnp.full_like(extent, np.log(_WEAKEST)), strongest
    low, high = jax.lax.fori_loop(0, _ROUNDS, search, widest)
    best = jnp.exp((low + high) / 2) / extent
    return jnp.where(storage(jnp.zeros_like(best)) <= storage(best), 0.0, best)[..., 0]


def _angle(gamma: ArrayLike) -> Float[Array, "..."]:
    """The acute angle; exactly 0 for the float32 number nearest to pi, which is above it."""
    remedy = "it is the angle between light and view direction, in radians."
    gamma = setting("gamma", gamma, 0.0, float(np.float32(np.pi)), remedy)
    return jnp.where(gamma > np.pi / 2, held(np.pi - gamma, 0.0), gamma)


def _part_range(alpha: ArrayLike, k: Float[Array, "..."]) -> Float[Array, "..."]:
    """alpha^(1/k) - 1, without the cancellation."""
    return jnp.expm1(jnp.log1p(depth_range(alpha)) / k)


def _silhouette(a1: Float[Array, "..."], theta: ArrayLike, gamma: ArrayLike) -> _Silhouette:
    """From v = z sin(gamma) - y cos(gamma), with y from -z tan(theta) to z tan(theta).

    v grows with z by sin(gamma) -+ tan(theta) cos(gamma) = sin(gamma -+ theta) / cos(theta) along
    its lower and upper edge, which are z 2 tan(theta) cos(gamma) apart: in these terms, and from
    the vertex where v is least, nothing cancels in a thin frustum nor in a light along its edge.
    """
    tangent, theta, gamma = half_angle_tangent(theta), half_angle(theta), _angle(gamma)
    lower, upper = (jnp.sin(gamma + s * theta) / jnp.cos(theta) for s in (-1, 1))
    # The float32 number nearest to pi / 2 is above it, where the cosine is below 0.
    apart = 2 * tangent * held(jnp.cos(gamma), 0.0)
    a1, lower, upper, tangent, apart = jnp.broadcast_arrays(a1, lower, upper, tangent, apart)
    far = 1 + a1
    z = jnp.stack([jnp.ones_like(far), jnp.ones_like(far), far, far])
    # The lower edge begins where v is least: at the near end where it rises, else at the far end.
    rises = lower > 0
    fall, rise = (jnp.where(side, a1 * jnp.abs(lower), 0.0) for side in (~rises, rises))
    v = jnp.stack([fall, fall + apart, rise, jnp.where(rises, apart + a1 * upper, far * apart)])
    return _Silhouette(z, v, v[-1], tangent)


def _factors(
    seen: _Silhouette, u: Float[Array, "..."], logarithmic: bool
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Largest errors along s and t."""
    w, whole = 1 + u * seen.v, 1 + u * seen.extent
    bend = log1p_over(u * seen.extent) if logarithmic else w / whole
    along = (bend * (w / seen.z)).max(axis=0)
    across = (seen.z / w).max(axis=0) * (w / seen.z).max(axis=0)
    return seen.extent * along / (2 * seen.tangent), across
