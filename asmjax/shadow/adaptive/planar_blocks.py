"""The blocks of pixels of an image that see one flat primitive each: quadrilaterals in space.

They are the same under any light, so they are found once for an eye's image, on the host.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, SeenPoints, SurfacePoints, seen_points
from asmjax.errors import require
from asmjax.geometry import Camera
from asmjax.numerics import dot

SIDE = 8
"""Pixels a side of a block: of 4, 8 and 16 the one that is quickest (docs/benchmarks.md)."""

FARTHEST_CORNER = 4.0
"""Blocks with a corner so many times as far from the eye as its first pixel are left to the pixels:
their plane is seen nearly edge-on."""


class Blocks(NamedTuple):
    """The whole blocks of an image, whatever the light; see `blocks_of`.

    Attributes:
        eyes: the samples of each pixel.
        seen: the valid points of each sample.
        corners: (3, 4 * blocks) of the blocks' quadrilaterals, corner by corner; not valid where a
            block is not planar.
        off: (blocks,) how far pixels may lie from their block's quadrilateral, scene units.
        planar: (rows, columns) bool, which blocks are.
    """

    eyes: tuple[EyeBuffer, ...]
    seen: tuple[SeenPoints, ...]
    corners: SurfacePoints
    off: Float[Array, " blocks"]
    planar: np.ndarray


def blocks_of(*eyes: EyeBuffer) -> Blocks:
    """The blocks of an image; more than one of `eyes` are samples of the same pixels.

    Raises:
        UseError: no eyes, eyes of different cameras, or points that lie outside their pixels.
    """
    require(len(eyes) > 0, "no eye was given; allowed: one or more samples of one camera's image.")
    camera, dtype = eyes[0].camera, eyes[0].points.position.dtype
    require(
        all(eqx.tree_equal(eye.camera, camera) for eye in eyes),
        "the eyes have different cameras; allowed: samples of one camera's image.",
    )
    planar, own = _of_one_primitive(eyes)
    which = np.flatnonzero(planar)
    seen_by = _Quadrilaterals.of(eyes, which, planar.shape[1])
    which = which[seen_by.sound]
    planar = np.zeros_like(planar)
    planar.reshape(-1)[which] = True

    def everywhere(values, empty=0):
        result = np.full((*values.shape[:-1], planar.size), empty, values.dtype)
        result[..., which] = values[..., seen_by.sound]
        return result

    return Blocks(
        eyes,
        tuple(seen_points(eye) for eye in eyes),
        SurfacePoints(
            position=jnp.asarray(everywhere(seen_by.corners).reshape(3, -1), dtype),
            normal=jnp.asarray(np.tile(everywhere(seen_by.normal), 4), dtype),
            prim=jnp.asarray(np.tile(own, 4)),
            valid=jnp.asarray(np.tile(planar.reshape(-1), 4)),
            origin=camera.origin,
        ),
        jnp.asarray(everywhere(seen_by.off), dtype),
        planar,
    )


def _of_one_primitive(eyes: Sequence[EyeBuffer]) -> tuple[np.ndarray, np.ndarray]:
    """Which whole blocks (rows, columns) see one flat primitive in all samples; the one that their
    first pixel sees (blocks,)."""
    height, width = (s // SIDE * SIDE for s in eyes[0].size)
    shape = height // SIDE, SIDE, width
    alike, own = np.ones((height // SIDE, width // SIDE), bool), None
    for eye in eyes:
        prim = np.where(np.asarray(eye.points.valid), np.asarray(eye.points.prim), -1)
        prim = prim.reshape(eye.size)[:height, :width].reshape(shape)
        top = prim[:, 0].reshape(*alike.shape, SIDE)
        own = top[:, :, 0] if own is None else own
        column = (prim == prim[:, :1]).all(axis=1).reshape(top.shape)
        alike &= (column & (top == own[:, :, None])).all(axis=2)
    assert own is not None
    return alike & (own >= 0), own.reshape(-1)


class _Quadrilaterals(NamedTuple):
    """What some blocks (k,) see: planar quadrilaterals.

    Attributes:
        corners: (3, 4, k) relative to the eye.
        normal: (3, k).
        off: (k,) how far points of the block may lie off it, scene units.
        sound: (k,) whether the corners could be found.
    """

    corners: np.ndarray
    normal: np.ndarray
    off: np.ndarray
    sound: np.ndarray

    @classmethod
    def of(cls, eyes: Sequence[EyeBuffer], which: np.ndarray, columns: int) -> "_Quadrilaterals":
        """The blocks `which` (k,) of an image of so many blocks a row.

        Through a pinhole, the pixels of a plane lie between the rays around them.
        """
        camera, width = eyes[0].camera, eyes[0].size[1]
        first = np.stack(np.divmod(which, columns)) * SIDE
        pixel = first[0] * width + first[1]
        start = eyes[0].world[:, pixel] - camera.origin[:, None]
        normal = eyes[0].normal[:, pixel]
        height = dot(normal, start)
        low, high, above = np.full(2, np.inf), np.full(2, -np.inf), np.zeros(which.size)
        for eye in eyes:
            for down, right in np.ndindex(2, 2):
                at = first + (SIDE - 1) * np.array([[down], [right]])
                point = eye.world[:, at[0] * width + at[1]] - camera.origin[:, None]
                above = np.maximum(above, np.abs(dot(normal, point) - height))
                within = _in_pixel(camera, point, at)
                low = np.minimum(low, within.min(axis=1, initial=np.inf))
                high = np.maximum(high, within.max(axis=1, initial=-np.inf))
        # Positions that were not found in float64 are off by roundings of float32 that differ from
        # pixel to pixel: all are looked at then.
        rough = np.flatnonzero(above > 1e-12 * np.abs(start).max(axis=0, initial=0))
        every = np.arange(SIDE)[:, None] * width + np.arange(SIDE)
        for eye in eyes if rough.size else ():
            point = eye.world[:, pixel[rough] + every.reshape(-1, 1)]
            point -= camera.origin[:, None, None]
            far = np.abs(dot(normal[:, None, rough], point) - height[rough])
            above[rough] = np.maximum(above[rough], far.max(axis=0))
        rows, cols = (
            f + np.array([[lo], [hi + SIDE - 1]])
            for f, lo, hi in zip(first, low, high, strict=True)
        )
        rays = [camera.directions(cols[i], rows[j]) for j in (0, 1) for i in (0, 1)]
        rays = np.stack(rays, axis=1)
        slant = dot(normal[:, None], rays)
        sound = (np.abs(slant) > 1e-9).all(axis=0)
        t = height / np.where(sound, slant, 1.0)
        sound &= ((t > 0) & (t < FARTHEST_CORNER * (camera.rotation[2] @ start))).all(axis=0)
        # Off the plane by so much, hence along the ray by that much more.
        length = np.sqrt(dot(rays, rays)).max(axis=0)
        off = above * length / np.where(sound, np.abs(slant).min(axis=0), 1.0)
        return cls(t * rays, normal, off, sound)


def _in_pixel(camera: Camera, point: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Where (row, column: (2, k), from 0 to 1) in the pixels `at` the points lie that they see."""
    x, y, z = camera.rotation @ point
    seen = np.stack([y / z, x / z]) * camera.focal[::-1, None] + camera.principal[::-1, None]
    within = seen - at
    require(
        bool(((within > -1e-3) & (within < 1 + 1e-3)).all()),
        "points lie outside their pixels; allowed: the image of the eye's own camera, row by row, "
        "samples at most half a pixel from the centres.",
    )
    return within
