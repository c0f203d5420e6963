"""Storage factors: an independent table, and maxima over a volume cut into many points."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.theory import compiled, in_range
from numpy.testing import assert_allclose
from tr05.paper import DIRECTIONS, STORAGE, last_digits

from asmjax import theory
from asmjax.errors import UseError

THETA = np.pi / 6


@cache
def overhead(warp):
    """Storage under an overhead light as a function of alpha, theta, u and k."""
    return compiled(
        lambda alpha, theta, u, k: theory.overhead_factors(alpha, theta, warp, u, k).storage
    )


@cache
def towards(warp):
    """Storage under a light at an angle as a function of alpha, theta, gamma and k."""
    return compiled(
        lambda alpha, theta, gamma, k: (
            theory.direction_storage(alpha, theta, gamma, warp, k).storage
        )
    )


@cache
def warped(logarithmic: bool):
    """Storage at one strength u as a function of alpha, gamma and u."""
    return compiled(
        lambda alpha, gamma, u: (
            theory.direction_factors(alpha, THETA, gamma, u, logarithmic=logarithmic).storage
        )
    )


@pytest.mark.parametrize("method", STORAGE, ids=lambda m: m.words)
def test_overhead_table(x64, method):
    """Closed forms to the digits of the reference's table, theta = 30 degrees."""
    found = overhead(method.warp)(list(method.printed), THETA, 1.0, method.k)
    for (alpha, text), value in zip(method.printed.items(), found, strict=True):
        assert last_digits(text, float(value)) <= 1.001, (alpha, text, value)


def test_storage_does_not_depend_on_the_warp_from_lispsm_to_psm(x64):
    """R_s R_t = (alpha - 1) F for xi in [0, 1]: LiSPSM splits it 27.4 x 31.6, PSM 865 x 1."""
    xi = np.append(np.linspace(0, 1, 101), -0.5)

    @jax.jit
    def factors(xi):
        u = theory.u_from_xi(xi, 1000.0)
        return theory.overhead_factors(1000.0, THETA, "perspective", u)

    found = factors(xi)
    storage = np.asarray(found.s * found.t)
    assert_allclose(storage[:-1], 999 * np.sqrt(3) / 2, rtol=1e-12)
    assert_allclose(np.asarray(found.s)[[0, 100]], [27.36, 865.2], rtol=1e-3)
    assert_allclose(np.asarray(found.t)[[0, 100]], [31.62, 1], rtol=1e-3)
    assert_allclose(storage[-1], 2.30e5, rtol=2e-3)
    bend = 1 + 0.5 * (np.sqrt(1000.0) - 1)
    assert_allclose(storage[-1], 999 * np.sqrt(3) / 2 * bend**2, rtol=1e-12)


def test_factors_are_the_largest_errors(x64):
    """Against the errors of the parameterizations over 500 depths."""
    alpha, u = 300.0, 0.2
    z = in_range(np.linspace(0, 1, 500), 1, alpha)

    @jax.jit
    def errors(z):
        return {
            "uniform": (theory.m_z(z, alpha, 0.0, THETA), theory.m_x(z, alpha, 0.0)),
            "perspective": (theory.m_z(z, alpha, u, THETA), theory.m_x(z, alpha, u)),
            "logarithmic": (theory.logarithmic_m_z(alpha, THETA), theory.m_x(z, alpha, 0.0)),
            "log_perspective": (
                theory.log_perspective_m_z(z, alpha, u, THETA), theory.m_x(z, alpha, u),
            ),
        }  # fmt: skip

    for warp, (along, across) in errors(z).items():
        wanted = float(np.max(along)) * float(np.max(across))
        assert_allclose(overhead(warp)(alpha, THETA, u, 1), wanted, rtol=1e-12)


def test_many_parts_come_to_the_logarithm(x64):
    """k -> infinity: ln(alpha) F with and without warps."""
    wanted = np.log(1000.0) * np.sqrt(3) / 2
    for warp in ("uniform", "perspective", "log_perspective"):
        assert_allclose(overhead(warp)(1000.0, THETA, 1.0, 1e7), wanted, rtol=1e-5)


