"""Light frames: how world points map to a light's image, and how frames are fitted."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np

from asmjax.errors import require
from asmjax.geometry.area_light import AreaLight
from asmjax.geometry.basis import basis_from_axis, unit
from asmjax.numerics import scalar

WIDEST_FACE_DEG = 125.0
"""A fitted perspective face wider than this is replaced by cube faces (centre texels of a wider
one cover too much: 15 times the edge texels' angle at 150 degrees)."""

MARGIN = 1e-4
"""Fitted rectangles grow by this fraction, so that no receiver lies on the border."""

NARROWEST = 1e-5
"""Fitted rectangles are at least this part of the scene wide, of the unit on perspective faces."""

NO_LAMP = -1
"""As the lamp of a frame: its light has none."""

ANY_LAMP = -2
"""As the lamp of a frame: nobody said whether its light has one."""


def _shape_number(number: int | np.ndarray) -> np.ndarray:
    return np.asarray(number, np.int32)


class LightFrame(eqx.Module):
    """One light's image planes ("faces"): a rectangle each in a common projection.

    Plane coordinates are `(x, y) / depth` for perspective faces and `(x, y)` in scene units for
    orthographic ones, in the face's axes. Image coordinates u, v in [0, 1] span the rectangle.

    Attributes:
        origin: (3,) float64, world: the light's position, or a point of the plane from which
            orthographic depth counts.
        rotation: (faces, 3, 3) float64, rows are the world directions of u, v and the axis.
        corner: (faces, 2) float64, plane coordinates of u = v = 0.
        extent: (faces, 2) float64, plane size of the rectangle.
        cone_axis: (3,) float64, world: the axis of a spot's cone, the normal of a flat light.
        cos_cutoff: () float64, cosine of the cone's half angle; -1 for no cone, 0 for a flat light.
        near: () float64, smallest axial depth that a receiver may have, scene units.
        perspective: whether rays start at `origin` (else they are parallel).
        area: the size of a light that has one: `origin` is then the centre of the surface, or the
            axis the middle of the sun. None for a light without size. Hard shadows take the centre,
            and of a flat light the side that it emits to.
        lamp: () int32, number of the shape that carries the light, in scene order, which its rays
            leave out; `NO_LAMP` or `ANY_LAMP`.
    """

    origin: np.ndarray
    rotation: np.ndarray
    corner: np.ndarray
    extent: np.ndarray
    cone_axis: np.ndarray
    cos_cutoff: np.ndarray = eqx.field(converter=scalar)
    near: np.ndarray = eqx.field(converter=scalar)
    perspective: bool = eqx.field(static=True)
    area: AreaLight | None = None
    lamp: np.ndarray = eqx.field(converter=_shape_number, default=ANY_LAMP)

    @property
    def faces(self) -> int:
        return self.rotation.shape[0]

    def ray(self, face: int, u, v) -> tuple[np.ndarray, np.ndarray]:
        """World origins and directions (3, n) of the rays through image coordinates u, v (n,).

        Directions have an axial component of 1, so the ray parameter is the axial depth.
        """
        x = self.corner[face, 0] + np.asarray(u, np.float64) * self.extent[face, 0]
        y = self.corner[face, 1] + np.asarray(v, np.float64) * self.extent[face, 1]
        e_u, e_v, e_w = (axis[:, None] for axis in self.rotation[face])
        origin = np.broadcast_to(self.origin[:, None], (3, x.size))
        if self.perspective:
            return origin, e_u * x + e_v * y + e_w
        return origin + e_u * x + e_v * y, np.broadcast_to(e_w, (3, x.size))


def towards_light(frame: LightFrame, position: np.ndarray) -> np.ndarray:
    """Vectors (3, n) from world points to the light; for parallel rays of length 1."""
    if frame.perspective:
        return frame.origin[:, None] - position
    return np.broadcast_to(-frame.rotation[0, 2][:, None], position.shape)


def in_domain(frame: LightFrame, position: np.ndarray) -> np.ndarray:
    """Which world points (3, n) the light shines at: inside a face, in front, inside the cone."""
    inside = np.zeros(position.shape[1], bool)
    relative = position - frame.origin[:, None]
    for face in range(frame.faces):
        x, y, depth = frame.rotation[face] @ relative
        in_front = depth > frame.near
        scale = np.where(in_front, depth, 1.0) if frame.perspective else 1.0
        u = (x / scale - frame.corner[face, 0]) / frame.extent[face, 0]
        v = (y / scale - frame.corner[face, 1]) / frame.extent[face, 1]
        inside |= in_front & (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    if frame.cos_cutoff > -1:
        axial = frame.cone_axis @ relative
        inside &= axial > frame.cos_cutoff * np.linalg.norm(relative, axis=0)
    return inside


def _grown(
    lo: np.ndarray, hi: np.ndarray, scale: float, blur: float
) -> tuple[np.ndarray, np.ndarray]:
    """Corner and extent around plane coordinates from `lo` to `hi`, which may be off by `blur`, in
    a plane of that scale."""
    least = max(NARROWEST * max(scale, float(np.abs([lo, hi]).max())), 4 * blur)
    size = np.maximum(hi - lo, least)
    # Around the middle: a single receiver would otherwise lie on the border.
    return (lo + hi) / 2 - size * (0.5 + MARGIN), size * (1 + 2 * MARGIN)


def cosine_of(cutoff_deg: float | None) -> float:
    """The cosine of a spot's half angle; -1 for a light that is no spot."""
    return -1.0 if cutoff_deg is None else float(np.cos(np.radians(cutoff_deg)))


def fixed_frame(
    position, direction, fov_deg: float, near: float, cutoff_deg: float | None = None
) -> LightFrame:
    """A square perspective face of `fov_deg` around `direction`; `UseError` from 179.9 on.

    `cutoff_deg` is the half angle of a spot's cone around the same direction.
    """
    require(
        0 < fov_deg < 179.9,
        f"a light's field of view of {fov_deg} degrees does not fit on one plane; allowed is more "
        "than 0 and less than 179.9: leave it out to fit cube faces.",
    )
    half = np.tan(np.radians(fov_deg) / 2)
    return LightFrame(
        origin=np.asarray(position, np.float64),
        rotation=basis_from_axis(direction)[None],
        corner=np.full((1, 2), -half),
        extent=np.full((1, 2), 2 * half),
        cone_axis=unit(direction),
        cos_cutoff=cosine_of(cutoff_deg),
        near=near,
        perspective=True,
    )


def fitted_point_frame(
    position,
    receivers: np.ndarray,
    near: float,
    *,
    axis=None,
    cutoff_deg: float | None = None,
    blur: float = 0.0,
) -> LightFrame:
    """Perspective faces that hold the world points `receivers` (3, n) tightly.

    One face around `axis` (default: the mean direction) if `WIDEST_FACE_DEG` allows, else the
    cube faces that see a receiver. Casters need no room of their own: they lie on the same rays.
    `blur` is by how much receivers may be off, scene units; no face is narrower.
    """
    origin = np.asarray(position, np.float64)
    relative = receivers - origin[:, None]
    distance = np.linalg.norm(relative, axis=0)
    relative, distance = relative[:, distance > near], distance[distance > near]
    require(
        relative.shape[1] > 0,
        f"the light at {origin.tolist()} sees no visible surface; choose another light or view.",
    )
    directions = relative / np.linalg.norm(relative, axis=0)
    mean = directions.mean(axis=1)
    if axis is None:
        axis = mean if np.linalg.norm(mean) > 1e-6 else np.array([0.0, 0.0, 1.0])
    limit = np.cos(np.radians(WIDEST_FACE_DEG) / 2)
    if cutoff_deg is not None:
        inside = unit(axis) @ directions > np.cos(np.radians(cutoff_deg))
        directions = directions[:, inside]
        require(
            directions.shape[1] > 0,
            f"the spot light at {origin.tolist()} lights no visible surface; choose another light "
            "or view.",
        )
    if (unit(axis) @ directions).min() > limit:
        rotations: Sequence[np.ndarray] = [basis_from_axis(axis)]
    else:
        rotations = [basis_from_axis(s * e) for e in np.eye(3) for s in (1.0, -1.0)]
    faces, corners, extents = [], [], []
    for rotation in rotations:
        x, y, z = rotation @ directions
        mine = z > 0
        if len(rotations) > 1:
            mine &= (z >= np.abs(x) * (1 - MARGIN)) & (z >= np.abs(y) * (1 - MARGIN))
        if not mine.any():
            continue
        plane = np.stack([x[mine], y[mine]]) / z[mine]
        corner, extent = _grown(
            plane.min(axis=1), plane.max(axis=1), 1.0, blur / float(distance.min())
        )  # fmt: skip
        faces.append(rotation)
        corners.append(corner)
        extents.append(extent)
    return LightFrame(
        origin=origin,
        rotation=np.stack(faces),
        corner=np.stack(corners),
        extent=np.stack(extents),
        cone_axis=unit(axis),
        cos_cutoff=cosine_of(cutoff_deg),
        near=near,
        perspective=True,
    )


def fitted_directional_frame(
    direction, receivers: np.ndarray, bounds: np.ndarray, *, blur: float = 0.0
) -> LightFrame:
    """An orthographic face that holds the world points `receivers` (3, n).

    Depth counts from a plane in front of all casters: the scene's box `bounds` (3, 2), min and
    max per axis. `blur` is as in `fitted_point_frame`.
    """
    require(receivers.shape[1] > 0, "no visible surface to fit a light frame to.")
    rotation = basis_from_axis(direction)
    corners = np.stack(np.meshgrid(*bounds), axis=0).reshape(3, -1)
    centre = bounds.mean(axis=1)
    axial = rotation[2] @ (corners - centre[:, None])
    diagonal = float(np.linalg.norm(bounds[:, 1] - bounds[:, 0]))
    # Light may come straight down on a flat scene, which has no axial extent.
    margin = 1e-3 * max(axial.max() - axial.min(), NARROWEST * diagonal)
    origin = centre + rotation[2] * (axial.min() - margin)
    x, y, _ = rotation @ (receivers - origin[:, None])
    corner, extent = _grown(
        np.array([x.min(), y.min()]), np.array([x.max(), y.max()]), diagonal, blur
    )  # fmt: skip
    return LightFrame(
        origin=origin,
        rotation=rotation[None],
        corner=corner[None],
        extent=extent[None],
        cone_axis=rotation[2],
        cos_cutoff=-1.0,
        near=0.0,
        perspective=False,
    )
