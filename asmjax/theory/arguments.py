"""What the theory's functions accept.

Settings (a depth range, a warp, a field of view) that are wrong and concrete raise; traced ones
cannot, and are held at the nearest allowed value, where their gradient is 0. Depths and image
coordinates are data: they are held inside the range in which the formulas mean something, so that
no value and no gradient is NaN, in float32 as in float64.
"""

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.errors import require

LARGEST_ALPHA = 1e9
"""Largest far / near: what is multiplied in the gradients then stays in the range of float32."""

LEAST_Z = 1e-6
"""Depths nearer to the eye than this, in units of the near distance, are taken there."""

NARROWEST, WIDEST = 1e-3, np.pi / 2 - 1e-2
"""Half fields of view in radians: beyond 179 degrees in all, tan^2 is too steep for float32."""

LEAST_AHEAD = 1e-6
"""Points nearer to a warp's centre of projection than this part of n, or behind it, are taken
there."""

FAR_OUTSIDE = 1e3
"""Image coordinates are held within + and - this many widths of the map."""


def held(x: Float[Array, "..."], low: ArrayLike, high: ArrayLike = np.inf) -> Float[Array, "..."]:
    """`x` within `low` .. `high`; the gradient is 1 inside and at both ends, and 0 beyond.

    (`jnp.clip` halves the gradient at the ends, which are limits of interest here.)
    """
    return jnp.where(x < low, low, jnp.where(x > high, high, x))


def floating(value: ArrayLike) -> Float[Array, "..."]:
    """`value` as floating point; Python numbers take the precision of what they meet."""
    return jnp.asarray(value) * 1.0


def setting(
    name: str, value: ArrayLike, low: float, high: float, remedy: str
) -> Float[Array, "..."]:
    """`value` as floating point, checked where it is concrete, and held within `low` .. `high`.

    Raises:
        UseError: a concrete value is NaN or outside; the message ends with `remedy`.
    """
    if not isinstance(value, Tracer):
        numbers = np.asarray(value, np.float64).ravel()
        wrong = numbers[~((numbers >= low) & (numbers <= high))]
        got = f"{wrong[0]:g}" if wrong.size else ""
        require(not got, f"{name} is {got}; allowed: {low:g} to {high:g}; {remedy}")
    return held(floating(value), low, high)


def depth_range(alpha: ArrayLike) -> Float[Array, "..."]:
    """alpha - 1 >= 0; the subtraction is exact where it could cancel."""
    remedy = "it is the far / the near distance."
    return setting("alpha", alpha, 1.0, LARGEST_ALPHA, remedy) - 1


def warp_strength(u: ArrayLike, most: float = 1.0) -> Float[Array, "..."]:
    """u = 1/n in units of 1 / near distance: 0 (uniform) to 1 (PSM) under an overhead light."""
    return setting("u", u, 0.0, most, "it is 1/n: 0 does not warp, u_lispsm(alpha) is best in z.")


def signed_strength(xi: ArrayLike) -> Float[Array, "..."]:
    """The paper's xi, -1 (uniform) to 1 (PSM)."""
    return setting("xi", xi, -1.0, 1.0, "-1 does not warp, 0 is the LiSPSM, 1 the PSM.")


def half_angle(theta: ArrayLike) -> Float[Array, "..."]:
    """theta, half a field of view in radians."""
    remedy = "it is half the field of view, in radians."
    return setting("theta", theta, NARROWEST, WIDEST, remedy)


def half_angle_tangent(theta: ArrayLike) -> Float[Array, "..."]:
    """tan(theta) of half a field of view in radians."""
    return jnp.tan(half_angle(theta))


def resolutions(ratio: ArrayLike) -> Float[Array, "..."]:
    """Pixels of the image / texels of the map along an axis."""
    remedy = "it is pixels / texels: 1 for a map as fine as the image."
    return setting("resolution_ratio", ratio, 1e-6, 1e6, remedy)


def parts(k: ArrayLike) -> Float[Array, "..."]:
    """How many parts a range is split into; real-valued, so that errors are smooth in it."""
    return setting("k", k, 1.0, 1e9, "1 does not split.")


def beyond_near(z: ArrayLike) -> Float[Array, "..."]:
    """q = z - 1 of any depth in units of the near distance; below 0 in front of the near plane."""
    return held(floating(z), -LARGEST_ALPHA, LARGEST_ALPHA) - 1


def seen_depth(z: ArrayLike) -> Float[Array, "..."]:
    """A depth in front of the eye, in units of the near distance."""
    return held(floating(z), LEAST_Z, LARGEST_ALPHA)


def ahead(w: Float[Array, "..."]) -> Float[Array, "..."]:
    """The homogeneous coordinate w = 1 + u q, kept in front of the warp's centre."""
    return held(w, LEAST_AHEAD)
