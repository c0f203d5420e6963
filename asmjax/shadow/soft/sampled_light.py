"""Light frames for the samples of a light with a size: each one holds what the light's own holds.

The frame of a light is fitted to what its centre (or its middle direction) shines on. Seen from
another point of the light the same receivers lie elsewhere, the nearer ones farther away. A
sample's frame has the face of the light's own and a rectangle around the same part of space: that
between the nearest and the farthest receiver that the view sees. Where the light's frame has faces
of a cube, receivers go from one to another as the sample moves: each sample has faces of its own.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import AreaLight, LightFrame, fitted_point_frame, stratified, unit

DEPTH_MARGIN = 0.1
"""Depths of receivers are taken to reach this part farther both ways: of their own, or under
parallel light of the range between them. Samples of a pixel see what its centre does not."""

LEAST_RANGE = 1e-3
"""Under parallel light depths reach at least this part of the image's size farther."""

FACE_MARGIN = 0.02
"""Faces of a sample's own reach this part of their size farther, all around."""

NEAREST = 2.0
"""Receivers nearer to a light than so many times its `radius` need not lie in all frames: a
rectangle around what is nearly beside a sample has no end."""


def sample_frames(frame: LightFrame, view: EyeBuffer, samples: int) -> list[LightFrame]:
    """Frames for the centres of `samples` x `samples` cells of equal area of the light, without an
    area themselves; the light's own where it has none, and for a sample at its very centre.

    Of a sphere the disk is sampled that the middle of the visible receivers sees.
    """
    area = frame.area
    if area is None:
        return [frame]
    point = replace(frame, area=None)
    world = view.world[:, view.valid]
    towards = world.mean(axis=1) if world.size else None
    if frame.faces > 1:
        from_there = partial(_around, receivers=world[:, area.emits_towards(world)])
    elif frame.perspective:
        from_there = partial(_from_point, seen=_depths(frame, world), radius=area.radius)
    else:
        from_there = partial(_along_direction, seen=_depths(frame, world))
    offsets = _offsets(frame, area, towards, samples).T
    return [from_there(point, offset) if offset.any() else point for offset in offsets]


def _offsets(frame: LightFrame, area: AreaLight, towards, samples: int) -> np.ndarray:
    """(3, n) from the light's centre to its samples. Those of a sphere's disk lie along the axes of
    the light's own map, so that they turn with the scene and not with the world."""
    square = stratified(samples)
    if area.shape != "sphere" or towards is None:
        return area.offsets(square, towards)
    axes = frame.rotation[0]
    ball = replace(area, centre=np.zeros(3))
    return axes.T @ ball.offsets(square, axes @ (towards - area.centre))


Depths = tuple[float, float] | None
"""Of the nearest and the farthest receiver that a light's one face holds; None if it holds none."""


def _depths(frame: LightFrame, world: np.ndarray) -> Depths:
    x, y, depth = frame.rotation[0] @ (world - frame.origin[:, None])
    in_front = depth > frame.near
    scale = np.where(in_front, depth, 1.0) if frame.perspective else 1.0
    low, high = frame.corner[0], frame.corner[0] + frame.extent[0]
    held = in_front & (x / scale >= low[0]) & (x / scale < high[0])
    held &= (y / scale >= low[1]) & (y / scale < high[1])
    return (float(depth[held].min()), float(depth[held].max())) if held.any() else None


def _outline(frame: LightFrame) -> np.ndarray:
    """Plane coordinates (2, 4) of the corners of the one face's rectangle."""
    (x, y), (wide, high) = frame.corner[0], frame.extent[0]
    return np.array([[x, x + wide, x, x + wide], [y, y, y + high, y + high]])


def _around(point: LightFrame, offset: np.ndarray, receivers: np.ndarray) -> LightFrame:
    """Faces that hold all receivers (3, n), and a little more of each for a pixel's samples; those
    of a cube along the axes of the light's own."""
    origin, axes = point.origin + offset, point.rotation[0]
    relative = axes @ (receivers - origin[:, None])
    if not (np.linalg.norm(relative, axis=0) > point.near).any():
        return replace(point, origin=origin)
    fitted = fitted_point_frame(np.zeros(3), relative, float(point.near))
    return replace(
        point,
        origin=origin,
        rotation=fitted.rotation @ axes,
        corner=fitted.corner - FACE_MARGIN * fitted.extent,
        extent=(1 + 2 * FACE_MARGIN) * fitted.extent,
    )


def _from_point(point: LightFrame, offset: np.ndarray, seen: Depths, radius: float) -> LightFrame:
    origin = point.origin + offset
    if seen is None:
        return replace(point, origin=origin)
    near = max((1 - DEPTH_MARGIN) * seen[0], NEAREST * radius)
    far = max((1 + DEPTH_MARGIN) * seen[1], near)
    right, down, ahead = point.rotation[0] @ offset
    ends = [
        (_outline(point) * depth - [[right], [down]]) / (depth - ahead) for depth in (near, far)
    ]
    both = np.concatenate(ends, axis=1)
    corner, extent = both.min(axis=1), np.ptp(both, axis=1)
    return replace(point, origin=origin, corner=corner[None], extent=extent[None])


def _along_direction(point: LightFrame, offset: np.ndarray, seen: Depths) -> LightFrame:
    """Depth counts from a plane in front of all that stands behind the light's own plane and may
    shade a receiver along the sample's direction."""
    e_u, e_v, e_w = point.rotation[0]
    ahead = unit(e_w + offset)
    across = unit(e_u - (e_u @ ahead) * ahead)
    rotation = np.stack([across, np.cross(ahead, across), ahead])
    least = LEAST_RANGE * float(point.extent.max())
    near, far = seen or (0.0, 0.0)
    more = max(DEPTH_MARGIN * (far - near), least)
    near, far = max(near - more, 0.0), far + more
    x, y = _outline(point)
    box = np.concatenate([
        e_u[:, None] * x + e_v[:, None] * y + e_w[:, None] * depth for depth in (near, far)
    ], axis=1)  # fmt: skip
    # Back along the sample's direction, to where the light's own rays start.
    starts = box - ahead[:, None] * ((e_w @ box) / (e_w @ ahead))
    origin = point.origin + ahead * float((ahead @ starts).min())
    plane = rotation[:2] @ box
    return replace(
        point,
        origin=origin,
        rotation=rotation[None],
        corner=plane.min(axis=1)[None],
        extent=np.ptp(plane, axis=1)[None],
        cone_axis=ahead,
    )