@pytest.mark.parametrize("method", DIRECTIONS, ids=lambda m: m.words)
def test_direction_table(x64, method):
    """The reference's independent computation, within 2 %."""
    gamma, texts = np.radians(list(method.printed)), list(method.printed.values())
    found = towards(method.warp)(1000.0, THETA, gamma, method.k)
    assert_allclose(found, [float(text) for text in texts], rtol=0.02)


VOLUME = np.stack(np.meshgrid(*(np.linspace(-1, 1, 9),) * 2, np.linspace(0, 1, 33)), 0)
"""Image x and y from -1 to 1, and depth from near to far in the logarithm."""


def ref_errors(alpha, gamma, u, logarithmic):
    """Largest errors over 2,673 points of the view volume, from derivatives of the map itself.

    The map takes a point to (s, t) in [0, 1]^2 by a projection with its centre 1/u before the
    frustum; texel widths are 1 / (ds/dv) at fixed rays across and 1 / (dt/dx).
    """
    x, y, share = VOLUME
    z = alpha**share
    tangent = np.tan(THETA)
    height, side = y * z * tangent, x * z * tangent
    v = z * np.sin(gamma) - height * np.cos(gamma)
    v = v - v.min()
    extent = v.max()
    half = (np.abs(side) / (1 + u * v)).max()

    def image(v, side):
        bent = 1 + u * v
        if logarithmic:
            s = np.log(bent) / np.log(1 + u * extent)
        else:
            s = v * (1 + u * extent) / (extent * bent)
        return s, 0.5 + side / bent / (2 * half)

    assert all(coordinate.min() > -1e-9 and coordinate.max() < 1 + 1e-9
               for coordinate in image(v, side))  # fmt: skip
    step = 1e-6 * (v + 1 / u)
    along = 2 * step / (image(v + step, side)[0] - image(v - step, side)[0])
    across = 2 * step / (image(v, side + step)[1] - image(v, side - step)[1])
    pixel = 2 * z * tangent
    return (along / pixel).max(), (across / pixel).max()


@pytest.mark.parametrize("logarithmic", [False, True], ids=["perspective", "logarithmic"])
def test_maxima_are_at_the_vertices(x64, logarithmic):
    """Errors of the explicit map over the whole volume: the same maxima to 1e-6."""

    @jax.jit
    def found(alpha, gamma, u):
        factors = theory.direction_factors(alpha, THETA, gamma, u, logarithmic=logarithmic)
        return factors.s, factors.t

    for alpha in (3.0, 1000.0):
        for gamma_deg in (0.0, 20.0, 35.0, 90.0, 130.0):
            for u in (1e-3, 0.1, 2.0):
                wanted = ref_errors(alpha, np.radians(gamma_deg), u, logarithmic)
                assert_allclose(found(alpha, np.radians(gamma_deg), u), wanted, rtol=1e-6)


def test_overhead_light_is_one_direction(x64):
    """gamma = 90 degrees: the closed forms, for parts too; and gamma mirrored is the same."""
    u = np.array([0.0, 0.01, 0.3, 1.0])
    for logarithmic, warp in ((False, "perspective"), (True, "log_perspective")):
        wanted = overhead(warp)(500.0, THETA, u, 1)
        assert_allclose(warped(logarithmic)(500.0, np.pi / 2, u), wanted, rtol=1e-12)
        gamma = np.radians([10.0, 40.0, 80.0])
        here, there = (warped(logarithmic)(50.0, angle, 0.1) for angle in (gamma, np.pi - gamma))
        assert_allclose(here, there, rtol=1e-12)


def test_overhead_in_float32_is_not_beyond(dtype):
    """The float32 number nearest to pi / 2 is above it: a flat frustum is not seen from behind."""
    alpha, gamma = jnp.asarray(1.0, dtype), jnp.asarray(np.float32(np.pi / 2), dtype)
    found = jax.jit(
        lambda a, g: theory.direction_factors(a, 1.5607, g, 566_856.0, logarithmic=True).storage
    )(alpha, gamma)
    assert np.isfinite(found)


