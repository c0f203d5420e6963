"""What the eye sees, as the light's image holds it: the body that maps are fitted to."""

from dataclasses import dataclass, replace

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import LightFrame
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
        pace: eye depth per plane unit along the axis on a surface across the light rays; 0 where
            the light comes along the view. For parallel light, the sine of their angle.
        sine: of the angle between the light's rays and the view, 0 to 1.
    """

    face: int
    plane: np.ndarray
    eye_depth: np.ndarray
    light_depth: np.ndarray
    axis: np.ndarray
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

    @property
    def turned(self) -> np.ndarray:
        """(2, m) the receivers' plane coordinates across and along the axis."""
        return self.turn[:2, :2] @ self.plane

    def part(self, which: np.ndarray) -> "Body":
        """The body of some of the receivers; axis and pace stay."""
        return replace(
            self,
            plane=self.plane[:, which],
            eye_depth=self.eye_depth[which],
            light_depth=self.light_depth[which],
        )


def bodies(view: EyeBuffer, frame: LightFrame) -> list[Body]:
    """A body for each face that holds visible receivers, in the order of the faces.

    A receiver that several faces hold belongs to the first, as everywhere.
    """
    camera, valid = view.camera, view.valid
    world, normal = view.world, view.normal
    if not valid.all():
        world, normal = world[:, valid], normal[:, valid]
    relative = world - frame.origin[:, None]
    towards = -relative if frame.perspective else -frame.rotation[0, 2]
    free = dot(normal, towards) > 0
    if frame.cos_cutoff > -1:
        free &= dot(frame.cone_axis, relative) > frame.cos_cutoff * np.sqrt(dot(relative, relative))
    found = []
    for face in range(frame.faces):
        x, y, depth = frame.rotation[face] @ relative
        if frame.perspective:
            scale = 1 / np.where(depth > frame.near, depth, 1.0)
            x, y = x * scale, y * scale
        (left, top), (width, height) = frame.corner[face], frame.extent[face]
        mine = free & (depth > frame.near) & (x >= left) & (x < left + width)
        mine &= (y >= top) & (y < top + height)
        free &= ~mine
        if mine.any():
            plane = np.stack([x, y])[:, mine]
            eye_depth = camera.rotation[2] @ world[:, mine] - camera.rotation[2] @ camera.origin
            found.append(_body(frame, face, plane, depth[mine], eye_depth, camera.rotation[2]))
    return found


def _body(frame: LightFrame, face: int, plane, depth, eye_depth, forward) -> Body:
    right, down, axis = frame.rotation[face]
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
    if sine < STILL or length == 0:
        return Body(face, plane, eye_depth, depth, np.array([0.0, 1.0]), 0.0, sine)
    towards = going / length
    # One plane unit along the axis, across the ray, is that far in the world at that distance.
    world = right * towards[0] + down * towards[1]
    world = world - ray * (world @ ray) / (ray @ ray)
    return Body(face, plane, eye_depth, depth, towards, distance * float(world @ forward), sine)
