"""Splitting the view frustum: how many texels each part gets, where to split, what is left.

Each part of a frustum, with a warp of its own, is the theory's frustum again with a smaller alpha.
Splits that make all parts alike, z_i = alpha^(i/k), lead to the logarithm as k grows
(Lloyd et al., TR05-024, section 4).
"""

from collections.abc import Sequence
from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.errors import require
from asmjax.numerics import safe_divide
from asmjax.theory.arguments import (
    depth_range,
    half_angle_tangent,
    parts,
    resolutions,
    setting,
    signed_strength,
)

_LEAST, _LARGEST = 1e-12, 1e12


def allocate(errors: ArrayLike | Sequence[float], texels: ArrayLike) -> Float[Array, " n"]:
    """Texels for each part, in proportion to its error (equation 6): r_i = r e_i / sum of e_j.

    Then all parts have the same error, the sum of all e_j: no other allocation has a smaller
    largest one.

    Args:
        errors: (n,) largest error of each part *if it had all texels*, not negative.
        texels: along the axis that is shared out.

    Returns:
        (n,) real numbers that add up to `texels`; equal ones where all errors are 0.

    Raises:
        UseError: a concrete error is negative or not finite, or texels is not positive.
    """
    errors = setting("errors", jnp.asarray(errors), 0.0, 1e18, "errors are texel / pixel widths.")
    texels = setting("texels", texels, _LEAST, _LARGEST, "it is the resolution to share out.")
    # Scaled first, so that neither the sum nor its square leaves the range of float32.
    largest = errors.max()
    shares = safe_divide(errors, largest * jnp.ones_like(errors), 1.0)
    return texels * (shares / shares.sum())


def subdivided_m_z_max(
    alpha: ArrayLike,
    k: ArrayLike,
    xi: ArrayLike,
    theta: ArrayLike,
    resolution_ratio: ArrayLike = 1,
) -> Float[Array, "..."]:
    """Largest error along z of a face in k parts z_i = alpha^(i/k) (equation 7).

    Every part is warped by the same xi, has the range alpha^(1/k), and r_s / k texels (the paper
    prints 1 / k). Falls with k to `logarithmic_m_z`, whatever xi; most of it at k = 2 and 3.

    Args:
        k: number of parts, 1 or more; may be real.
        xi: -1 uniform, 0 LiSPSM, 1 PSM.
        theta: half the field of view, radians.
        resolution_ratio: r_p / r_s for the texels of all parts together.

    Raises:
        UseError: a concrete argument is not finite or not allowed.
    """
    k, strength = parts(k), jnp.abs(signed_strength(xi))
    ratio = resolutions(resolution_ratio)
    # log of the square root of a part's range; with expm1, alpha near 1 or large k lose nothing.
    half = jnp.log1p(depth_range(alpha)) / (2 * k)
    largest_g = (1 + strength * jnp.expm1(half)) * jnp.exp(-half)
    return ratio * (k * jnp.expm1(2 * half) * largest_g / (2 * half_angle_tangent(theta)))


def uniform_splits(near: ArrayLike, far: ArrayLike, k: int) -> Float[Array, " depths"]:
    """Depths near = z_0 < z_1 < ... < z_k = far, equally far apart."""
    return practical_splits(near, far, k, 0.0)


def logarithmic_splits(near: ArrayLike, far: ArrayLike, k: int) -> Float[Array, " depths"]:
    """z_i = near (far / near)^(i/k): all parts have the same shape, and the same error."""
    return practical_splits(near, far, k, 1.0)


def practical_splits(
    near: ArrayLike, far: ArrayLike, k: int, weight: ArrayLike = 0.5
) -> Float[Array, " depths"]:
    """weight x logarithmic + (1 - weight) x uniform splits (the "practical" scheme of PSSM).

    Logarithmic splits alone spend most parts close to the eye, where often nothing is seen;
    Zhang et al. 2006 mix both by halves. With near = far all are equal.

    Args:
        near, far: distances, 0 < near <= far, any unit.
        k: number of parts.
        weight: lambda, 0 to 1.

    Returns:
        (k + 1,) depths, both ends included.

    Raises:
        UseError: a concrete argument is not finite or not allowed.
    """
    require(k >= 1, f"k is {k}; allowed: 1 or more parts; 1 does not split.")
    near = setting("near", near, _LEAST, _LARGEST, "the logarithm needs a near plane.")
    far = setting("far", far, _LEAST, _LARGEST, "it is the distance of the far plane.")
    weight = setting("weight", weight, 0.0, 1.0, "0 is uniform, 1 logarithmic, 0.5 usual.")
    return blended_splits(near, depth_range(far / near), k, weight, jnp)


def blended_splits(near: Any, range_: Any, k: int, weight: Any, xp: ModuleType) -> Any:
    """`practical_splits` of arguments known to be allowed, with range_ = far / near - 1: of NumPy's
    or JAX's numbers, by the functions of that module."""
    part = xp.asarray(np.arange(k + 1) / k, range_.dtype)
    even, by_ratio = part * range_, xp.expm1(part * xp.log1p(range_))
    return near * (1 + even + weight * (by_ratio - even))
