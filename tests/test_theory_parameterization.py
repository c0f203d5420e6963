"""Warps along z against the paper's own equations in 40 digits, its errata, and the limits."""

from types import SimpleNamespace

import jax
import mpmath
import numpy as np
import pytest
from helpers.theory import compiled, derivative, in_range, shares
from hypothesis import given
from numpy.testing import assert_allclose

from asmjax import theory
from asmjax.errors import UseError
from asmjax.theory import logarithmic, parameterization

THETA = np.pi / 6
ALPHAS = (1.001, 10.0, 1e3, 1e6)
XIS = (-1.0, -0.4, 0.0, 0.3, 1.0)
mpf = mpmath.mpf


fast = SimpleNamespace(
    **{
        name: compiled(function)
        for module in (parameterization, logarithmic)
        for name, function in vars(module).items()
        if name in theory.__all__
    }
)
"""The functions under test, by name, each compiled once."""


def ref_n(xi, alpha):
    """Equation 4 as printed."""
    xi, alpha = mpf(xi), mpf(alpha)
    root = mpmath.sqrt(alpha)
    if xi > 0:
        return (root + 1) / (xi * root + 1)
    return mpmath.inf if xi == -1 else (root + 1 - xi * (alpha - 1)) / (xi + 1)


def ref_g(z, n, alpha):
    """Equation 3 as printed."""
    z, n, alpha = mpf(z), mpf(n), mpf(alpha)
    return 1 / z if mpmath.isinf(n) else (z - 1 + n) ** 2 / (z * n * (n + alpha - 1))


def ref_m_x(z, n, alpha):
    """Equation 8 as printed, for r_p = r_t."""
    z, n, alpha = mpf(z), mpf(n), mpf(alpha)
    return alpha / z if mpmath.isinf(n) else alpha * (n + z - 1) / (z * (n + alpha - 1))


def depths(alpha, count=60):
    """From the near to the far plane, both included, evenly in the logarithm."""
    return [mpf(alpha) ** (mpf(i) / count) for i in range(count + 1)]


@pytest.fixture(autouse=True)
def forty_digits():
    with mpmath.workdps(40):
        yield


PAIRS = (
    (theory.s_of_z, theory.z_of_s),
    (theory.log_perspective_s, theory.log_perspective_z),
    (
        lambda z, alpha, _: theory.logarithmic_s(z, alpha),
        lambda s, alpha, _: theory.logarithmic_z(s, alpha),
    ),
)
"""Each parameterization and its inverse."""

THERE_AND_BACK = jax.jit(lambda z, s, alpha, u: [
    (to_s(1.0, alpha, u), to_s(alpha, alpha, u), to_z(s, alpha, u),
     to_s(to_z(s, alpha, u), alpha, u), to_z(to_s(z, alpha, u), alpha, u))
    for to_s, to_z in PAIRS
])  # fmt: skip


@given(shares(4))
def test_image_coordinates_run_from_0_to_1(share):
    """Every parameterization: 0 near, 1 far, rising between, and inverted by its inverse."""
    alpha, u = float(in_range(share[0, 0], 1 + 1e-6, 1e8)), share[1, 0]
    z, s = in_range(share[2], 1.0, alpha), np.sort(share[3])
    with jax.enable_x64(True):
        found = THERE_AND_BACK(z, s, alpha, u)
    for near, far, risen, same_s, same_z in found:
        assert_allclose(near, 0, atol=1e-15)
        assert_allclose(far, 1, rtol=1e-12)
        assert (np.diff(risen)[np.diff(s) > 1e-9] > 0).all()
        # A unit in the last place of s, or of z - 1, in the other coordinate.
        assert_allclose(same_s, s, atol=1e-14 + 1e-15 / (alpha - 1))
        assert_allclose(same_z, z, rtol=1e-14 * (1 + alpha))


def test_erratum_c_sign_of_the_last_term(x64):
    """s(z) as printed is 2.733 near and 1.733 far at alpha = 10, n = 3.3, and falls; with a minus
    it is 0, 1, rises, and is what `s_of_z` computes."""
    alpha, n = 10.0, 3.3
    f = n + alpha - 1
    z = np.linspace(1, alpha, 50)
    signed = [
        0.5 + (f + n) / (2 * (f - n)) + sign * f * n / ((z - 1 + n) * (f - n)) for sign in (1, -1)
    ]
    assert_allclose(signed[0][[0, -1]], [2.733, 1.733], atol=5e-4)
    assert (np.diff(signed[0]) < 0).all()
    assert_allclose(fast.s_of_z(z, alpha, 1 / n), signed[1], atol=1e-14)


