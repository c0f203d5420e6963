"""Kernels of the theory of aliasing: warps, logarithms, storage, splits, beams and edges.

The twins are the paper's equations in mpmath, in the paper's own n where it has one.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import mpmath
import numpy as np

from asmjax import theory
from helpers.kernels import Arrays, Kernel, Part, powers, spaced_powers

NEAR, FAR = 1e-6, 1e8
"""Ends of alpha - 1, and of the depths in units of the near distance."""


def _n(u):
    return mpmath.inf if u == 0 else 1 / u


NUMBER = (Part(1),)


def _elementwise(names: str, of: Callable, digits: Callable | None, parts=NUMBER, **more):
    """A kernel of some of `ARGUMENTS`."""
    chosen = names.split()

    def sane(rng, n, draw=powers) -> Arrays:
        drawn = _arguments(rng, n, draw)
        return tuple(drawn[name] for name in chosen)

    def smooth(*arguments: np.ndarray) -> Arrays:
        return tuple(_smooth(dict(zip(chosen, arguments, strict=True))).values())

    def pushes(*arguments: np.ndarray) -> Arrays:
        given = dict(zip(chosen, arguments, strict=True))
        return tuple(_pushes(given)[name] for name in chosen)

    return Kernel(
        more.pop("name", of.__name__),
        of,
        sane,
        parts,
        digits=None if digits is None else lambda *args: [digits(*args)],
        spaced=lambda rng, n: sane(rng, n, spaced_powers),
        near=lambda rng, n: tuple(_limits(rng, n)[name] for name in chosen),
        pushes=pushes,
        smooth=smooth,
        **more,
    )


def _arguments(rng, n, draw) -> dict[str, np.ndarray]:
    a1 = draw(rng, n, NEAR, FAR)
    alpha = 1 + a1
    return {
        "alpha": alpha,
        "z": 1 + powers(rng, n, 1e-4, 1) * (alpha - 1),
        "s": rng.uniform(0.01, 0.99, n),
        "u": np.where(rng.random(n) < 0.1, 1.0, powers(rng, n, 1e-4, 1)),
        "xi": rng.choice([-1.0, 1.0], n) * powers(rng, n, 1e-3, 1),
        "theta": powers(rng, n, 0.01, 1.5),
        "gamma": rng.uniform(0.02, np.pi / 2 - 0.02, n),
        "ratio": powers(rng, n, 1e-3, 1e3),
        "k": powers(rng, n, 1, 20),
    }


def _limits(rng, n) -> dict[str, np.ndarray]:
    """The ends of what is allowed, and beyond."""
    alpha = rng.choice([1.0, 1 + 1e-8, 1e8, 1e9, 1e12], n)
    u = rng.choice([0.0, 1e-30, 1.0], n)
    return {
        "alpha": alpha,
        "z": np.where(rng.random(n) < 0.5, 1.0, alpha),
        "s": rng.choice([0.0, 1.0, -1e3], n),
        "u": u,
        "xi": 2 * u - 1,
        "theta": rng.choice([0.0, 1e-3, np.pi / 2], n),
        "gamma": rng.choice([0.0, np.pi / 2, np.pi], n),
        "ratio": rng.choice([1e-6, 1e6], n),
        "k": rng.choice([1.0, 1e9], n),
    }


def _smooth(given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Away from where the largest error goes to another plane, and from the ends of what is
    allowed, where arguments are held."""
    given = dict(given)
    if "u" in given:
        given["u"] = np.minimum(given["u"], 0.999)
    if "xi" in given:
        given["xi"] = np.clip(given["xi"], -0.99, 0.99)
    if "k" in given:
        given["k"] = np.maximum(given["k"], 1.01)
    if "alpha" in given:
        given["alpha"] = np.maximum(given["alpha"], 1.01)
    if "u" in given and "alpha" in given:
        root = given["alpha"] ** (0.5 / given.get("k", 1.0))
        kink = np.abs(given["u"] * (1 + root) - 1) < 1e-3
        given["u"] = np.where(kink, 0.9 * given["u"], given["u"])
    if "z" in given and "alpha" in given:
        given["z"] = np.maximum(given["z"], 1 + 0.01 * (given["alpha"] - 1))
    if "gamma" in given and "theta" in given:
        given["theta"] = np.clip(given["theta"], 0.1, 1.1)
        lower = np.sin(given["gamma"]) - np.tan(given["theta"]) * np.cos(given["gamma"])
        given["gamma"] = np.where(np.abs(lower) < 1e-3, given["gamma"] + 0.01, given["gamma"])
    return given


