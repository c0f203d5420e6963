"""The bound that four moments set to the share of blockers: exact, below the truth, finite."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.gradients import assert_finite, assert_gradient, hostile_arrays, value_and_gradient
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asmjax.shadow.soft.hamburger import (
    ALPHA,
    CENTRAL,
    alpha_of,
    mean_blocker,
    moments_of,
    shadow_intensity,
)

WINDOWS, DEPTHS = 16, 12
"""Windows of an example, and depths in each."""


def centred(depth) -> np.ndarray:
    """Depths in [0, 1] as the kernels have them."""
    return 2 * np.asarray(depth, float) - 1


def moments(depths, shares) -> np.ndarray:
    """(4,) of a distribution on depths in [-1, 1]."""
    return np.stack([np.sum(np.asarray(shares) * np.asarray(depths) ** k) for k in range(1, 5)])


def intensity(found, at, dtype, alpha=None) -> np.ndarray:
    """At many depths of one distribution."""
    at = np.asarray(at, dtype)
    many = np.broadcast_to(np.asarray(found, dtype)[:, None], (4, at.size))
    return np.asarray(_intensity(many, at, alpha_of(dtype) if alpha is None else alpha))


_intensity = jax.jit(shadow_intensity)
_blocker = jax.jit(mean_blocker)


def ref_intensity(b, z: float, alpha: float) -> float:
    """Peters and Klein 2015, algorithm 3, as printed: a linear system and the roots."""
    b = (1 - alpha) * np.asarray(b) + alpha * np.array(CENTRAL)
    hankel = np.array([[1, b[0], b[1]], [b[0], b[1], b[2]], [b[1], b[2], b[3]]])
    c = np.linalg.solve(hankel, [1, z, z * z])
    near, far = np.sort(np.roots(c[::-1]).real)
    if z <= near:
        return 0.0
    if z <= far:
        return (z * far - b[0] * (z + far) + b[1]) / ((far - near) * (z - near))
    return 1 + (near * far - b[0] * (near + far) + b[1]) / ((far - z) * (z - near))


def test_two_depths_are_exact_to_3_digits(dtype):
    """40 % of a window at 0.3 and 60 % at 0.8 of the range: at any depth between and beyond."""
    found = moments(centred([0.3, 0.8]), [0.4, 0.6])
    at = centred([0.1, 0.25, 0.4, 0.55, 0.7, 0.9, 0.99])
    np.testing.assert_allclose(
        intensity(found, at, dtype), [0, 0, 0.4, 0.4, 0.4, 1, 1], atol=1.5e-3
    )


def test_one_depth_is_exact_to_3_digits(dtype):
    at = np.array([-0.9, -0.2, 0.05, 0.15, 0.4, 1.0])
    found = intensity(np.asarray(moments_of(jnp.asarray(0.1))), at, dtype)
    np.testing.assert_allclose(found, at > 0.1, atol=1.5e-3)


def test_three_depths_leak_as_known(x64):
    """A third depth is more than four moments can tell: 0.332 of 0.6 are seen in the middle."""
    found = moments(centred([0.2, 0.5, 0.8]), [0.3, 0.3, 0.4])
    seen = intensity(found, centred([0.4, 0.55, 0.7, 0.9]), np.float64)
    np.testing.assert_allclose(seen, [0.19, 0.332, 0.397, 0.878], atol=2e-3)
    assert (seen < [0.3, 0.6, 0.6, 1.0]).all()


def test_a_hundred_thousandth_of_the_light(dtype):
    """What the bias costs where a receiver stands 1e-3 behind its only blocker."""
    found = intensity(np.asarray(moments_of(jnp.asarray(0.1))), [0.101], dtype)
    assert found[0] > {"float32": 0.55, "float64": 0.98}[np.dtype(dtype).name]


@st.composite
def distributions(draw):
    """Depths and shares (DEPTHS, WINDOWS), and a depth (WINDOWS,) that is asked about."""
    edges = st.sampled_from((-1.0, -0.5, 0.0, 0.25, 1.0))
    depth = draw(hnp.arrays(np.float64, (DEPTHS, WINDOWS), elements=edges | st.floats(-1, 1)))
    share = draw(hnp.arrays(np.float64, (DEPTHS, WINDOWS), elements=st.sampled_from((0.0, 1, 7))))
    share[0] += 1e-3
    at = draw(hnp.arrays(np.float64, WINDOWS, elements=edges | st.floats(-1, 1)))
    return depth, share / share.sum(axis=0), at


SLACK = {"float32": 2e-3, "float64": 1e-6}
"""Rounding of moments over the bias: what of a share may seem to be there."""


@given(distributions())
def test_never_darker_than_the_truth(example):
    """Beside the share of depths that are nearer, counted one by one, in both precisions."""
    depth, share, at = example
    truth = np.sum(share * (depth < at), axis=0)
    for double in (False, True):
        dtype = np.float64 if double else np.float32
        with jax.enable_x64(double):
            exact = [np.sum(share * depth.astype(dtype).astype(float) ** k, axis=0) for k in
                     range(1, 5)]  # fmt: skip
            found = np.asarray(
                _intensity(np.asarray(exact, dtype), at.astype(dtype), alpha_of(dtype))
            )
        # Depths that round to the asked one are not nearer.
        nearer = np.sum(share * (depth.astype(dtype) < at.astype(dtype)), axis=0)
        slack = SLACK[np.dtype(dtype).name]
        assert (found <= nearer + slack).all(), (found - nearer).max()
        assert (found >= 0).all() and (found <= 1).all()
    assert truth.shape == (WINDOWS,)


@given(distributions())
def test_the_printed_algorithm_says_the_same(example):
    """Which solves for the polynomial and its roots. Distributions of many depths, as it divides
    by their distance, and receivers that are none of these."""
    depth, share, at = example
    spread = np.random.default_rng(0).uniform(-1, 1, (DEPTHS, WINDOWS))
    depth, share = 0.5 * depth + 0.5 * spread, 0.5 * share + 0.5 / DEPTHS
    at = 0.99 * at + 0.003
    b = np.stack([np.sum(share * depth**k, axis=0) for k in range(1, 5)])
    alpha = 1e-5
    expected = np.array([ref_intensity(b[:, k], at[k], alpha) for k in range(WINDOWS)])
    with jax.enable_x64(True):
        found = np.asarray(_intensity(b, at, alpha))
    np.testing.assert_allclose(found, np.clip((expected - alpha) / (1 - alpha), 0, 1), atol=1e-7)


@given(distributions())
def test_mean_blocker_is_a_depth_before_the_receiver(example):
    """Of two depths the nearer one; never behind what is asked about, nor before the map."""
    depth, share, at = example
    b = np.stack([np.sum(share * depth**k, axis=0) for k in range(1, 5)])
    with jax.enable_x64(True):
        found = np.asarray(_blocker(b, at, ALPHA["float64"]))
    # Processors take the smallest numbers for 0.
    assert (found <= at + 1e-300).all() and (found >= -1).all()


def test_mean_blocker_of_one_and_two_depths(dtype):
    at = np.full(3, 0.35, dtype)
    two = moments([-0.4, 0.9], [0.3, 0.7])
    both = moments([-0.4, 0.2], [0.5, 0.5])
    one = moments([0.2], [1.0])
    b = np.stack([two, both, one], axis=1).astype(dtype)
    found = np.asarray(_blocker(b, at, alpha_of(dtype)))
    # The bias may lie before the nearer one, which is seen between.
    slack = {"float32": 0.05, "float64": 2e-3}[np.dtype(dtype).name]
    np.testing.assert_allclose(found, [-0.4, -0.1, 0.2], atol=slack)


@pytest.mark.parametrize("kernel", [shadow_intensity, mean_blocker], ids=lambda k: k.__name__)
def test_finite_for_any_input(kernel):
    """Also for what are no moments at all, in value and gradient."""
    both = {
        double: value_and_gradient(lambda b, z: kernel(b, z, 1e-8 if double else 1e-6))  # noqa: B023
        for double in (False, True)
    }
    unit = st.sampled_from((-1.0, -0.5, 0.0, 1e-20, 0.5, 1.0)) | st.floats(-1, 1)

    @given(
        hostile_arrays((4, 8)) | hnp.arrays(np.float64, (4, 8), elements=unit),
        hnp.arrays(np.float64, 8, elements=unit),
    )
    def check(b, z):
        for double, found in both.items():
            with jax.enable_x64(double):
                assert_finite(found(jnp.asarray(b, float), jnp.asarray(z, float)))

    check()


def test_gradient_is_that_of_differences(x64):
    """Of distributions with room around them, on both sides of the mean."""
    rng = np.random.default_rng(4)
    depth = rng.uniform(-0.9, 0.9, (DEPTHS, 32))
    b = np.stack([(depth**k).mean(axis=0) for k in range(1, 5)])
    z = depth.mean(axis=0) + rng.choice([-1.0, 1.0], 32) * rng.uniform(0.1, 0.3, 32)
    assert_gradient(lambda b, z: shadow_intensity(b, z, 1e-4), b, z)


def single_depths(dtype):
    """Of a window each: depths, and their moments."""
    depth = np.random.default_rng(2).uniform(-0.9, 0.9, 20_000).astype(dtype)
    return depth, np.stack([depth, depth**2, depth**3, depth**4])


@pytest.mark.parametrize("name", ["float32", "float64"])
def test_alpha_is_enough_for_every_single_depth(name):
    """The table: of 20,000 depths none is wrong by more than 3 digits at 5 % of the range before
    or behind the receiver; with a thousandth of the bias neither, as nothing divides by less."""
    depth, b = single_depths(name)
    with jax.enable_x64(name == "float64"):
        for alpha in (ALPHA[name], 1e-3 * ALPHA[name]):
            behind = 1 - np.asarray(_intensity(b, depth + depth.dtype.type(0.1), alpha))
            before = np.asarray(_intensity(b, depth - depth.dtype.type(0.1), alpha))
            assert max(behind.max(), before.max()) < 5e-4
    assert ALPHA == {"float32": 1e-6, "float64": 1e-8}


def ref_printed(b, z, alpha: float):
    """Algorithm 3 as it is usually coded, for many windows, in the dtype at hand."""
    of = z.dtype.type
    b0, b1, b2, b3 = (of(1 - alpha) * x + of(alpha * c) for x, c in zip(b, CENTRAL, strict=True))
    cross, variance = b2 - b0 * b1, b1 - b0 * b0
    spread = ((b3 - b1 * b1) * variance - cross * cross) / variance
    c1 = (z - b0) / variance
    c2 = (z * z - b1 - cross * c1) / spread
    c1 = c1 - cross / variance * c2
    c0 = 1 - c1 * b0 - c2 * b1
    half = c1 / c2 / of(2)
    root = np.sqrt(half * half - c0 / c2)
    near, far = -half - root, -half + root
    between = (z * far - b0 * (z + far) + b1) / ((far - near) * (z - near))
    beyond = 1 + (near * far - b0 * (near + far) + b1) / ((far - z) * (z - near))
    return np.where(z <= near, 0, np.where(z <= far, between, beyond))


def test_the_printed_form_needs_the_bias_that_this_one_does_not():
    """In float32, at 5 % behind the blocker: below 1e-6 it is no number in places, then in most."""
    depth, b = single_depths(np.float32)
    found = {}
    with np.errstate(all="ignore"):
        for alpha in (1e-6, 3e-7, 1e-8):
            found[alpha] = ref_printed(b, depth + np.float32(0.1), alpha)
    assert np.abs(found[1e-6] - 1).max() < 5e-3
    assert 0 < np.isnan(found[3e-7]).mean() < 0.01 < np.isnan(found[1e-8]).mean()
