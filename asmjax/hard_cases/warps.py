"""Kernel cases: warps and splits at the ends of the depth range, and gradients without NaN.

Formulas of truth are those that TR05-024 prints, at fifty digits; the kernels use others, in which
nothing cancels. Depths are in units of the near distance, alpha is far / near.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np

from asmjax import theory
from asmjax.buffers import SurfacePoints, light_offset, project
from asmjax.footprint import log2_m, uv_jacobian
from asmjax.geometry import LightFrame, look_at
from asmjax.hard_cases.case import Bound, HardCase, Kernel
from asmjax.hard_cases.exact import fifty, ln, power, slope, tan
from asmjax.shadow.warped.predicted import log2_p_mean
from asmjax.theory.arguments import LEAST_AHEAD

_THETA = math.pi / 4
_PARTS = 4
_SPREAD = np.array([1.0, 1.3, 1.7, 2.0, 2.6, 3.1, 4.4, 7.3])
"""Eight entries of each case lie so far apart, in parts of the severity's own size."""


def _summed(value, argument: int):
    """The gradient of an elementwise function by one of its arguments."""
    return jax.grad(lambda *inputs: value(*inputs).sum(), argnums=argument)


# Splits: far / near towards 1.


def _split_error(alpha, theta):
    return theory.subdivided_m_z_max(alpha, _PARTS, 0.5, theta)


def _split_error_exact(alpha, theta):
    """Equation 7: k (alpha^(1/k) - 1) (1 + xi (alpha^(1/2k) - 1)) / alpha^(1/2k) / (2 tan)."""
    root = power(alpha, 1 / (2 * _PARTS + 0 * alpha))
    largest = (1 + (root - 1) / 2) / root
    return _PARTS * (root * root - 1) * largest / (2 * tan(theta))


_split_gradient = _summed(_split_error, 0)


def _splits(severity: float) -> Kernel:
    alpha = 1 + _SPREAD / severity
    return Kernel(
        inputs=(alpha, np.full(8, _THETA)),
        value=_split_error,
        truth=fifty(_split_error_exact),
        gradient=_split_gradient,
        gradient_truth=slope(_split_error_exact, 0),
    )


def _logarithm(z, alpha):
    return theory.logarithmic_s(z, alpha)


def _logarithm_exact(z, alpha):
    flat = alpha == 1
    return np.where(flat, 0 * alpha, ln(z) / ln(np.where(flat, 1 + alpha, alpha)))


_logarithm_gradient = _summed(_logarithm, 0)


def _logarithms(severity: float) -> Kernel:
    alpha = 1 + _SPREAD / severity
    return Kernel(
        inputs=(1 + np.linspace(0.05, 0.95, 8) * (alpha - 1), alpha),
        value=_logarithm,
        truth=fifty(_logarithm_exact),
        gradient=_logarithm_gradient,
        gradient_truth=slope(_logarithm_exact, 0),
        unit=1.0,
    )


def _xi(u, alpha):
    return theory.xi_from_u(u, alpha)


def _xi_exact(u, alpha):
    """Section 3.2: the largest error on a scale from g_0 = 1 / sqrt(alpha) to 1, with the sign of
    the end at which it is reached; 2 u - 1 where alpha is 1."""
    flat = alpha == 1
    alpha = np.where(flat, 1 + alpha, alpha)
    least = 1 / np.sqrt(alpha)
    near, far = 1 / (1 + u * (alpha - 1)), (1 + u * (alpha - 1)) / alpha
    xi = np.where(near >= far, least - near, far - least) / (1 - least)
    return np.where(flat, 2 * u - 1, xi)


_xi_gradient = _summed(_xi, 0)


def _strengths(severity: float) -> Kernel:
    return Kernel(
        inputs=(np.array([0.0, 0.1, 0.2, 0.3, 0.6, 0.7, 0.85, 1.0]), 1 + _SPREAD / severity),
        value=_xi,
        truth=fifty(_xi_exact),
        gradient=_xi_gradient,
        gradient_truth=slope(_xi_exact, 0),
        unit=1.0,
    )


# Warps: the centre far away, far / near large, points at the centre.


def _warped(z, alpha, u):
    return theory.s_of_z(z, alpha, u)


def _warped_exact(z, alpha, u):
    """s = q (1 + u a) / (a (1 + u q)), q = z - 1, a = alpha - 1."""
    q, a = z - 1, alpha - 1
    return q * (1 + u * a) / (a * (1 + u * q))


_warped_gradient = _summed(_warped, 0)


def _far_centre(severity: float) -> Kernel:
    return Kernel(
        inputs=(np.geomspace(1.5, 9e5, 8), np.full(8, 1e6), np.full(8, 1 / severity)),
        value=_warped,
        truth=fifty(_warped_exact),
        gradient=_warped_gradient,
        gradient_truth=slope(_warped_exact, 0),
    )


