"""Surface points: what the eye sees, as the kernels take it."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.errors import require
from asmjax.geometry import Camera

BLUR = 1e-6
"""Points are at float32 positions from the eye: this part of their depth, at most, from where the
host has them."""


class SurfacePoints(eqx.Module):
    """Points on surfaces, relative to `origin` so that float32 keeps the digits that matter.

    Attributes:
        position: (3, n) world axes, scene units, minus `origin`.
        normal: (3, n) unit geometric normals on the eye's side; 0 where not valid.
        prim: (n,) global primitive id where the primitive is flat, else -1: a curved one can shade
            itself, so its id proves nothing. -1 where not valid.
        valid: (n,) whether the eye sees a surface there.
        origin: (3,) float64, world.
    """

    position: Float[Array, "3 n"]
    normal: Float[Array, "3 n"]
    prim: Int[Array, " n"]
    valid: Bool[Array, " n"]
    origin: np.ndarray

    @property
    def count(self) -> int:
        return self.prim.shape[0]


class EyeBuffer(eqx.Module):
    """The eye's image, flat, row by row from the top; `n = width * height`.

    Attributes:
        camera: the camera that saw it.
        points: the surface points on the device, in the default float dtype of JAX.
        world: (3, n) float64 world positions on the host, NaN where not valid.
        normal: (3, n) float64 normals on the host, 0 where not valid.
        depth: (n,) float64 axial depth on the host, +inf where not valid.
        prim: (n,) int32 global primitive id on the host, flat or curved, -1 where not valid.
        shape: (n,) int32 dense shape id in scene order, -1 where not valid.
        albedo: (3, n) float32 diffuse reflectance, 0 where not valid.
    """

    camera: Camera
    points: SurfacePoints
    world: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    prim: np.ndarray
    shape: np.ndarray
    albedo: np.ndarray

    @property
    def size(self) -> tuple[int, int]:
        """(height, width), the shape of the images."""
        return self.camera.height, self.camera.width

    @property
    def valid(self) -> np.ndarray:
        """(n,) bool on the host."""
        return self.shape >= 0


def eye_buffer(
    camera: Camera,
    world: np.ndarray,
    normal: np.ndarray,
    depth: np.ndarray,
    prim: np.ndarray,
    shape: np.ndarray,
    albedo: np.ndarray,
    flat: np.ndarray,
) -> EyeBuffer:
    """An `EyeBuffer` from float64 host arrays; positions become relative before any rounding.

    `flat` (n,) says whether the seen primitive is flat; the other arguments are the attributes.

    Raises:
        UseError: the eye is so far from the origin that its float64 coordinates have lost what
            float32 positions relative to it would keep.
    """
    valid = shape >= 0
    _check_digits(camera, depth, valid)
    relative = np.where(valid, world - camera.origin[:, None], 0.0)
    return EyeBuffer(
        camera=camera,
        points=SurfacePoints(
            position=jnp.asarray(relative, float),
            normal=jnp.asarray(np.where(valid, normal, 0.0), float),
            prim=jnp.asarray(np.where(flat, prim, -1), jnp.int32),
            valid=jnp.asarray(valid),
            origin=camera.origin,
        ),
        world=world,
        normal=normal,
        depth=depth,
        prim=prim,
        shape=shape,
        albedo=albedo,
    )


def _check_digits(camera: Camera, depth: np.ndarray, valid: np.ndarray) -> None:
    away = float(np.abs(camera.origin).max())
    lost = away * float(np.finfo(np.float64).eps)
    # Nearly always far from it: the depths are not looked at then.
    if lost > BLUR * camera.near and valid.any():
        seen = float(depth[valid].mean())
        require(
            lost <= BLUR * seen,
            f"the eye is {away:g} units from the origin and looks {seen:g} units far: float64 has "
            "too few digits for both; move the scene to the origin.",
        )


SEEN_STEPS = 8
"""Sizes of `SeenPoints` are whole eighths of the image, so that few shapes are ever traced."""


class SeenPoints(NamedTuple):
    """The valid pixels of an eye buffer without the others: what a shadow has to be found for.

    Attributes:
        points: (m,) of them, filled up with points that are not valid.
        pixels: (k,) int32, k <= m: pixel of each of the first k points.
        size: pixels of the image.
    """

    points: SurfacePoints
    pixels: np.ndarray
    size: int

    def image(self, visibility) -> np.ndarray:
        """(size,) visibility of all pixels from that of the points (m,); 0 where not valid."""
        result = np.zeros(self.size, np.asarray(visibility).dtype)
        result[self.pixels] = np.asarray(visibility)[: self.pixels.size]
        return result


def seen_points(eye: EyeBuffer) -> SeenPoints:
    """The valid points of `eye`, in its order; the points themselves where all are valid."""
    pixels = np.flatnonzero(eye.valid).astype(np.int32)
    size = eye.valid.size
    step = -(-size // SEEN_STEPS)
    padded = step * -(-pixels.size // step)
    if padded >= size:
        return SeenPoints(eye.points, np.arange(size, dtype=np.int32), size)
    index = np.zeros(padded, np.int32)
    index[: pixels.size] = pixels
    points = eye.points
    valid = np.arange(padded) < pixels.size
    return SeenPoints(
        SurfacePoints(
            position=points.position[:, index],
            normal=points.normal[:, index],
            prim=points.prim[index],
            valid=points.valid[index] & valid,
            origin=points.origin,
        ),
        pixels,
        size,
    )
