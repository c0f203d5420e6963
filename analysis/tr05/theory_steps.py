"""Sections 3 and 4 of TR05-024: figures 4 and 7, the equations as printed, storage factors."""

import jax
import jax.numpy as jnp
import numpy as np

from asmjax import theory
from asmjax.report.figures.aliasing import (
    Curve,
    draw_directions,
    draw_distribution,
    draw_subdivision,
)
from tr05.paper import (
    CROSSING_DEG,
    DIRECTIONS,
    EQUATION_7,
    EQUATION_7_LIMIT,
    STORAGE,
    last_digits,
    signed,
)
from tr05.sizes import Analysis

THETA_DEG = 30.0
THETA = np.radians(THETA_DEG)
UNIT = np.arctan(0.5)
"""The half angle at which 1 / (2 tan theta) is 1: errors in those units."""


def equations(analysis: Analysis) -> None:
    """Our kernels in u against the equations as printed in n and xi, in float64 and float32."""
    sizes = analysis.sizes
    alpha, xi = (x.reshape(-1, 1) for x in np.meshgrid(sizes.check_alphas, sizes.check_xis))
    z = alpha ** np.linspace(0, 1, sizes.depths)
    z[:, -1:] = alpha
    ours = {key: np.asarray(value) for key, value in _warps(xi, alpha).items()}
    ours |= {key: np.asarray(value) for key, value in _errors(z, alpha, ours["u"]).items()}

    root = np.sqrt(alpha)
    # xi = -1 is n = infinity: the printed forms are taken at 1e30 and more.
    weak = (root + 1 - xi * (alpha - 1)) / np.maximum(xi + 1, 1e-30)
    n = np.where(xi > 0, (root + 1) / (np.abs(xi) * root + 1), weak)
    f = n + alpha - 1
    g, m_x = (z - 1 + n) ** 2 / (z * n * f), alpha * (n + z - 1) / (z * f)
    m_max = (alpha - 1) * (1 + np.abs(xi) * (root - 1)) / root
    bend = 1 + np.abs(xi) * (root - 1)
    m_x_max = alpha / root * np.where(xi <= 0, bend, 1 / bend)
    density = f / (alpha - 1) * (n / (z - 1 + n)) / (z - 1 + n)
    finite = xi > -1
    worst = {
        "equation 3": apart(ours["g"], g),
        "equation 4": max(
            apart(ours["n"][finite], n[finite]), apart(1 + ours["xi"][finite], 1 + xi[finite])
        ),
        "equation 5": max(
            apart((alpha - 1) * g.max(axis=1, keepdims=True), m_max), apart(ours["m_max"], m_max)
        ),
        "equation 8": apart(ours["m_x"], m_x),
        "equation 9": max(
            apart(m_x.max(axis=1, keepdims=True), m_x_max), apart(ours["m_x_max"], m_x_max)
        ),
        "g at n_opt": apart(ours["g"][xi[:, 0] == 0][:, [0, -1]], alpha[xi == 0][:, None] ** -0.5),
        "s(z)": max(
            apart(ours["s"][:, [0, -1]] + 1, np.array([1, 2])), apart(ours["density"], density)
        ),
    }
    single = np.float32(z), np.float32(alpha), np.float32(ours["u"])
    exact = _errors(*(np.float64(x) for x in single))
    with jax.enable_x64(False):
        rounded = _errors(*single)
    worst["float32"] = max(apart(rounded[name], exact[name]) for name in ("g", "m_x", "m_x_max"))
    k = np.reshape(sizes.check_parts, (-1, 1, 1))
    printed = [_largest_of_parts(z, alpha, int(parts), xi) for parts in k.ravel()]
    worst["equation 7"] = apart(subdivided(alpha, k, xi), np.stack(printed)[:, :, None])
    analysis.record["equations"] = worst


def apart(got, wanted) -> float:
    """Largest relative deviation."""
    wanted = np.asarray(wanted, np.float64)
    return float(np.abs(np.asarray(got, np.float64) / wanted - 1).max())


