"""Soft shadows as the mean of many hard ones, from samples of the light."""

import time
from collections.abc import Hashable
from dataclasses import KW_ONLY, replace
from math import isqrt
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, LightRays, SurfacePoints, light_offset
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.numerics import dot
from asmjax.shadow.base import Cost, MapMemory, ShadowAlgorithm, Status
from asmjax.shadow.comparison import BIAS, Compare, check_test
from asmjax.shadow.neighbourhood import Neighbourhood
from asmjax.shadow.soft.sampled_light import sample_frames
from asmjax.shadow.uniform import LARGEST, FlatNeighbourhood, UniformShadowMap, UniformState

MOST_SAMPLES = 64
"""Samples of a light a side."""

MOST_TEXELS = 2**31 - 1
"""Of all faces of one map (`UniformShadowMap.build`)."""


class AccumulatedState(eqx.Module):
    """A flat map for each sample of the light; one for a light without a size.

    Attributes:
        frame: the light's own.
        analysis: seconds that the samples' frames took.
    """

    frame: LightFrame
    maps: tuple[UniformState, ...]
    analysis: float


class AccumulatedShadowMap(ShadowAlgorithm[AccumulatedState]):
    """The mean of hard shadows from `samples` x `samples` points of the light, centred in cells of
    equal area (Heckbert and Herf 1997). On a straight edge the visibility is off by at most
    1 / (2 `samples`); the edges of the hard shadows show as bands unless they are a pixel apart.

    All maps together have `resolution`^2 texels for each face of the light, so that a soft shadow
    is as large as the hard one of the same resolution, and blurred the more the coarser each of its
    maps is. A light without a size has one map, `UniformShadowMap` of that resolution bit for bit.

    Visibility is a part of the light's area, as a receiver sees it only of spheres and suns (that
    of a flat light is not weighted by cosines). Samples behind the receiver's own plane are dark to
    it, and so is all that is on the side to which a flat light does not emit. Receivers that are
    nearer to a light than its own diameter are answered by the samples whose frames hold them.

    Attributes:
        resolution: texels a side of all maps together; each of a light with a size has
            `resolution` / `samples`.
        samples: points of a light with a size, a side of the grid.
        compare: what is stored and compared: "depth", "id", or "both".
        bias: relative depth bias of the comparison.
        keep: whether `update` keeps the maps while light and casters rest and the samples' frames
            hold what the view sees.
    """

    resolution: int = 2048
    samples: int = 4
    _: KW_ONLY
    compare: Compare = "depth"
    bias: float = BIAS
    keep: bool = False

    reference: ClassVar[str] = (
        "Heckbert and Herf 1997, Simulating Soft Shadows with Graphics Hardware"
    )

    def __check_init__(self):
        require(
            1 <= self.samples <= MOST_SAMPLES,
            f"{self.samples} x {self.samples} samples of a light are not possible; allowed: 1 to "
            f"{MOST_SAMPLES} a side.",
        )
        require(
            1 <= self.resolution <= LARGEST,
            f"maps of {self.resolution} texels a side in all are not possible; allowed: 1 to "
            f"{LARGEST}.",
        )
        check_test(self.compare, self.bias)

    @property
    def name(self) -> str:
        suffix = "" if self.compare == "depth" else f"-{self.compare}"
        kept = "-kept" if self.keep else ""
        return f"accumulated-{self.resolution}-{self.samples}x{self.samples}{suffix}{kept}"

    def _side(self, frame: LightFrame, sample: LightFrame) -> int:
        """Texels a side of a sample's map: the more faces, the fewer on each; 0 where its share of
        all texels has none for each face."""
        side = self.resolution // (1 if frame.area is None else self.samples)
        if sample.faces == frame.faces:
            return side
        # With few faces a share may be more than a map can have: nobody asked for one so large.
        most = min(LARGEST, isqrt(MOST_TEXELS // sample.faces))
        return min(isqrt(side**2 * frame.faces // sample.faces), most)

    def _flat(self, frame: LightFrame, sample: LightFrame | None = None) -> UniformShadowMap:
        """The settings of a sample's map, or of one with the faces of the light's own frame."""
        # What has no texel is refused by `build`, which says why.
        side = max(self._side(frame, frame if sample is None else sample), 1)
        return UniformShadowMap(side, compare=self.compare, bias=self.bias)

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> AccumulatedState:
        start = time.perf_counter()
        frames = sample_frames(frame, view, self.samples)
        most = max(one.faces for one in frames)
        require(
            min(self._side(frame, one) for one in frames) > 0,
            f"{self.name} has no texel for each face of each of its maps, of which one has {most} "
            f"and the light's own frame {frame.faces}; allowed: at least as many texels a side as "
            "samples, and more where a map has more faces than the light's own frame: raise the "
            "resolution.",
        )
        analysis = time.perf_counter() - start
        maps = tuple(self._flat(frame, one).build(view, one, rays) for one in frames)
        return AccumulatedState(frame, maps, analysis)

    def update(self, state, view, frame, rays, moved=None) -> AccumulatedState:
        """Drawn anew, as the samples' frames follow what the view sees; or kept (`keep`), which
        takes the time of looking whether these still serve, and no rays."""
        if self.keep and moved is None and eqx.tree_equal(state.frame, frame):
            start = time.perf_counter()
            wanted = sample_frames(frame, view, self.samples)
            analysis = time.perf_counter() - start
            if all(_holds(one.frame, other) for one, other in zip(state.maps, wanted, strict=True)):
                rested = tuple(replace(one, seconds=0.0, rays=0) for one in state.maps)
                return replace(state, maps=rested, analysis=analysis)
        return self.build(view, frame, rays)

    def warm_up(self, state: AccumulatedState, view: EyeBuffer, frame: LightFrame) -> None:
        """Nothing: every update calls the same."""

    def program(self, frame: LightFrame) -> Hashable:
        """One compilation serves all samples, whatever their number, where one face holds all that
        is lit; else there is one for each number of faces, which the view decides."""
        return self._flat(frame).program(frame), frame.area is None

    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> AccumulatedState:
        """What every build calls."""
        return self.build(view, frame, rays)

    def copied(self, state: AccumulatedState) -> AccumulatedState:
        """`state` itself: nothing takes it over."""
        return state

    def visibility(self, state: AccumulatedState, points: SurfacePoints) -> Float[Array, " n"]:
        if state.frame.area is None:
            return self._flat(state.frame).visibility(state.maps[0], points)
        lit = counted = jnp.zeros(points.valid.shape, points.position.dtype)
        for one in state.maps:
            offset = light_offset(points, one.frame)
            around = self._flat(state.frame, one.frame).around(one, points)
            lit, counted = _added(lit, counted, around, one.frame, points, offset)
        return lit / jnp.maximum(counted, 1)

    def check_filterable(self, frame: LightFrame) -> None:
        """Raise `UseError` where there is nothing to filter under a light."""
        require(
            frame.area is None,
            f"{self.name} is the mean of several maps under a light with a size, and cannot be "
            "filtered; raise its samples instead.",
        )

    def around(self, state: AccumulatedState, points: SurfacePoints) -> Neighbourhood:
        """Of a light without a size; the mean of several maps has no texels."""
        self.check_filterable(state.frame)
        return self._flat(state.frame).around(state.maps[0], points)

    def density(self, state: AccumulatedState, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        """Of one map, as if it were that of the light's centre."""
        centre = replace(state.maps[0], frame=state.frame)
        return self._flat(state.frame).density(centre, points)

    def cost(self, state: AccumulatedState) -> Cost:
        costs = [self._flat(state.frame, one.frame).cost(one) for one in state.maps]
        return Cost(
            texels=sum(cost.texels for cost in costs),
            bytes=sum(cost.bytes for cost in costs),
            rays=sum(cost.rays for cost in costs),
            passes=sum(cost.passes for cost in costs),
            seconds={
                "build": sum(cost.seconds["build"] for cost in costs),
                "analysis": state.analysis,
            },
        )

    def memory(self, faces: int) -> MapMemory:
        """All maps together are no larger than one of the whole resolution."""
        return UniformShadowMap(self.resolution, compare=self.compare, bias=self.bias).memory(faces)

    def status(self, state: AccumulatedState) -> Status:
        return Status.COMPLETE

    def effective_resolution(self, state: AccumulatedState) -> int:
        return self._flat(state.frame).resolution


def _holds(kept: LightFrame, wanted: LightFrame) -> bool:
    """Whether the rectangles of one sample's frame hold those of another, and so the depths between
    which they were made."""
    if not np.array_equal(kept.rotation, wanted.rotation):
        return False
    ends = kept.corner + kept.extent >= wanted.corner + wanted.extent
    return bool((kept.corner <= wanted.corner).all() and ends.all())


@eqx.filter_jit
def _added(lit, counted, around: FlatNeighbourhood, frame, points, offset):
    """Sums over samples with one more: which points are lit, and which the sample can tell about:
    those in its frame, and those behind whose plane it stands. Nobody tells about what lies behind
    a flat light."""
    dtype = points.position.dtype
    rotation, start = jnp.asarray(frame.rotation[0], dtype), jnp.asarray(offset[0], dtype)
    normal = [dot(axis, points.normal) for axis in rotation]
    local = [dot(axis, points.position) + start[k] for k, axis in enumerate(rotation)]
    height = -dot(normal, local) if frame.perspective else -normal[2]
    told = around.receivers.facing | ~(height > 0)
    return lit + around.lit().astype(lit.dtype), counted + told.astype(lit.dtype)
