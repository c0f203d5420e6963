"""Double-where helpers: no NaN in value or gradient when a masked entry would divide by zero; and
float64 for a while."""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

_P = ParamSpec("_P")
_R = TypeVar("_R")


def least_depth(dtype) -> float:
    """Points nearer than this along an axis, in scene units, are not in front of it.

    No part of a scene's size, which the near distances of lights and eyes are: only what keeps the
    squares of inverse depths in the range of the type, 2e-13 in float32 and 3e-103 in float64.
    """
    return float(jnp.finfo(dtype).tiny) ** (1 / 3)


def safe_divide(numerator, denominator, otherwise=0.0):
    """`numerator / denominator`, and `otherwise` where the denominator is 0.

    So small that its square underflows counts as 0: the gradient divides by the square.
    """
    zero = jnp.abs(denominator) < jnp.finfo(denominator.dtype).tiny ** 0.5
    ratio = numerator / jnp.where(zero, jnp.ones_like(denominator), denominator)
    return jnp.where(zero, jnp.asarray(otherwise, ratio.dtype), ratio)


def safe_log2(x, least):
    """`log2(x)`, and `least` with a zero gradient where `x` is below 2**least."""
    bad = ~(x > jnp.exp2(jnp.asarray(least, x.dtype)))
    value = jnp.log2(jnp.where(bad, jnp.ones_like(x), x))
    return jnp.where(bad, jnp.asarray(least, value.dtype), value)


def safe_sqrt(x):
    """`sqrt(x)`, and 0 with a zero gradient where `x` is not positive."""
    bad = ~(x > 0)
    return jnp.where(bad, jnp.zeros_like(x), jnp.sqrt(jnp.where(bad, jnp.ones_like(x), x)))


def power_below(x):
    """The largest power of 2 that is at most abs(x); 0 below the normal numbers. No gradient."""
    bits, exponent = (jnp.int32, 0x7F800000) if x.dtype == jnp.float32 else (
        jnp.int64, 0x7FF0000000000000
    )  # fmt: skip
    whole = jax.lax.bitcast_convert_type(jax.lax.stop_gradient(x), bits)
    return jax.lax.bitcast_convert_type(whole & jnp.asarray(exponent, bits), x.dtype)


def dot(a, b):
    """Inner product over the first axis of component-first arrays `(3, ...)`."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def scalar(value: float | np.ndarray | jax.Array) -> Any:
    """A number as a () float64 array, which a jitted function is told; a Python float becomes a
    part of what `eqx.filter_jit` compiles, again for every other value. JAX's own stay."""
    return value if isinstance(value, jax.Array) else np.asarray(value, np.float64)


def in_float64(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorates a function of NumPy arrays: JAX computes in float64 while it runs."""

    @functools.wraps(function)
    def precise(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with jax.enable_x64(True):
            return function(*args, **kwargs)

    return precise
