"""A scene as plain data: shapes, views and lights, before any renderer sees it.

Lengths are scene units, angles are radians unless a name ends in `_deg`. Directions of lights
point *along* the light's travel (from the light into the scene).
"""

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from asmjax.errors import UseError, require, unknown_name

if TYPE_CHECKING:
    from asmjax.geometry import AreaLight, Camera

MAX_SIDE = 16_384
"""Largest eye buffer side in pixels."""

Vector = tuple[float, float, float]
LightKind = Literal["point", "spot", "directional"]


SKEW = 1e-6
"""Cosine between the sides of a rectangle that passes for a right angle."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Flat triangles: `vertices` (3, n_vertices) float64, `faces` (3, n_faces) int32, from 0."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    reflectance: Vector = (0.7, 0.7, 0.7)

    def __post_init__(self):
        for part in ("vertices", "faces"):
            shape = np.shape(getattr(self, part))
            require(
                len(shape) == 2 and shape[0] == 3 and shape[1] > 0,
                f"mesh '{self.name}' has {part} of shape {shape}; allowed: (3, n) with n "
                "of 1 or more, one column each: transpose an array of rows.",
            )
        # Smallest and largest say of all whether they are finite, and no copy is made.
        least, most = np.min(self.vertices), np.max(self.vertices)
        require(
            bool(np.isfinite(least) and np.isfinite(most)),
            f"mesh '{self.name}' has vertices that are not finite; give finite numbers.",
        )
        first, last, count = np.min(self.faces), np.max(self.faces), np.shape(self.vertices)[1]
        require(
            bool(isinstance(first, np.integer) and 0 <= first <= last < count),
            f"mesh '{self.name}' has {count} vertices, and faces of {first.dtype} from {first} to "
            f"{last}; allowed: whole numbers from 0 to {count - 1}.",
        )


@dataclass(frozen=True)
class Rectangle:
    """`centre + a * half_u + b * half_v`, |a|, |b| <= 1; `half_u` is perpendicular to `half_v`."""

    name: str
    centre: Vector
    half_u: Vector
    half_v: Vector
    reflectance: Vector = (0.7, 0.7, 0.7)

    def __post_init__(self):
        _check_numbers("rectangle", self.name, self.centre, self.half_u, self.half_v)
        size = math.hypot(*self.half_u) * math.hypot(*self.half_v)
        along = sum(u * v for u, v in zip(self.half_u, self.half_v, strict=True))
        require(
            bool(size > 0 and abs(along) <= SKEW * size),
            f"rectangle '{self.name}' has sides along {self.half_u} and {self.half_v}; allowed: "
            "two of some length that are perpendicular: make a parallelogram a mesh.",
        )


@dataclass(frozen=True)
class Disk:
    """Flat disk of `radius` around `centre`, perpendicular to the unit vector `normal`."""

    name: str
    centre: Vector
    normal: Vector
    radius: float
    reflectance: Vector = (0.7, 0.7, 0.7)

    def __post_init__(self):
        _check_numbers("disk", self.name, self.centre, self.normal)
        _check_radius("disk", self.name, self.radius)
        require(
            any(self.normal),
            f"disk '{self.name}' has a normal of {self.normal}; allowed: any direction.",
        )


@dataclass(frozen=True)
class Sphere:
    """Sphere of `radius` around `centre`."""

    name: str
    centre: Vector
    radius: float
    reflectance: Vector = (0.7, 0.7, 0.7)

    def __post_init__(self):
        _check_numbers("sphere", self.name, self.centre)
        _check_radius("sphere", self.name, self.radius)


Shape = Mesh | Rectangle | Disk | Sphere


def _check_numbers(kind: str, name: str, *vectors: Vector) -> None:
    require(
        all(len(vector) == 3 and all(map(math.isfinite, vector)) for vector in vectors),
        f"{kind} '{name}' has {', '.join(map(str, vectors))}; allowed: three finite numbers each.",
    )


def _check_radius(kind: str, name: str, radius: float) -> None:
    require(
        0 < radius < math.inf,
        f"{kind} '{name}' has a radius of {radius}; allowed: finite and above 0.",
    )


@dataclass(frozen=True, eq=False)
class Instances:
    """Meshes whose triangles are kept once and placed `transforms.shape[0]` times.

    `transforms` (k, 3, 4) float64 take the meshes' own coordinates to the world's; the first three
    columns must be invertible and may mirror.
    """

    name: str
    meshes: tuple[Mesh, ...]
    transforms: np.ndarray

    def __post_init__(self):
        shape = np.shape(self.transforms)
        require(
            len(shape) == 3 and shape[0] > 0 and shape[1:] == (3, 4) and len(self.meshes) > 0,
            f"instances '{self.name}' have {len(self.meshes)} meshes and transforms of shape "
            f"{shape}; allowed: one mesh or more, and (k, 3, 4) with k of 1 or more.",
        )
        finite = np.all(np.isfinite(self.transforms), axis=(1, 2), keepdims=True)
        regular = np.linalg.det(np.where(finite, self.transforms, 0.0)[:, :, :3]) != 0.0
        require(
            bool(regular.all()),
            f"transform {int(np.argmin(regular))} of instances '{self.name}' is not finite or has "
            "no inverse; give another.",
        )

    @property
    def count(self) -> int:
        return self.transforms.shape[0]

    @property
    def triangles(self) -> int:
        """Of all that are placed."""
        return self.count * sum(mesh.faces.shape[1] for mesh in self.meshes)


@dataclass(frozen=True)
class ViewSpec:
    """A pinhole eye at `origin`; the image spans `fov_x_deg` horizontally.

    `near` and `far` are axial distances; what lies outside them is not seen.
    `principal_point` is the offset of the optical axis from the image centre, as a fraction of
    the width and height. `mirrored` flips left and right.
    """

    name: str
    origin: Vector
    target: Vector
    up: Vector = (0.0, 0.0, 1.0)
    fov_x_deg: float = 45.0
    width: int = 512
    height: int = 512
    near: float = 1e-4
    far: float = math.inf
    principal_point: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    def __post_init__(self):
        numbers = (*self.origin, *self.target, *self.up, self.fov_x_deg, self.near)
        require(
            all(math.isfinite(x) for x in numbers),
            f"view '{self.name}' has a camera that is not finite (origin {self.origin}, target "
            f"{self.target}, fov {self.fov_x_deg}); give finite numbers.",
        )
        require(
            0.0 < self.fov_x_deg < 180.0,
            f"view '{self.name}' has a field of view of {self.fov_x_deg} degrees; allowed is more "
            "than 0 and less than 180.",
        )
        require(
            0.0 < self.near < self.far,
            f"view '{self.name}' sees from {self.near} to {self.far}; allowed: from more than 0 to "
            "something farther, scene units.",
        )
        for side in (self.width, self.height):
            require(
                1 <= side <= MAX_SIDE,
                f"size {self.width} x {self.height} is not possible; allowed is 1 to {MAX_SIDE} "
                "pixels a side: choose another `size`.",
            )

    def resized(self, width: int, height: int) -> "ViewSpec":
        """The same horizontal field of view on another pixel grid."""
        return replace(self, width=width, height=height)

    def camera(self) -> "Camera":
        """The camera of this view. Raises `UseError` where `up` is parallel to the view."""
        # Here, so that listing scenes does not load JAX.
        from asmjax.geometry import look_at

        return look_at(
            self.origin,
            self.target,
            self.up,
            fov_x_deg=self.fov_x_deg,
            width=self.width,
            height=self.height,
            near=self.near,
            far=self.far,
            principal_point=self.principal_point,
            mirrored=self.mirrored,
        )


@dataclass(frozen=True)
class LightSpec:
    """A light: a point, a spot or a direction, around which it may have a size.

    `position` is for point and spot lights, `direction` (along the light's travel) for spot and
    directional ones. `fov_deg` fixes the light's square field of view around `direction`; `None`
    fits the light frame to the visible receivers. `cutoff_deg` is the half angle of a spot.

    `area` is the light's size, which hard shadows leave out: a rectangle, disk or sphere around the
    position of a point light, or a sun around the direction of a directional one.
    `intensity` is how bright it is, as luminance: radiant intensity of a point or spot, irradiance
    across a direction (that of a whole sun too), radiance of a rectangle, disk or sphere.
    """

    name: str
    kind: LightKind
    position: Vector | None = None
    direction: Vector | None = None
    fov_deg: float | None = None
    cutoff_deg: float | None = None
    area: "AreaLight | None" = None
    intensity: float = 1.0

    def __post_init__(self):
        needs = {
            "point": ("position",),
            "spot": ("position", "direction", "cutoff_deg"),
            "directional": ("direction",),
        }
        if self.kind not in needs:
            raise unknown_name("light kind", self.kind, needs)
        for name in needs[self.kind]:
            require(
                getattr(self, name) is not None,
                f"light '{self.name}' of kind '{self.kind}' needs '{name}'; give it.",
            )
        require(
            self.fov_deg is None or self.kind == "directional" or self.direction is not None,
            f"light '{self.name}' has a field of view ({self.fov_deg} degrees) but no direction "
            "that it is around; give it one, or no field of view.",
        )
        numbers = [x for v in (self.position, self.direction) if v is not None for x in v]
        require(
            all(math.isfinite(x) for x in numbers),
            f"light '{self.name}' is not finite (position {self.position}, direction "
            f"{self.direction}); give finite numbers.",
        )
        require(
            self.cutoff_deg is None or 0 < self.cutoff_deg <= 180,
            f"light '{self.name}' has a cone of {self.cutoff_deg} degrees; allowed: more than 0 "
            "and at most 180, from its axis to its rim.",
        )
        require(
            bool(0 <= self.intensity < math.inf),
            f"light '{self.name}' has an intensity of {self.intensity}; allowed: finite and not "
            "below 0.",
        )
        self._check_area()

    def _check_area(self) -> None:
        area = self.area
        if area is None:
            return
        fits = {"point": ("rectangle", "disk", "sphere"), "spot": (), "directional": ("sun",)}
        require(
            area.shape in fits[self.kind],
            f"light '{self.name}' of kind '{self.kind}' cannot have the size of a {area.shape}; "
            "allowed: a rectangle, disk or sphere around a point light, a sun around a directional "
            "one.",
        )
        if self.kind == "point":
            apart = math.dist(self.position or (), area.centre)
            least = 1e-9 * (area.radius + math.hypot(*area.centre))
            require(
                bool(apart <= least),
                f"light '{self.name}' is at {self.position}, and the centre of its area at "
                f"{area.centre.tolist()}; give the same for both.",
            )
            return
        length = math.hypot(*(self.direction or ()))
        along = sum(x * y for x, y in zip(self.direction or (), area.normal, strict=True))
        require(
            bool(along >= (1 - 1e-9) * length),
            f"light '{self.name}' travels along {self.direction}, and its sun along "
            f"{area.normal.tolist()}; give the same for both.",
        )

    def moved_to(self, position: Vector) -> "LightSpec":
        """The light at another position, with its area."""
        area = None if self.area is None else self.area.at(position)
        return replace(self, position=position, area=area)

    def turned_to(self, direction: Vector) -> "LightSpec":
        """The light with another direction, with its sun."""
        area = None if self.area is None else self.area.along(direction)
        return replace(self, direction=direction, area=area)


@dataclass(frozen=True)
class SceneSpec:
    """A scene: shapes, named views and named lights; the first of each is the default.

    `path` are the key views of a walkthrough; see `asmjax.scene.path`. `instances` come after the
    shapes in the order of the scene; each one placed is a shape of its own there.
    """

    name: str
    summary: str
    shapes: tuple[Shape, ...]
    views: dict[str, ViewSpec] = field(default_factory=dict)
    lights: dict[str, LightSpec] = field(default_factory=dict)
    path: tuple[ViewSpec, ...] = ()
    instances: tuple[Instances, ...] = ()

    @property
    def triangles(self) -> int:
        """Of all meshes, those of instances counted for each time they are placed."""
        alone = sum(s.faces.shape[1] for s in self.shapes if isinstance(s, Mesh))
        return alone + sum(instances.triangles for instances in self.instances)


def pick(kind: str, items: dict, wanted: str | int | None, scene: str):
    """The item called `wanted` (a name or an index), or the first one.

    Raises `UseError` when the scene has none, or none of that name.
    """
    if not items:
        raise UseError(
            f"scene '{scene}' has no {kind}; asmjax needs at least one: add a {kind} to the scene."
        )
    if wanted is None:
        return next(iter(items.values()))
    if wanted in items:
        return items[wanted]
    name = str(wanted)
    if name.isdecimal() and int(name) < len(items):
        return list(items.values())[int(name)]
    raise unknown_name(kind, name, items, f"Indices 0 to {len(items) - 1} work too.")
