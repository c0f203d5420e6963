"""Image coordinates of surface points to more digits than float32 has, from float32 positions.

Positions are relative to the eye, and the map from them to the light's image is an anchor that the
host computes in float64 (docs/theory.md, "Addresses"): what is near the eye, where maps are
refined and warps magnify, loses no digits at any distance from the origin.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float64, Int

from asmjax.buffers.points import SurfacePoints
from asmjax.geometry import LightFrame
from asmjax.numerics import dot


class Anchor(NamedTuple):
    """The map from positions to image coordinates, u = row_u(p) / row_w(p).

    Each row is a base, its value at the points' origin, and three weights. `high` + `low` is the
    float64 number: JAX takes float32 arguments, unless told otherwise.

    Attributes:
        high, low: (3, 4, faces): rows u, v, w; base and weights of x, y, z. For parallel light the
            row w is not used.
    """

    high: np.ndarray | Array
    low: np.ndarray | Array


def anchor(points: SurfacePoints, frame: LightFrame) -> Anchor:
    """The anchor of these points in `frame`, computed in float64 on the host."""
    concrete = isinstance(points.origin, np.ndarray) and isinstance(frame.origin, np.ndarray)
    # Inside a transformation of the caller's it is computed there, in the precision at hand.
    xp = np if concrete else jnp
    offset = xp.asarray(points.origin) - xp.asarray(frame.origin)
    rotation, corner, extent = (xp.asarray(a) for a in (frame.rotation, frame.corner, frame.extent))
    base = rotation @ offset
    if frame.perspective:
        # u = (x / z - corner) / extent: the row is x - corner * z.
        across = rotation[:, :2] - corner[:, :, None] * rotation[:, 2:]
        start = base[:, :2] - corner * base[:, 2:]
    else:
        across, start = rotation[:, :2], base[:, :2] - corner
    weights = xp.concatenate([across / extent[:, :, None], rotation[:, 2:]], axis=1)
    base = xp.concatenate([start / extent, base[:, 2:]], axis=1)
    exact = xp.concatenate([base[:, :, None], weights], axis=2).transpose(1, 2, 0)
    if points.position.dtype == jnp.float64 or not concrete:
        return Anchor(exact, xp.zeros_like(exact))
    high = exact.astype(np.float32)
    return Anchor(high, (exact - high).astype(np.float32))


def image_rows(
    points: SurfacePoints, anchor: Anchor, face: Int[Array, " n"], perspective: bool
) -> list[Float64[Array, " n"]]:
    """Homogeneous image coordinates: u w, v w and w, (n,) each, in float64 whatever the points are.

    Call it with float64 enabled; pairs of float32 numbers take twice as long. w is 1 for parallel
    light; for perspective faces it is the axial depth, which may be 0 where a point faces no light.
    """
    position = [double(x) for x in points.position]
    table = double(anchor.high) + double(anchor.low)

    def row(k):
        base, *weights = (_of_face(table[k, j], face) for j in range(4))
        return base + dot(weights, position)

    return [row(0), row(1), row(2) if perspective else jnp.ones_like(position[0])]


def double(x) -> Float64[Array, "..."]:
    """`x` in float64; call it with float64 enabled."""
    return jax.lax.convert_element_type(x, jnp.float64)


def _of_face(values, face):
    return values[0] if values.shape[0] == 1 else values[face]