@jax.jit
def _warps(xi, alpha):
    """What follows from xi and alpha."""
    u = theory.u_from_xi(xi, alpha)
    return {
        "u": u,
        "n": theory.n_from_u(u),
        "xi": theory.xi_from_u(u, alpha),
        "m_max": theory.m_z_max(alpha, u, UNIT),
    }


@jax.jit
def _errors(z, alpha, u):
    """What depends on depth; density is ds/dz."""
    s, density = jax.jvp(lambda z: theory.s_of_z(z, alpha, u), (z,), (jnp.ones_like(z),))
    return {
        "g": theory.g(z, alpha, u),
        "m_x": theory.m_x(z, alpha, u),
        "m_x_max": theory.m_x_max(alpha, u),
        "s": s,
        "density": density,
    }


_subdivided = jax.jit(lambda alpha, k, xi: theory.subdivided_m_z_max(alpha, k, xi, UNIT))


def subdivided(alpha, k, xi) -> np.ndarray:
    """Equation 7 in units of r_p / (2 r_s tan theta)."""
    return np.asarray(_subdivided(*np.broadcast_arrays(alpha, np.float64(k), np.float64(xi))))


def _largest_of_parts(z, alpha, k: int, xi) -> np.ndarray:
    """Equation 2 with r_s / k texels for the part 1 <= z <= alpha^(1/k): the largest by row.

    The other parts are this one, scaled.
    """
    part = np.expm1(np.log(alpha) / k)
    root = np.sqrt(1 + part)
    u = np.where(xi > 0, 1 + xi * root, 1 + xi) / (1 + root - np.where(xi > 0, 0, xi * part))
    # Not z^(1/k) - 1, which cancels.
    q = np.expm1(np.log(z) / k)
    return (k * part * (1 + u * q) ** 2 / ((1 + q) * (1 + u * part))).max(axis=1)


def figure_4(analysis: Analysis) -> None:
    """g over depth for warps from the PSM to none."""
    alpha = analysis.sizes.figure_alpha
    z = np.linspace(1, alpha, analysis.sizes.depths)
    best = float(jax.jit(theory.u_lispsm)(alpha))
    warps = {1.0: " (PSM)", 0.5: "", best: " (LiSPSM)", 0.1: "", 0.0: " (uniform)"}
    strengths = np.array(list(warps))[:, None]
    distributions = np.asarray(jax.jit(theory.g)(z, alpha, strengths))
    xis = np.asarray(jax.jit(theory.xi_from_u)(strengths[:, 0], alpha))
    curves, rows = [], []
    for (u, name), xi, g in zip(warps.items(), xis, distributions, strict=True):
        n = "∞" if u == 0 else f"{1 / u:.3g}"
        curves.append(Curve(f"n = {n}, ξ = {signed(xi)}{name}", z, g))
        least = int(g.argmin())
        rows.append({"u": u, "xi": xi, "near": g[0], "far": g[-1], "least": g[least],
                     "least_at": z[least]})  # fmt: skip
    analysis.record["figure_4"] = {"alpha": alpha, "curves": rows}
    analysis.kept.figure("figure_4", draw_distribution(curves, alpha), "g over depth")