def test_erratum_d_spacing_of_texels(x64):
    """Equation 1; the spacing dz/ds is proportional to z'^2 = (z - 1 + n)^2, not to 1/z^2."""
    alpha, n = 50.0, 4.0
    f = n + alpha - 1
    z = np.linspace(1, alpha, 40)
    density = derivative(theory.s_of_z)(z, alpha, 1 / n)
    assert_allclose(density, f * n / ((z - 1 + n) ** 2 * (f - n)), rtol=1e-12)
    spacing = derivative(theory.z_of_s)(fast.s_of_z(z, alpha, 1 / n), alpha, 1 / n)
    assert_allclose(spacing / (z - 1 + n) ** 2, (f - n) / (f * n), rtol=1e-11)
    assert np.ptp(spacing * z**2) > 100 * np.ptp(spacing / (z - 1 + n) ** 2)


def test_erratum_e_logarithm_is_normalised(x64):
    """s = ln z / ln alpha covers 0 .. 1; ln z would give texels that are too wide by ln alpha."""
    alpha = 100.0
    z = np.linspace(1, alpha, 30)
    assert_allclose(fast.logarithmic_s(z, alpha), np.log(z) / np.log(alpha), rtol=1e-13)
    assert_allclose(fast.logarithmic_z(0.3, alpha), alpha**0.3, rtol=1e-13)
    spacing = derivative(theory.logarithmic_z)(fast.logarithmic_s(z, alpha), alpha)
    error = spacing / (2 * z * np.tan(THETA))
    assert_allclose(error, fast.logarithmic_m_z(alpha, THETA), rtol=1e-12)
    printed = 1 / (2 * np.tan(THETA))
    assert_allclose(fast.logarithmic_m_z(alpha, THETA) / printed, np.log(alpha), rtol=1e-13)


def test_erratum_g_alpha_is_far_over_near():
    """Near / far, as section 3.1 has it, is refused with what to pass instead."""
    with pytest.raises(UseError, match=r"alpha is 0.01; allowed: 1 to 1e\+09; it is the far"):
        theory.g(1.0, 0.01, 0.5)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_error_distribution_is_equation_3(x64, alpha):
    """g and m_x against the printed forms in n, 1e-12; g is at most 1, convex, and has its least
    largest value 1 / sqrt(alpha) at the u of LiSPSM, where both ends are equal."""
    z = depths(alpha)
    values = np.array([float(v) for v in z])
    for xi in XIS:
        n = ref_n(xi, alpha)
        u = 0.0 if mpmath.isinf(n) else float(1 / n)
        near = mpmath.inf if u == 0 else 1 / mpf(u)
        got = fast.g(values, alpha, u)
        assert_allclose(got, [float(ref_g(v, near, alpha)) for v in values], rtol=1e-12)
        across = fast.m_x(values, alpha, u)
        assert_allclose(across, [float(ref_m_x(v, near, alpha)) for v in values], rtol=1e-12)
        assert got.max() <= 1 + 1e-12
        middle = got[1:-1]
        weight = (values[1:-1] - values[:-2]) / (values[2:] - values[:-2])
        assert (middle <= (1 - weight) * got[:-2] + weight * got[2:] + 1e-12).all()
    best = fast.u_lispsm(alpha)
    assert_allclose(fast.g([1.0, alpha], alpha, best), alpha**-0.5, rtol=1e-12)
    inner = 4 / (1 + np.sqrt(alpha)) ** 2
    assert_allclose(fast.g(np.sqrt(alpha), alpha, best), inner, rtol=1e-12)
    others = fast.g_max(alpha, np.linspace(0, 1, 1001))
    assert float(others.min()) >= alpha**-0.5 * (1 - 1e-12)


