"""How large a shadow texel is beside an eye pixel, on the receiver, and which one each pixel needs.

Ratios are functions of the `(2, 2, n)` Jacobian of `uv_jacobian` and the number of texels per side
of the light's image. Above 1 the map is too coarse. Logarithms first: area ratios span many
decades, and a grazing light or eye must not overflow.
"""

import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from asmjax.footprint.jacobian import determinant, singular_values
from asmjax.numerics import safe_log2

LOG2_WORST = 30.0
"""log2 of the linear ratio, for one texel per face side, that stands for "no resolution is enough":
a light edge-on. Area ratios of it, and their gradients, still are float32 numbers."""


def log2_linear_ratio(jacobian: Float[Array, "2 2 n"], resolution: ArrayLike) -> Float[Array, " n"]:
    """log2 of the side of a texel / side of a pixel, from areas; `LOG2_WORST` for a flat footprint.

    Where the Jacobian is 0 (no receiver) this is `LOG2_WORST` too: mask before reducing.
    """
    dtype = jacobian.dtype
    area = jnp.abs(determinant(jacobian))
    # So small a determinant is rounding: its inverse would overflow in the gradient.
    least = jnp.finfo(dtype).eps ** 2 * jnp.square(jacobian).max(axis=(0, 1))
    texels = 0.5 * safe_log2(jnp.where(area > least, area, 0), -LOG2_WORST * 2)
    return -(texels + jnp.log2(jnp.asarray(resolution, dtype)))


def area_ratio(jacobian: Float[Array, "2 2 n"], resolution: ArrayLike) -> Float[Array, " n"]:
    """World area of a shadow texel / of an eye pixel: 1 / |det J| (Fernando et al. 2001, 3.1)."""
    return jnp.exp2(2 * log2_linear_ratio(jacobian, resolution))


def linear_ratio(jacobian: Float[Array, "2 2 n"], resolution: ArrayLike) -> Float[Array, " n"]:
    """Square root of `area_ratio`."""
    return jnp.exp2(log2_linear_ratio(jacobian, resolution))


def log2_m(jacobian: Float[Array, "2 2 n"], resolution: ArrayLike) -> Float[Array, " n"]:
    """log2 of `m`; see there."""
    dtype = jacobian.dtype
    _, smallest = singular_values(jacobian)
    return -(safe_log2(smallest, -LOG2_WORST) + jnp.log2(jnp.asarray(resolution, dtype)))


def m(jacobian: Float[Array, "2 2 n"], resolution: ArrayLike) -> Float[Array, " n"]:
    """Lloyd's linear error: texel width / pixel width in the worst direction, 1 / sigma_min(J).

    `area_ratio <= m**2`, equal where the footprint is not stretched. The expected displacement of
    a shadow edge is at most m / 4 pixels (M4 of docs/theory.md).
    """
    return jnp.exp2(log2_m(jacobian, resolution))


def n_required(
    n_current: Float[Array, " n"] | float, ratio: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Texels that an area of `n_current` texels needs to match the eye: n_current * area ratio.

    Fernando et al. 2001, 3.1, print the inverse ratio (eye / shadow); read literally that asks
    for fewer texels the coarser the map is. Shrinking the light's focal length by 2 must multiply
    this by 4 (docs/theory.md).
    """
    return n_current * ratio


def required_level(
    log2_ratio: Float[Array, " n"], log2_cells: ArrayLike, log2_target: ArrayLike = 0.0
) -> Float[Array, " n"]:
    """Real-valued refinement level below a map where log2(linear ratio or m) is `log2_ratio`.

    Each level multiplies the linear resolution by 2**log2_cells; 0 where the map is fine enough
    for a target ratio of 2**log2_target.
    """
    return jnp.maximum((log2_ratio - log2_target) / log2_cells, 0)
