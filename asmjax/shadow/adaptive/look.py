"""Looking at receivers: which page serves each, how fine it is, and whether more would help."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial, reduce
from operator import or_
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers import EyeBuffer, Receivers, SurfacePoints, anchor, light_offset, project
from asmjax.footprint import (
    log2_linear_ratio,
    log2_m,
    log2_mipmap_ratio,
    required_level,
    straddles_discontinuity,
    uv_jacobian,
)
from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.address import (
    BITS,
    Address,
    address_of,
    centre_offset,
    index_at,
)
from asmjax.shadow.adaptive.page_table import level_of
from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.tree import Tree, page_outcome, serve
from asmjax.shadow.comparison import plane_is_trusted

COARSE = 4.0
"""Texel / pixel size, over the matched one, that coarse coverage is content with."""

PARTS = (128, 16, 4)
"""Parts of the receivers that a look at some of them is padded to, so that nothing retraces: the
first that holds them, or all."""

LEAST = 1024
"""Receivers that a look is worth preparing for."""

Goals = tuple[float, float, float, float | None]
"""Arguments of `analyse` that settings decide, in its order: log2_target to apart."""


def _axis(points, camera, frame, receivers):
    return log2_m(uv_jacobian(points, camera, frame, receivers), 1)


def _area(points, camera, frame, receivers):
    return log2_linear_ratio(uv_jacobian(points, camera, frame, receivers), 1)


Measure = Literal["axis", "area", "mipmap", "mipmap_anisotropic"]

MEASURES: dict[Measure, Callable[..., Array]] = {
    "axis": _axis,
    "area": _area,
    "mipmap": log2_mipmap_ratio,
    "mipmap_anisotropic": partial(log2_mipmap_ratio, max_anisotropy=2.0),
}
"""What the size of a texel beside a pixel means: functions of points, camera, frame and receivers
that give log2 of it for one texel per face side, (n,)."""


class Audience(eqx.Module):
    """Receivers that are looked at, on the device.

    Attributes:
        receivers, address: (n,) of them.
        log2_ratio: (n,) log2 of texel / pixel size for one texel per face side.
        weight: eye pixels that each of them stands for.
    """

    receivers: Receivers
    address: Address
    log2_ratio: Float[Array, " n"]
    weight: int = eqx.field(static=True)

    @property
    def count(self) -> int:
        return self.receivers.facing.shape[0]

    def picked(self, who: Int[np.ndarray, " k"]) -> "Audience":
        """The receivers of the given numbers, filled up with ones that face no light; all where
        there are many, see `PARTS`."""
        size = padded_size(self.count, who.size)
        if size == self.count:
            return self
        padded = np.zeros(size, np.int32)
        padded[: who.size] = who
        return _picked(self, padded, who.size)


def padded_size(count: int, chosen: int) -> int:
    """How many receivers a look at `chosen` ones out of `count` takes."""
    return next(size for size in _sizes_of(count) if size >= chosen)


def _sizes_of(count: int) -> tuple[int, ...]:
    return *(-(-count // part) for part in PARTS if count >= part * LEAST), count


@jax.jit
def _picked(audience: Audience, index, count) -> Audience:
    chosen = jax.tree.map(lambda a: a[..., index], audience)
    real = jnp.arange(index.size) < count
    facing = chosen.receivers.facing & real
    return replace(chosen, receivers=replace(chosen.receivers, facing=facing))


def audience_of(
    view: EyeBuffer, frame: LightFrame, measure: str, share: int = 1, turn: int = 0
) -> Audience:
    """The receivers of a view, or of one pixel in `share` of it: all are seen in `share` turns."""
    return _audience(*_arguments(view, frame, share, turn), measure=measure, weight=share)


def first_look(
    tree: Tree,
    view: EyeBuffer,
    frame: LightFrame,
    goals: Goals,
    *,
    shape: TreeShape,
    measure: str,
    share: int,
    turn: int,
) -> "tuple[Audience, Analysis]":
    """`audience_of` and `analyse`.

    Two programs: as one, XLA's CPU backend forms the receivers anew for each of the taps.
    """
    audience = audience_of(view, frame, measure, share, turn)
    perspective = frame.perspective
    return audience, analyse(tree, audience, *goals, shape=shape, perspective=perspective)


def compile_looks(
    tree: Tree,
    view: EyeBuffer,
    frame: LightFrame,
    goals: Goals,
    *,
    shape: TreeShape,
    measure: str,
    share: int,
) -> Audience:
    """Have looks of every size compiled: at all pixels, at some of them again, at one turn's share
    of them whatever part sees a surface, and at those again. Returns all receivers."""
    arguments = _arguments(view, frame, 1, 0)

    def audience(pixels, weight):
        some = (*arguments[:4], pixels, *arguments[5:])
        return _audience(*some, measure=measure, weight=weight)

    everyone = audience(None, 1)
    every = [everyone.picked(np.zeros(size, np.int32)) for size in _sizes_of(everyone.count)]
    if share > 1:
        sizes = _sizes(_pixels(*view.size, share, 0).size)
        every += [audience(np.full(size, -1, np.int32), share) for size in sizes]
    for looking in every:
        analyse(tree, looking, *goals, shape=shape, perspective=frame.perspective)
    return everyone


def _arguments(view: EyeBuffer, frame: LightFrame, share: int, turn: int) -> tuple:
    points = view.points
    pixels = None if share == 1 else _seen_pixels(view, share, turn % share)
    return (
        points.position, points.normal, points.prim, points.valid, pixels,
        view.camera, frame, light_offset(points, frame), anchor(points, frame),
    )  # fmt: skip


def _seen_pixels(view: EyeBuffer, share: int, turn: int) -> np.ndarray:
    """One turn's pixels that see a surface, filled up with -1 to a quarter, half or all of them."""
    pixels = _pixels(*view.size, share, turn)
    seen = pixels[(view.shape[pixels] >= 0) & (pixels >= 0)]
    size = next(size for size in _sizes(pixels.size) if size >= seen.size)
    result = np.full(size, -1, np.int32)
    result[: seen.size] = seen
    return result