def test_the_ends_of_the_warp(x64):
    """u = 1 has its largest g, 1, on the far plane; u = 0 on the near plane."""
    assert_allclose(fast.g(100.0, 100.0, 1.0), 1, rtol=1e-14)
    assert_allclose(fast.g(1.0, 100.0, 0.0), 1, rtol=1e-14)
    assert_allclose(fast.g(1.0, 100.0, 1.0), 0.01, rtol=1e-14)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_xi_is_equation_4(x64, alpha):
    """n(xi) as printed; and back: xi from n, in both printed forms."""
    root = mpmath.sqrt(alpha)
    least = 1 / root
    for xi in XIS:
        n = ref_n(xi, alpha)
        u = fast.u_from_xi(xi, alpha)
        assert_allclose(float(u), 0.0 if mpmath.isinf(n) else float(1 / n), rtol=1e-12)
        assert_allclose(fast.xi_from_u(u, alpha), xi, atol=1e-12)
        if not mpmath.isinf(n):
            assert_allclose(fast.u_from_n(float(n)), float(1 / n), rtol=1e-12)
            assert_allclose(fast.n_from_u(u), float(n), rtol=1e-12)
            by_g = (
                (least - ref_g(1, n, alpha)) / (1 - least)
                if xi <= 0
                else (ref_g(alpha, n, alpha) - least) / (1 - least)
            )
            assert_allclose(float(by_g), xi, atol=1e-12)
    assert_allclose(fast.u_from_xi(0.0, alpha), fast.u_lispsm(alpha), rtol=1e-14)
    assert fast.n_from_u(0.0) == np.inf and fast.u_from_n(np.inf) == 0


def test_xi_near_a_flat_frustum_keeps_its_digits():
    """alpha - 1 = 1e-6 in float32, n = 3: -1/3 to 1e-6; the form with g_0 loses all but one."""
    alpha, n = np.float32(1 + 1e-6), np.float32(3)
    a1 = alpha - np.float32(1)
    assert_allclose(fast.xi_from_u(1 / n, alpha), -1 / 3, rtol=1e-6)
    least = 1 / np.sqrt(alpha)
    near = n / (n + a1)
    assert abs((least - near) / (1 - least) + 1 / 3) > 0.03


@pytest.mark.parametrize("xi", XIS)
@pytest.mark.parametrize("alpha", ALPHAS)
def test_largest_errors_are_equations_5_and_9(x64, alpha, xi):
    """Printed maxima, our maxima in u, and the largest over 61 depths agree to 1e-12."""
    u, n, root = fast.u_from_xi(xi, alpha), ref_n(xi, alpha), mpmath.sqrt(alpha)
    factor = (mpf(alpha) - 1) / (2 * mpmath.tan(mpf(THETA)))
    printed = factor * (1 + abs(mpf(xi)) * (root - 1)) / root
    brute = max(factor * ref_g(z, n, alpha) for z in depths(alpha))
    assert abs(brute / printed - 1) < 1e-30
    assert_allclose(fast.m_z_max(alpha, u, THETA), float(printed), rtol=1e-12)
    assert_allclose(fast.m_z_max(alpha, u, THETA, 2.0), 2 * float(printed), rtol=1e-12)
    x_printed = (
        mpf(alpha) * (1 - mpf(xi) * (root - 1)) / root
        if xi <= 0
        else mpf(alpha) / (root * (1 + mpf(xi) * (root - 1)))
    )
    x_brute = max(ref_m_x(z, n, alpha) for z in depths(alpha))
    assert abs(x_brute / x_printed - 1) < 1e-30
    assert_allclose(fast.m_x_max(alpha, u), float(x_printed), rtol=1e-12)


def test_erratum_a_which_end_is_best_across(x64):
    """alpha = 1000: m_x is 1000 at xi = -1, 31.62 at 0 and 1 at +1, so +1 (the PSM) is best there,
    not -1; the error along z is at its largest at both ends."""
    u = fast.u_from_xi([-1.0, 0.0, 1.0], 1000.0)
    assert_allclose(fast.m_x_max(1000.0, u), [1000, 31.62, 1], rtol=1e-4)
    along = fast.m_z_max(1000.0, u, THETA)
    assert_allclose(along[0], along[2], rtol=1e-12)
    assert float(along[1]) < float(along[0]) / 30


