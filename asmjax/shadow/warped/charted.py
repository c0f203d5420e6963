"""What all maps have in common that store charts: building, queries, costs.

A warped, partitioned or subdivided map differs from its siblings only in the charts that it chooses
for a view; it is then cast through the inverse parameterization, so nothing needs to be drawable by
a rasteriser, and casters that are behind the eye or the warp's centre are no trouble: a ray meets
them like any other.
"""

import abc
import time
from collections.abc import Hashable
from dataclasses import replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt16

from asmjax.buffers import (
    EyeBuffer,
    LightRays,
    SurfacePoints,
    anchor,
    light_offset,
    project,
)
from asmjax.errors import require
from asmjax.geometry import Chart, Charts, LightFrame, laid_out, padded
from asmjax.memory import Memory
from asmjax.numerics import dot, scalar
from asmjax.shadow.base import (
    Cost,
    MapMemory,
    ShadowAlgorithm,
    Status,
    array_bytes,
)
from asmjax.shadow.comparison import BIAS, Compare, check_test, stored, texel_bytes
from asmjax.shadow.warped.around import ChartNeighbourhood
from asmjax.shadow.warped.table import ChartTable, chart_of, place_in, table_of

GRID = 17
"""Places a side of each chart where its texels are measured."""


class Drawn(NamedTuple):
    """What a query reads: texels of all charts, one after the other, each row by row; unused ones
    at the end. `forward` (3,) float64 is the unit vector along which eye depths count."""

    frame: LightFrame
    table: ChartTable
    depth: Float[Array, " texels"] | None
    prim: UInt16[Array, " texels"] | None
    forward: np.ndarray


class Chosen(NamedTuple):
    """The charts for a view, and whether they are what the settings ask for."""

    charts: list[Chart]
    status: Status = Status.COMPLETE


class ChartedState(eqx.Module):
    """A map of charts.

    Attributes:
        eye: (3,) float64, world.
        used: texels that charts cover.
        finest: texels per side of the flat map with the finest texels throughout.
        build, analysis: seconds.
        status: of the choice of charts.
    """

    drawn: Drawn
    eye: np.ndarray
    used: int
    finest: int
    build: float
    analysis: float
    status: Status = eqx.field(static=True, default=Status.COMPLETE)


