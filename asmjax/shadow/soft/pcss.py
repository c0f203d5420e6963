"""Percentage-closer soft shadows: a filter as wide as the penumbra that the blockers would cast."""

from dataclasses import KW_ONLY
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import SurfacePoints, light_offset, project
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.numerics import scalar
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.soft.light_taps import horizon, scale_at, seen, shift_at, taps_of
from asmjax.shadow.soft.wide_map import (
    WideShadowMap,
    WideState,
    WideTexels,
    search_depth,
    tapped,
)

MOST_TAPS = 2**12
"""Taps of a search or a filter, at most."""


class PCSSShadowMap(WideShadowMap):
    """Fernando 2005: a flat map, asked three times for each receiver.

    1. Where rays to the light pass at the depth of the nearest caster, texels are looked for that
       shade the receiver and stand before the light at their own depth; d_b is the mean of these.
    2. w = w_light (d_r - d_b) / d_b is the penumbra.
    3. Visibility is the lit share of the texels where rays to the light pass at the depth d_b: of a
       light parallel to the map, a filter of width w.

    Every tap is tested by its own texel's centre, so planes shade themselves nowhere, however wide
    the search is. Taps are the same for all receivers: no noise, and a penumbra has as many steps
    as taps. Exact where all blockers have one depth; of several the mean is taken, so that a
    penumbra is too wide below the near and too narrow below the far ones.

    Attributes:
        resolution: texels a side.
        blocker_taps: texels that are asked in the search.
        filter_taps: texels that are averaged.
        compare: what is stored and compared: "depth", "id", or "both".
        bias: relative depth bias of the comparison.
        keep: whether `update` keeps the map while light and casters rest.
    """

    resolution: int = 1024
    _: KW_ONLY
    blocker_taps: int = 32
    filter_taps: int = 64
    compare: Compare = "depth"
    bias: float = BIAS
    keep: bool = False

    family: ClassVar[str] = "pcss"
    reference: ClassVar[str] = "Fernando 2005, Percentage-Closer Soft Shadows"

    def __check_init__(self):
        self._check()
        for name, taps in (("blocker", self.blocker_taps), ("filter", self.filter_taps)):
            require(
                1 <= taps <= MOST_TAPS,
                f"{taps} {name} taps are not possible; allowed: 1 to {MOST_TAPS}.",
            )

    @property
    def name(self) -> str:
        return self._named(f"-{self.blocker_taps}+{self.filter_taps}")

    def is_uniform(self, frame: LightFrame) -> bool:
        return frame.area is None

    def filter_texels(self, frame: LightFrame) -> float:
        return 1.0

    def sums_of(self, depth: np.ndarray) -> None:
        """Nothing."""

    def visibility(self, state: WideState, points: SurfacePoints) -> Float[Array, " n"]:
        frame = state.flat.frame
        if frame.area is None:
            return self.uniform.visibility(state.flat, points)
        taps = tuple(taps_of(frame.area, k).T for k in (self.blocker_taps, self.filter_taps))
        return _visibility(
            self.texels(state), points, light_offset(points, frame), taps,
            self.resolution, scalar(self.bias), self.compare != "id",
        )  # fmt: skip


@eqx.filter_jit
def _visibility(
    texels: WideTexels, points, offset, taps, resolution: int, bias, by_depth: bool
):  # fmt: skip
    receivers = project(points, texels.frame, offset)
    dtype = points.position.dtype
    blocker_taps, filter_taps = (jnp.asarray(table, dtype) for table in taps)
    assert texels.frame.area is not None
    light = seen(texels.frame, texels.frame.area, receivers)
    none = jnp.zeros_like(receivers.depth)

    def ask(shift, tap):
        return tapped(texels, receivers, shift.at(*tap), resolution, bias, by_depth)

    frame, rectangle = texels.frame, texels.frame.area.shape == "rectangle"
    search = shift_at(light, frame, receivers, search_depth(texels, light, receivers, resolution))

    def look(carry, tap):
        count, total = carry
        found = ask(search, tap)
        # What is farther than the receiver is not on its way to the light, whatever an id says; nor
        # is what stands aside of the light as the receiver sees it at that depth.
        reach = jnp.maximum(*jnp.abs(tap)) if rectangle else jnp.hypot(*tap)
        seen_at = jnp.abs(scale_at(light, frame, found.depth))
        blocks = ~found.lit & (found.depth < receivers.depth)
        blocks &= jnp.abs(search.scale) * reach <= seen_at
        total = total + jnp.where(blocks, found.depth, 0)
        return (count + blocks.astype(dtype), total), None

    (count, total), _ = jax.lax.scan(look, (none, none), blocker_taps)
    blocked = count > 0
    blocker = jnp.where(blocked, total / jnp.where(blocked, count, 1), receivers.depth)
    filtered = shift_at(light, frame, receivers, blocker)

    heights = horizon(light, frame, receivers)

    def pass_through(lit, tap):
        passes = heights.above(*tap) & (ask(filtered, tap).lit | ~blocked)
        return lit + passes.astype(dtype), None

    lit, _ = jax.lax.scan(pass_through, none, filter_taps)
    lit = lit / filter_taps.shape[0]
    return jnp.where(receivers.facing, lit, 0)
