"""Light rays and an eye without a renderer: closed-form intersections behind the same interface.

Every algorithm that takes `LightRays` runs on these scenes, exactly and without Mitsuba.
"""

from collections.abc import Sequence

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays, eye_buffer
from asmjax.geometry import unit
from asmjax.scene.analytic import closest, primitive_offsets
from asmjax.scene.spec import Disk, Mesh, Rectangle, Shape, Sphere, ViewSpec


class AnalyticRays(LightRays):
    """Float64 rays against a few shapes (see `asmjax.scene.analytic`)."""

    def __init__(self, shapes: Sequence[Shape]):
        self.shapes = tuple(shapes)

    def closest(self, origins, directions, t_min=0.0):
        t, prim, _ = closest(self.shapes, origins, directions, t_min)
        return t, prim

    def occluded(self, origins, directions, t_max):
        return closest(self.shapes, origins, directions, 0.0, t_max)[1] >= 0


def analytic_eye(shapes: Sequence[Shape], view: ViewSpec) -> EyeBuffer:
    """The eye's image of `view`, exact to float64."""
    camera = view.camera()
    directions = camera.directions(*camera.centres())
    t, prim, normal = closest(shapes, camera.origin[:, None], directions, camera.near, camera.far)
    hit = prim >= 0
    away = np.einsum("in,in->n", normal, directions) > 0
    shape = np.searchsorted(primitive_offsets(shapes), prim, side="right") - 1
    albedo = np.array([s.reflectance for s in shapes], np.float32).T[:, np.where(hit, shape, 0)]
    return eye_buffer(
        camera,
        world=np.where(hit, camera.origin[:, None] + np.where(hit, t, 0) * directions, np.nan),
        normal=np.where(hit, np.where(away, -normal, normal), 0.0),
        depth=np.where(hit, t, np.inf),
        prim=prim,
        shape=np.where(hit, shape, -1).astype(np.int32),
        albedo=np.where(hit, albedo, 0).astype(np.float32),
        flat=np.array([not isinstance(s, Sphere) for s in shapes])[np.where(hit, shape, 0)],
    )


def scene_bounds(shapes: Sequence[Shape]) -> np.ndarray:
    """The box (3, 2) float64 that holds all shapes, min and max per axis."""
    boxes = np.stack([_box(shape) for shape in shapes])
    return np.stack([boxes[:, :, 0].min(axis=0), boxes[:, :, 1].max(axis=0)], axis=1)


def _box(shape: Shape) -> np.ndarray:
    if isinstance(shape, Mesh):
        return np.stack([shape.vertices.min(axis=1), shape.vertices.max(axis=1)], axis=1)
    if isinstance(shape, Rectangle):
        half = np.abs(shape.half_u) + np.abs(shape.half_v)
    elif isinstance(shape, Disk):
        half = shape.radius * np.sqrt(np.maximum(1 - np.square(unit(shape.normal)), 0))
    else:
        half = np.full(3, shape.radius)
    centre = np.asarray(shape.centre, np.float64)
    return np.stack([centre - half, centre + half], axis=1)
