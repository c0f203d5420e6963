"""A light that has a size, as receivers see it through a flat map: where rays to it pass.

A receiver at depth z sees the point l of the light (relative to the light's centre, in the axes of
the face) through the place where the ray between them has the depth d of a blocker. In plane
coordinates, from the receiver's own place p on:

    shift = tau / d (l_xy - p l_w),   tau = (z - d) / (z - l_w)      perspective
    shift = -(z - d) l_xy                                            sun, l its unit direction's

For a light parallel to the map, l_w = 0, it is l (1 / d - 1 / z): times z the penumbra of Fernando
2005, w_light (z - d) / d. All is linear in l but for tau, whose l_w is that of the light's centre.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from asmjax.buffers import Receivers
from asmjax.geometry import LightFrame
from asmjax.geometry.area_light import AreaLight, concentric
from asmjax.geometry.basis import axes_across
from asmjax.numerics import dot, least_depth, safe_sqrt


class SeenLight(NamedTuple):
    """What each receiver sees of a light: `centre + a axis_u + b axis_v`, relative to the light's
    centre in the axes of the receiver's face.

    Attributes:
        centre, axis_u, axis_v: three rows each, numbers or (n,); scene units, tangents of a sun.
        place: u and v rows (n,) of the receiver in plane coordinates.
        depth: (n,) of the receiver.
    """

    centre: list
    axis_u: list
    axis_v: list
    place: list
    depth: Float[Array, " n"]


def taps_of(area: AreaLight, count: int) -> np.ndarray:
    """`count` points (2, count) of the light in its half axes, float64, each for an equal part of
    it: Hammersley's, so that along both axes they are (nearly) one for each of `count` strips, and
    an edge is seen to pass in `count` steps."""
    index = np.arange(count)
    bits = (count - 1).bit_length()
    mirrored = np.zeros_like(index)
    for k in range(bits):
        mirrored |= ((index >> k) & 1) << (bits - 1 - k)
    square = np.stack([(index + 0.5) / count, (mirrored + 0.5) / 2**bits])
    return 2 * square - 1 if area.shape == "rectangle" else concentric(square)


def seen(frame: LightFrame, area: AreaLight, receivers: Receivers) -> SeenLight:
    """What receivers see of `area`, the light of `frame`, in their dtype."""
    dtype = receivers.depth.dtype

    def cast(a):
        return jnp.asarray(a, dtype)

    def in_axes(vector):
        """Rows of a world vector in the axes of each receiver's face."""
        rows = [cast(frame.rotation[:, k] @ vector) for k in range(3)]
        return [row[0] if frame.faces == 1 else row[receivers.face] for row in rows]

    def of_face(table):
        return table[0] if frame.faces == 1 else table[receivers.face]

    corner, extent = cast(frame.corner), cast(frame.extent)
    place = [of_face(corner[:, k]) + receivers.uv[k] * of_face(extent[:, k]) for k in range(2)]
    depth, zero = receivers.depth, jnp.zeros((), dtype)
    if area.shape == "sphere":
        return SeenLight(*_disk_of_sphere(in_axes(area.half_u), place, depth), place, depth)
    return SeenLight([zero] * 3, in_axes(area.half_u), in_axes(area.half_v), place, depth)


def _disk_of_sphere(half, place, depth):
    """The disk within the circle of tangents from each receiver (`AreaLight.offsets`)."""
    length = jnp.sqrt(place[0] * place[0] + place[1] * place[1] + 1)
    x, y, z = place[0] / length, place[1] / length, 1 / length
    radius = safe_sqrt(dot(half, half))
    distance = depth * length
    sine = radius / jnp.maximum(distance, radius)
    across = radius * safe_sqrt((1 - sine) * (1 + sine))
    # Receivers are before the light: z > 0.
    u, v = axes_across(x, y, z)
    axis_u, axis_v = ([across * e for e in axis] for axis in (u, v))
    return [radius * sine * e for e in (x, y, z)], axis_u, axis_v


