"""Lights that have a size: where samples lie on them, and how wide they look."""

from dataclasses import replace
from types import ModuleType
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.errors import require
from asmjax.geometry.basis import bases_along, basis_from_axis, unit
from asmjax.numerics import dot

AreaShape = Literal["rectangle", "disk", "sphere", "sun"]

SUN_DEG = 0.5338
"""Angular diameter of the sun from the earth, as Mitsuba's sunsky has it."""

LEAST_COSINE = 1e-30
"""Flat lights are seen at no smaller cosine."""

LEAST_LENGTH = 1e-30
"""Directions that are not longer are none: the inverse of a length is a gradient's."""

WIDEST_SUN_DEG = 90.0
"""Angular diameter of the widest sun; a wider light is a sky."""


class AreaLight(eqx.Module):
    """The surface of a light around the point (or along the direction) that hard shadows take.

    Rectangle: `centre + a half_u + b half_v`, |a|, |b| <= 1. Disk: the same with a^2 + b^2 <= 1.
    Sphere: all points `|half_u|` from the centre; of it a receiver sees a disk. Sun: light whose
    directions of travel are the unit `normal` + a half_u + b half_v, a^2 + b^2 <= 1, so that the
    half axes are tan(angular diameter / 2) long and offsets are of a unit direction, no lengths.

    The functions `rectangle_light`, `disk_light`, `sphere_light` and `sun_light` make them.

    Attributes:
        shape: "rectangle", "disk", "sphere" or "sun".
        centre: (3,) float64, world; zeros for a sun.
        half_u, half_v: (3,) float64, world half axes, scene units (a sun's: tangents).
        normal: (3,) float64, world, unit: the side that emits; zeros for a sphere, which emits on
            all sides; the direction of travel of a sun.
    """

    shape: AreaShape = eqx.field(static=True)
    centre: np.ndarray
    half_u: np.ndarray
    half_v: np.ndarray
    normal: np.ndarray

    @property
    def is_flat(self) -> bool:
        """Whether it emits on one side of a plane only."""
        return self.shape in ("rectangle", "disk")

    @property
    def area(self) -> float:
        """Scene units squared; of a sphere that of its silhouette, of a sun in tangents."""
        parallelogram = float(np.linalg.norm(np.cross(self.half_u, self.half_v)))
        return (4.0 if self.shape == "rectangle" else np.pi) * parallelogram

    @property
    def radius(self) -> float:
        """The longest offset from the centre, scene units (a sun's: a tangent)."""
        ends = [self.half_u, self.half_v]
        if self.shape == "rectangle":
            ends = [self.half_u + self.half_v, self.half_u - self.half_v]
        return float(max(np.linalg.norm(end) for end in ends))

    def at(self, centre) -> "AreaLight":
        """The same light around another point; a sun has none."""
        return self if self.shape == "sun" else replace(self, centre=_vector("centre", centre))

    def along(self, direction) -> "AreaLight":
        """A sun with another direction of travel; other lights stay as they are."""
        if self.shape != "sun":
            return self
        return sun_light(direction, 2 * float(np.arctan(self.radius)))

    def offsets(self, square: np.ndarray, towards: np.ndarray | None = None) -> np.ndarray:
        """Samples of the light (3, k) float64, world, relative to its centre, for points of the
        unit square (2, k); of a sun offsets of its unit direction. Equal areas go to equal areas.

        A disk, and what is seen of a sphere or sun, by the concentric map (Shirley and Chiu 1997,
        "A Low Distortion Map Between Disk and Square"), so that cells of a grid stay compact.

        Args:
            towards: (3,) or (3, k) world, receivers. A sphere is seen from there as the disk
                within its circle of tangents, which lies inside the ball: samples are uniform on
                that disk, whose equal areas a receiver takes for equal parts of what it sees, as it
                does those of a flat light that faces it. None takes the disk of the half axes, of a
                receiver far away along their cross product. Other shapes need none.
        """
        square = np.asarray(square, np.float64)
        if self.shape == "rectangle":
            a, b = 2 * square - 1
        else:
            a, b = concentric(square)
        if self.shape != "sphere" or towards is None:
            return self.half_u[:, None] * a + self.half_v[:, None] * b
        away = np.asarray(towards, np.float64).reshape(3, -1) - self.centre[:, None]
        radius = np.linalg.norm(self.half_u)
        distance = np.linalg.norm(away, axis=0)
        # Receivers inside the ball see no silhouette; they get the point of the ball before them.
        sine = radius / np.maximum(distance, radius)
        e_u, e_v, e_w = _bases(away, distance)
        across = radius * np.sqrt((1 - sine) * (1 + sine))
        return radius * sine * e_w + across * (a * e_u + b * e_v)

    def effective_width(self, directions) -> Any:
        """Diameter (n,) of the disk that looks as large along `directions` (3, n), world, from the
        light to receivers, of any length: 2 sqrt(A cos / pi) of a flat light with area A; 0 on the
        side that does not emit. Scene units; a sun's is 2 tan(angular diameter / 2).

        For NumPy or JAX, in the dtype of `directions`.
        """
        xp, cast = _like(directions)
        half_u, half_v = cast(self.half_u), cast(self.half_v)
        if not self.is_flat:
            return 2 * xp.sqrt(dot(half_u, half_u)) * xp.ones_like(directions[0])
        normal = cast(self.normal)
        across = xp.stack(
            [half_u[i] * half_v[j] - half_u[j] * half_v[i] for i, j in ((1, 2), (2, 0), (0, 1))]
        )
        disk = 4 / np.pi if self.shape == "rectangle" else 1.0
        # Of unit size, as a gradient has cubes of lengths.
        size = xp.abs(directions).max(axis=0)
        some = size > LEAST_LENGTH
        scale = xp.where(some, size, 1)
        if xp is jnp:
            scale = jax.lax.stop_gradient(scale)
        along, squared = (
            dot(normal, directions / scale),
            dot(directions / scale, directions / scale),
        )
        length = xp.sqrt(xp.where(some, squared, 1))
        unseen = ~(some & (along > LEAST_COSINE * length))
        cosine = xp.where(unseen, 1, along) / length
        width = 2 * xp.sqrt(disk * xp.sqrt(dot(across, across)) * cosine)
        return xp.where(unseen, 0, width)

    def emits_towards(self, points) -> Any:
        """Whether world points (3, n) lie on the side that emits: (n,) bool, NumPy or JAX."""
        xp, cast = _like(points)
        if not self.is_flat:
            return xp.ones_like(points[0], bool)
        normal, centre = cast(self.normal), cast(self.centre)
        return dot(normal, [points[k] - centre[k] for k in range(3)]) > 0

    def extent_along(self, directions: np.ndarray) -> np.ndarray:
        """How far (n,) the light reaches from its centre along unit vectors (3, n), world."""
        u, v = np.abs(self.half_u @ directions), np.abs(self.half_v @ directions)
        if self.shape == "rectangle":
            return u + v
        if self.shape == "sphere":
            return np.full(u.shape, np.linalg.norm(self.half_u))
        return np.hypot(u, v)


