"""What the eye sees, as the light's image holds it: the body that maps are fitted to."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import dot

STILL = 0.02
"""Sine of the angle between light and view below which there is no axis to warp along (the light
comes along the view; other renderers stop there as well)."""


@dataclass(frozen=True, eq=False)
class Body:
    """The visible receivers in one face of a light, and how the view lies in its plane.

    Attributes:
        face: of the light frame.
        plane: (2, m) float64 plane coordinates of the receivers, see `LightFrame`.
        eye_depth, light_depth: (m,) float64 axial depths, scene units.
        axis: (2,) unit vector: where the view goes to in the plane; (0, 1) where it goes nowhere.
        centre: the eye's own place across the axis, where rows of pixels converge: the second of
            `turned` is what runs along it. The middle of the receivers for a lamp that has not the
            eye in its image, before them.
        pace: eye depth per plane unit along the axis on a surface across the light rays; 0 where
            the light comes along the view. For parallel light, the sine of their angle.
        sine: of the angle between the light's rays and the view, 0 to 1.
    """

    face: int
    plane: np.ndarray
    eye_depth: np.ndarray
    light_depth: np.ndarray
    axis: np.ndarray
    centre: float
    pace: float
    sine: float

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) rotation of plane coordinates (x, y, 1) so that `axis` becomes the second."""
        x, y = self.axis
        return np.array([[y, -x, 0.0], [x, y, 0.0], [0.0, 0.0, 1.0]])

    @property
    def near(self) -> float:
        """Distance (plane units) along the axis at which the eye lies before the near end; infinite
        where the light comes along the view."""
        return float(self.eye_depth.min()) / self.pace if self.pace > 0 else np.inf

    @property
    def far(self) -> float:
        """The same to the far end."""
        return self.near + float(np.ptp(self.turned[1]))

    @cached_property
    def turned(self) -> np.ndarray:
        """(2, m) the receivers' plane coordinates across and along the axis."""
        return np.stack([affine(row, self.plane) for row in self.turn[:2]])

    def part(self, which: np.ndarray) -> "Body":
        """The body of some of the receivers, a mask or their numbers; axis and pace stay."""
        which = np.flatnonzero(which) if which.dtype == bool else which
        return replace(
            self,
            plane=self.plane.take(which, axis=1),
            eye_depth=self.eye_depth.take(which),
            light_depth=self.light_depth.take(which),
        )


def affine(row: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """(m,) `row` @ (x, y, 1) of plane points (2, m).

    Written out: with so few rows a threaded matrix product mostly waits for its threads.
    """
    result = row[0] * plane[0]
    result += row[1] * plane[1]
    result += row[2]
    return result


def bodies(view: EyeBuffer, frame: LightFrame) -> list[Body]:
    """A body for each face that holds visible receivers, in the order of the faces.

    A receiver that several faces hold belongs to the first, as everywhere.
    """
    camera = view.camera
    seen = np.flatnonzero(view.valid)
    seen = seen[_faces_light(view, frame, seen)]
    relative = [view.world[k].take(seen) - frame.origin[k] for k in range(3)]
    free = np.ones(seen.size, bool)
    if frame.cos_cutoff > -1:
        free = dot(frame.cone_axis, relative) > frame.cos_cutoff * np.sqrt(dot(relative, relative))
    found = []
    for face in range(frame.faces):
        x, y, depth = (dot(axis, relative) for axis in frame.rotation[face])
        if frame.perspective:
            scale = 1 / np.where(depth > frame.near, depth, 1.0)
            x, y = x * scale, y * scale
        (left, top), (width, height) = frame.corner[face], frame.extent[face]
        mine = free & (depth > frame.near) & (x >= left) & (x < left + width)
        mine &= (y >= top) & (y < top + height)
        free &= ~mine
        if mine.any():
            mine = np.flatnonzero(mine)
            plane = np.stack([x.take(mine), y.take(mine)])
            eye_depth = view.depth.take(seen.take(mine))
            found.append(_body(frame, face, plane, depth.take(mine), eye_depth, camera))
    return found


def _faces_light(view: EyeBuffer, frame: LightFrame, seen: np.ndarray) -> np.ndarray:
    """Which of the pixels `seen` (k,) have their lit side towards the light."""
    normal = [row.take(seen) for row in view.normal]
    if not frame.perspective:
        return dot(-frame.rotation[0, 2], normal) > 0
    towards = [frame.origin[k] - view.world[k].take(seen) for k in range(3)]
    return dot(normal, towards) > 0


def _body(frame: LightFrame, face: int, plane, depth, eye_depth, camera: Camera) -> Body:
    right, down, axis = frame.rotation[face]
    forward = camera.rotation[2]
    if frame.perspective:
        # At the middle of what is seen, as seen from the light.
        middle, distance = plane.mean(axis=1), float(depth.mean())
        ray = right * middle[0] + down * middle[1] + axis
        going = np.array(
            [(right - middle[0] * axis) @ forward, (down - middle[1] * axis) @ forward]
        )
    else:
        ray, distance = axis, 1.0
        going = np.array([right @ forward, down @ forward])
    cosine = float(ray @ forward / np.linalg.norm(ray))
    sine = float(np.sqrt(max(0.0, 1 - cosine**2)))
    length = np.linalg.norm(going)
    still = sine < STILL or length == 0
    towards = np.array([0.0, 1.0]) if still else going / length
    # One plane unit along the axis, across the ray, is that far in the world at that distance.
    world = right * towards[0] + down * towards[1]
    world = world - ray * (world @ ray) / (ray @ ray)
    pace = 0.0 if still else distance * float(world @ forward)
    body = Body(face, plane, eye_depth, depth, towards, 0.0, pace, sine)
    across, along = body.turned
    eye = _eye_in_plane(frame, face, camera)
    centre = 0.5 * float(across.min() + across.max())
    if eye is not None:
        eye_across, eye_along = body.turn[:2, :2] @ eye
        if not frame.perspective or eye_along <= along.min():
            centre = float(eye_across)
    return replace(body, centre=centre)


def _eye_in_plane(frame: LightFrame, face: int, camera: Camera) -> np.ndarray | None:
    """Plane coordinates (2,) of the eye; None where it is not in front of a lamp's face."""
    x, y, depth = frame.rotation[face] @ (camera.origin - frame.origin)
    if not frame.perspective:
        return np.array([x, y])
    return np.array([x, y]) / depth if depth > frame.near else None