class Shift(NamedTuple):
    """In image coordinates, u and v rows (n,): the light's centre is seen `centre` beside a
    receiver's own place, and its point (a, b) a `axis_u` + b `axis_v` further. All are in
    proportion to `scale` (n,), which falls with the depth."""

    scale: Float[Array, " n"]
    centre: list
    axis_u: list
    axis_v: list

    def at(self, a, b) -> Float[Array, "2 n"]:
        parts = zip(self.centre, self.axis_u, self.axis_v, strict=True)
        return jnp.stack([c + a * u + b * v for c, u, v in parts])

    def half_box(self, rectangle: bool) -> list:
        """Half sides, u and v rows (n,), of the box around all of the light."""
        pairs = zip(self.axis_u, self.axis_v, strict=True)
        if rectangle:
            return [jnp.abs(u) + jnp.abs(v) for u, v in pairs]
        return [jnp.hypot(u, v) for u, v in pairs]


def shift_at(
    light: SeenLight, frame: LightFrame, receivers: Receivers, blocker: Float[Array, "..."]
) -> Shift:
    """Where receivers see the light at the depth `blocker`, a number or (n,); at their own place
    where that is not nearer than they are."""
    dtype = light.depth.dtype
    scale = scale_at(light, frame, blocker)
    extent = jnp.asarray(frame.extent, dtype)
    per_plane = [
        1 / (extent[0, k] if frame.faces == 1 else extent[receivers.face, k]) for k in range(2)
    ]
    along = light.place if frame.perspective else [jnp.zeros((), dtype)] * 2

    def image(vector):
        return [(vector[k] - along[k] * vector[2]) * scale * per_plane[k] for k in range(2)]

    return Shift(scale, image(light.centre), image(light.axis_u), image(light.axis_v))


def scale_at(
    light: SeenLight, frame: LightFrame, blocker: Float[Array, "..."]
) -> Float[Array, " n"]:
    """Plane units of shift (n,) per unit of the light at the depth `blocker`: tau / d, or d - z."""
    gap = jnp.maximum(light.depth - blocker, 0)
    if not frame.perspective:
        return -gap
    floor = least_depth(light.depth.dtype)
    away = jnp.maximum(light.depth - light.centre[2], floor)
    return jnp.minimum(gap / away, 1) / jnp.maximum(blocker, floor)


class Horizon(NamedTuple):
    """How high points of the light stand above each receiver's tangent plane, in any unit: `centre`
    + a `axis_u` + b `axis_v`, (n,) each."""

    centre: Float[Array, " n"]
    axis_u: Float[Array, " n"]
    axis_v: Float[Array, " n"]

    def above(self, a, b) -> Bool[Array, " n"]:
        """Whether a point is on the side of the plane that the eye sees; others light nothing."""
        return self.centre + a * self.axis_u + b * self.axis_v > 0


def horizon(light: SeenLight, frame: LightFrame, receivers: Receivers) -> Horizon:
    """From the plane as `Receivers.slope` has it: z (1 + slope . du) is the receiver's own depth on
    it (or z - slope . du is), and less towards the light."""
    dtype = light.depth.dtype
    extent = jnp.asarray(frame.extent, dtype)
    weight = [
        receivers.slope[k] / (extent[0, k] if frame.faces == 1 else extent[receivers.face, k])
        for k in range(2)
    ]
    if not frame.perspective:
        one = jnp.ones_like(light.depth)
        return Horizon(
            one, *(-(weight[0] * v[0] + weight[1] * v[1]) for v in (light.axis_u, light.axis_v))
        )

    def along(v):
        return v[2] + sum(weight[k] * (v[k] - v[2] * light.place[k]) for k in range(2))

    return Horizon(light.depth - along(light.centre), -along(light.axis_u), -along(light.axis_v))


def share_above(heights: Horizon, taps: Float[Array, "taps 2"]) -> Float[Array, " n"]:
    """The share of the taps that stand above each receiver's plane."""

    def count(total, tap):
        return total + heights.above(*tap).astype(total.dtype), None

    total, _ = jax.lax.scan(count, jnp.zeros_like(heights.centre), taps)
    return total / taps.shape[0]