def figure_7(analysis: Analysis) -> None:
    """Equation 7 against the number of parts, its table, and the gain that figure 9 claims."""
    sizes = analysis.sizes
    cells = [
        (alpha, k, xi, text)
        for alpha, by_k in EQUATION_7.items()
        for k, texts in by_k.items()
        for xi, text in zip((0, 1), texts, strict=True)
    ]
    values = subdivided(*np.array([cell[:3] for cell in cells], float).T)
    rows = [_row(text, value, alpha=alpha, k=k, xi=xi)
            for (alpha, k, xi, text), value in zip(cells, values, strict=True)]  # fmt: skip
    alphas = np.array([*EQUATION_7_LIMIT, *sizes.figure_alphas])
    least = np.asarray(jax.jit(theory.logarithmic_m_z)(alphas, UNIT))
    for (alpha, text), limit in zip(EQUATION_7_LIMIT.items(), least, strict=False):
        rows.append(_row(text, limit, alpha=alpha, k=None, xi=None))
    analysis.record["equation_7_table"] = rows
    xi = np.array([0.0, 0.3, 0.6, 0.673, 1.0])
    whole, halves = subdivided(100.0, [[1], [2]], xi)
    gains = zip(xi, whole / halves, strict=True)
    analysis.record["figure_9"] = {f"{x:g}": gain for x, gain in gains}
    k = np.arange(1, sizes.most_parts + 1)
    curves = subdivided(np.reshape(sizes.figure_alphas, (-1, 1, 1)), k, [[0], [1]])
    shapes, excesses = [], []
    for alpha, (best, strongest), limit in zip(
        sizes.figure_alphas, curves, least[len(EQUATION_7_LIMIT) :], strict=True
    ):
        label = f"α = {alpha:,.0f}"
        shapes.append(Curve(label, k, best / best[0]))
        excesses.append(Curve(label, k, best / limit))
        excesses.append(Curve(f"{label}, ξ = ±1", k, strongest / limit, dashed=True))
    drawn = draw_subdivision(shapes, excesses)
    analysis.kept.figure("figure_7", drawn, "largest error against the number of parts")


def storage(analysis: Analysis) -> None:
    """Storage factors under an overhead light beside the reference's."""
    stored = jax.jit(
        lambda alpha, k, warp: theory.overhead_factors(alpha, THETA, warp, k=k).storage,
        static_argnames="warp",
    )
    rows = analysis.record["storage"] = []
    for method in STORAGE:
        alphas = np.array(list(method.printed), float)
        values = np.asarray(stored(alphas, float(method.k), method.warp))
        for (alpha, text), value in zip(method.printed.items(), values, strict=True):
            rows.append(_row(text, value, words=method.words, alpha=alpha))


def light_directions(analysis: Analysis) -> None:
    """Storage factors against the angle between light and view, beside the reference's."""
    alpha = analysis.sizes.direction_alpha
    gamma_deg = np.linspace(0, 90, analysis.sizes.directions)
    about_deg = np.linspace(CROSSING_DEG - 5, CROSSING_DEG + 5, 41)
    places = np.array(sorted({place for method in DIRECTIONS for place in method.printed}), float)
    gamma = np.radians(np.concatenate([places, gamma_deg, about_deg]))
    stored = jax.jit(
        lambda k, warp: theory.direction_storage(alpha, THETA, gamma, warp, k).storage,
        static_argnames="warp",
    )
    rows, curves, near_crossing = [], [], {}
    for method in analysis.kept.bar(DIRECTIONS, "light directions"):
        at, along, near_crossing[method.words] = np.split(
            np.asarray(stored(float(method.k), method.warp)),
            np.cumsum([places.size, gamma_deg.size]),
        )
        for place, text in method.printed.items():
            value = float(at[places == place][0])
            rows.append({"words": method.words, "gamma_deg": place, "printed": text,
                         "value": value, "deviation": apart(value, float(text))})  # fmt: skip
        theirs = [(place, float(text)) for place, text in method.printed.items()]
        curves.append(Curve(method.words, gamma_deg, along, np.array(theirs).T))
    excess = np.log(near_crossing["LiSPSM"] / near_crossing["uniform"])
    analysis.record["directions"] = rows
    # It falls with the angle: interpolated at 0.
    analysis.record["crossing_deg"] = float(np.interp(0, -excess, about_deg))
    drawn = draw_directions(curves, THETA_DEG, alpha)
    analysis.kept.figure("light_directions", drawn, "storage factors by light direction")


def _row(text: str, value, **entries) -> dict:
    """A line of a table: ours, the printed number, and how far apart they are."""
    value = float(value)
    return {**entries, "printed": text, "value": value, "deviation": last_digits(text, value)}
