"""One endless tilted plane under one light, in float32: nothing on it is in shadow."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from asmjax.buffers import SurfacePoints
from asmjax.geometry import LightFrame, basis_from_axis, fixed_frame, unit
from asmjax.scene.spec import Rectangle, Vector

LARGE = 1e5
"""Half side of a rectangle that stands for a plane."""


def vector(v) -> Vector:
    x, y, z = (float(c) for c in v)
    return x, y, z


def square_light(axis, extent: float, distance: float, *, perspective: bool) -> LightFrame:
    """A light at `distance` before the world origin: a square face of plane size `extent` around
    it. Perspective extents are relative to depth, orthographic ones in scene units."""
    axis = unit(axis)
    frame = fixed_frame(vector(-distance * axis), vector(axis), 90.0, 1e-6)
    corner = np.full((1, 2), -extent / 2)
    return LightFrame(
        origin=frame.origin,
        rotation=frame.rotation,
        corner=corner,
        extent=np.full((1, 2), extent),
        cone_axis=frame.cone_axis,
        cos_cutoff=-1.0,
        near=frame.near,
        perspective=perspective,
    )


@dataclass(frozen=True)
class Plane:
    """A plane through `centre` with unit `normal`, towards the light."""

    normal: np.ndarray
    centre: np.ndarray

    def shape(self, name="plane", lift=0.0, half=LARGE) -> Rectangle:
        """A square of it, `lift` along the normal."""
        u, v, n = basis_from_axis(self.normal)
        return Rectangle(
            name, vector(self.centre + lift * n), vector(half * u), vector(half * v)
        )  # fmt: skip

    def seen(self, frame: LightFrame, uv: np.ndarray, deepest=1e3) -> np.ndarray:
        """Points (3, m) of the plane at image coordinates (2, n), as far as `deepest`."""
        origin, ray = frame.ray(0, *uv)
        along = self.normal @ ray
        with np.errstate(divide="ignore"):
            t = self.normal @ (self.centre[:, None] - origin) / along
        keep = (along < 0) & (t > 0.01) & (t < deepest)
        return (origin + np.where(keep, t, 0) * ray)[:, keep]


def surface_points(world: np.ndarray, normal: np.ndarray, prim=0) -> SurfacePoints:
    """World points (3, n) as an eye at the world origin keeps them."""
    n = world.shape[1]
    return SurfacePoints(
        position=jnp.asarray(world, float),
        normal=jnp.asarray(np.broadcast_to(normal[:, None], world.shape), float),
        prim=jnp.full(n, prim, jnp.int32),
        valid=jnp.ones(n, bool),
        origin=np.zeros(3),
    )


def tilted(degrees: float, axis, roll: float, distance=0.0) -> Plane:
    """A plane whose normal leaves the direction to the light by `degrees`."""
    u, v, w = basis_from_axis(axis)
    side = np.cos(roll) * u + np.sin(roll) * v
    angle = np.radians(degrees)
    return Plane(-np.cos(angle) * w + np.sin(angle) * side, distance * unit(axis))
