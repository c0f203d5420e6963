"""Kernels of plain numbers: areas, functions of a Jacobian, mip levels, cells, rays, quotients."""

import jax.numpy as jnp
import mpmath
import numpy as np

from asmjax.footprint import (
    area_ratio,
    cell_worst,
    determinant,
    linear_ratio,
    log2_linear_ratio,
    log2_m,
    log2_mip_value,
    log2_sampled_length,
    m,
    n_required,
    orthographic_area,
    perspective_area,
    required_level,
    singular_values,
)
from asmjax.geometry.reintersect import meet_triangles
from asmjax.numerics import dot, power_below, safe_divide, safe_log2, safe_sqrt
from asmjax.theory import displacement_bounds
from helpers.gradients import unit_or_zero
from helpers.kernels import Arrays, Kernel, Part, powers, spaced_powers

RESOLUTION = 4
"""Texels a side, where a ratio needs them: a power of two, so that it adds no rounding."""

MOST_STRETCHED = 30.0
"""Stretch of the matrices whose determinant is asked for all its digits: it is a difference, which
loses as many as the stretch has, in the kernel as in the rounding of the entries themselves."""


# Areas: position, normal, axis and focal length of a pinhole; normal, axis and texel.

AXIS, FOCAL = np.array([0.0, 0.0, 1.0]), np.array([443.5, 512.25])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=0)


def _seen(rng, distance) -> tuple[np.ndarray, np.ndarray]:
    """Points in front of a pinhole at so many units, and normals within 72 degrees of the ray."""
    n = distance.size
    ray = _unit(np.stack([*rng.uniform(-0.7, 0.7, (2, n)), np.ones(n)]))
    other = _unit(rng.normal(size=(3, n)))
    aside = _unit(other - ray * (ray * other).sum(axis=0))
    cosine = rng.uniform(0.3, 1.0, n) * rng.choice([-1.0, 1.0], n)
    return ray * distance, cosine * ray + np.sqrt(1 - cosine**2) * aside


def _pinhole(rng, n) -> Arrays:
    return *_seen(rng, powers(rng, n, 1e-6, 1e6)), AXIS, FOCAL


def _pinhole_spaced(rng, n) -> Arrays:
    return *_seen(rng, spaced_powers(rng, n, 1e-6, 1e6)), AXIS, FOCAL


def _edge_on(rng, n) -> Arrays:
    """Planes that hold the ray, to within 1e-20 to 1; some behind the pinhole."""
    position, normal, *rest = _pinhole(rng, n)
    ray = _unit(position)
    tilt = 10.0 ** rng.uniform(-20, 0, n)
    normal = _unit(normal - ray * (ray * normal).sum(axis=0)) + tilt * ray
    return position * rng.choice([-1.0, 1.0], n), _unit(normal), *rest


def _with_units(position, normal, axis, focal) -> Arrays:
    return position, unit_or_zero(normal), AXIS, FOCAL


def _pinhole_digits(position, normal, axis, focal) -> list:
    along = sum(a * b for a, b in zip(position, normal, strict=True))
    return [position[2] ** 3 / (focal[0] * focal[1] * abs(along))]


def _parallel(rng, n) -> Arrays:
    normal = _seen(rng, np.ones(n))[1]
    # Within 72 degrees of the axis, whatever the ray was.
    normal[2] = np.copysign(np.maximum(np.abs(normal[2]), 0.3), normal[2])
    return _unit(normal), AXIS, np.array([0.1, 0.2])


def _parallel_digits(normal, axis, texel) -> list:
    along = sum(a * b for a, b in zip(normal, axis, strict=True))
    return [texel[0] * texel[1] / abs(along)]


AREAS = (
    Kernel(
        "perspective_area",
        perspective_area,
        _pinhole,
        allowed=_with_units,
        near=_edge_on,
        digits=_pinhole_digits,
        spaced=_pinhole_spaced,
        infinite=True,
    ),
    Kernel(
        "orthographic_area",
        orthographic_area,
        _parallel,
        allowed=lambda normal, axis, texel: (unit_or_zero(normal), AXIS, np.array([1e-3, 1e-2])),
        digits=_parallel_digits,
        infinite=True,
    ),
)


# Functions of a Jacobian (2, 2, n).


def _matrices(rng, size: np.ndarray) -> Arrays:
    """Turned, mirrored, and stretched up to `MOST_STRETCHED` times; `size` (n,) long."""
    n = size.size
    one, other = rng.uniform(0, 2 * np.pi, (2, n))

    def turn(angle):
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]])

    stretch = powers(rng, n, 1.1, MOST_STRETCHED)
    middle = np.zeros((2, 2, n))
    middle[0, 0], middle[1, 1] = size, rng.choice([-1.0, 1.0], n) * size / stretch
    return (np.einsum("ijn,jkn,kln->iln", turn(one), middle, turn(other)),)


def _any_matrices(rng, n) -> Arrays:
    return _matrices(rng, powers(rng, n, 1e-4, 1e4))