def stratified(m: int) -> np.ndarray:
    """The centres (2, m * m) float64 of an m x m grid of cells of the unit square, row by row.

    Raises:
        UseError: `m` is less than 1.
    """
    require(m >= 1, f"{m} x {m} samples of a light are not possible; allowed: 1 or more a side.")
    at = (np.arange(m) + 0.5) / m
    return np.stack([np.tile(at, m), np.repeat(at, m)])


def concentric(square: np.ndarray) -> np.ndarray:
    """The points (2, k) of the unit disk for points (2, k) of the unit square; equal areas stay so,
    and squares around the centre become circles."""
    a, b = 2 * square - 1
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    # At the centre any angle will do.
    safe = np.where(radius == 0, 1.0, radius)
    angle = np.where(wide, (np.pi / 4) * b / safe, np.pi / 2 - (np.pi / 4) * a / safe)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)])


def rectangle_light(centre, half_u, half_v) -> AreaLight:
    """`centre + a half_u + b half_v`, |a|, |b| <= 1; emits along half_u x half_v.

    Args:
        centre, half_u, half_v: (3,) world, scene units.

    Raises:
        UseError: one is no vector of three finite numbers, or the half axes span no area.
    """
    return _flat("rectangle", centre, half_u, half_v)


def disk_light(centre, half_u, half_v) -> AreaLight:
    """As `rectangle_light` with a^2 + b^2 <= 1: half axes of one length and at right angles are a
    disk, others an ellipse.

    Args:
        centre, half_u, half_v: (3,) world, scene units.

    Raises:
        UseError: as `rectangle_light`.
    """
    return _flat("disk", centre, half_u, half_v)