def _behind_centre(z, alpha, u):
    return z < LEAST_AHEAD


def _at_centre(severity: float) -> Kernel:
    return Kernel(
        inputs=(_SPREAD / severity, np.full(8, 1e3), np.full(8, 1.0)),
        value=_warped,
        truth=fifty(_warped_exact),
        marks=_behind_centre,
    )


def _error(z, alpha, u, theta):
    return theory.m_z(z, alpha, u, theta)


def _error_exact(z, alpha, u, theta):
    """Equations 2 and 3."""
    a = alpha - 1
    return a / (2 * tan(theta)) * (1 + u * (z - 1)) ** 2 / (z * (1 + u * a))


_error_gradient = _summed(_error, 2)


def _depth_range(severity: float) -> Kernel:
    alpha = np.full(8, severity)
    return Kernel(
        inputs=(
            np.geomspace(1, severity, 8),
            alpha,
            np.linspace(0.5, 2, 8) / (1 + np.sqrt(alpha)),
            np.full(8, _THETA),
        ),
        value=_error,
        truth=fifty(_error_exact),
        gradient=_error_gradient,
        gradient_truth=slope(_error_exact, 2),
        refusal=lambda: theory.m_z(1.0, severity, 0.5, _THETA),
    )


def _falls(alpha):
    """By how much s decreases between neighbouring depths, where it should increase; all warps."""
    z = jnp.exp(jnp.linspace(0.0, 1.0, 257)[:, None] * jnp.log(alpha))
    z = jnp.clip(z, 1, alpha)
    strengths = (0.0, theory.u_lispsm(alpha), 1.0)
    s = [theory.s_of_z(z, alpha, u) for u in strengths]
    s += [theory.log_perspective_s(z, alpha, u) for u in strengths]
    return jnp.maximum(0, -jnp.diff(jnp.stack(s), axis=1).min(axis=(0, 1)))


def _fold_over(severity: float) -> Kernel:
    return Kernel(
        inputs=(np.array([severity, severity * 0.7]),),
        value=_falls,
        truth=lambda alpha: 0 * alpha,
        unit=1.0,
    )


# Gradients.


def _p_mean(log2_values, power):
    return log2_p_mean(log2_values, jnp.ones_like(log2_values), power)[None]


def _p_mean_exact(log2_values, power_):
    two = 2 + 0 * log2_values
    mean = power(two, power_ * log2_values).mean()
    return np.array([ln(mean)]) / (ln(two[:1]) * power_)


_p_mean_gradient = jax.grad(lambda x, power: _p_mean(x, power)[0])


def _p_mean_slope(log2_values, power_):
    weight = power(2 + 0 * log2_values, power_ * log2_values)
    return weight / weight.sum()


def _maxima(severity: float) -> Kernel:
    values = np.array([3.0, 3.0, 3.0 - 0.5**10, 2.9, 2.0, 0.0, -4.0, -9.0])
    return Kernel(
        inputs=(values, np.array(severity)),
        value=_p_mean,
        truth=fifty(_p_mean_exact),
        gradient=_p_mean_gradient,
        gradient_truth=fifty(_p_mean_slope),
        unit=1.0,
    )


_COUNT = 32