@pytest.mark.parametrize(
    ("alpha", "theta_deg", "crossing"), [(1000, 30, 25.5), (100, 20, 12.5), (100, 45, 37.0)]
)
def test_where_lispsm_becomes_worse_than_no_warp(x64, alpha, theta_deg, crossing):
    """Its 1 / sin gamma falls off too slowly: the crossing with the uniform map, +- 0.5 degrees."""
    gamma_deg = np.linspace(2, 88, 861)
    args = (float(alpha), np.radians(theta_deg), np.radians(gamma_deg), 1)
    better = towards("lispsm")(*args) < towards("uniform")(*args)
    assert (np.diff(better.astype(int)) >= 0).all()
    assert abs(gamma_deg[better][0] - crossing) < 0.5


def test_the_best_warp_is_best(x64):
    """No n of 2,001 from a millionth to a million times the frustum needs 0.1 % less; never worse
    than none, and never worse than LiSPSM."""
    strengths = np.append(np.geomspace(1e-9, 1e6, 2001), 0)
    gamma = np.radians([5.0, 20.0, 30.0, 45.0, 80.0])
    none, lispsm = (towards(warp)(1000.0, THETA, gamma, 1) for warp in ("uniform", "lispsm"))
    for logarithmic, warp in ((False, "perspective"), (True, "log_perspective")):
        best = towards(warp)(1000.0, THETA, gamma, 1)
        scanned = warped(logarithmic)(1000.0, gamma[:, None], strengths)
        assert (best <= scanned.min(axis=1) * 1.001).all()
        assert (best <= none * (1 + 1e-12)).all()
        assert logarithmic or (best <= lispsm * 1.001).all()


def test_the_best_warp_carries_no_gradient(x64):
    """The search is not differentiated; it ends at the same u as the named warp."""
    gamma = np.radians(60.0)
    value, gradient = jax.jit(
        jax.value_and_grad(lambda alpha: theory.best_strength(alpha, THETA, gamma))
    )(1000.0)
    assert float(gradient) == 0
    least = towards("perspective")(1000.0, THETA, gamma, 1)
    assert_allclose(warped(False)(1000.0, gamma, float(value)), least, rtol=1e-9)


def test_limits_of_the_depth_range(dtype):
    """alpha = 1 under an overhead light: nothing to store along z. alpha = 1e8: closed forms."""
    assert_allclose(overhead("uniform")([1, 1e8], THETA, 0, 1), [0, 0.8660254e16], rtol=1e-5)
    found = towards("log_perspective")([1, 1e8], THETA, np.pi / 2, 1)
    assert found.dtype == dtype
    assert_allclose(found, [0, 0.8660254 * np.log(1e8)], rtol=2e-3, atol=1e-6)
    # Concrete, and rounded upwards: the ends of what is allowed.
    most = jax.jit(
        lambda: theory.direction_storage(1e9, THETA, np.float32(np.pi), "lispsm").storage
    )
    assert np.isfinite(most())


"""Of alpha, theta, u and gamma."""


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: theory.overhead_factors(0.1, THETA), "alpha is 0.1"),
        (lambda: theory.overhead_factors(10, 2.0), "theta is 2"),
        (lambda: theory.overhead_factors(10, THETA, "lispsm"), "unknown warp 'lispsm'"),
        (lambda: theory.overhead_factors(10, THETA, k=0), "k is 0"),
        (lambda: theory.direction_storage(10, THETA, -0.1), "gamma is -0.1; .* in radians"),
        (lambda: theory.direction_storage(10, THETA, 1, "psm"), "unknown warp 'psm'"),
        (lambda: theory.direction_factors(10, THETA, 1, -1.0), "u is -1"),
    ],
)  # fmt: skip
def test_wrong_use(call, message):
    with pytest.raises(UseError, match=message):
        call()