def _spaced_matrices(rng, n) -> Arrays:
    return _matrices(rng, spaced_powers(rng, n, 1e-4, 1e4))


def _flat(rng, n) -> Arrays:
    """Singular to within 1e-18 to 1, of all sizes."""
    (matrix,) = _matrices(rng, powers(rng, n, 1e-30, 1e6))
    part = 10.0 ** rng.uniform(-18, 0, n)
    matrix[1] = rng.uniform(-2, 2, n) * matrix[0] + part * matrix[1]
    return (matrix,)


def _svd(jacobian) -> tuple:
    (a, b), (c, d) = jacobian
    det = abs(a * d - b * c)
    squares = a * a + b * b + c * c + d * d
    largest = mpmath.sqrt((squares + mpmath.sqrt(squares**2 - 4 * det**2)) / 2)
    return det, largest, det / largest


def _log2(x):
    return mpmath.log(x) / mpmath.log(2)


def _signed(jacobian):
    (a, b), (c, d) = jacobian
    return a * d - b * c


def _jacobian(name: str, of, digits, octaves=False) -> Kernel:
    return Kernel(
        name,
        of,
        _any_matrices,
        (Part(1, octaves=octaves),),
        near=_flat,
        digits=lambda jacobian: [digits(jacobian)],
        spaced=_spaced_matrices,
    )


def _ratio(jacobian):
    return 1 / (RESOLUTION**2 * _svd(jacobian)[0])


MATRICES = (
    _jacobian("determinant", determinant, _signed),
    _jacobian("largest", lambda j: singular_values(j)[0], lambda j: _svd(j)[1]),
    _jacobian("smallest", lambda j: singular_values(j)[1], lambda j: _svd(j)[2]),
    _jacobian(
        "log2_linear_ratio",
        lambda j: log2_linear_ratio(j, RESOLUTION),
        lambda j: _log2(_ratio(j)) / 2,
        octaves=True,
    ),
    _jacobian(
        "log2_m",
        lambda j: log2_m(j, RESOLUTION),
        lambda j: -_log2(RESOLUTION * _svd(j)[2]),
        octaves=True,
    ),
    _jacobian(
        "linear_ratio", lambda j: linear_ratio(j, RESOLUTION), lambda j: mpmath.sqrt(_ratio(j))
    ),
    _jacobian("m", lambda j: m(j, RESOLUTION), lambda j: 1 / (RESOLUTION * _svd(j)[2])),
    _jacobian("area_ratio", lambda j: area_ratio(j, RESOLUTION), _ratio),
    _jacobian(
        "n_required",
        lambda j: n_required(16.0, area_ratio(j, RESOLUTION)),
        lambda j: 16 * _ratio(j),
    ),
    Kernel(
        "required_level",
        lambda j: required_level(log2_m(j, RESOLUTION), 2),
        _any_matrices,
        (Part(1, least=1.0),),
        near=_flat,
        digits=lambda j: [max(-_log2(RESOLUTION * _svd(j)[2]) / 2, mpmath.mpf(0))],
        spaced=_spaced_matrices,
        # A level is 0 from a texel / pixel size of 1 on.
        smooth=lambda j: (0.02 * j / np.abs(j).max(axis=(0, 1)),),
    ),
)


# Mip levels, and the largest value of each cell.


def _levels(rng, n) -> Arrays:
    """Of footprints from 2^-20 to 2^20, away from whole levels."""
    return (rng.integers(-20, 20, n) + rng.uniform(0.01, 0.99, n),)


def _mip_digits(level) -> list:
    below = mpmath.floor(level)
    return [below + _log2(1 + level - below)]


def _axes(rng, n) -> Arrays:
    """Two axes and the most anisotropy, log2; no two of the lengths compared nearly alike."""
    one, other = rng.uniform(-20, 20, (2, n))
    other = np.where(np.abs(one - other) < 0.01, other + 0.1, other)
    most = rng.uniform(0, 4, n)
    tie = np.abs(np.abs(one - other) - most) < 0.01
    return one, other, np.where(tie, most + 0.1, most)


CELLS = 5
_INDEX = np.arange(64) % (CELLS - 1)
"""The last cell has no pixel."""


def _worst(ratio):
    # As many indices as there are ratios, whatever their number.
    index = jnp.asarray(np.resize(_INDEX, ratio.shape[0]))
    counted = jnp.asarray(np.arange(ratio.shape[0]) % 3 != 0)
    return cell_worst(index, counted, ratio, CELLS)


def _worst_twin(ratio) -> np.ndarray:
    found = np.zeros(CELLS)
    for i, (cell, value) in enumerate(zip(np.resize(_INDEX, ratio.size), ratio, strict=True)):
        if i % 3:
            found[cell] = max(found[cell], value)
    return found


