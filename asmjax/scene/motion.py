"""Lights and objects that move on small circles, which begin and end where they rest."""

import math

import numpy as np

from asmjax.geometry import basis_from_axis
from asmjax.scene.spec import LightSpec, Vector

TURN = 120
"""Frames of a whole turn."""

LIGHT_RADIUS = 0.02
"""Radius of a light's circle, in parts of the scene's diagonal."""

LIGHT_ANGLE_DEG = 2.0
"""Half angle of the cone on which the direction of a light without a place turns."""

OBJECT_RADIUS = 0.25
"""Radius of an object's circle, in parts of its own diagonal."""


def circle(frame: int, radius: float, axis: Vector) -> np.ndarray:
    """Offset (3,) from the resting place in a frame; 0 in frame 0, and after each `TURN`."""
    angle = 2 * math.pi * (frame % TURN) / TURN
    e_u, e_v, _ = basis_from_axis(axis)
    return radius * ((math.cos(angle) - 1) * e_u + math.sin(angle) * e_v)


def moved_light(light: LightSpec, frame: int, diagonal: float, up: Vector) -> LightSpec:
    """The light in that frame: a lamp swings level with `up`, a far light's direction turns.

    Args:
        diagonal: of the scene's box, scene units.
    """
    if light.position is None:
        along = np.asarray(light.direction, np.float64)
        along = along / np.linalg.norm(along)
        turned = along + circle(frame, math.tan(math.radians(LIGHT_ANGLE_DEG)), tuple(along))
        x, y, z = turned.tolist()
        return light.turned_to((x, y, z))
    offset = circle(frame, LIGHT_RADIUS * diagonal, up)
    x, y, z = (np.asarray(light.position) + offset).tolist()
    return light.moved_to((x, y, z))
