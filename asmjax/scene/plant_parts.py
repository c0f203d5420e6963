"""Many parts in one closed mesh, all made by one array operation: bars, beams, pipes, vessels.

Lengths are scene units, z is up; triangles face outward and counts are exact.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from asmjax.scene.mesh_tools import make_mesh
from asmjax.scene.shapes import box, quads_to_triangles, tube
from asmjax.scene.spec import Mesh, Vector

BAR_TRIANGLES = 12
BEND = 3.0
"""Radius of a pipe's elbows around their own centre, in radii of the pipe."""


class Bars(NamedTuple):
    """Straight bars of rectangular section from `start` to `end` (3, n).

    `width` (n,) is level and `height` (n,) across it; of an upright bar they are along x and y.
    """

    start: np.ndarray
    end: np.ndarray
    width: np.ndarray
    height: np.ndarray

    @property
    def count(self) -> int:
        return self.width.shape[0]


def bars(start, end, width, height) -> Bars:
    """Bars from anything that broadcasts: points (3, n) or (3, 1), sizes (n,) or one number."""
    start, end = np.broadcast_arrays(np.asarray(start, float), np.asarray(end, float))
    shape = start.shape[1:]
    return Bars(start, end, np.broadcast_to(width, shape), np.broadcast_to(height, shape))


def joined(parts: Sequence[Bars]) -> Bars:
    """All bars of several lists in one."""
    return Bars(*(np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True)))


def beams(start, end, width: float, height: float) -> Bars:
    """I-beams: two flanges of `width` and a web, `height` in all; three bars each."""
    start, end = np.broadcast_arrays(np.asarray(start, float), np.asarray(end, float))
    _, _, across = _axes(start, end)
    flange, web = 0.08 * height, 0.12 * width
    lift = 0.5 * (height - flange) * across
    return joined(
        [
            bars(start + lift, end + lift, width, flange),
            bars(start - lift, end - lift, width, flange),
            bars(start, end, web, height - 2.0 * flange),
        ]
    )