MIPMAPS = (
    Kernel(
        "log2_mip_value",
        log2_mip_value,
        _levels,
        (Part(1, octaves=True),),
        digits=_mip_digits,
    ),
    Kernel(
        "log2_mip_value_8_bit",
        lambda level: log2_mip_value(level, eight_bit=True),
        _levels,
        (Part(1, octaves=True),),
        jumps=lambda level: np.abs(_halves(level) % 1 - 0.5) < 1e-4 * _halves(level),
        jumps_at="rounding to whole numbers, from one to the next",
        slopes=False,
    ),
    Kernel(
        "log2_sampled_length",
        lambda one, other, most: log2_sampled_length((one, other), most),
        _axes,
        (Part(1, octaves=True),),
        digits=lambda one, other, most: [max(min(one, other), max(one, other) - most)],
    ),
    Kernel("cell_worst", _worst, lambda rng, n: (powers(rng, n, 1e-6, 1e6),), oracle=_worst_twin),
)


# Rays and their triangles.


def _rays_at_triangles(rng, size: np.ndarray) -> Arrays:
    """Triangles of so many units, seen from a few of them away, within 72 degrees of upright."""
    n = size.size
    ray, normal = _seen(rng, np.ones(n))
    side = _unit(np.cross(normal, rng.normal(size=(3, n)), axis=0))
    other = np.cross(normal, side, axis=0)
    # Corners at 120 degrees or so, and a place well inside.
    angles = np.array([0.0, 2.1, 4.2])[:, None] + rng.uniform(-0.3, 0.3, (3, n))
    corners = [np.cos(t) * side + np.sin(t) * other for t in angles]
    weights = rng.uniform(0.2, 1, (3, n))
    weights = weights / weights.sum(axis=0)
    aim = sum(w * corner for w, corner in zip(weights, corners, strict=True))
    start = aim - ray * rng.uniform(1, 3, n)
    return start * size, ray, *(corner * size for corner in corners)


def _meeting(origin, direction, a, b, c):
    found = meet_triangles(origin, direction, a, b, c)
    return jnp.concatenate([found.t[None], found.weights, found.normal])


def _meeting_digits(origin, direction, a, b, c) -> list:
    """Plane and areas, by cross products."""

    def minus(p, q):
        return [x - y for x, y in zip(p, q, strict=True)]

    def cross(p, q):
        return [p[i - 2] * q[i - 1] - p[i - 1] * q[i - 2] for i in range(3)]

    def dot(p, q):
        return sum(x * y for x, y in zip(p, q, strict=True))

    normal = cross(minus(b, a), minus(c, a))
    t = dot(normal, minus(a, origin)) / dot(normal, direction)
    at = [o + t * d for o, d in zip(origin, direction, strict=True)]
    whole = dot(normal, normal)
    parts = [
        dot(normal, cross(minus(q, p), minus(at, p))) / whole for p, q in ((b, c), (c, a), (a, b))
    ]
    length = mpmath.sqrt(whole) * (-1 if dot(normal, direction) > 0 else 1)
    return [t, *parts, *(x / length for x in normal)]


RAYS = (
    Kernel(
        "meet_triangles",
        _meeting,
        lambda rng, n: _rays_at_triangles(rng, powers(rng, n, 1e-6, 1e6)),
        (Part(1), Part(3), Part(3)),
        allowed=lambda origin, ray, *corners: (origin, unit_or_zero(ray), *corners),
        digits=_meeting_digits,
        spaced=lambda rng, n: _rays_at_triangles(rng, spaced_powers(rng, n, 1e-6, 1e6)),
        pushes=lambda *arrays: tuple(np.abs(a).max(axis=0) * np.ones_like(a) for a in arrays),
    ),
)


def _halves(level) -> np.ndarray:
    """What is read before it is rounded; 255 at most."""
    below = np.floor(level)
    return np.minimum(2.0 ** np.minimum(below, 8) * (1 + level - below), 255)


# Quotients, roots and logarithms of what may be 0.


def _safe(x, y, vector):
    at = [safe_divide(x, y), safe_log2(jnp.abs(y), -100.0), safe_sqrt(y), power_below(y)]
    return jnp.stack([*at, dot(vector, vector), *displacement_bounds(y)])


def _safe_digits(x, y, vector) -> list:
    power = mpmath.mpf(2) ** mpmath.floor(_log2(y))
    squares = sum(a * a for a in vector)
    return [x / y, _log2(y), mpmath.sqrt(y), power, squares, y / 4, y / mpmath.sqrt(12)]


SAFE = (
    Kernel(
        "safe_numbers",
        _safe,
        lambda rng, n: (rng.uniform(-1, 1, n), powers(rng, n, 1e-6, 1e6), rng.normal(size=(3, n))),
        (Part(1), Part(1, octaves=True), *[Part(1)] * 5),
        # The slope of a / b is a / b^2: of a larger a float32 has none where b^2 is all it has.
        allowed=lambda x, y, vector: (np.clip(x, -1, 1), y, vector),
        digits=_safe_digits,
        # No step of differences may pass a power of 2.
        smooth=lambda x, y, vector: (
            x,
            np.where(np.abs(np.log2(y) % 1) < 1e-3, 1.1 * y, y),
            vector,
        ),
    ),
)


KERNELS = (*AREAS, *MATRICES, *MIPMAPS, *RAYS, *SAFE)
