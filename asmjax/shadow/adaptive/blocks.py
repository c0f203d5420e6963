"""Queries that settle whole blocks of pixels at once, and look up only the pixels that are left.

A block of 8 x 8 pixels that sees one flat primitive is a planar quadrilateral, so its four corners
bound what the shadow test compares at any of its pixels: a rectangle of the light's image, and the
depth of the plane above it. Against them stand the bounds of all texels below the rectangle
(`asmjax.shadow.adaptive.bounds`). A block is

* dark if it turns its back on the light, or if the farthest texel is nearer than the nearest depth
  that any pixel's plane is compared with, tolerances included, and no texel holds the block's own
  primitive;
* lit if it faces the light and all texels hold its own primitive.

The 2001 paper's depth pyramid would call a block lit whose farthest point is nearer than the
nearest texel. That never is so on a surface that the light sees: its own depths are in the map, and
they range over the same interval as the block's. Ids say what the depths cannot.

What is decided is exactly what `AdaptiveShadowMap.visibility` answers for each pixel of the block;
all bounds are widened by what rounding can do.
"""

import functools
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int8

from asmjax.buffers import EyeBuffer, Receivers, SurfacePoints, light_offset, project
from asmjax.buffers.points import SEEN_STEPS
from asmjax.errors import require
from asmjax.geometry import Camera
from asmjax.numerics import LEAST_DEPTH, dot
from asmjax.shadow.adaptive.address import BITS, address_of, anchor
from asmjax.shadow.adaptive.asm import AdaptiveShadowMap
from asmjax.shadow.adaptive.bounds import Pyramid
from asmjax.shadow.adaptive.page_table import find_entries, level_of, page_of, take
from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.state import AdaptiveState
from asmjax.shadow.comparison import CURVATURE_BIAS, pack_prim

SIDE = 8
"""Pixels a side of a block: of 4, 8 and 16 the one that is quickest (docs/benchmarks.md)."""

ROUNDINGS = 16
"""Roundings of a position's size by which it may be off in the kernels; some four are found."""

STEEPEST = 1e-3
"""Blocks of a smaller cosine between normal and light ray are left to the pixels."""

FARTHEST_CORNER = 4.0
"""Blocks with a corner so many times as far from the eye as its first pixel are left to the pixels:
their plane is seen nearly edge-on."""

TAPS = 3
"""Places a side of a block's rectangle under which pages are looked for."""

OPEN, LIT, DARK = 0, 1, 2
"""What is known of a block: nothing, all pixels are lit, all pixels are dark."""


class Blocks(NamedTuple):
    """An eye's image in blocks, whatever the light; see `blocks_of`.

    Attributes:
        samples: the surface points of each sample, block by block and row by row in each, images
            filled up to whole blocks with points that are not valid.
        corners: (3, 4 * blocks) of the blocks' quadrilaterals, corner by corner; not valid where a
            block is not planar.
        off: (blocks,) how far pixels may lie from their block's quadrilateral, scene units.
        seen: (blocks,) whether a pixel of the block is valid in any sample.
        size: (height, width) of the image.
    """

    samples: tuple[SurfacePoints, ...]
    corners: SurfacePoints
    off: Float[Array, " blocks"]
    seen: np.ndarray
    size: tuple[int, int]

    @property
    def count(self) -> int:
        return self.seen.size


