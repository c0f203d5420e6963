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
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Int8

from asmjax.buffers import Receivers, SurfacePoints, anchor, light_offset, project
from asmjax.buffers.points import SEEN_STEPS
from asmjax.numerics import dot, least_depth
from asmjax.shadow.adaptive.address import BITS, address_of
from asmjax.shadow.adaptive.asm import AdaptiveShadowMap
from asmjax.shadow.adaptive.bounds import Bounds
from asmjax.shadow.adaptive.page_table import find_entries, level_of, page_of, take
from asmjax.shadow.adaptive.planar_blocks import SIDE, Blocks
from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.state import AdaptiveState
from asmjax.shadow.comparison import CURVATURE_BIAS, pack_prim

ROUNDINGS = 16
"""Roundings of a position's size by which it may be off in the kernels; some four are found."""

STEEPEST = 1e-3
"""Blocks of a smaller cosine between normal and light ray are left to the pixels."""

PLACES = 3
"""Points a side of a block's rectangle at which pages are looked up."""

OPEN, LIT, DARK = 0, 1, 2
"""What is known of a block: nothing, all pixels are lit, all pixels are dark."""


def visibility_by_blocks(
    algorithm: AdaptiveShadowMap, state: AdaptiveState, blocks: Blocks
) -> np.ndarray:
    """Visibility (samples, n) of all pixels as `algorithm.visibility` finds it; 0 where not valid.

    Raises:
        UseError: `update` has taken the state over.
    """
    known = np.asarray(decided(algorithm, state, blocks)).reshape(blocks.planar.shape)
    if not known.any():
        return np.stack([s.image(algorithm.visibility(state, s.points)) for s in blocks.seen])
    rows, columns = blocks.planar.shape
    image = np.full(blocks.eyes[0].size, OPEN, np.int8)
    image[: SIDE * rows, : SIDE * columns] = np.repeat(np.repeat(known, SIDE, 0), SIDE, 1)
    known = image.reshape(-1)
    step, is_open = -(-known.size // SEEN_STEPS), known == OPEN
    lit = (known == LIT).astype(blocks.corners.position.dtype)
    result = np.empty((len(blocks.eyes), known.size), lit.dtype)
    for eye, seen, visibility in zip(blocks.eyes, blocks.seen, result, strict=True):
        left = np.flatnonzero(is_open & eye.valid).astype(np.int32)
        # Whole eighths of the image, as those of `seen`, so that no new shapes are traced.
        padded = step * -(-left.size // step)
        if padded >= seen.points.count:
            visibility[:] = seen.image(algorithm.visibility(state, seen.points))
            continue
        visibility[:] = lit
        if left.size:
            index = np.zeros(padded, np.int32)
            index[: left.size] = left
            found = algorithm.visibility(state, _chosen(eye.points, index))
            visibility[left] = np.asarray(found)[: left.size]
    return result


def decided(
    algorithm: AdaptiveShadowMap, state: AdaptiveState, blocks: Blocks
) -> np.ndarray | Int8[Array, " blocks"]:
    """What is known of each block: `LIT`, `DARK` or `OPEN`."""
    state.check_owned()
    if blocks.planar.sum() * SIDE**2 * SEEN_STEPS < blocks.eyes[0].valid.sum():
        # So few spare no step of the pixels that are left.
        return np.full(blocks.planar.size, OPEN, np.int8)
    corners, frame = blocks.corners, state.frame
    offset = light_offset(corners, frame), corners.origin - frame.origin
    # Two calls: as one, XLA computes the addresses once for each of their uses.
    facing = _facing(corners, blocks.off, frame, offset, anchor(corners, frame))
    return _verdict(
        state.pyramid(), state.tree.entries, corners.prim, facing, algorithm.bias,
        shape=state.shape, perspective=frame.perspective,
    )  # fmt: skip


def _chosen(points: SurfacePoints, index) -> SurfacePoints:
    arrays = points.position, points.normal, points.prim, points.valid
    # The origin stays out of it: it is float64, whatever JAX's precision.
    return SurfacePoints(*_taken(arrays, index), origin=points.origin)


@jax.jit
def _taken(arrays, index):
    return [jnp.stack([take(x, index) for x in a]) if a.ndim == 2 else take(a, index)
            for a in arrays]  # fmt: skip


class _Facing(NamedTuple):
    """Blocks in a light's image: four corners and what bounds all points between them.

    Attributes:
        depth, slope, secant, reach: as in `Receivers`, per corner.
        at: (2, 4 * blocks) fixed-point coordinates of the corners.
        face: (blocks,).
        low, high: (2, blocks) lowest and highest fixed-point coordinates.
        error: (blocks,) scene units by which computed points may be off.
        usable: (blocks,) whether every point faces the light, in its domain and on one face.
        back: (blocks,) whether every point turns its back on the light.
    """

    depth: Float[Array, " corners"]
    slope: Float[Array, "2 corners"]
    secant: Float[Array, " corners"]
    reach: Float[Array, " corners"]
    at: Int[Array, "2 corners"]
    face: Int[Array, " blocks"]
    low: Int[Array, "2 blocks"]
    high: Int[Array, "2 blocks"]
    error: Float[Array, " blocks"]
    usable: Bool[Array, " blocks"]
    back: Bool[Array, " blocks"]


@jax.jit
def _facing(corners: SurfacePoints, off, frame, offset, anchor) -> _Facing:
    from_faces, offset = offset
    receivers = project(corners, frame, from_faces)
    at = address_of(corners, anchor, receivers, frame.perspective).at
    planar = _four(corners.valid)[0]
    # Positions are relative to the eye; relative to the light they are rounded once more.
    eps = jnp.finfo(off.dtype).eps
    near_eye = off + ROUNDINGS * eps * _most(_four(_size(corners.position)))
    error = near_eye + ROUNDINGS * eps * _size(jnp.asarray(offset, off.dtype))
    back, faces = _sides(corners, receivers, error, frame, offset)
    low, high, inside = _rectangle(receivers, at, near_eye, frame)
    return _Facing(
        receivers.depth, receivers.slope, receivers.secant, receivers.reach, at,
        _four(receivers.face)[0], low, high, error, planar & faces & inside, planar & back,
    )  # fmt: skip


@partial(jax.jit, static_argnames=("shape", "perspective"))
def _verdict(
    pyramid: Bounds, entries, prim, blocks: _Facing, bias,
    *, shape: TreeShape, perspective: bool,
):  # fmt: skip
    pages, levels, covered = _pages_over(shape, entries, blocks.face, blocks.low, blocks.high)
    usable = blocks.usable & covered
    own = pack_prim(_four(prim)[0])
    lit, dark = jnp.zeros_like(usable), usable
    if pyramid.least is not None and pyramid.most is not None:
        least = _some(take(pyramid.least, pages), jnp.minimum)
        most = _some(take(pyramid.most, pages), jnp.maximum)
        lit = usable & (least == own) & (most == own)
        dark &= (own < least) | (own > most)
    if pyramid.farthest is not None:
        farthest = _some(take(pyramid.farthest, pages), jnp.maximum)
        coarsest = _some(levels, jnp.minimum)
        dark &= farthest < _nearest_compared(shape, blocks, coarsest, bias, perspective)
    known = jnp.where(lit, LIT, jnp.where(dark | blocks.back, DARK, OPEN))
    return known.astype(jnp.int8)


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


def _sides(corners: SurfacePoints, receivers: Receivers, error, frame, offset):
    """Which blocks turn their back on the light at every point, and which face it and lie in its
    domain at every point, where computed points may be off by `error`.

    The light's side of a plane is the same everywhere on it, the cosine is smallest and the depth
    is an extreme at a corner, and a cone is convex: so are all conditions that hold at the corners.
    """
    position, normal = corners.position, corners.normal
    dtype = position.dtype
    world = position + jnp.asarray(offset, dtype)[:, None]
    depth = _least(_four(receivers.depth))
    faces = depth - 4 * error > jnp.maximum(jnp.asarray(frame.near, dtype), least_depth(dtype))
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
    and whether the rectangle lies within it.

    A plane is projected to a plane: the quadrilateral stays one, and lies between its corners.
    """
    dtype = error.dtype
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
    return jnp.clip(low, 0, limit), jnp.clip(high, 0, limit), inside


def _pages_over(shape: TreeShape, entries, face, low, high):
    """Pages whose squares cover rectangles of `face` (blocks,) from `low` to `high` (2, blocks),
    and their levels: (places, blocks); and whether they do cover them.

    They are the deepest pages over `PLACES` x `PLACES` evenly spread points of a rectangle, its
    corners among them. Where no side of theirs is below the points' distance, no gap is left:
    squares of a tree are aligned to multiples of their sides, which are powers of two. Take the
    grid of the smallest side among them. A cell of it that meets the rectangle holds one of the
    points, as the next one is not further than its side; the square over that point is this cell,
    or a larger one that the cell lies in. A page that serves a pixel of a square is that square's,
    or below it: the bounds of its subtree hold.
    """
    step = -(-(high - low) // (PLACES - 1))
    x, y = ([jnp.minimum(low[k] + i * step[k], high[k]) for i in range(PLACES)] for k in (0, 1))
    at = jnp.concatenate(x * PLACES), jnp.concatenate([b for b in y for _ in x])
    entry = find_entries(shape, entries, jnp.tile(face, PLACES**2), at)
    entry = entry.reshape(PLACES**2, -1)
    levels = level_of(entry)
    deepest = _some(levels, jnp.maximum)
    covered = (1 << (BITS - shape.log2_nodes_at(deepest))) >= jnp.maximum(*step)
    return page_of(entry), levels, covered


def _nearest_compared(shape: TreeShape, blocks: _Facing, level, bias, perspective: bool):
    """A depth below all that the texels under a block are compared with, tolerances included.

    Planes are compared at texel centres, which lie within half a texel of the pixels, by pages of
    `level` or finer: 1 / depth, or the depth under parallel light, is linear there, so its extreme
    is at a corner of the rectangle grown by that half. Where the plane is not trusted the pixel's
    own depth counts, which lies between those extremes.
    """
    dtype = blocks.depth.dtype
    log2 = shape.log2_resolution(level)
    half = 1 << (BITS - 1 - log2)
    here, depth, slope = (_four(a)[0] for a in (blocks.at, blocks.depth, blocks.slope))
    before = (blocks.low - here - half).astype(dtype) * 2.0**-BITS
    after = (blocks.high - here + half).astype(dtype) * 2.0**-BITS
    extreme = jnp.maximum if perspective else jnp.minimum
    along = sum(extreme(slope[k] * before[k], slope[k] * after[k]) for k in (0, 1))
    nearest = depth / (1 + along) if perspective else depth + along
    secant, farthest, reach = (_most(_four(a)) for a in (blocks.secant, blocks.depth, blocks.reach))
    texel = jnp.exp2(-log2.astype(dtype))
    tolerance = bias * farthest + CURVATURE_BIAS * texel * reach + 4 * blocks.error
    # What rounding makes of a slope.
    rounding = 8 * ROUNDINGS * jnp.finfo(dtype).eps * (jnp.abs(nearest) + farthest)
    return nearest - secant * (tolerance * (1 + 1e-5) + rounding)
