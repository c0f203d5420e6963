"""How much must be in shadow, given four moments of depth: Hamburger's moment problem.

Of all distributions of depth with the same four moments, one that has a depth z among its three
depths has the least below z (Chebyshev, Markov; Peters and Klein 2015, "Moment Shadow Mapping",
algorithm 3). So what it has below z is a lower bound, and the sharpest one, of the true share of
blockers: light may leak, nothing is too dark.

The three depths are z and the roots of the kernel K(x) = sum_k p_k(x) p_k(z) of the polynomials
that are orthonormal under the moments. No root is needed but where z lies between the two:

    weight of z        w = 1 / K(z)
    p_2(z) > 0         both roots are on one side: below z, and 1 - w is, or above, and nothing is
    p_2(z) <= 0        one root is below: its weight follows from the mean

which divides by nothing that can vanish, and is the printed algorithm otherwise. Depths are in
[-1, 1], the two ends of what a map holds; moments (4, n) are the means of x, x^2, x^3 and x^4.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from asmjax.numerics import safe_divide

ALPHA = {"float32": 1e-6, "float64": 1e-8}
"""By which part moments are moved towards those of `CENTRAL`, by the dtype that computes.

Moments of one or two depths lie on the border of what is possible, and rounding puts them beyond.
With depths in [-1, 1] the worst of 20,000 single depths is right to 3 digits at a distance of 5 %
from here on (docs/theory.md, "Moment shadow maps")."""

CENTRAL = (0.0, 0.375, 0.0, 0.375)
"""Moments well inside of what is possible."""

LEAST_VARIANCE = 0.3
LEAST_SPREAD = 0.2
"""Of the biased moments, variance and what of x^2 is no linear function of x are at least these
parts of alpha (those of `CENTRAL` are 0.375 and 0.234, and both are superadditive): less is
rounding."""

STEEPEST = 2.0
"""Slope of the regression of x^2 on x, at most, as x is in [-1, 1]."""

ALL_AT_Z = 1e-8
"""Of the discriminant: what is left beside z is less than that then."""


def moments_of(depth: Float[Array, "..."]) -> Float[Array, "4 ..."]:
    """Those of a single depth in [-1, 1]."""
    square = depth * depth
    return jnp.stack([depth, square, square * depth, square * square])


def alpha_of(dtype) -> float:
    """`ALPHA` of a dtype."""
    return ALPHA[jnp.dtype(dtype).name]


class _Kernel(NamedTuple):
    """K(x) of one depth z.

    Attributes:
        depth: z.
        mean: of the distribution, from z on.
        value, slope, bend: K(z), K'(z), K''(z) / 2.
    """

    depth: Array
    mean: Array
    value: Array
    slope: Array
    bend: Array


def _kernel(moments, depth, alpha) -> _Kernel:
    b0, b1, b2, b3 = (
        (1 - alpha) * jnp.clip(moment, -1, 1) + alpha * centre
        for moment, centre in zip(moments, CENTRAL, strict=True)
    )
    z = jnp.clip(depth, -1, 1)
    mean = b0 - z
    variance = jnp.maximum(b1 - b0 * b0, LEAST_VARIANCE * alpha)
    covariance = b2 - b0 * b1
    steepness = jnp.clip(covariance / variance, -STEEPEST, STEEPEST)
    spread = jnp.maximum(b3 - b1 * b1 - steepness * covariance, LEAST_SPREAD * alpha)
    p2 = z * z - b1 + steepness * mean
    return _Kernel(
        depth=z,
        mean=mean,
        value=1 + mean * mean / variance + p2 * p2 / spread,
        slope=(2 * z - steepness) * p2 / spread - mean / variance,
        bend=p2 / spread,
    )


class _Split(NamedTuple):
    """Where z lies between the roots z_1 and z_2 (`bend` is not positive), with S^2 the
    discriminant: 1 / (z - z_1) = (S + K'(z)) / (2 K(z)), 1 / (z_2 - z) = (S - K'(z)) / (2 K(z)).

    Attributes:
        root: S.
        plus, minus: S + K'(z), S - K'(z).
    """

    root: Array
    plus: Array
    minus: Array


def _split(kernel: _Kernel) -> _Split:
    product = -4 * jnp.minimum(kernel.bend, 0) * kernel.value
    inside = kernel.slope * kernel.slope + product
    # Where both vanish all of the weight is at z, and the root has no slope.
    none = inside <= ALL_AT_Z
    root = jnp.where(none, 0, jnp.sqrt(jnp.where(none, 1, inside)))
    # The larger one of the two, and the other by their product: nothing cancels.
    larger = root + jnp.abs(kernel.slope)
    smaller = safe_divide(product, larger)
    rising = kernel.slope > 0
    return _Split(root, jnp.where(rising, larger, smaller), jnp.where(rising, smaller, larger))


def shadow_intensity(
    moments: Float[Array, "4 ..."], depth: Float[Array, "..."], alpha: Float[Array, "..."] | float
) -> Float[Array, "..."]:
    """The least share (n,) of blockers below `depth` (n,), in [0, 1]; what the bias `alpha` adds
    is taken away again, so that it stays a lower bound."""
    kernel = _kernel(moments, depth, alpha)
    split = _split(kernel)
    others = 1 - 1 / kernel.value
    nearer = safe_divide(split.plus, 2 * split.root)
    nearer = nearer * (others - kernel.mean * split.minus / (2 * kernel.value))
    both = jnp.where(kernel.slope > 0, others, 0)
    below = jnp.where(kernel.bend > 0, both, nearer)
    return jnp.clip((below - alpha) / (1 - alpha), 0, 1)


def mean_blocker(
    moments: Float[Array, "4 ..."], depth: Float[Array, "..."], alpha: Float[Array, "..."] | float
) -> Float[Array, "..."]:
    """Mean depth (n,) of the blockers that `shadow_intensity` counts below `depth`, in [-1, depth];
    `depth` where there are none."""
    kernel = _kernel(moments, depth, alpha)
    # Relative to z: of both others, and of the one below it.
    both = jnp.where(kernel.slope > 0, safe_divide(kernel.mean, 1 - 1 / kernel.value), 0)
    lower = safe_divide(-2 * kernel.value, _split(kernel).plus)
    found = jnp.where(kernel.bend > 0, both, lower)
    return jnp.clip(kernel.depth + jnp.minimum(found, 0), -1, 1)