def blocks_of(*eyes: EyeBuffer) -> Blocks:
    """The blocks of an image; more `eyes` are further samples of the same pixels.

    Raises:
        UseError: no eyes, eyes of different cameras, or points that lie outside their pixels.
    """
    require(len(eyes) > 0, "no eye was given; allowed: one or more samples of one camera's image.")
    camera, size = eyes[0].camera, eyes[0].size
    require(
        all(eye.size == size and eqx.tree_equal(eye.camera, camera) for eye in eyes),
        "the eyes have different cameras; allowed: samples of one camera's image.",
    )
    samples = tuple(_in_blocks(eye) for eye in eyes)
    first = np.asarray(samples[0].prim).reshape(-1, SIDE * SIDE)
    own = first[:, 0]
    planar = own >= 0
    seen = np.zeros(own.size, bool)
    for sample in samples:
        prim = np.asarray(sample.prim).reshape(first.shape)
        planar &= (prim == own[:, None]).all(axis=1)
        seen |= np.asarray(sample.valid).reshape(first.shape).any(axis=1)
    which = np.flatnonzero(planar)
    corners, good, off = _corners(camera, eyes, samples, which)
    planar[which[~good]] = False
    normal = np.asarray(samples[0].normal)[:, :: SIDE * SIDE]
    dtype = samples[0].position.dtype
    everywhere = np.zeros((3, 4, own.size))
    everywhere[:, :, which] = np.where(good, corners, 0.0)
    reach = np.zeros(own.size)
    reach[which] = np.where(good, off, 0.0)
    return Blocks(
        samples,
        SurfacePoints(
            position=jnp.asarray(everywhere.reshape(3, -1), dtype),
            normal=jnp.asarray(np.tile(normal, 4)),
            prim=jnp.asarray(np.tile(own, 4)),
            valid=jnp.asarray(np.tile(planar, 4)),
            origin=camera.origin,
        ),
        jnp.asarray(reach, dtype),
        seen,
        size,
    )


