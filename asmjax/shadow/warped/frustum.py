"""The eye's frustum as the light sees it: the faces on the near plane's side, and parts of them.

Side faces meet in the eye. In a side face, eye depth and a coordinate across are affine functions
of the plane of parallel light; for a lamp they are homographies of its plane, which the sides' own
lines still bound.
"""

from dataclasses import dataclass

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import LightFrame, image_to_plane
from asmjax.shadow.warped.body import Body, affine

SIDES = 4

OVERLAP = 1e-6
"""Regions reach this far (of the image) over their borders, so that rounding leaves no gap."""

FLAT = 1e-6
"""Faces whose area in the light's plane is a smaller part of the largest one's are left out: they
are seen edge-on."""


@dataclass(frozen=True, eq=False)
class Region:
    """Part of a face of the frustum, in the light's plane.

    Attributes:
        onto: (3, 3) affine map of plane coordinates to a coordinate across, 0 in the middle, and
            the eye depth of the face.
        lines: (k, 3) it holds points with lines @ (x, y, 1) >= 0, scaled to image sizes.
    """

    onto: np.ndarray
    lines: np.ndarray

    def holds(self, plane: np.ndarray) -> np.ndarray:
        """Which plane points (2, m) lie inside, or a rounding outside."""
        held = np.ones(plane.shape[1], bool)
        for line in self.lines:
            held &= affine(line, plane) >= -OVERLAP
        return held

    def in_image(self, frame: LightFrame, face: int) -> tuple[tuple[float, float, float], ...]:
        """The lines in image coordinates, moved outwards by the overlap."""
        lines = self.lines @ image_to_plane(frame, face)
        lines[:, 2] += OVERLAP
        return tuple(tuple(line) for line in lines.tolist())


def frustum_regions(
    view: EyeBuffer, frame: LightFrame, body: Body, parts: int
) -> list[Region] | None:
    """The side faces on the near plane's side, each in `parts` parts along its length, logarithmic.

    Together with the near face they cover what is seen, without overlap; the near face has no
    region: it is what is left. Empty where the light stands so that no side is seen, or all that is
    seen has one depth; None where a corner of the frustum has no image in the light's face.
    """
    near, far = float(body.eye_depth.min()), float(body.eye_depth.max())
    image = _in_plane(frame, body.face, _corners(view, near, far))
    if image is None:
        return None
    if far <= near * (1 + 1e-9):
        return []
    size = float(frame.extent[body.face].max())
    near_area = _area(image[0])
    # All faces on one side of the light's rays have images of one orientation.
    faces = [np.stack([image[0][i], image[0][j], image[1][j], image[1][i]]) for i, j in _EDGES]
    areas = np.array([_area(face) for face in faces])
    largest = max(abs(near_area), float(np.abs(areas).max()))
    sign = np.sign(near_area) if abs(near_area) > FLAT * largest else 0.0
    splits = near * (far / near) ** (np.arange(parts + 1) / parts)
    regions = []
    for face, area in zip(faces, areas.tolist(), strict=True):
        # A near plane's edge runs the other way round in the side that it bounds.
        seen = abs(area) > FLAT * largest and (sign == 0 or np.sign(area) == -sign)
        if sign == 0 and seen:
            seen = area > 0
        if seen:
            regions += _parts(face, near, far, splits, size)
    return regions


_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))


def _corners(view: EyeBuffer, near: float, far: float) -> np.ndarray:
    """World corners (2, 4, 3) of the frustum between two eye depths, around the image."""
    camera = view.camera
    columns = np.array([0.0, camera.width, camera.width, 0.0])
    rows = np.array([0.0, 0.0, camera.height, camera.height])
    ways = camera.directions(columns, rows).T
    return np.stack([camera.origin + depth * ways for depth in (near, far)])


def _in_plane(frame: LightFrame, face: int, world: np.ndarray) -> np.ndarray | None:
    """Plane coordinates (2, 4, 2) of the corners; None where one lies behind the light's face."""
    x, y, depth = np.moveaxis((world - frame.origin) @ frame.rotation[face].T, -1, 0)
    if not frame.perspective:
        return np.stack([x, y], axis=-1)
    if depth.min() <= max(frame.near, 1e-9 * depth.max()):
        return None
    return np.stack([x / depth, y / depth], axis=-1)


def _area(corners: np.ndarray) -> float:
    """Signed area of a quadrilateral (4, 2)."""
    a, b = corners[2] - corners[0], corners[3] - corners[1]
    return 0.5 * float(a[0] * b[1] - a[1] * b[0])


def _parts(face: np.ndarray, near: float, far: float, splits, size: float) -> list[Region]:
    """The parts of one side face: corners (4, 2) near, near, far, far in the light's plane."""
    middle_near, middle_far = 0.5 * (face[0] + face[1]), 0.5 * (face[2] + face[3])
    along = (middle_far - middle_near) / (far - near)
    across = face[1] - face[0]
    # p = middle_near + across x + along (y - near).
    back = np.eye(3)
    back[:2, 0], back[:2, 1], back[:2, 2] = across, along, middle_near - along * near
    onto = np.linalg.inv(back)
    inside = face.mean(axis=0)
    sides = [_line(face[0], face[3], inside, size), _line(face[1], face[2], inside, size)]
    depth = onto[1]
    scale = size * np.hypot(*depth[:2])
    regions = []
    for k, (least, most) in enumerate(zip(splits[:-1], splits[1:], strict=True)):
        lines = [*sides, (depth - [0, 0, least]) / scale]
        if k < len(splits) - 2:
            lines.append(([0, 0, most] - depth) / scale)
        regions.append(Region(onto, np.stack(lines)))
    return regions


def _line(start: np.ndarray, end: np.ndarray, inside: np.ndarray, size: float) -> np.ndarray:
    """(3,) the line through two points, positive on the side of `inside`, in sizes of the image."""
    normal = np.array([start[1] - end[1], end[0] - start[0]])
    normal = normal / (np.hypot(*normal) * size)
    line = np.append(normal, -normal @ start)
    return line if line @ np.append(inside, 1.0) >= 0 else -line
