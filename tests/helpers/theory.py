"""What the tests of the theory share: functions compiled once, numbers of its tables."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

COUNT = 4
"""Values of each argument in one example: one shape, so each kernel is compiled once."""

PADDED = 64
"""Arguments of `compiled` functions are padded to a multiple of this many."""

QUICKLY = {"xla_backend_optimization_level": 0}
"""For what runs once, or in microseconds, and takes seconds to compile."""


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


def in_range(share, low: float, high: float) -> np.ndarray:
    """A share of 0 .. 1 as a number from `low` to `high`, evenly in its logarithm."""
    return low * (high / low) ** np.asarray(share)
