"""What the eye sees, as the light's image holds it: the body that maps are fitted to."""

from dataclasses import dataclass, replace

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import LightFrame, in_domain

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
    camera = view.camera
    world = view.world[:, view.valid]
    normal = view.normal[:, view.valid]
    taken = ~in_domain(frame, world)
    relative = world - frame.origin[:, None]
    towards = -relative if frame.perspective else -frame.rotation[0, 2][:, None]
    taken |= np.einsum("in,in->n", normal, np.broadcast_to(towards, normal.shape)) <= 0
    eye_depth = camera.rotation[2] @ (world - camera.origin[:, None])
    found = []
    for face in range(frame.faces):
        x, y, depth = frame.rotation[face] @ relative
        scale = np.where(depth > frame.near, depth, 1.0) if frame.perspective else 1.0
        plane = np.stack([x, y]) / scale
        inside = np.all(plane >= frame.corner[face][:, None], axis=0)
        inside &= np.all(plane < (frame.corner[face] + frame.extent[face])[:, None], axis=0)
        mine = ~taken & (depth > frame.near) & inside
        taken |= mine
        if mine.any():
            found.append(
                _body(frame, face, plane[:, mine], depth[mine], eye_depth[mine], camera.rotation[2])
            )
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