class ChartedShadowMap(ShadowAlgorithm[ChartedState]):
    """A shadow map of charts, `resolution`^2 texels for each face of the light in all."""

    resolution: eqx.AbstractVar[int]
    compare: eqx.AbstractVar[Compare]
    bias: eqx.AbstractVar[float]
    family: eqx.AbstractClassVar[str]
    """What its names begin with."""

    largest: ClassVar[int] = 2**15

    def _check(self) -> None:
        require(
            1 <= self.resolution <= self.largest,
            f"a map of {self.resolution} texels a side is not possible; allowed: 1 to "
            f"{self.largest}.",
        )
        check_test(self.compare, self.bias)

    @abc.abstractmethod
    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        """The charts for a view, every visible receiver in one at least; the first one counts.
        None where the light reaches nothing that is seen: the map is flat then."""

    def charts(self, view: EyeBuffer, frame: LightFrame) -> list[Chart]:
        """The charts of `chosen` alone."""
        return self.chosen(view, frame).charts

    @abc.abstractmethod
    def most_charts(self, faces: int) -> int:
        """The largest number of charts for a light of so many faces, so that nothing retraces."""

    @property
    def name(self) -> str:
        suffix = "" if self.compare == "depth" else f"-{self.compare}"
        return f"{self.family}-{self.resolution}{suffix}"

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> ChartedState:
        texels = frame.faces * self.resolution**2
        require(
            texels < 2**31,
            f"{self.name} for each of {frame.faces} light faces is not possible; allowed are 2^31 "
            "texels in all: lower the resolution, or `memory_mb` where it follows from that.",
        )
        start = time.perf_counter()
        chosen, status = self.chosen(view, frame)
        chosen = chosen or [Chart(face, np.eye(3)) for face in range(frame.faces)]
        # Faces that light nothing that is seen get no chart, and leave their texels to nobody.
        lit = len({chart.face for chart in chosen})
        charts = laid_out(chosen, lit * self.resolution**2)
        used, finest = charts.texels, _finest(charts)
        table = table_of(padded(charts, self.most_charts(frame.faces)))
        fitted = time.perf_counter()
        buffer = rays.chart_buffer(frame, charts)
        # Always as many texels: another view may share them out otherwise, and nothing retraces.
        fill = np.full(texels - used, np.inf, np.float32), np.full(texels - used, -1, np.int32)
        whole = (
            jax.device_put(np.concatenate(parts) if parts[1].size else parts[0])
            for parts in zip(buffer, fill, strict=True)
        )
        depth, prim = stored(self.compare, *whole)
        jax.block_until_ready((depth, prim))
        drawn = Drawn(frame, table, depth, prim, view.camera.rotation[2])
        seconds = time.perf_counter() - fitted, fitted - start
        return ChartedState(drawn, view.camera.origin, used, finest, *seconds, status)

    def update(self, state, view, frame, rays, moved=None) -> ChartedState:
        """Drawn anew: a warp follows the eye, so nothing of the last frame is in its place."""
        return self.build(view, frame, rays)

    def warm_up(self, state: ChartedState, view: EyeBuffer, frame: LightFrame) -> None:
        """Nothing: every update calls the same."""

    def program(self, frame: LightFrame) -> Hashable:
        """Shapes follow from all settings but the bias."""
        return replace(self, bias=BIAS)

    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> ChartedState:
        """What every build calls."""
        return self.build(view, frame, rays)

    def copied(self, state: ChartedState) -> ChartedState:
        """`state` itself: nothing takes it over."""
        return state

    def visibility(self, state: ChartedState, points: SurfacePoints) -> Float[Array, " n"]:
        return _visibility(state.drawn, points, _seen_from(state, points), scalar(self.bias))

    def around(self, state: ChartedState, points: SurfacePoints) -> ChartNeighbourhood:
        drawn = state.drawn
        place = _around(drawn, points, _seen_from(state, points))
        return ChartNeighbourhood(
            *place, drawn.depth, drawn.prim, scalar(self.bias), drawn.frame.perspective
        )

    def density(self, state: ChartedState, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        return _density(state.drawn, points, _seen_from(state, points))

    def cost(self, state: ChartedState) -> Cost:
        texels = state.drawn.frame.faces * self.resolution**2
        return Cost(
            texels=texels,
            bytes=array_bytes(state.drawn[1:], state.eye),
            rays=state.used,
            passes=1,
            seconds={"build": state.build, "analysis": state.analysis},
        )

    def memory(self, faces: int) -> MapMemory:
        """Depth and primitive of each texel are there three times: as the renderer gives them, put
        together, and on the device."""
        texels = faces * self.resolution**2
        state = texels * Memory(device=texel_bytes(self.compare))
        return MapMemory(state, texels * Memory(8, 8, 8))

    def status(self, state: ChartedState) -> Status:
        return state.status

    def effective_resolution(self, state: ChartedState) -> int:
        return state.finest


def _finest(charts: Charts) -> int:
    """Texels a side of the flat map whose texels are as small as the smallest of all charts."""
    at = np.linspace(0, 1, GRID)
    finest = 0.0
    for k, (columns, rows) in enumerate(charts.size.tolist()):
        s, t = np.tile(at, GRID), np.repeat(at, GRID)
        half_s, half_t = 0.5 / columns, 0.5 / rows
        s, t = half_s + s * (1 - 2 * half_s), half_t + t * (1 - 2 * half_t)
        longest = np.zeros(s.size)
        for step_s, step_t in ((half_s, 0), (0, half_t)):
            right = charts.image(k, s + step_s, t + step_t)
            left = charts.image(k, s - step_s, t - step_t)
            longest = np.maximum(longest, np.hypot(right[0] - left[0], right[1] - left[1]))
        finest = max(finest, 1 / float(longest.min()))
    return round(finest)


def _seen_from(state: ChartedState, points: SurfacePoints) -> tuple:
    """The points' origin as seen from the light and from the eye, and the anchor."""
    frame = state.drawn.frame
    concrete = isinstance(points.origin, np.ndarray) and isinstance(state.eye, np.ndarray)
    xp = np if concrete else jnp
    from_eye = xp.asarray(points.origin) - xp.asarray(state.eye)
    return light_offset(points, frame), from_eye, anchor(points, frame)


def _placed(drawn: Drawn, points, seen_from):
    offset, from_eye, anchor = seen_from
    receivers = project(points, drawn.frame, offset)
    dtype = points.position.dtype
    along = dot(jnp.asarray(drawn.forward, dtype), points.position)
    along = along + dot(jnp.asarray(drawn.forward, dtype), jnp.asarray(from_eye, dtype))
    chart, found = chart_of(drawn.table, receivers, along)
    place = place_in(drawn.table, chart, points, receivers, anchor, drawn.frame.perspective)
    return receivers, place, found & place.inside


def _around_of(drawn: Drawn, points, seen_from):
    """What `ChartNeighbourhood` begins with: receivers, fraction, place, width, found."""
    receivers, place, found = _placed(drawn, points, seen_from)
    # The longer side of a texel, as a fraction of the image's longer side.
    extent = drawn.frame.extent
    width, height = (jnp.asarray(extent[:, k], points.position.dtype) for k in range(2))
    width, height = width[receivers.face], height[receivers.face]
    (du_s, du_t), (dv_s, dv_t) = place.per_texel
    sides = [(du * width) ** 2 + (dv * height) ** 2 for du, dv in ((du_s, dv_s), (du_t, dv_t))]
    texel = jnp.sqrt(jnp.maximum(*sides)) / jnp.maximum(width, height)
    return receivers, place.fraction, place, texel, found


_around = eqx.filter_jit(_around_of)


@eqx.filter_jit
def _visibility(drawn: Drawn, points, seen_from, bias):
    place = _around_of(drawn, points, seen_from)
    around = ChartNeighbourhood(*place, drawn.depth, drawn.prim, bias, drawn.frame.perspective)
    return around.lit().astype(points.position.dtype)


@eqx.filter_jit
def _density(drawn: Drawn, points, seen_from):
    receivers, place, found = _placed(drawn, points, seen_from)
    (a, b), (c, d) = place.per_texel
    determinant = a * d - b * c
    known = found & receivers.facing & (determinant != 0)
    scale = jnp.where(known, 1 / jnp.where(known, determinant, 1), 0)
    return jnp.stack([jnp.stack([d, -b]) * scale, jnp.stack([-c, a]) * scale])
