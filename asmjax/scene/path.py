"""Camera paths: smooth curves through key views, walked at an even pace."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from asmjax.errors import require
from asmjax.scene.spec import ViewSpec

STEP = 1 / 40
"""How far a frame is from the one before it, as `path_length` measures it: 1.4 degrees about the
target, or a fortieth of the distance to it."""

ORBIT_DEG = (0.0, 5.0, 10.0, 15.0, 20.0)
"""Angles of the key views of an orbit, in degrees."""

_SAMPLES = 256
"""Points between two keys from which the length of the curve is summed."""


class CameraPath:
    """A smooth curve through key views, measured by how much the image changes along it.

    Eye, target, up vector and the logarithm of the field of view are monotone between
    neighbouring keys (Fritsch and Carlson 1980), so that the eye never swings out of the box that
    its keys span, as other splines do: into a wall, for instance. Everything else, the image size
    included, is the first key's.

    Attributes:
        keys: the views that the curve passes through, one at least.
        length: of the whole curve; see `path_length`.
    """

    def __init__(self, keys: Sequence[ViewSpec]):
        require(len(keys) >= 1, "a camera path needs at least one key view; name one.")
        self.keys = tuple(keys)
        rows = np.stack([_row(key) for key in keys])
        knots = np.arange(len(keys), dtype=np.float64)
        if len(keys) == 1:
            # A curve of one point is that point.
            rows, knots = np.repeat(rows, 2, axis=0), np.arange(2.0)
        with np.errstate(over="ignore"):
            # Slopes of keys that differ by next to nothing, whose inverse is next to infinite.
            self._curve = PchipInterpolator(knots, rows)
        self._at = np.linspace(0.0, knots[-1], _SAMPLES * (knots.size - 1) + 1)
        self._walked = path_length(self._curve(self._at))
        self.length = float(self._walked[-1])

    def view(self, frame: int) -> ViewSpec:
        """The view of frame 0, 1, ...: `STEP` from one to the next, to the end and back again."""
        walked = frame * STEP
        if self.length > 0:
            walked = self.length - abs(walked % (2 * self.length) - self.length)
        row = self._curve(np.interp(walked, self._walked, self._at))
        eye, target, up = (tuple(row[k : k + 3].tolist()) for k in (0, 3, 6))
        fov = math.degrees(2 * math.atan(math.exp(row[9])))
        return replace(
            self.keys[0], name=f"frame {frame}", origin=eye, target=target, up=up, fov_x_deg=fov
        )


def path_length(rows: np.ndarray) -> np.ndarray:
    """Length (n,) of a polyline up to each of its views, rows (n, 10) as `_row` makes them.

    A step is as long as the eye or the target moves, whichever moves more, in parts of the
    distance between them, plus the change of the logarithm of the field of view: about the angle
    by which the image moves, however near the eye is.
    """
    eye, target = rows[:, :3], rows[:, 3:6]
    distance = np.linalg.norm(target - eye, axis=1)
    moved = [np.linalg.norm(np.diff(place, axis=0), axis=1) for place in (eye, target)]
    between = np.maximum(0.5 * (distance[1:] + distance[:-1]), 1e-12)
    steps = np.maximum(*moved) / between + np.abs(np.diff(rows[:, 9]))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _row(key: ViewSpec) -> np.ndarray:
    """Eye, target, unit up vector, and log tan of half the field of view: (10,)."""
    up = np.asarray(key.up, np.float64)
    length = np.linalg.norm(up)
    require(bool(length > 0), f"view '{key.name}' has an up vector of length 0; give a direction.")
    half = math.log(math.tan(math.radians(key.fov_x_deg) / 2))
    return np.array([*key.origin, *key.target, *(up / length), half])


def orbit_keys(view: ViewSpec) -> list[ViewSpec]:
    """Key views on an arc of 20 degrees about the target of `view`, around its up vector."""
    return [turned(view, degrees) for degrees in ORBIT_DEG]


def turned(view: ViewSpec, degrees: float) -> ViewSpec:
    """The view from elsewhere on a circle about its target, around its up vector."""
    eye, target, up = (np.asarray(v, np.float64) for v in (view.origin, view.target, view.up))
    axis, arm = up / np.linalg.norm(up), eye - target
    along = axis * (axis @ arm)
    across, third = arm - along, np.cross(axis, arm)
    angle = math.radians(degrees)
    arm = along + math.cos(angle) * across + math.sin(angle) * third
    return replace(view, origin=tuple((target + arm).tolist()))


def aimed_at(view: ViewSpec, distance: float) -> ViewSpec:
    """The same view with its target at that distance from the eye, scene units.

    Sensors of scene files say where they look, not how far; paths turn about what is seen.
    """
    eye, target = np.asarray(view.origin, np.float64), np.asarray(view.target, np.float64)
    forward = (target - eye) / np.linalg.norm(target - eye)
    return replace(view, target=tuple((eye + distance * forward).tolist()))
