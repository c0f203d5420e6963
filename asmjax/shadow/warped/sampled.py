"""Some of what the eye sees, spread evenly over the image: what a layout is tuned and judged by."""

from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import EyeBuffer, SurfacePoints, light_offset, project
from asmjax.geometry import LightFrame, towards_light
from asmjax.numerics import dot, scalar
from asmjax.shadow.warped.body import Body
from asmjax.shadow.warped.sight import (
    BINS,
    Seen,
    beam_jacobian,
    bin_of,
    outline_of,
    plane_jacobian,
    plane_of,
    turned,
)

Measure = Literal["m", "perspective"]
"""Which error is tuned: m, or its perspective factor, which no receiver's slant enters."""

SAMPLES = 2048
"""Receivers that a layout is tuned for."""

DIGITS = 14
"""Bits that a layout is tuned with: enough for whole rows and columns. Kinks make a search's path
depend on the last digit; with so few, a scene that is moved as a whole has the same ones."""

GRAZING = 0.05
"""Receivers lit more edge-on than at this cosine do not count: a map can do nothing for them, and
would be tuned for nothing else."""


class SampledReceivers(NamedTuple):
    """`SAMPLES` of the visible receivers, in the light's image; float64.

    Attributes:
        uv: (2, n).
        jacobian: (2, 2, n) d(plane)_k / d(step)_i of what is measured, see `Seen`.
        plane: (2, n) plane coordinates, not turned.
        scale: (2, n) image size per plane unit.
        face, depth, counts: (n,) face, eye depth, and whether it counts.
        pixel: (n,) that sees it.
    """

    uv: np.ndarray
    jacobian: np.ndarray
    plane: np.ndarray
    scale: np.ndarray
    face: np.ndarray
    depth: np.ndarray
    counts: np.ndarray
    pixel: np.ndarray


def sampled_receivers(view: EyeBuffer, frame: LightFrame, measure: Measure) -> SampledReceivers:
    """Samples spread evenly over the pixels that face the light; call it with float64 enabled."""
    world = np.where(view.valid, view.world, 0.0)
    towards = towards_light(frame, world)
    length = np.sqrt(dot(towards, towards))
    facing = np.flatnonzero(view.valid & (dot(view.normal, towards) > GRAZING * length))
    # Golden-ratio steps within equal parts: even, and out of step with the image's rows.
    jitter = np.modf(np.arange(SAMPLES) * (np.sqrt(5) - 1) / 2)[0]
    spread = ((np.arange(SAMPLES) + jitter) * facing.size / SAMPLES).astype(int)
    index = np.zeros(SAMPLES, int)
    if facing.size > SAMPLES:
        index[:] = facing[spread]
    else:
        index[: facing.size] = facing
    valid = np.arange(SAMPLES) < facing.size
    points = SurfacePoints(
        position=jnp.asarray(world[:, index] - view.camera.origin[:, None]),
        normal=jnp.asarray(view.normal[:, index]),
        prim=jnp.zeros(SAMPLES, jnp.int32),
        valid=jnp.asarray(valid),
        origin=view.camera.origin,
    )
    camera = eqx.tree_at(lambda c: (c.near, c.far), view.camera, (scalar(0), scalar(0)))
    found = _in_light(points, camera, frame, light_offset(points, frame), measure)
    uv, jacobian, plane, scale, face, counts = (np.asarray(part) for part in found)
    depth = np.where(valid, view.depth[index], 1.0)
    return SampledReceivers(uv, jacobian, plane, scale, face, depth, counts, index)


@eqx.filter_jit
def _in_light(points, camera, frame, offset, measure: Measure):
    receivers = project(points, frame, offset)
    steps = plane_jacobian if measure == "m" else beam_jacobian
    scale = 1 / jnp.asarray(frame.extent)[receivers.face].T
    return (
        receivers.uv,
        steps(points, camera, frame, receivers),
        plane_of(frame, receivers),
        scale,
        receivers.face,
        receivers.facing,
    )


def sight_of(receivers: SampledReceivers, found: list[Body], frame: LightFrame, most: int) -> Seen:
    """What the receivers' errors depend on, with the outline of all that is visible.

    `found` are the bodies of the view; `most` is the largest number of receivers that they may
    hold, the number of pixels, so that nothing retraces. Call it with float64 enabled.
    """
    axis = np.tile([0.0, 1.0], (frame.faces, 1))
    centre, pace = np.zeros((2, frame.faces))
    plane, depth = np.zeros((2, most)), np.ones(most)
    face, filled = np.zeros(most, int), 0
    for body in found:
        axis[body.face], centre[body.face], pace[body.face] = body.axis, body.centre, body.pace
        part = slice(filled, filled + body.eye_depth.size)
        plane[:, part], depth[part], face[part] = body.turned, body.eye_depth, body.face
        filled = part.stop
    extent = np.ptp(plane[:, :filled])
    depth = rounded(depth, depth)
    near, far = (float(edge) for edge in (depth[:filled].min(), depth[:filled].max()))
    across = jnp.asarray(axis[receivers.face].T)
    mine = [turned(across, jnp.asarray(part)) for part in (receivers.plane, receivers.jacobian)]
    whole = rounded(plane, extent), depth, face, np.arange(most) < filled
    some = (
        rounded(np.asarray(mine[0]), extent),
        rounded(np.asarray(mine[1]), np.abs(receivers.jacobian).max(axis=(0, 1))),
        rounded(receivers.depth, receivers.depth),
    )
    return _assembled(
        *(jnp.asarray(part) for part in (*whole, *some, receivers.face, receivers.counts)),
        *(jnp.asarray(part) for part in (near, far)),
        *(jnp.asarray(part) for part in (rounded(centre, extent), rounded(pace, pace))),
    )


def rounded(values: np.ndarray, size) -> np.ndarray:
    """`values` to whole multiples of 2^-`DIGITS` of the power of two above `size`."""
    _, exponent = np.frexp(size)
    return np.ldexp(np.round(np.ldexp(values, DIGITS - exponent)), exponent - DIGITS)


@jax.jit
def _assembled(
    whole, whole_depth, whole_face, counted,
    plane, jacobian, depth, face, counts, near, far, centre, pace,
) -> Seen:  # fmt: skip
    cell = whole_face * BINS + bin_of(whole_depth, near, far)
    outline = outline_of(whole, cell, counted, pace.shape[0])
    weight = counts.astype(depth.dtype)
    return Seen(plane, jacobian, depth, face, weight, outline, near, far, centre, pace)
