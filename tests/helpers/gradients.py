"""Checks of gradients that hold for any kernel."""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

EXTREMES = (0.0, -0.0, 1e-45, -1e-45, 5e-324, 1e-38, 1e-20, -1e-12, 1e-6, 1.0, -1.0, 1e6, -1e6)
"""Zeros, denormals of both precisions, and the ends of the range that is promised."""


def hostile_arrays(shape) -> st.SearchStrategy[np.ndarray]:
    """Arrays within +-1e6 that mix extremes, small integers (which cancel) and any floats."""
    numbers = st.sampled_from(EXTREMES) | st.integers(-2, 2).map(float) | st.floats(-1e6, 1e6)
    return hnp.arrays(np.float64, shape, elements=numbers)


def unit_or_zero(vectors):
    """Each column scaled to length 1 in a way that cannot overflow; columns of zeros stay."""
    largest = np.abs(vectors).max(axis=0)
    scaled = vectors / np.where(largest > 1e-300, largest, 1)
    length = np.linalg.norm(scaled, axis=0)
    return np.where(length > 0.5, scaled / np.where(length > 0, length, 1), 0)


def value_and_gradient(kernel):
    """One jitted function of float arrays: the kernel's value, and the gradient of its sum.

    Infinite values (documented: an edge-on area) do not enter the sum.
    """

    def total(*args):
        value = kernel(*args)
        return jnp.where(jnp.isfinite(value), value, 0).sum(), value

    def both(*args):
        every = tuple(range(len(args)))
        (_, value), gradient = jax.value_and_grad(total, every, has_aux=True)(*args)
        return value, gradient

    return jax.jit(both)


def assert_finite(found, *, infinite_values: bool = False) -> None:
    """No NaN or infinity in a result of `value_and_gradient`; values may be +inf if allowed."""
    value, gradient = found
    value = np.asarray(value)
    assert not np.isnan(value).any(), "NaN in the value"
    assert infinite_values or np.isfinite(value).all(), "infinity in the value"
    for k, g in enumerate(gradient):
        assert np.isfinite(np.asarray(g)).all(), f"gradient to argument {k} is not finite: {g}"


def assert_gradient(kernel, *args: np.ndarray, step=1e-6) -> None:
    """Under x64: central differences to 1e-4, forward against reverse mode to 1e-10.

    Along a random direction in each argument; errors are relative to the largest derivative of
    that argument, as one point's derivative may vanish by chance. With steps of 1e-6 (relative to
    arguments of about 1) the differences are exact to about 1e-9 of third-derivative error and
    1e-10 of rounding times the condition of the kernel.
    """
    rng = np.random.default_rng(0)
    given = tuple(jnp.asarray(a) for a in args)
    weights = rng.normal(size=jax.eval_shape(kernel, *given).shape)

    @jax.jit
    def differences(pushes):
        def along(t):
            return kernel(*(a + t * p for a, p in zip(given, pushes, strict=True)))

        _, forward = jax.jvp(kernel, given, pushes)
        _, pull = jax.vjp(kernel, *given)
        return forward, (along(step) - along(-step)) / (2 * step), pull(jnp.asarray(weights))

    for k in range(len(given)):
        pushes = tuple(
            jnp.asarray(rng.normal(size=a.shape)) if i == k else jnp.zeros_like(a)
            for i, a in enumerate(given)
        )
        forward, central, reverse = differences(pushes)
        scale = np.abs(forward).max() + 1e-300
        assert np.abs(central - forward).max() <= 1e-4 * scale, f"argument {k}: finite differences"
        pulled = sum((g * p).sum() for g, p in zip(reverse, pushes, strict=True))
        size = np.abs(weights * forward).sum() + 1e-300
        wrong = abs(pulled - (weights * forward).sum())
        assert wrong <= 1e-10 * size, f"argument {k}: forward against reverse"
