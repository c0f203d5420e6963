"""The correction against Gaussian processes by hand, and against refits without each trial."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from asmjax.tuning.correction import (
    KERNELS,
    MIDDLE,
    REACH,
    WIDTH,
    Correction,
    corrected,
    fitted_correction,
    no_correction,
    place_of,
)
from asmjax.tuning.goal import LEAST_PX

CORRECTED = jax.jit(corrected)

KNOBS, ROOM = 9, 16
COUNT = 12


@pytest.fixture(autouse=True, scope="module")
def double():
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def trials():
    """Points (k, 9), what rules say of them (2, k), their misfits (2, k), and weights (k,)."""
    rng = np.random.default_rng(0)
    said = np.exp(rng.normal(np.log([[0.3], [0.05]]), 0.5, (2, COUNT)))
    return (
        rng.random((COUNT, KNOBS)), said, 0.3 * rng.normal(size=(2, COUNT)),
        rng.uniform(0.3, 1, COUNT),
    )  # fmt: skip


def places_of(points, said) -> np.ndarray:
    """Places by hand: points from the middle of the box, logarithms from theirs."""
    logs = np.log([said[0] + LEAST_PX, said[1]]).T
    return np.concatenate([points - 0.5, (logs - MIDDLE) / WIDTH], axis=1)


def covariance(kernel, one, other) -> float:
    """Of two places."""
    apart = (((one - other) / REACH) ** 2).sum()
    return kernel.constant + kernel.slope * one @ other + kernel.rest * np.exp(-apart / 2)


def test_places_are_those_by_hand(trials):
    points, said, _, _ = trials
    found = [place_of(jnp.asarray(p), *said[:, k]) for k, p in enumerate(points)]
    np.testing.assert_allclose(found, places_of(points, said))


def test_it_is_a_gaussian_process(trials):
    """At new places its logarithm is k (K + noise / weight^2)^-1 misfit, loop by loop."""
    points, said, misfits, weight = trials
    places = places_of(points, said)
    correction, _ = fitted_correction(places, misfits, weight, ROOM)
    assert correction.places.shape == (ROOM, KNOBS + 2)
    new, edge, seconds = np.full(KNOBS, 0.3), 0.2, 0.08
    found = CORRECTED(correction, jnp.asarray(new), edge, seconds)
    here = places_of(new[None], np.array([[edge], [seconds]]))[0]
    for row, (kernel, before) in enumerate(zip(KERNELS, (edge + LEAST_PX, seconds), strict=True)):
        known = np.array([[covariance(kernel, a, b) for b in places] for a in places])
        known += np.diag(kernel.noise / weight**2)
        near = np.array([covariance(kernel, here, b) for b in places])
        expected = before * np.exp(near @ np.linalg.solve(known, misfits[row]))
        assert float(found[row]) == pytest.approx(expected)


def test_what_is_left_is_that_of_refits(trials):
    """Each trial left out in turn: its misfit less what the others say of it."""
    points, said, misfits, weight = trials
    places = places_of(points, said)
    _, left = fitted_correction(places, misfits, weight, ROOM)
    for k in range(COUNT):
        others = np.arange(COUNT) != k
        without, _ = fitted_correction(places[others], misfits[:, others], weight[others], ROOM)
        edge, seconds = said[:, k]
        told = CORRECTED(without, jnp.asarray(points[k]), edge, seconds)
        shifts = np.log([float(told[0]) / (edge + LEAST_PX), float(told[1]) / seconds])
        np.testing.assert_allclose(left[:, k], misfits[:, k] - shifts, atol=1e-9)


def test_without_misfits_nothing_changes(trials):
    """Nor without trials."""
    points, said, misfits, weight = trials
    nothing, left = fitted_correction(places_of(points, said), 0 * misfits, weight, ROOM)
    assert (left == 0).all()
    for correction in (nothing, no_correction(KNOBS + 2, ROOM)):
        edge, seconds = CORRECTED(correction, jnp.asarray(points[0]), 0.2, 0.05)
        assert (float(edge), float(seconds)) == pytest.approx((0.2 + LEAST_PX, 0.05))


def test_what_all_trials_say_is_learned():
    """Rules that are too low by a factor everywhere, and by another along one setting, are put
    right to a tenth at places that were not tried."""
    rng = np.random.default_rng(1)
    points, said = rng.random((60, KNOBS)), np.full((2, 60), [[0.3], [0.05]])
    lean = 0.3 + 0.5 * (points[:, 3] - 0.5)
    correction, left = fitted_correction(
        places_of(points, said), np.stack([lean, 0.5 * lean]), np.ones(60), 64
    )
    assert np.median(np.abs(left[0])) < 0.1
    fresh = rng.random((40, KNOBS))
    each = jax.jit(jax.vmap(corrected, in_axes=(None, 0, None, None)))
    found = np.stack(each(correction, jnp.asarray(fresh), 0.3, 0.05), axis=1)
    off = np.log(found[:, 0] / 0.3) - (0.3 + 0.5 * (fresh[:, 3] - 0.5))
    assert np.median(np.abs(off)) < 0.1


def test_it_is_differentiable(trials):
    """Against central differences, in the point and through what the rules say."""
    points, said, misfits, weight = trials
    correction: Correction
    correction, _ = fitted_correction(places_of(points, said), misfits, weight, ROOM)

    @jax.jit
    def of(point):
        edge, seconds = corrected(correction, point, 0.2 + 0.1 * point[0], 0.05 + 0.02 * point[1])
        return jnp.log(edge) + jnp.log(seconds)

    at, step = jnp.full(KNOBS, 0.4), 1e-6
    central = [float(of(at + s) - of(at - s)) / (2 * step) for s in step * jnp.eye(KNOBS)]
    np.testing.assert_allclose(jax.grad(of)(at), central, rtol=1e-5, atol=1e-8)