def _pushes(given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    size = {name: np.abs(value) for name, value in given.items()}
    for name in ("alpha", "z"):
        if name in size:
            size[name] = given[name] - 1
    for name, most in (("xi", 0.01), ("k", 0.1), ("theta", 0.1), ("gamma", 0.1), ("s", 0.1)):
        if name in size:
            size[name] = np.minimum(size[name], most)
    return size


# Equations of the paper.


def _s_of_z(z, alpha, u):
    q, a = z - 1, alpha - 1
    return q * (1 + u * a) / (a * (1 + u * q))


def _z_of_s(s, alpha, u):
    a = alpha - 1
    return 1 + s * a / (1 + u * a * (1 - s))


def _g(z, alpha, u):
    """Equation 3 in the paper's n."""
    n = _n(u)
    return (z - 1 + n) ** 2 / (z * n * (n + alpha - 1))


def _m_z(z, alpha, u, theta):
    return (alpha - 1) / (2 * mpmath.tan(theta)) * _g(z, alpha, u)


def _m_x(z, alpha, u):
    n = _n(u)
    return alpha * (n + z - 1) / (z * (n + alpha - 1))


def _g_max(alpha, u):
    return max(_g(mpmath.mpf(1), alpha, u), _g(alpha, alpha, u))


def _u_from_xi(xi, alpha):
    """Equation 4."""
    root = mpmath.sqrt(alpha)
    if xi > 0:
        return (xi * root + 1) / (root + 1)
    return (xi + 1) / (root + 1 - xi * (alpha - 1))


def _xi_from_u(u, alpha):
    """What `_u_from_xi` is inverted by."""
    root, n = mpmath.sqrt(alpha), 1 / u
    return (root + 1 - n) / (n * root) if u > 1 / (1 + root) else (root + 1 - n) / (n + alpha - 1)


def _log_s(z, alpha, u):
    return mpmath.log(1 + u * (z - 1)) / mpmath.log(1 + u * (alpha - 1))


def _log_z(s, alpha, u):
    return 1 + ((1 + u * (alpha - 1)) ** s - 1) / u


def _log_m_z(z, alpha, u, theta):
    whole = mpmath.log(1 + u * (alpha - 1))
    return (1 + u * (z - 1)) * whole / (2 * u * z * mpmath.tan(theta))


def _subdivided(alpha, k, xi, theta):
    """Equation 7."""
    part = alpha ** (1 / k)
    root = mpmath.sqrt(part)
    return k * (part - 1) * (1 + abs(xi) * (root - 1)) / (root * 2 * mpmath.tan(theta))


WARPS = (
    _elementwise("z alpha u", theory.s_of_z, _s_of_z),
    _elementwise("s alpha u", theory.z_of_s, _z_of_s),
    _elementwise("z alpha u", theory.g, _g),
    _elementwise("z alpha u theta", theory.m_z, _m_z),
    _elementwise("z alpha u", theory.m_x, _m_x),
    _elementwise("alpha u", theory.g_max, _g_max),
    _elementwise(
        "alpha u theta",
        theory.m_z_max,
        lambda alpha, u, theta: (alpha - 1) / (2 * mpmath.tan(theta)) * _g_max(alpha, u),
    ),
    _elementwise("alpha u", theory.m_x_max, lambda alpha, u: _m_x(mpmath.mpf(1), alpha, u)),
    _elementwise("xi alpha", theory.u_from_xi, _u_from_xi),
    # A scale from -1 to 1.
    _elementwise("u alpha", theory.xi_from_u, _xi_from_u, (Part(1, least=1.0),)),
    _elementwise("alpha", theory.u_lispsm, lambda alpha: 1 / (1 + mpmath.sqrt(alpha))),
    _elementwise("u", theory.n_from_u, _n, infinite=True),
    _elementwise("alpha", lambda n: theory.u_from_n(n), lambda n: 1 / n, name="u_from_n"),
    _elementwise(
        "z alpha", theory.logarithmic_s, lambda z, alpha: mpmath.log(z) / mpmath.log(alpha)
    ),
    _elementwise("s alpha", theory.logarithmic_z, lambda s, alpha: alpha**s),
    _elementwise(
        "alpha theta",
        theory.logarithmic_m_z,
        lambda alpha, theta: mpmath.log(alpha) / (2 * mpmath.tan(theta)),
    ),
    _elementwise("z alpha u", theory.log_perspective_s, _log_s),
    _elementwise("s alpha u", theory.log_perspective_z, _log_z),
    _elementwise("z alpha u theta", theory.log_perspective_m_z, _log_m_z),
    _elementwise("alpha k xi theta", theory.subdivided_m_z_max, _subdivided),
)


# Storage.


def _overhead(warp: str):
    def of(alpha, theta, u, k):
        strength = u if "perspective" in warp else None
        return theory.overhead_factors(alpha, theta, warp, strength, k).storage

    def digits(alpha, theta, u, k):
        part = alpha ** (1 / k)
        a = part - 1
        along, across = {
            "uniform": (a, part),
            "perspective": (a * _g_max(part, u), part / (1 + u * a)),
            "logarithmic": (mpmath.log(part), part),
            "log_perspective": (mpmath.log(1 + u * a) / u, part / (1 + u * a)),
        }[warp]
        return k * along * across / (2 * mpmath.tan(theta))

    return _elementwise("alpha theta u k", of, digits, name=f"overhead_{warp}")


def _direction_digits(alpha, theta, gamma, u, logarithmic: bool):
    """The largest errors at the vertices of the view volume; `storage` says no more than 1e26."""
    tangent, sine, cosine = mpmath.tan(theta), mpmath.sin(gamma), mpmath.cos(gamma)
    places = [(z, z * sine - y * cosine) for z in (mpmath.mpf(1), alpha)
              for y in (z * tangent, -z * tangent)]  # fmt: skip
    least = min(v for _, v in places)
    places = [(z, v - least) for z, v in places]
    extent = max(v for _, v in places)
    grown = [(z, 1 + u * v) for z, v in places]
    whole = 1 + u * extent
    if logarithmic:
        along = max(extent * w * mpmath.log(whole) / (u * extent) / z for z, w in grown)
    else:
        along = max(extent * w * w / whole / z for z, w in grown)
    across = max(z / w for z, w in grown) * max(w / z for z, w in grown)
    return min(along / (2 * tangent) * across, mpmath.mpf(10) ** 26)


def _direction(logarithmic: bool):
    def of(alpha, theta, gamma, u):
        return theory.direction_factors(alpha, theta, gamma, u, logarithmic=logarithmic).storage

    return _elementwise(
        "alpha theta gamma u",
        of,
        functools.partial(_direction_digits, logarithmic=logarithmic),
        name=f"direction_{'log_perspective' if logarithmic else 'perspective'}",
    )


def _lispsm_digits(alpha, theta, gamma):
    tangent, sine, cosine = mpmath.tan(theta), mpmath.sin(gamma), mpmath.cos(gamma)
    lower, upper = sine - tangent * cosine, sine + tangent * cosine
    extent = alpha * upper - min(lower, alpha * lower)
    return sine / (1 + mpmath.sqrt(1 + extent * sine))


STORAGE = (
    *(_overhead(warp) for warp in theory.WARPS),
    _direction(False),
    _direction(True),
    _elementwise("alpha theta gamma", theory.lispsm_strength, _lispsm_digits),
    _elementwise(
        "alpha theta gamma",
        lambda alpha, theta, gamma: (
            theory.direction_storage(alpha, theta, gamma, "perspective").storage
        ),
        None,
        name="direction_best",
        # The search carries none, and may end at another strength of as little storage.
        slopes=False,
    ),
)


# Allocation, splits, and errors of beams and of edges.


def _splits_digits(near, far, weight) -> list:
    even, ratio = far - near, far / near
    parts = [mpmath.mpf(i) / 4 for i in range(5)]
    return [weight * near * ratio**i + (1 - weight) * (near + even * i) for i in parts]


def _ranges(rng, n) -> Arrays:
    near = powers(rng, n, 1e-6, 1e3)
    return near, near * (1 + powers(rng, n, 1e-3, 1e6)), rng.uniform(0.01, 0.99, n)


def _axis_m(depth, cos_off_axis, width, distance, cos_eye, cos_light):
    eye = theory.log2_point_beam(depth, cos_off_axis, width, distance, 64.0)
    light = theory.log2_parallel_beam(distance, 256.0, width)
    found = theory.axis_aliasing(eye, light, cos_eye, cos_light)
    return jnp.stack([found.m, found.projective])


def _axis_digits(depth, cos_off_axis, width, distance, cos_eye, cos_light) -> list:
    eye = depth * cos_off_axis * (width / 64) / distance
    slants = cos_eye / cos_light
    return [distance / 256 * width / eye * slants, slants]


def _beams(rng, n) -> Arrays:
    depth, width, distance = (powers(rng, n, 1e-3, 1e3) for _ in range(3))
    off, eye, light = (powers(rng, n, 1e-3, 1) for _ in range(3))
    return depth, off, width, distance, eye, light


def _edges_of(jacobian, normal):
    edges = theory.texel_edges(jacobian, 4.0)
    return jnp.concatenate([
        edges.reshape(4, -1),
        theory.edge_lengths(edges),
        theory.mean_displacement(edges, normal)[None],
        theory.rms_displacement(edges, normal)[None],
    ])  # fmt: skip


def _edges_digits(jacobian, normal) -> list:
    (a, b), (c, d) = jacobian
    det = 4 * (a * d - b * c)
    edges = [[d / det, -b / det], [-c / det, a / det]]
    lengths = [mpmath.sqrt(edges[0][k] ** 2 + edges[1][k] ** 2) for k in range(2)]
    falls = [abs(edges[0][k] * normal[0] + edges[1][k] * normal[1]) for k in range(2)]
    most, least = max(falls), min(falls)
    mean = most / 4 + least**2 / (12 * most)
    rms = mpmath.sqrt((most**2 + least**2) / 12)
    return [*edges[0], *edges[1], *lengths, mean, rms]


def _turned_texels(rng, n, draw=powers) -> Arrays:
    """Jacobians of texels up to 8 times as long as wide, and a shadow edge that crosses both of
    their sides under 0.2 radians at least, along no diagonal."""
    angle, shear, between = rng.uniform(0, 6.28, n), rng.uniform(0.5, 2.6, n), rng.random(n)
    size, stretch = draw(rng, n, 1e-4, 1e4), powers(rng, n, 0.125, 8)
    first = np.stack([np.cos(angle), np.sin(angle)]) / size
    second = np.stack([np.cos(angle + shear), np.sin(angle + shear)]) / size * stretch
    edges = np.stack([first, second], axis=1)
    jacobian = np.moveaxis(np.linalg.inv(np.moveaxis(edges, -1, 0)), 0, -1) / 4
    # The normal leaves the first edge, as does the second, and a diagonal, by a part of `shear`.
    sum_, difference = (np.arctan2(*v[::-1]) for v in (first + second, first - second))
    normal = angle + np.pi / 2 + 0.2 + between * (shear - 0.4)
    for diagonal in (sum_, difference):
        near = np.abs(np.cos(normal - diagonal)) < 0.05
        normal = np.where(near, normal + 0.1, normal)
    return jacobian, np.stack([np.cos(normal), np.sin(normal)])


MAPS = (
    Kernel(
        "allocate",
        lambda errors: theory.allocate(errors, 64.0),
        lambda rng, n: (powers(rng, 8, 1e-3, 1e3),),
        oracle=lambda errors: 64 * errors / errors.sum(),
    ),
    Kernel(
        "practical_splits",
        jax.vmap(lambda near, far, weight: theory.practical_splits(near, far, 4, weight), -1, -1),
        _ranges,
        NUMBER * 5,
        digits=_splits_digits,
    ),
    Kernel(
        "axis_aliasing",
        _axis_m,
        _beams,
        (Part(1), Part(1)),
        digits=_axis_digits,
    ),
    Kernel(
        "texel_edges",
        _edges_of,
        _turned_texels,
        (Part(4), Part(2), Part(1), Part(1)),
        digits=_edges_digits,
        spaced=lambda rng, n: _turned_texels(rng, n, spaced_powers),
        pushes=lambda jacobian, normal: (
            np.abs(jacobian).max(axis=(0, 1)) * np.ones_like(jacobian) * 0.1,
            0.1 * np.ones_like(normal),
        ),
    ),
)


KERNELS = (*WARPS, *STORAGE, *MAPS)
