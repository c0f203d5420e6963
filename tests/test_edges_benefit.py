"""Discontinuity test and benefit per cell, against loops over pixels in plain Python."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asmjax.footprint import cell_benefit, cell_index, cell_worst, straddles_discontinuity

PIXELS, CELLS, FACES = 64, 4, 3
IN_ALL = FACES * CELLS**2

# One shape each, so that an example costs no compilation.
benefit_of = jax.jit(cell_benefit, static_argnums=2)
worst_of = jax.jit(cell_worst, static_argnums=3)
index_of = jax.jit(cell_index, static_argnums=2)

# XLA flushes subnormal numbers on some machines; they are no ratios of anything.
masks = hnp.arrays(bool, PIXELS)
coordinates = hnp.arrays(np.float64, (2, PIXELS), elements=st.floats(0, 1, exclude_max=True))
faces = hnp.arrays(np.int32, PIXELS, elements=st.integers(0, FACES - 1))
ratios = hnp.arrays(np.float64, PIXELS, elements=st.floats(0, 1e6, allow_subnormal=False))
indices = hnp.arrays(np.int32, PIXELS, elements=st.integers(0, IN_ALL - 1))


def ref_cell(u, v, face):
    """The cell that holds a point, found by comparing with every border."""
    column = max(k for k in range(CELLS) if k / CELLS <= u)
    row = max(k for k in range(CELLS) if k / CELLS <= v)
    return face * CELLS * CELLS + row * CELLS + column


@given(hnp.arrays(bool, (4, PIXELS)))
def test_straddles(taps):
    """Straddling is neither all lit nor all dark: 0 < mean < 1 of the taps."""
    got = np.asarray(straddles_discontinuity(jnp.asarray(taps)))
    for i in range(PIXELS):
        lit = sum(bool(tap) for tap in taps[:, i])
        assert got[i] == (0 < lit < 4)


@given(coordinates, faces)
def test_cell_index(uv, face):
    with jax.enable_x64(True):
        got = np.asarray(index_of(jnp.asarray(uv), jnp.asarray(face), CELLS))
    wanted = [ref_cell(u, v, f) for u, v, f in zip(*uv, face, strict=True)]
    assert got.tolist() == wanted


@given(indices, masks, st.randoms(use_true_random=False))
def test_benefit_counts_each_pixel_once(index, counted, random):
    """A count per cell, whatever the order of the pixels; all counted pixels are in it."""
    wanted = [0] * IN_ALL
    for i in range(PIXELS):
        wanted[index[i]] += bool(counted[i])
    got = benefit_of(jnp.asarray(index), jnp.asarray(counted), IN_ALL)
    assert got.tolist() == wanted
    order = list(range(PIXELS))
    random.shuffle(order)
    again = benefit_of(jnp.asarray(index[order]), jnp.asarray(counted[order]), IN_ALL)
    assert again.tolist() == wanted


@given(indices, masks, ratios, st.randoms(use_true_random=False))
def test_worst_is_the_largest_counted_ratio(index, counted, ratio, random):
    wanted = [0.0] * IN_ALL
    for i in range(PIXELS):
        if counted[i]:
            wanted[index[i]] = max(wanted[index[i]], ratio[i])
    order = list(range(PIXELS))
    with jax.enable_x64(True):
        for _ in range(2):
            got = worst_of(
                jnp.asarray(index[order]), jnp.asarray(counted[order]),
                jnp.asarray(ratio[order]), IN_ALL,
            )  # fmt: skip
            assert got.tolist() == wanted
            random.shuffle(order)


@pytest.mark.parametrize("masked", ["none", "all", "half"])
def test_gradient_of_worst_goes_to_the_largest(dtype, masked):
    """d worst / d ratio is 1 at the one pixel that sets it and 0 elsewhere; never NaN.

    Empty cells, and cells whose pixels are all masked, reduce over nothing: -inf inside.
    """
    rng = np.random.default_rng(0)
    ratio = jnp.asarray(rng.permutation(PIXELS) + 1.0, dtype)
    index = jnp.asarray(rng.integers(0, IN_ALL, PIXELS))
    counted = {
        "none": np.ones(PIXELS, bool),
        "all": np.zeros(PIXELS, bool),
        "half": rng.random(PIXELS) < 0.5,
    }[masked]

    def total(ratio):
        return cell_worst(index, jnp.asarray(counted), ratio, IN_ALL).sum()

    wanted = np.zeros(PIXELS)
    for cell in range(IN_ALL):
        mine = np.flatnonzero((np.asarray(index) == cell) & counted)
        if mine.size:
            wanted[mine[np.argmax(np.asarray(ratio)[mine])]] = 1
    assert np.asarray(jax.grad(total)(ratio)).tolist() == wanted.tolist()


def test_points_on_and_beyond_the_border_stay_in_the_grid(dtype):
    """The last float below 1 is in the last cell; what lies outside is clamped, never wrapped."""
    below = np.nextafter(np.ones((), dtype), np.zeros((), dtype))
    uv = jnp.asarray([[0, below, 1, -1, 0.25], [0, below, 2, 0, 0.75]], dtype)
    got = cell_index(uv, jnp.zeros(5, jnp.int32), CELLS)
    assert got.tolist() == [0, 15, 15, 0, 13]


@settings(max_examples=examples(20))
@given(masks)
def test_benefit_is_exact_up_to_2_24(counted):
    """Counts are kept in float32: exact to 16,777,216 pixels in one cell, the size of 4096^2."""
    index = jnp.zeros(PIXELS, jnp.int32)
    assert float(benefit_of(index, jnp.asarray(counted), IN_ALL)[0]) == counted.sum()
