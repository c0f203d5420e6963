"""What the tests of the theory share: kernels that are checked together, numbers of its tables."""

from collections.abc import Callable, Collection, Mapping
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from helpers.gradients import value_and_gradient

Kernels = Mapping[str, Callable]

COUNT = 4
"""Values of each argument in one example: one shape, so each kernel is compiled once."""


PADDED = 64
"""Arguments of `compiled` functions are padded to a multiple of this many."""


QUICKLY = {"xla_backend_optimization_level": 0}
"""For what runs a hundred times in microseconds and takes seconds to compile."""


def shares(rows: int) -> st.SearchStrategy[np.ndarray]:
    """(rows, COUNT) numbers from 0 to 1, the ends among them."""
    numbers = st.sampled_from((0.0, 1.0, 0.5)) | st.floats(0, 1)
    return hnp.arrays(np.float64, (rows, COUNT), elements=numbers)


def compiled(function: Callable) -> Callable[..., np.ndarray]:
    """An elementwise function in one compilation, whatever the shapes of its arguments.

    Operation by operation most of a test's time would go into compiling.
    """
    whole = jax.jit(function)

    def call(*args):
        dtype = jnp.result_type(float)
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype) for a in args))
        shape, size = arrays[0].shape, arrays[0].size
        padded = [np.pad(a.ravel(), (0, -size % PADDED), mode="edge") for a in arrays]
        return np.asarray(whole(*padded))[:size].reshape(shape)

    return call


def derivative(function: Callable) -> Callable[..., np.ndarray]:
    """The same for d function / d first argument."""

    def along_first(x, *others):
        return jax.jvp(lambda x: function(x, *others), (x,), (jnp.ones_like(x),))[1]

    return compiled(along_first)


def finite(kernels: Kernels, infinite_values: Collection[str] = ()):
    """A check for stacked arguments: in both precisions no value or gradient of these kernels is
    NaN or infinite, but values of those named may be infinite."""
    each = {name: value_and_gradient(kernel) for name, kernel in kernels.items()}

    @partial(jax.jit, compiler_options=QUICKLY)
    def wrong(stacked):
        """(kernels, 1 + arguments): whether the value or a gradient is not finite. One array:
        hundreds of small ones take longer to fetch than to compute."""
        return jnp.stack([
            jnp.stack([
                (jnp.isnan if name in infinite_values else _not_finite)(value).any(),
                *(_not_finite(g).any() for g in gradient),
            ])
            for name, (value, gradient) in (
                (name, both(*stacked)) for name, both in each.items()
            )
        ])  # fmt: skip

    def check(arguments: np.ndarray) -> None:
        for dtype in (np.float32, np.float64):
            with jax.enable_x64(dtype == np.float64):
                found = np.asarray(wrong(np.asarray(arguments, dtype)))
            bad = [name for name, flags in zip(kernels, found, strict=True) if flags.any()]
            assert not bad, f"{dtype.__name__}: {bad} not finite (value, gradients):\n{found}"

    return check


def _not_finite(x):
    return ~jnp.isfinite(x)


def slopes(kernels: Kernels, step: float = 1e-6):
    """A check of derivatives in float64 against central differences, one compilation for all.

    It takes one array (COUNT,) for each argument, and the size of each push (0: not pushed);
    differences may be off by 1e-4, and by 1e-8 of the value for rounding.
    """

    def pair(kernel, args, pushes):
        value, forward = jax.jvp(kernel, args, pushes)

        def shifted(t):
            return kernel(*(a + t * p for a, p in zip(args, pushes, strict=True)))

        # Both at once: compiled once.
        after, before = jax.vmap(shifted)(jnp.array([step, -step]))
        return value, forward, (after - before) / (2 * step)

    @partial(jax.jit, compiler_options=QUICKLY)
    def wrong(args, sizes):
        """Shares of the allowed error: (arguments, kernels, COUNT)."""
        args = tuple(args)

        def along(k):
            pushes = tuple(jnp.where(i == k, size, 0.0) for i, size in enumerate(sizes))
            found = []
            for kernel in kernels.values():
                value, forward, central = pair(kernel, args, pushes)
                allowed = 1e-4 * jnp.abs(forward) + 1e-8 * jnp.abs(value) + 1e-12
                found.append(jnp.abs(central - forward) / allowed)
            return jnp.stack(found)

        return jax.vmap(along)(jnp.arange(len(args)))

    def check(args, sizes) -> None:
        with jax.enable_x64(True):
            args, sizes = (
                np.stack([np.broadcast_to(np.asarray(a, np.float64), COUNT) for a in rows])
                for rows in (args, sizes)
            )
            found = np.asarray(wrong(args, sizes))
        bad = [name for i, name in enumerate(kernels) if not (found[:, i] <= 1).all()]
        assert not bad, f"{bad}: error / allowed error {found} at {args}"

    return check


def in_range(share, low: float, high: float) -> np.ndarray:
    """A share of 0 .. 1 as a number from `low` to `high`, evenly in its logarithm."""
    return low * (high / low) ** np.asarray(share)