def test_erratum_b_where_the_largest_error_is(x64):
    """Near plane for xi <= 0, far plane for xi > 0: exchanged, as printed, they give the smaller
    end, 0.00194 instead of 0.5158 at alpha = 1000 and |xi| = 1/2."""
    alpha = 1000.0
    for xi, right, wrong in ((-0.5, 1.0, alpha), (0.5, alpha, 1.0)):
        u = fast.u_from_xi(xi, alpha)
        assert_allclose(fast.g(right, alpha, u), 0.5158, atol=5e-5)
        assert_allclose(fast.g(wrong, alpha, u), 0.00194, atol=5e-6)
        assert_allclose(fast.g_max(alpha, u), fast.g(right, alpha, u), rtol=1e-12)


def test_errors_are_spacings_over_pixels(x64):
    """m = (r_p / r_s) (dz/ds) / (2 z tan theta) for each parameterization, dz/ds by gradient."""
    alpha, u, ratio = 200.0, 0.07, 1.5
    z = in_range(np.linspace(0, 1, 20), 1, alpha)
    for to_z, to_s, error in (
        (theory.z_of_s, fast.s_of_z, fast.m_z),
        (theory.log_perspective_z, fast.log_perspective_s, fast.log_perspective_m_z),
    ):
        spacing = derivative(to_z)(to_s(z, alpha, u), alpha, u)
        wanted = ratio * spacing / (2 * z * np.tan(THETA))
        assert_allclose(error(z, alpha, u, THETA, ratio), wanted, rtol=1e-11)


def test_log_perspective_between_uniform_and_logarithm(x64):
    """u = 0 is uniform, u = 1 the logarithm, and between Lloyd's c_0 log(c_1 y + 1) of the
    perspective y; its error is largest near, and with u = 1 the same everywhere."""
    alpha = 300.0
    z = in_range(np.linspace(0, 1, 40), 1, alpha)
    assert_allclose(fast.log_perspective_s(z, alpha, 0.0), (z - 1) / (alpha - 1), rtol=1e-13)
    assert_allclose(fast.log_perspective_s(z, alpha, 1.0), np.log(z) / np.log(alpha), rtol=1e-12)
    # The series at 0 and the formula meet.
    assert_allclose(
        fast.log_perspective_s(z, alpha, 1e-9), (z - 1) / (alpha - 1), rtol=1e-6
    )  # fmt: skip
    n = 7.0
    f = n + alpha - 1
    y = fast.s_of_z(z, alpha, 1 / n)
    hardware = -np.log((1 - f / n) / (f / n) * y + 1) / np.log(f / n)
    assert_allclose(fast.log_perspective_s(z, alpha, 1 / n), hardware, rtol=1e-10)
    error = fast.log_perspective_m_z(z, alpha, 1 / n, THETA)
    assert (np.diff(error) < 0).all()
    flat = fast.log_perspective_m_z(z, alpha, 1.0, THETA)
    assert_allclose(flat, fast.logarithmic_m_z(alpha, THETA), rtol=1e-12)
    # No parameterization has a smaller largest error.
    assert float(fast.m_z_max(alpha, fast.u_lispsm(alpha), THETA)) > float(flat[0])


def test_points_in_front_of_the_near_plane(x64):
    """Casters: s < 0 by the same formula up to the warp's centre; behind it, far outside."""
    alpha, n = 100.0, 5.0
    z = np.array([0.5, -1.0, -3.0])
    wanted = (z - 1) * (1 + 99 / n) / (99 * (1 + (z - 1) / n))
    assert_allclose(fast.s_of_z(z, alpha, 1 / n), wanted, rtol=1e-13)
    assert float(fast.s_of_z(-4.5, alpha, 1 / n)) < -100
    assert float(fast.log_perspective_s(-3.9, alpha, 1 / n)) < -1