def _masked(severity: float) -> Kernel:
    """Nothing masked, half of all, all; then all facing away, and all at the eye and the light."""
    rng = np.random.default_rng(7)
    position = np.stack([*rng.uniform(-1, 1, (2, _COUNT)), rng.uniform(2, 3, _COUNT)])
    valid = np.ones(_COUNT)
    normal = np.tile([[0.0], [0.0], [-1.0]], _COUNT)
    if severity >= 2:
        valid[: _COUNT // 2 if severity == 2 else _COUNT] = 0
    if severity == 4:
        normal = -normal
    if severity == 5:
        position, valid = np.zeros_like(position), np.ones(_COUNT)
    return Kernel(
        inputs=(position, np.where(valid > 0, normal, 0.0), valid),
        value=_not_finite,
        truth=lambda position, normal, valid: np.zeros(2),
        unit=1.0,
    )


def _ratios(position, normal, valid):
    """log2 of texel / pixel size of points under a lamp at the eye."""
    frame = LightFrame(
        origin=np.zeros(3),
        rotation=np.eye(3)[None],
        corner=np.full((1, 2), -1.0),
        extent=np.full((1, 2), 2.0),
        cone_axis=np.array([0.0, 0.0, 1.0]),
        cos_cutoff=-1.0,
        near=1e-6,
        perspective=True,
    )
    points = SurfacePoints(
        position=position,
        normal=normal,
        prim=jnp.zeros(_COUNT, jnp.int32),
        valid=valid > 0,
        origin=np.zeros(3),
    )
    camera = look_at((0, 0, 0), (0, 0, 1), (0, 1, 0), fov_x_deg=60, width=32, height=32)
    receivers = project(points, frame, light_offset(points, frame))
    return log2_m(uv_jacobian(points, camera, frame, receivers), 64)


def _not_finite(position, normal, valid):
    """The share of values and of gradients that are NaN or infinite."""
    value = _ratios(position, normal, valid)
    gradient = jax.grad(lambda x, n: _ratios(x, n, valid).sum(), argnums=(0, 1))(position, normal)
    bad = [jnp.mean(~jnp.isfinite(x), dtype=position.dtype) for x in (value, jnp.stack(gradient))]
    return jnp.stack(bad)


_TR05 = "Lloyd et al., TR05-024"

CASES = (
    HardCase(
        "splits as far / near goes to 1", (15,), "warps",
        "alpha^(1/k) - 1 cancels, and ln z / ln alpha becomes 0/0.",
        f"{_TR05}, equation 7, with expm1 and log1p (docs/theory.md, \"Subdivision\")",
        "50 digits", "1 / (far / near − 1)", (1e1, 1e3, 1e5, 1e7, 1e8),
        Bound(2e-6, 1e-13, "relative", 1e-4), _splits,
    ),
    HardCase(
        "logarithm as far / near goes to 1", (15,), "warps",
        "ln z / ln alpha loses its digits: 1e-3 of the map at alpha - 1 = 1e-4 in float32.",
        f"{_TR05}, section 3.1, as q / a times two quotients with series about 0",
        "50 digits", "1 / (far / near − 1)", (1e1, 1e3, 1e5, 1e7, 1e8),
        Bound(1e-6, 1e-14, "widths of the map", 1e-4), _logarithms,
    ),
    HardCase(
        "warp strength xi as far / near goes to 1", (16,), "warps",
        "The difference of two errors g near 1 cancels; the paper's xi comes out wrong by a tenth.",
        f"{_TR05}, section 3.2, simplified: (u (1 + sqrt alpha) - 1) / (1 + u a)",
        "50 digits", "1 / (far / near − 1)", (1e0, 1e2, 1e4, 1e6, 1e8),
        Bound(1e-6, 1e-14, "of the range −1 to 1", 1e-4), _strengths,
    ),
    HardCase(
        "warp whose centre is far away", (17,), "warps",
        "(z - 1 + n)^2 overflows float32 at n = 1e20.",
        f"{_TR05}, equation 1 in u = 1 / n (docs/theory.md, \"Warps\")",
        "50 digits", "distance n of the centre, near distances",
        (1e0, 1e5, 1e10, 1e20, 1e30),
        Bound(1e-6, 1e-14, "relative", 1e-4), _far_centre,
    ),
    HardCase(
        "error of a warp over a large depth range", (17,), "warps",
        "Products of far / near leave the range of float32, and sums lose the near end.",
        f"{_TR05}, equations 2 and 3, as a product of quotients near 1",
        "50 digits", "far / near", (1e2, 1e4, 1e6, 1e8, 1e9, 1e10),
        Bound(2e-6, 1e-14, "relative", 1e-4), _depth_range,
        1e10, "refused: UseError above far / near = 1e9",
    ),
    HardCase(
        "points at a warp's centre", (8,), "warps",
        "1 + u q reaches 0: coordinates become infinite, then change their sign.",
        "1 - u + u z for w, held above 1e-6 (docs/theory.md, \"Warps\")",
        "50 digits", "1 / depth, near distances", (1e1, 1e3, 1e5, 1e7, 1e9),
        Bound(2e-6, 1e-14, "relative"), _at_centre,
        1e6, "no view has such depths, below 1e-6 of its near distance: they are held there",
    ),
    HardCase(
        "fold-over of warps", (28,), "warps",
        "A warp that is not monotone maps two places to one.",
        "Closed forms with positive slopes (docs/theory.md, \"Warps\"); no warp here is learned",
        "closed form", "far / near", (1e1, 1e3, 1e6, 1e9),
        Bound(1.2e-7, 2.3e-16, "widths of the map"), _fold_over,
    ),
    HardCase(
        "gradient of a maximum", (25,), "warps",
        "The gradient of a maximum is that of one of its entries: noise where two nearly tie.",
        "A power mean, shifted by its largest logarithm (docs/theory.md, \"Tuning\")",
        "50 digits", "power of the mean", (1.0, 4.0, 64.0, 1e3, 1e5),
        Bound(2e-6, 1e-14, "octaves", 1e-2), _maxima,
    ),
    HardCase(
        "gradients of masked pixels", (24,), "warps",
        "where(mask, bad, good) has NaN for its gradient though bad is not taken.",
        "Inputs are made safe before they are divided (asmjax.numerics); JAX's FAQ on where",
        "closed form", "1 none, 2 half, 3 all masked, 4 all away, 5 all at the eye",
        (1.0, 2.0, 3.0, 4.0, 5.0),
        Bound(0.0, 0.0, "share that is not finite"), _masked,
    ),
)  # fmt: skip
"""Of the theme "warps"."""