def sphere_light(centre, radius: float) -> AreaLight:
    """A sphere.

    Args:
        centre: (3,) world, scene units.
        radius: scene units.

    Raises:
        UseError: the centre is no vector of three finite numbers, or the radius is not finite or
            not above 0.
    """
    require(
        bool(np.isfinite(radius) and radius > 0),
        f"a spherical light of radius {radius} is not possible; allowed: finite and more than 0: "
        "a light without size is a point.",
    )
    half_u, half_v = radius * np.eye(3)[:2]
    return AreaLight("sphere", _vector("centre", centre), half_u, half_v, np.zeros(3))


def sun_light(direction, angle: float) -> AreaLight:
    """Light that travels along `direction` and those around it, from a disk.

    Args:
        direction: (3,) world, of any length.
        angle: angular diameter of the disk, radians.

    Raises:
        UseError: the angle is not above 0 or wider than `WIDEST_SUN_DEG`, or the direction is zero
            or not finite.
    """
    require(
        bool(0 < angle <= np.radians(WIDEST_SUN_DEG)),
        f"a sun of {np.degrees(angle):g} degrees across is not possible; allowed: more than 0 and "
        f"at most {WIDEST_SUN_DEG:g}.",
    )
    e_u, e_v, e_w = basis_from_axis(direction)
    half = np.tan(angle / 2)
    return AreaLight("sun", np.zeros(3), half * e_u, half * e_v, e_w)


def _flat(shape: AreaShape, centre, half_u, half_v) -> AreaLight:
    half_u, half_v = _vector("half_u", half_u), _vector("half_v", half_v)
    normal = np.cross(half_u, half_v)
    least = 1e-12 * float(np.linalg.norm(half_u) * np.linalg.norm(half_v))
    require(
        bool(np.linalg.norm(normal) > least),
        f"a {shape} light with the half axes {half_u.tolist()} and {half_v.tolist()} has no area; "
        "give two that are not zero and not parallel.",
    )
    return AreaLight(shape, _vector("centre", centre), half_u, half_v, unit(normal))


def _vector(name: str, value) -> np.ndarray:
    vector = np.array(value, np.float64).ravel()
    require(
        vector.shape == (3,) and bool(np.isfinite(vector).all()),
        f"the {name} of a light, {vector.tolist()}, is no vector; give three finite numbers.",
    )
    return vector


def _bases(away: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """(3, 3, n): of each column of `away` (3, n) the two axes across it and the unit one along it,
    as `basis_from_axis`; z where it has no length."""
    nowhere = distance == 0
    return bases_along(
        np.where(nowhere, [[0.0], [0.0], [1.0]], away / np.where(nowhere, 1.0, distance))
    )


def _like(array) -> tuple[ModuleType, Any]:
    """The module of an array's functions, and what turns others into its dtype."""
    xp = np if isinstance(array, np.ndarray) else jnp
    return xp, lambda other: xp.asarray(other, array.dtype)
