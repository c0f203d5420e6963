"""Where rays meet triangles, to float64: a renderer says which triangle, this says where on it.

Watertight (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2.1): corners
are sheared so that the ray becomes the axis, and the side on which it passes an edge depends on the
two ends of that edge alone. Both triangles of a shared edge get the same number with the other
sign, so a ray between them is inside of one at least. Differentiable in rays and corners.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from asmjax.numerics import dot, power_below, safe_divide, safe_sqrt

LANES = 1 << 14
"""Rays of one call: temporaries fit the processor's cache, and one shape is ever traced."""


MEANT = 4.0
"""Areas of fewer roundings than this say nothing: a triangle seen edge-on, or none. A side has a
rounding of its distance at the least."""


class Meeting(NamedTuple):
    """Where rays meet the planes of triangles.

    Attributes:
        t: (n,) ray parameter, 0 where there is no meeting.
        weights: (3, n) barycentric coordinates of the place, 1 in sum; negative beyond an edge.
        normal: (3, n) unit normal that faces the ray's origin, 0 for a degenerate triangle.
        inside: (n,) whether the ray passes through the triangle, its edges included.
        met: (n,) whether the plane is met at all: not by rays along it, nor that of a triangle
            without an area.
    """

    t: Float[Array | np.ndarray, " n"]
    weights: Float[Array | np.ndarray, "3 n"]
    normal: Float[Array | np.ndarray, "3 n"]
    inside: Bool[Array | np.ndarray, " n"]
    met: Bool[Array | np.ndarray, " n"]


def meet_triangles(
    origin: Float[Array, "3 n"],
    direction: Float[Array, "3 n"],
    a: Float[Array, "3 n"],
    b: Float[Array, "3 n"],
    c: Float[Array, "3 n"],
) -> Meeting:
    """Each ray and its own triangle; pure, in the dtype of its arguments.

    Corners and origin should be relative to a point near them: what cancels is lost before.
    """
    relative = [corner - origin for corner in (a, b, c)]
    # In units of their distance, nothing that is met is so small that a gradient overflows; the
    # unit is a power of 2, so that no digit changes.
    unit = power_below(jnp.max(jnp.abs(jnp.stack(relative)), axis=(0, 1)))
    unit = jnp.where(unit > 0, unit, 1)
    largest = jnp.argmax(jnp.abs(direction), axis=0)
    # The longest component of the direction becomes the axis; a turn keeps the orientation.
    turned = [_turned(vector, largest) for vector in (direction, *(r / unit for r in relative))]
    (along_x, along_y, along), corners = turned[0], turned[1:]
    shear_x, shear_y = safe_divide(along_x, along), safe_divide(along_y, along)
    x, y, z = (jnp.stack([corner[k] for corner in corners]) for k in range(3))
    x, y = x - shear_x * z, y - shear_y * z
    sides, terms = _sides(x, y)
    area = sides[0] + sides[1] + sides[2]
    eps, least = jnp.finfo(area.dtype).eps, jnp.finfo(area.dtype).tiny ** 0.5
    rounding = eps * jnp.maximum(terms[0] + terms[1] + terms[2], eps)
    met = (jnp.abs(area) > MEANT * rounding) & (jnp.abs(along) > least)
    weights = jnp.where(met, sides, 1 / 3) / jnp.where(met, area, 1)
    along = jnp.where(met, along, 1)
    return Meeting(
        t=jnp.where(met, unit * (dot(weights, z) / along), 0),
        weights=weights,
        normal=_facing(direction, relative),
        inside=met & (jnp.all(sides >= 0, axis=0) | jnp.all(sides <= 0, axis=0)),
        met=met,
    )


def _turned(vector, largest):
    """Components (x, y, z) of vectors with the one numbered `largest` (n,) as z."""
    return [
        jnp.where(
            largest == 0, vector[(k + 1) % 3], jnp.where(largest == 1, vector[(k + 2) % 3],
            vector[k])
        )
        for k in range(3)
    ]  # fmt: skip


def _sides(x: Float[Array, "3 n"], y: Float[Array, "3 n"]) -> tuple[Array, Array]:
    """On which side of each edge the axis passes (3, n), opposite corners first: twice an area; and
    the size (3, n) of what cancels in it.

    The other triangle of an edge gets the negative, bit for bit: the two ends are put in order, so
    that both compute the same, whether or not the compiler fuses a product with the difference.
    """
    first = jnp.roll(x, -1, axis=0), jnp.roll(y, -1, axis=0)
    last = jnp.roll(x, -2, axis=0), jnp.roll(y, -2, axis=0)
    turned = (first[0] > last[0]) | ((first[0] == last[0]) & (first[1] > last[1]))
    alike = (first[0] == last[0]) & (first[1] == last[1])
    low = [jnp.where(turned, end, begin) for begin, end in zip(first, last, strict=True)]
    high = [jnp.where(turned, begin, end) for begin, end in zip(first, last, strict=True)]
    one, other = low[0] * high[1], low[1] * high[0]
    side = jnp.where(turned, -1, 1) * (one - other)
    return jnp.where(alike, 0, side), jnp.abs(one) + jnp.abs(other)


def _facing(direction, relative) -> Float[Array, "3 n"]:
    a, b, c = relative
    (p, q, r), (u, v, w) = b - a, c - a
    normal = jnp.stack([q * w - r * v, r * u - p * w, p * v - q * u])
    # Scaled first: squares of small triangles would vanish.
    largest = jnp.max(jnp.abs(normal), axis=0)
    normal = safe_divide(normal, largest)
    length = safe_sqrt(dot(normal, normal))
    away = jnp.where(dot(normal, direction) > 0, -1.0, 1.0)
    return safe_divide(normal, length) * away


def meet_triangles_on_host(
    origin: np.ndarray,
    direction: np.ndarray,
    corners: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> Meeting:
    """`meet_triangles` for float64 arrays (3, n) on the host and one origin (3,), as NumPy arrays.

    Corners are made relative to the origin in float64; any n runs the same compiled code.
    """
    count = direction.shape[1]
    padded = LANES * max(1, -(-count // LANES))
    result = [np.empty((*shape, padded), kind) for shape, kind in _LAYOUT]
    with jax.enable_x64(True):
        for start in range(0, padded, LANES):
            end = min(start + LANES, count)
            arrays = [
                _filled(part[:, start:end] - shift)
                for part, shift in ((direction, 0.0), *((c, origin[:, None]) for c in corners))
            ]
            found = _meet_from_zero(*arrays)
            for whole, part in zip(result, found, strict=True):
                whole[..., start : start + LANES] = part
    return Meeting(*(whole[..., :count] for whole in result))


_LAYOUT = (((), np.float64), ((3,), np.float64), ((3,), np.float64), ((), bool), ((), bool))
"""Leading shape and type of each field of `Meeting`."""


@jax.jit
def _meet_from_zero(direction, a, b, c):
    return meet_triangles(jnp.zeros_like(direction), direction, a, b, c)


def _filled(rows: np.ndarray) -> np.ndarray:
    return rows if rows.shape[1] == LANES else np.pad(rows, ((0, 0), (0, LANES - rows.shape[1])))