def visibility_by_blocks(
    algorithm: AdaptiveShadowMap, state: AdaptiveState, blocks: Blocks
) -> np.ndarray:
    """Visibility (samples, n) of all pixels, as `algorithm.visibility` finds it; 0 where not valid.

    Raises:
        UseError: `update` has taken the state over.
    """
    known = np.asarray(decided(algorithm, state, blocks))
    left = np.flatnonzero((known == OPEN) & blocks.seen).astype(np.int32)
    # Whole eighths of the image, so that few shapes are ever traced.
    step = -(-blocks.count // SEEN_STEPS)
    padded = np.zeros(min(step * -(-left.size // step), blocks.count), np.int32)
    padded[: left.size] = left
    result = []
    for points in blocks.samples:
        image = np.zeros((blocks.count, SIDE * SIDE), points.position.dtype)
        image[known == LIT] = 1
        if left.size and padded.size == blocks.count:
            lit = np.asarray(algorithm.visibility(state, points)).reshape(image.shape)
            image[left] = lit[left]
        elif left.size:
            lit = algorithm.visibility(state, _chosen(points, padded))
            image[left] = np.asarray(lit).reshape(-1, SIDE * SIDE)[: left.size]
        result.append(_by_rows(image, blocks.size))
    return np.stack(result)


def decided(
    algorithm: AdaptiveShadowMap, state: AdaptiveState, blocks: Blocks
) -> Int8[Array, " blocks"]:
    """What is known of each block: `LIT`, `DARK` or `OPEN`."""
    corners, frame = blocks.corners, state.frame
    return _decided(
        state.pyramid(), state.tree.entries, corners, blocks.off, frame,
        light_offset(corners, frame), anchor(corners, frame), algorithm.bias,
        shape=state.shape, depths=state.tree.depth is not None, ids=state.tree.prim is not None,
    )  # fmt: skip


def _chosen(points: SurfacePoints, index) -> SurfacePoints:
    """The points of some blocks."""
    arrays = points.position, points.normal, points.prim, points.valid
    # The origin stays out of it: it is float64, whatever JAX's precision.
    return SurfacePoints(*_rows(arrays, index), origin=points.origin)


@jax.jit
def _rows(arrays, index):
    """Whole rows are copied, which is quick."""

    def taken(a):
        return take(a.reshape(-1, SIDE * SIDE), index).reshape(-1)

    return [jnp.stack([taken(x) for x in a]) if a.ndim == 2 else taken(a) for a in arrays]


def _padded_size(size: tuple[int, int]) -> tuple[int, int]:
    return -(-size[0] // SIDE) * SIDE, -(-size[1] // SIDE) * SIDE


def _in_blocks(eye: EyeBuffer) -> SurfacePoints:
    height, width = _padded_size(eye.size)
    missing = height - eye.size[0], width - eye.size[1]

    def in_blocks(a, fill=0):
        a = np.asarray(a)
        lead = a.shape[:-1]
        a = a.reshape(*lead, *eye.size)
        if any(missing):
            beside = [(0, 0)] * len(lead) + [(0, missing[0]), (0, missing[1])]
            a = np.pad(a, beside, constant_values=fill)
        a = a.reshape(*lead, height // SIDE, SIDE, width // SIDE, SIDE)
        return jnp.asarray(a.swapaxes(-3, -2).reshape(*lead, -1))

    points = eye.points
    return SurfacePoints(
        position=in_blocks(points.position),
        normal=in_blocks(points.normal),
        prim=in_blocks(points.prim, -1),
        valid=in_blocks(points.valid),
        origin=points.origin,
    )


def _by_rows(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    height, width = _padded_size(size)
    image = image.reshape(height // SIDE, width // SIDE, SIDE, SIDE).swapaxes(1, 2)
    return image.reshape(height, width)[: size[0], : size[1]].reshape(-1)


def _corners(camera: Camera, eyes: Sequence[EyeBuffer], samples, which: np.ndarray):
    """Corners (3, 4, k) of the quadrilaterals of the blocks `which` (k,) relative to the camera's
    origin, whether each is sound (k,), and how far at most the block's points are off it (k,).

    Through a pinhole the pixels of a plane lie within the quadrilateral of the rays around them.
    """
    wide = _padded_size(eyes[0].size)[1] // SIDE
    row, column = (SIDE * a for a in np.divmod(which, wide))
    # Where in their pixels the samples lie: first and last column and row of each block.
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    first = None
    for eye in eyes:
        for step in (0, SIDE - 1):
            pixel = (row + step) * eye.size[1] + column + step
            relative = eye.world[:, pixel] - camera.origin[:, None]
            first = (relative, eye.normal[:, pixel]) if first is None else first
            x, y, z = camera.rotation @ relative
            at = np.stack([x / z, y / z]) * camera.focal[:, None] + camera.principal[:, None]
            at -= np.stack([column, row]) + step
            if at.size:
                require(
                    bool((at > -1e-3).all() and (at < 1 + 1e-3).all()),
                    "points lie outside their pixels; allowed: the image of the eye's own camera, "
                    "row by row, samples at most half a pixel from the centres.",
                )
            low = np.minimum(low, at.min(axis=1, initial=np.inf))
            high = np.maximum(high, at.max(axis=1, initial=-np.inf))
    assert first is not None
    (start, normal) = first
    columns = column + np.array([low[0], high[0] + SIDE - 1])[:, None]
    rows = row + np.array([low[1], high[1] + SIDE - 1])[:, None]
    rays = np.stack(
        [camera.directions(columns[i], rows[j]) for j in (0, 1) for i in (0, 1)], axis=1
    )
    height = (normal * start).sum(axis=0)
    slant = (normal[:, None] * rays).sum(axis=0)
    depth = camera.rotation[2] @ start
    sound = (np.abs(slant) > 1e-9).all(axis=0)
    t = height / np.where(sound, slant, 1.0)
    sound &= ((t > 0) & (t < FARTHEST_CORNER * depth)).all(axis=0)
    # Off the plane by so much, along the ray by that much more.
    above = np.zeros(which.size)
    for sample in samples:
        position = np.asarray(sample.position).reshape(3, -1, SIDE * SIDE)[:, which]
        dtype = position.dtype
        along = sum(n[:, None].astype(dtype) * p for n, p in zip(normal, position, strict=True))
        above = np.maximum(above, np.abs(along - height[:, None].astype(dtype)).max(axis=1))
    length = np.sqrt((rays**2).sum(axis=0)).max(axis=0)
    off = above * length / np.where(sound, np.abs(slant).min(axis=0), 1.0)
    return t * rays, sound, off


@partial(jax.jit, static_argnames=("shape", "depths", "ids"))
def _decided(
    pyramid: Pyramid, entries, corners: SurfacePoints, off, frame, offset, anchor, bias,
    *, shape: TreeShape, depths: bool, ids: bool,
):  # fmt: skip
    receivers = project(corners, frame, offset)
    address = address_of(corners, anchor, receivers, frame.perspective)
    prim = pack_prim(_four(corners.prim)[0])
    planar = _four(corners.valid)[0]
    # Positions are relative to the eye; relative to the light they are rounded once more.
    near_eye = off + ROUNDINGS * jnp.finfo(off.dtype).eps * _most(_four(_size(corners.position)))
    error = near_eye + ROUNDINGS * jnp.finfo(off.dtype).eps * _size(offset)
    back, faces = _facing(corners, receivers, error, frame, offset)
    low, high, face, inside = _rectangle(receivers, address.at, near_eye, frame)
    usable = planar & faces & inside
    pages, levels, covered = _pages_over(shape, pyramid, entries, face, low, high, usable)
    usable &= covered
    least = _some(take(pyramid.least, pages), jnp.minimum)
    most = _some(take(pyramid.most, pages), jnp.maximum)
    lit = usable & (least == prim) & (most == prim) if ids else jnp.zeros_like(usable)
    dark = usable
    if ids:
        dark &= (prim < least) | (prim > most)
    if depths:
        level = _some(levels, jnp.minimum)
        farthest = _some(take(pyramid.farthest, pages), jnp.maximum)
        dark &= farthest < _nearest_compared(
            shape, receivers, address.at, low, high, level, error, bias, frame.perspective
        )
    state = jnp.where(lit, LIT, jnp.where(dark | (planar & back), DARK, OPEN))
    return state.astype(jnp.int8)


def _four(a):
    """The four corners of all blocks, (..., 4 * blocks): (blocks,) each, or rows of them."""
    return [a.reshape(*a.shape[:-1], 4, -1)[..., k, :] for k in range(4)]


def _size(vectors):
    x, y, z = vectors
    return jnp.abs(x) + jnp.abs(y) + jnp.abs(z)


def _some(rows, extreme):
    # Written out: a reduction over the first axis takes XLA's CPU backend seven times as long.
    return functools.reduce(extreme, list(rows))


def _least(four):
    return _some(four, jnp.minimum)


def _most(four):
    return _some(four, jnp.maximum)


def _facing(corners: SurfacePoints, receivers: Receivers, error, frame, offset):
    """Which blocks turn their back on the light at every point, and which face it and lie in its
    domain at every point, where computed points may be off by `error`.

    The light's side of a plane is the same everywhere on it, the cosine is smallest and the depth
    is an extreme at a corner, and a cone is convex: so are all conditions that hold at the corners.
    """
    position, normal = corners.position, corners.normal
    dtype = position.dtype
    world = position + jnp.asarray(offset, dtype)[:, None]
    depth = _least(_four(receivers.depth))
    faces = depth - 4 * error > jnp.maximum(jnp.asarray(frame.near, dtype), LEAST_DEPTH)
    steep = STEEPEST * jnp.ones_like(depth)
    if frame.perspective:
        back = _least(_four(dot(normal, world))) > 4 * error
        steep += 4 * error / depth
        # A wider cone than a half space is not convex: its front half is.
        cosine = jnp.maximum(jnp.asarray(frame.cos_cutoff, dtype), 0)
        axis = jnp.asarray(frame.cone_axis, dtype)
        within = dot(axis, world) - cosine * jnp.sqrt(dot(world, world))
        faces &= (frame.cos_cutoff <= -1) | (_least(_four(within)) > 4 * error)
    else:
        axis = jnp.asarray(frame.rotation, dtype)[0, 2]
        back = _least(_four(dot(normal, axis))) > STEEPEST
    faces &= 1 / _most(_four(receivers.secant)) > steep
    for k in range(4):
        faces &= _four(receivers.facing)[k]
        faces &= _four(receivers.face)[k] == _four(receivers.face)[0]
    return back, faces


def _rectangle(receivers: Receivers, at, error, frame):
    """Lowest and highest fixed-point coordinates (2, blocks) of the blocks in the light's image,
    their face (blocks,), and whether the rectangle lies within the image.

    A plane is projected to a plane: the quadrilateral stays one, and lies between its corners.
    """
    dtype = error.dtype
    face = _four(receivers.face)[0]
    corner, extent = jnp.asarray(frame.corner, dtype), jnp.asarray(frame.extent, dtype)
    widen = error / jnp.min(extent)
    if frame.perspective:
        # A step of `error` in x or in depth, seen from the nearest corner.
        slope = jnp.max(jnp.abs(corner) + extent)
        widen = 4 * widen * (1 + slope) / _least(_four(receivers.depth))
    beside = jnp.clip(jnp.ceil(widen * 2.0**BITS), 0, 2.0**28).astype(jnp.int32) + 2
    low, high = _least(_four(at)) - beside, _most(_four(at)) + beside
    inside = (low[0] > 0) & (low[1] > 0) & (high[0] < 1 << BITS) & (high[1] < 1 << BITS)
    limit = (1 << BITS) - 1
    return jnp.clip(low, 0, limit), jnp.clip(high, 0, limit), face, inside


def _pages_over(shape: TreeShape, pyramid: Pyramid, entries, face, low, high, usable):
    """Pages whose squares cover the rectangles (2, blocks) from `low` to `high`, `TAPS` x `TAPS` of
    them, (taps, blocks), their levels, and whether there are such pages.

    The deepest page over each of a grid of points, the rectangle's corners among them, or the
    nearest page above it whose side is not below the points' distance. Then no gap is left: squares
    of a tree are aligned to multiples of their sides, which are powers of two. Take the grid of
    the smallest side among those found. A cell of it that meets the rectangle holds one of the
    points, for the next one is not further than its side; the square over that point is this cell,
    or a larger one that the cell lies in. Every page that serves a pixel of a square is that
    square's, or below it: its bounds hold.
    """
    step = -(-(high - low) // (TAPS - 1))
    apart = jnp.where(usable, jnp.maximum(*step), 0)
    x, y = ([jnp.minimum(low[k] + i * step[k], high[k]) for i in range(TAPS)] for k in (0, 1))
    at = jnp.stack([jnp.concatenate(x * TAPS), jnp.concatenate([b for b in y for _ in x])])
    entry = find_entries(shape, entries, jnp.tile(face, TAPS**2), at)
    wanted = jnp.tile(apart, TAPS**2)

    def too_small(entry):
        return (1 << (BITS - shape.log2_nodes_at(level_of(entry)))) < wanted

    def climb(state):
        entry, above, rising = state
        entry = jnp.where(rising, above, entry)
        above = take(pyramid.above, page_of(entry))
        return entry, above, too_small(entry) & (above >= 0)

    entry, _, _ = jax.lax.while_loop(
        lambda state: jnp.any(state[2]), climb, climb((entry, entry, jnp.zeros_like(entry, bool)))
    )
    rows = (TAPS**2, -1)
    covered = ~_some(too_small(entry).reshape(rows), jnp.logical_or)
    return page_of(entry).reshape(rows), level_of(entry).reshape(rows), covered


def _nearest_compared(
    shape: TreeShape, receivers: Receivers, at, low, high, level, error, bias, perspective
):
    """A depth below all that the texels under a block are compared with, tolerances included.

    Planes are compared at texel centres, which lie within half a texel of the pixels, by pages of
    `level` or finer: 1 / depth, or the depth under parallel light, is linear there, so its extreme
    is at a corner of the rectangle grown by that half. Where the plane is not trusted the pixel's
    own depth counts, which is an extreme at no other place.
    """
    dtype = error.dtype
    log2 = shape.log2_resolution(level)
    half = 1 << (BITS - 1 - log2)
    depth, slope = _four(receivers.depth)[0], _four(receivers.slope)[0]
    here = _four(at)[0]
    left, right = (
        ((edge - here + sign * half).astype(dtype)) * 2.0**-BITS
        for edge, sign in ((low, -1), (high, 1))
    )
    sides = [jnp.minimum(s * a, s * b) if not perspective else jnp.maximum(s * a, s * b)
             for s, a, b in zip(slope, left, right, strict=True)]  # fmt: skip
    along = sides[0] + sides[1]
    nearest = depth / (1 + along) if perspective else depth + along
    secant = _most(_four(receivers.secant))
    farthest, reach = _most(_four(receivers.depth)), _most(_four(receivers.reach))
    texel = jnp.exp2(-log2.astype(dtype))
    tolerance = secant * (bias * farthest + CURVATURE_BIAS * texel * reach + 4 * error)
    # What rounding makes of a slope, and of the tolerance itself.
    rounding = 8 * ROUNDINGS * jnp.finfo(dtype).eps * secant * (jnp.abs(nearest) + farthest)
    return nearest - tolerance * (1 + 1e-5) - rounding
