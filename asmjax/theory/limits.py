"""Functions whose own formulas are 0/0 at 0: series about it, for values and gradients."""

import jax.numpy as jnp
from jaxtyping import Array, Float

_SERIES = 0.03
"""Below this argument the series is used. Above it, the quotient rule that automatic
differentiation applies to the formula loses two digits at most."""

_TERMS = 11
"""0.03^11 is below the rounding unit of float64."""


def log1p_over(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """log(1 + x) / x for x > -1; 1 at 0."""
    coefficients = [(-1.0) ** k / (k + 1) for k in range(_TERMS)]
    return _with_series(lambda x: jnp.log1p(x) / x, coefficients, x)


def expm1_over(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """(exp(x) - 1) / x; 1 at 0."""
    coefficients = [1.0]
    for k in range(1, _TERMS):
        coefficients.append(coefficients[-1] / (k + 1))
    return _with_series(lambda x: jnp.expm1(x) / x, coefficients, x)


def _with_series(formula, coefficients, x):
    """`formula`, and about 0 the polynomial with these coefficients, lowest first."""
    small = jnp.abs(x) < _SERIES
    near = jnp.where(small, x, 0.0)
    total = coefficients[-1] * jnp.ones_like(near)
    for coefficient in reversed(coefficients[:-1]):
        total = total * near + coefficient
    return jnp.where(small, total, formula(jnp.where(small, 1.0, x)))


def over_range(q: Float[Array, "..."], a1: Float[Array, "..."]) -> Float[Array, "..."]:
    """q / (alpha - 1); 0, with a gradient of 0, for the flat frustum alpha = 1."""
    flat = a1 <= 0
    return jnp.where(flat, 0.0, q) / jnp.where(flat, 1.0, a1)