@pytest.mark.parametrize("alpha", [1.0, 1.0001, 3.0, 1e4, 1e8])
def test_float32_is_enough(alpha):
    """1e-6 relative to 40 digits at every strength of the warp, n = 1e20 included."""
    strengths = np.array([0, 1e-20, 1e-5, 0.01, 0.3, 1], np.float32)
    single = np.float32(alpha)
    for share in (0.0, 0.2, 0.7, 1.0):
        z = np.float32(single**share)
        got = fast.g(z, single, strengths)
        wanted = [
            float(ref_g(float(z), mpmath.inf if u == 0 else 1 / mpf(u), float(single)))
            for u in strengths.tolist()
        ]
        assert got.dtype == np.float32
        assert_allclose(got, wanted, rtol=1e-6)
        if alpha > 1.001:
            q, a1 = mpf(float(z)) - 1, mpf(float(single)) - 1
            s = [float(q * (1 + u * a1) / (a1 * (1 + u * q))) for u in strengths.tolist()]
            assert_allclose(fast.s_of_z(z, single, strengths), s, rtol=1e-6)


def test_gradient_of_s_in_float32():
    """1e-5 of equation 1 to the far end of a PSM at alpha = 1e6, where the quotient rule for
    q (1 + u a) / (a (1 + u q)) has no correct digit."""
    alpha = 1e6
    z = in_range(np.linspace(0, 1, 30), 1, alpha)
    for u in (1.0, 1e-3, 1e-6):
        got = derivative(theory.s_of_z)(z, alpha, u)
        wanted = (1 + u * (alpha - 1)) / ((alpha - 1) * (1 + u * (z - 1)) ** 2)
        assert got.dtype == np.float32
        assert_allclose(got, wanted, rtol=1e-5)


def test_limits_of_the_depth_range(dtype):
    """alpha = 1: a flat frustum, s = 0, g = m_x = 1/z, m_z = 0. alpha = 1e8: finite."""
    u = np.array([0.0, 0.5, 1.0])
    assert_allclose(fast.s_of_z(1, 1, u), 0)
    assert_allclose(fast.log_perspective_s(1, 1, u), 0)
    assert_allclose(fast.z_of_s(0.7, 1, u), 1)
    for kernel in (fast.g, fast.m_x):
        assert_allclose(kernel(1, 1, u), 1)
        assert_allclose(kernel(4, 1, 0), 0.25)
    assert_allclose(fast.m_z(1, 1, u, THETA), 0)
    assert_allclose(fast.u_lispsm(1), 0.5)
    assert_allclose(fast.xi_from_u(u, 1), [-1, 0, 1])
    best = fast.u_lispsm(1e8)
    assert best.dtype == dtype
    assert_allclose(fast.m_z_max(1e8, best, THETA), 0.866025e4, rtol=1e-5)
    assert_allclose(fast.logarithmic_m_z(1e8, THETA), 0.866025 * np.log(1e8), rtol=1e-5)


"""Those that all others are made of."""


def test_jit_changes_nothing(x64):
    """Operation by operation the results are the same; and float32 depths stay float32 beside
    Python numbers, also where 64 bits are enabled."""
    alpha = np.array([2.0, 30.0, 400.0])
    assert_allclose(theory.u_lispsm(alpha), fast.u_lispsm(alpha), rtol=1e-15)
    assert_allclose(theory.g(alpha, 500.0, 0.2), fast.g(alpha, 500.0, 0.2), rtol=1e-14)
    single = jax.ShapeDtypeStruct((3,), np.float32)
    for kernel in (theory.s_of_z, theory.g, theory.log_perspective_s, theory.log_perspective_z):
        found = jax.eval_shape(lambda z, kernel=kernel: kernel(z, 50.0, 0.2), single)
        assert found.dtype == np.float32


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: theory.g(1.0, np.nan, 0.1), "alpha is nan"),
        (lambda: theory.g(1.0, np.inf, 0.1), "alpha is inf"),
        (lambda: theory.g(1.0, np.array([2.0, 0.5]), 0.1), "alpha is 0.5"),
        (lambda: theory.s_of_z(1.0, 2.0, 1.5), "u is 1.5; allowed: 0 to 1; it is 1/n"),
        (lambda: theory.u_from_xi(-1.1, 2.0), "xi is -1.1; allowed: -1 to 1"),
        (lambda: theory.u_from_n(0.5), "n is 0.5; allowed: 1 to inf"),
        (lambda: theory.m_z(1.0, 2.0, 0.1, 30.0), "theta is 30; .* in radians"),
        (lambda: theory.m_x(1.0, 2.0, 0.1, 0.0), "resolution_ratio is 0"),
    ],
)
def test_wrong_use(call, message):
    with pytest.raises(UseError, match=message):
        call()