def _sizes(count: int) -> tuple[int, ...]:
    """A quarter, a half and all of so many pixels: the sizes of looks at those that see a surface,
    so that few shapes are ever traced."""
    return -(-count // 4), -(-count // 2), count


@lru_cache(maxsize=16)
def _pixels(height: int, width: int, share: int, turn: int) -> np.ndarray:
    """Every `share`-th pixel of each row, three further on in each next one.

    Rows of a width that `share` does not divide have one more now and then; they are filled up
    with -1 to the same number in each turn.
    """
    row, column = np.divmod(np.arange(height * width), width)
    chosen = np.flatnonzero((column + 3 * row + turn) % share == 0)
    result = np.full(height * -(-width // share), -1, np.int32)
    result[: chosen.size] = chosen
    return result


@partial(jax.jit, static_argnames=("measure", "weight"))
def _audience(
    position, normal, prim, valid, pixels, camera, frame, offset, anchor, *, measure, weight
) -> Audience:
    if pixels is not None:
        position, normal, prim = position[:, pixels], normal[:, pixels], prim[pixels]
        valid = valid[pixels] & (pixels >= 0)
    points = SurfacePoints(position, normal, prim, valid, np.zeros(3))
    receivers = project(points, frame, offset)
    address = address_of(points, anchor, receivers, frame.perspective)
    log2_ratio = MEASURES[measure](points, camera, frame, receivers)
    return Audience(receivers, address, log2_ratio, weight)


class Analysis(eqx.Module):
    """What one look at receivers found.

    Attributes:
        entry: (n,) page table entry of the page that serves each receiver now.
        target: (n,) level at which it is matched.
        finest: (n,) deepest level worth having for it.
        coarse: (n,) level at which its texels are `COARSE` times as large.
        straddles: (n,) whether the 2 x 2 texels around it disagree about it, one of them because
            of a caster as far off as counts; or one of them cannot decide.
    """

    entry: Int[Array, " n"]
    target: Int[Array, " n"]
    finest: Int[Array, " n"]
    coarse: Int[Array, " n"]
    straddles: Bool[Array, " n"]


@partial(jax.jit, static_argnames=("shape", "perspective"))
def analyse(
    tree: Tree,
    audience: Audience,
    log2_target: Float[Array, ""] | float,
    log2_finest: Float[Array, ""] | float,
    bias: Float[Array, ""] | float,
    apart: Float[Array, ""] | float | None = None,
    *,
    shape: TreeShape,
    perspective: bool,
) -> Analysis:
    """Serve every receiver, and see whether more texels could change the answer.

    Args:
        log2_target: log2 of the ratio at which a pixel is matched; 0 for texels as small as pixels.
        log2_finest: log2 of the smallest ratio worth having.
        apart: a bias by which one of the texels must shade the receiver for an edge to count.
    """
    receivers, address = audience.receivers, audience.address
    entry = serve(shape, tree, receivers, address)
    log2 = shape.log2_resolution(level_of(entry))
    column, row = index_at(address.x, log2), index_at(address.y, log2)

    def nearer(at):
        # Half a texel in fixed point: its bit says which neighbour is nearest.
        return jnp.where((at >> (BITS - 1 - log2)) & 1 == 1, 1, -1).astype(jnp.int32)

    side_x, side_y = nearer(address.x), nearer(address.y)
    taps, far_off, undecided = [], [], jnp.zeros_like(receivers.facing)
    for dy in (0, 1):
        for dx in (0, 1):
            step = side_x * dx, side_y * dy
            lit = partial(
                page_outcome, shape, tree, receivers, address, entry, step, perspective=perspective
            )
            taps.append(lit(bias=bias))
            if apart is not None:
                far_off.append(~lit(bias=apart))
            offset = centre_offset(address, (column + step[0], row + step[1]), log2)
            undecided |= ~plane_is_trusted(receivers, offset, perspective)
    edge = straddles_discontinuity(taps)
    if apart is not None:
        # Besides, not instead: where a caster comes nearer within its shadow there is no edge.
        edge &= reduce(or_, far_off)
    at_start = audience.log2_ratio - shape.log2_resolution(0)

    def whole_level(log2_goal):
        wanted = required_level(at_start, shape.log2_cells, log2_goal)
        return jnp.clip(jnp.ceil(wanted), 0, shape.levels).astype(jnp.int32)

    return Analysis(
        entry=entry,
        target=whole_level(log2_target),
        finest=whole_level(log2_finest),
        coarse=whole_level(log2_target + math.log2(COARSE)),
        straddles=(edge | undecided) & receivers.facing,
    )
