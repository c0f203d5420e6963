"""Fixed-point addresses against exact rational arithmetic, at every level of a tree."""

from fractions import Fraction
from math import floor

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asmjax.shadow.adaptive.address import (
    BITS,
    DEEPEST_LOG2,
    centre_offset,
    fixed_point,
    index_at,
)

COUNT = 32
"""Coordinates per example: one shape, one compilation."""


def borders(dtype, log2: int, cell: int) -> list[float]:
    """The border below cell `cell` of a 2**log2 grid, and its neighbours in `dtype`, in [0, 1)."""
    border = np.ldexp(dtype.type(cell % (1 << log2)), -log2)
    one = dtype.type(1)
    near = [border, np.nextafter(border, one), np.nextafter(border, -one)]
    return [float(x) for x in near if 0 <= x < 1]


def check(values, log2: int, dtype) -> None:
    """Index and offset of `values` against fractions.

    The index is exact. The offset is from the coordinate cut to 30 bits, hence 2^-30 off at most,
    and is rounded once.
    """
    filled = (values * COUNT)[:COUNT]
    uv = jnp.stack([jnp.array(filled, dtype), jnp.array(filled[::-1], dtype)])
    at = fixed_point(uv)
    index = index_at(at, log2)
    offset = centre_offset(at, index, log2, dtype)
    assert at.dtype == index.dtype == jnp.int32 and offset.dtype == dtype
    exact = [[Fraction(float(x)) for x in row] for row in np.asarray(uv)]
    for row in range(2):
        for k, x in enumerate(exact[row]):
            assert int(index[row, k]) == floor(x * 2**log2)
            cut = Fraction(floor(x * 2**BITS), 2**BITS)
            true = Fraction(2 * int(index[row, k]) + 1, 2 ** (log2 + 1)) - cut
            got = Fraction(float(offset[row, k]))
            assert abs(got - true) <= abs(true) * Fraction(float(jnp.finfo(dtype).eps)) / 2
            assert abs(got) <= Fraction(1, 2 ** (log2 + 1))


@pytest.mark.parametrize("log2", [0, 1, 4, 9, 19, 23, 24, 25, DEEPEST_LOG2])
def test_borders_at_every_level(log2, dtype):
    """On a border, and within one rounding of it: the point belongs to one texel, the right one."""
    last = (1 << log2) - 1
    cells = (0, 1, last // 3, last // 2, last - 1, last, last + 1)
    # last + 1 wraps to 0; the number before 1 is added, the greatest coordinate there is.
    values = [x for cell in cells for x in borders(dtype, log2, max(cell, 0))]
    greatest = float(np.nextafter(dtype.type(1), dtype.type(0)))
    check([*values, greatest], log2, dtype)
    check([greatest, 0.0, float(jnp.finfo(dtype).tiny)], log2, dtype)


@given(
    values=st.lists(st.floats(0, 1, exclude_max=True, width=32), min_size=1, max_size=COUNT),
    log2=st.integers(0, DEEPEST_LOG2),
    cell=st.integers(0, 2**DEEPEST_LOG2 - 1),
)
def test_any_coordinate_at_any_level(values, log2, cell):
    float32 = np.dtype(np.float32)
    check([*borders(float32, log2, cell), *values], log2, float32)


@given(
    x=st.floats(0, 1, exclude_max=True),
    levels=st.lists(st.integers(0, DEEPEST_LOG2), min_size=2, max_size=2),
)
def test_levels_nest(x, levels):
    """The texel of a coarse level is the one that holds the texel of a fine level."""
    coarse, fine = sorted(levels)
    with jax.enable_x64(True):
        at = fixed_point(jnp.full((2, 1), x))
    assert int(index_at(at, fine)[0, 0]) >> (fine - coarse) == int(index_at(at, coarse)[0, 0])


def test_outside_is_clamped_into_the_image(dtype):
    at = fixed_point(jnp.array([[-1.0, -0.0, 1.0], [2.0, 1e30, -1e30]], dtype))
    index = np.asarray(index_at(at, DEEPEST_LOG2))
    last = 2**DEEPEST_LOG2 - 1
    np.testing.assert_array_equal(index, [[0, 0, last], [last, last, 0]])