def bar_mesh(name: str, parts: Bars, reflectance: Vector) -> Mesh:
    """The bars as one mesh: `BAR_TRIANGLES` each."""
    unit = box("", (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    along, side, across = _axes(parts.start, parts.end)
    length = np.linalg.norm(parts.end - parts.start, axis=0)
    x, y, z = unit.vertices[:, None, :]
    vertices = 0.5 * (parts.start + parts.end)[:, :, None] + (
        (along * length)[:, :, None] * x
        + (side * parts.width)[:, :, None] * y
        + (across * parts.height)[:, :, None] * z
    )
    return _copies(name, vertices, unit.faces, reflectance)


def pipe_triangles(legs: int, sides: int, arc: int) -> int:
    """Triangles of one pipe of `pipe_mesh`."""
    rings = 2 + (legs - 1) * (arc + 1)
    return 2 * sides * (rings - 1) + 2 * (sides - 2)


def pipe_mesh(
    name: str,
    corners: np.ndarray,
    radius: np.ndarray,
    sides: int,
    arc: int,
    reflectance: Vector,
) -> Mesh:
    """Capped pipes along polylines `corners` (3, n, legs + 1) whose legs are parallel to the axes.

    Successive legs are at right angles and at least 2 `BEND` radii long; elbows are quarter
    circles of `arc` segments. `radius` is (n,).
    """
    legs = np.diff(corners, axis=2)
    along = legs / np.linalg.norm(legs, axis=0)
    bend = BEND * radius
    # Any axis at a right angle to the first leg.
    normal = np.roll(along[:, :, 0], 1, axis=0)
    rings = [_ring(corners[:, :, 0], normal, along[:, :, 0])]
    for k in range(1, legs.shape[2]):
        before, after = along[:, :, k - 1], along[:, :, k]
        binormal = np.cross(before, after, axis=0)
        in_plane, off_plane = np.sum(normal * after, axis=0), np.sum(normal * binormal, axis=0)
        for angle in 0.5 * math.pi * np.arange(arc + 1) / arc:
            c, s = math.cos(angle), math.sin(angle)
            towards = c * after - s * before
            normal = in_plane * towards + off_plane * binormal
            tangent = c * before + s * after
            centre = corners[:, :, k] + bend * ((1.0 - c) * after - (1.0 - s) * before)
            rings.append(_ring(centre, normal, tangent))
    rings.append(_ring(corners[:, :, -1], normal, along[:, :, -1]))
    centre, normal, binormal = (np.stack(part, axis=2) for part in zip(*rings, strict=True))
    turn = 2.0 * math.pi * np.arange(sides) / sides
    spoke = normal[..., None] * np.cos(turn) + binormal[..., None] * np.sin(turn)
    vertices = centre[..., None] + radius[:, None, None] * spoke
    faces = _tube_faces(len(rings), sides)
    return _copies(name, vertices.reshape(3, radius.size, -1), faces, reflectance)


def vessel_triangles(sides: int) -> int:
    """Triangles of one `vessel`."""
    return pipe_triangles(1, sides, 0) + 2 * sides * 2 * _head_steps(sides)


def vessel(
    name: str, start: Vector, end: Vector, radius: float, sides: int, reflectance: Vector
) -> Mesh:
    """Closed cylinder from `start` to `end` with heads that bulge by a third of the radius."""
    start_, end_ = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end_ - start_))
    angle = np.linspace(0.06, 0.5 * math.pi, _head_steps(sides) + 1)
    head = radius / 3.0
    at = np.concatenate([head - head * np.cos(angle), length - head + head * np.cos(angle[::-1])])
    reach = radius * np.concatenate([np.sin(angle), np.sin(angle[::-1])])
    path = start_[:, None] + ((end_ - start_) / length)[:, None] * at
    return tube(name, path, reach, sides, reflectance=reflectance)


def _head_steps(sides: int) -> int:
    return max(sides // 6, 2)


def _ring(centre, normal, tangent):
    return centre, normal, np.cross(tangent, normal, axis=0)


def _axes(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (3, n) along bars, level and across that; a right-handed frame."""
    along = (end - start) / np.linalg.norm(end - start, axis=0)
    x, y, _ = along
    level = np.hypot(x, y)
    upright = level < 1e-9
    safe = np.where(upright, 1.0, level)
    side = np.stack(
        [np.where(upright, 1.0, -y / safe), np.where(upright, 0.0, x / safe), np.zeros_like(x)]
    )
    return along, side, np.cross(along, side, axis=0)


def _tube_faces(rings: int, sides: int) -> np.ndarray:
    """Faces of one open tube with flat caps, ring by ring."""
    ring = np.arange(rings * sides, dtype=np.int32).reshape(rings, sides)
    near, far = ring[:-1], ring[1:]
    sheet = (near, np.roll(near, -1, axis=1), np.roll(far, -1, axis=1), far)
    fan = np.arange(1, sides - 1, dtype=np.int32)
    first, last = np.zeros_like(fan), np.full_like(fan, (rings - 1) * sides)
    caps = [np.stack([first, fan + 1, fan]), last + np.stack([first, fan, fan + 1])]
    quads = quads_to_triangles(np.stack([q.ravel() for q in sheet]))
    return np.concatenate([quads, *caps], axis=1)


def _copies(name: str, vertices: np.ndarray, faces: np.ndarray, reflectance: Vector) -> Mesh:
    """One mesh of n bodies that share their faces; `vertices` is (3, n, vertices of a body)."""
    _, count, size = vertices.shape
    start = size * np.arange(count, dtype=np.int32)
    every = faces[:, None, :].astype(np.int32) + start[None, :, None]
    return make_mesh(name, vertices.reshape(3, -1), every.reshape(3, -1), reflectance)
