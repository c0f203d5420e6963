"""Tuned maps: warp strengths, splits and shares of texels of least predicted error."""

import time
from dataclasses import KW_ONLY, dataclass, replace
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import check_choice, require
from asmjax.geometry import Chart, LightFrame, laid_out
from asmjax.shadow.base import Status
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import Body, bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import perspective, rectangle
from asmjax.shadow.warped.light_space import LightSpaceShadowMap
from asmjax.shadow.warped.predicted import Layout
from asmjax.shadow.warped.sampled import (
    Measure,
    SampledReceivers,
    rounded,
    sampled_receivers,
    sight_of,
)
from asmjax.shadow.warped.strength import light_space_n
from asmjax.shadow.warped.tune import POWER, Rest, tuned_layout
from asmjax.shadow.warped.z_partition import (
    MOST_PARTITIONS,
    PartitionedShadowMap,
    Warp,
    in_slab,
    joined,
    split_depths,
)

FARTHEST = 1e5
"""A warp's centre more lengths of its slab away than this makes a rectangle."""


@dataclass(frozen=True, eq=False)
class Tuning:
    """What tuning for a view came to.

    Attributes:
        charts: the better ones of start and tuned.
        improved: whether those are the tuned ones.
        start, tuned: p-mean of the error over the receivers that count, by the charts as they will
            be stored, whole rows and columns: of the sibling with closed-form settings, and tuned.
        rest: how the search ended.
        seconds: that it took.
    """

    charts: list[Chart]
    improved: bool
    start: float
    tuned: float
    rest: Rest
    seconds: float

    @property
    def status(self) -> Status:
        """A search that came to rest is complete, whichever of the two was better."""
        if self.rest is Rest.SETTLED:
            return Status.COMPLETE
        return Status.UNSETTLED if self.improved else Status.FALLBACK


class TunedShadowMap(ChartedShadowMap):
    """A warped, partitioned map whose settings minimise the predicted error by gradient.

    Warp strength of each slab, the splits between slabs, their shares of the texels and columns
    against rows: all from one descent on the power mean of the error over the visible receivers.
    It starts where `LightSpaceShadowMap` or `PartitionedShadowMap` stand, and their charts are kept
    where they are not improved on.

    Attributes:
        resolution: texels a side of a square map of as many texels, per face of the light.
        partitions: number of slabs of eye depth, 1 to 16.
        warp: "light-space", a perspective in each slab, or "none".
        power: p of the mean, 1 or more: larger for the worst receiver, smaller for all of them.
        measure: "m", or "perspective": its perspective factor alone.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    _: KW_ONLY
    partitions: int = 4
    warp: Warp = "light-space"
    power: float = POWER
    measure: Measure = "m"
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = (
        "Lloyd, Tuft, Yoon, Manocha 2006, Warping and Partitioning for Low Error Shadow Maps"
    )
    family: ClassVar[str] = "tuned"

    def __check_init__(self):
        self._check()
        require(
            1 <= self.partitions <= MOST_PARTITIONS,
            f"{self.partitions} partitions are not possible; allowed: 1 to {MOST_PARTITIONS}.",
        )
        check_choice("warp", self.warp, Warp)
        require(
            1 <= self.power <= 64,
            f"a mean of power {self.power} is not possible; allowed: 1 to 64.",
        )
        check_choice("measure", self.measure, Measure)

    @property
    def name(self) -> str:
        return f"{super().name}-{self.partitions}{'-warped' if self.warp != 'none' else ''}"

    def most_charts(self, faces: int) -> int:
        return self.partitions * faces

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        found = self.tuning(view, frame)
        return Chosen(found.charts, found.status)

    def tuning(self, view: EyeBuffer, frame: LightFrame) -> Tuning:
        """The charts for a view, and how they were found."""
        began = time.perf_counter()
        start = self._start.charts(view, frame)
        found = bodies(view, frame)
        if not found or (self.partitions == 1 and self.warp == "none"):
            return Tuning(start, False, np.nan, np.nan, Rest.SETTLED, time.perf_counter() - began)
        texels = len(found) * self.resolution**2
        with jax.enable_x64(True):
            receivers = sampled_receivers(view, frame, self.measure)
            layout, minimum = tuned_layout(
                sight_of(receivers, found, frame, view.valid.size),
                self._closed_form(found, frame.faces),
                jnp.asarray(float(texels)),
                jnp.asarray(float(self.power)),
                self.warp != "none",
            )
            layout = jax.device_get(layout)
            rest = minimum.rest
        charts = self._charts(found, frame, layout)
        before, after = (
            p_mean(*chart_errors(chosen, texels, receivers), self.power)
            for chosen in (start, charts)
        )
        improved = after < before
        seconds = time.perf_counter() - began
        return Tuning(charts if improved else start, improved, before, after, rest, seconds)

    @property
    def _start(self) -> ChartedShadowMap:
        """The sibling with settings in closed form."""
        if self.partitions == 1:
            falloff = "none" if self.warp == "none" else "shaped"
            return LightSpaceShadowMap(resolution=self.resolution, falloff=falloff)
        return PartitionedShadowMap(
            resolution=self.resolution, partitions=self.partitions, warp=self.warp
        )

    def _closed_form(self, found: list[Body], faces: int) -> Layout:
        """Logarithmic splits, equal shares, light-space warps without any falloff: from none, which
        is the flat end of their logarithm's scale, a search would not come away."""
        k = self.partitions
        near = min(float(body.eye_depth.min()) for body in found)
        far = max(float(body.eye_depth.max()) for body in found)
        splits = split_depths(near, far, k, 1.0)
        splits[0], splits[-1] = -np.inf, np.inf
        u = np.ones((faces, k))
        for body in found:
            for slab, (least, most) in enumerate(zip(splits[:-1], splits[1:], strict=True)):
                which = (body.eye_depth >= least) & (body.eye_depth < most)
                if which.any() and body.pace > 0:
                    part = body.part(which)
                    u[body.face, slab] = part.near / light_space_n(part, 0.0, "sine")
        ones = np.ones((faces, k))
        inner = rounded(splits[1:-1], splits[1:-1])
        return Layout(
            *(jnp.asarray(part) for part in (rounded(u, u), inner, ones / ones.size, ones))
        )

    def _charts(self, found: list[Body], frame: LightFrame, layout: Layout) -> list[Chart]:
        """The charts of a layout, for all receivers."""
        splits = np.concatenate([[-np.inf], layout.splits, [np.inf]])
        nearest = min(float(body.eye_depth.min()) for body in found)
        charts = []
        for body in found:
            slabs = []
            for slab, (least, most) in enumerate(zip(splits[:-1], splits[1:], strict=True)):
                which = in_slab(body, least, most)
                if which.any():
                    u, share, aspect = (
                        float(table[body.face, slab])
                        for table in (layout.u, layout.shares, layout.aspect)
                    )
                    chart = _chart(frame, body.part(which), u * body.pace / max(nearest, least))
                    size = float(np.sqrt(share * aspect)), float(np.sqrt(share / aspect))
                    slabs.append((float(least), replace(chart, error=size)))
            charts += joined(slabs)
        return charts


def _chart(frame: LightFrame, part: Body, rate: float) -> Chart:
    """A perspective with its centre 1 / rate before the near end, or a rectangle."""
    if rate * float(np.ptp(part.turned[1])) > 1 / FARTHEST:
        return perspective(frame, part, 1 / rate)
    return rectangle(frame, part)


def chart_errors(
    charts: list[Chart], texels: int, receivers: SampledReceivers
) -> tuple[np.ndarray, np.ndarray]:
    """Error (n,) of receivers in charts laid out in so many texels, and which (n,) count.

    1 / the least singular value of d(texel) / d(step), the chart's derivative in closed form.
    """
    layout = laid_out(charts, texels)
    error, left = np.full(receivers.depth.size, np.nan), receivers.counts.copy()
    u, v = receivers.uv
    steps = np.einsum("kn,kin->nki", receivers.scale, receivers.jacobian)
    for k in range(layout.count):
        least, most = layout.depths[k]
        inside = left & (receivers.face == layout.face[k])
        inside &= (receivers.depth >= least) & (receivers.depth < most)
        left &= ~inside
        rows = layout.to_chart[k]
        x, y, w = rows @ np.stack([u[inside], v[inside], np.ones(int(inside.sum()))])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            place = np.stack([x, y], axis=-1) / w[:, None]
            motion = (rows[:2, :2] - place[:, :, None] * rows[2, :2]) / w[:, None, None]
            texel = layout.size[k][:, None] * motion @ steps[inside]
        # On a warp's horizon there is no texel, and the error is the largest there is.
        texel = np.where(np.isfinite(texel), texel, 0.0)
        error[inside] = 1 / np.maximum(np.linalg.svd(texel, compute_uv=False)[:, 1], 1e-300)
    return error, receivers.counts & ~np.isnan(error)


def p_mean(values: np.ndarray, counts: np.ndarray, power: float) -> float:
    """(mean of x^p)^(1/p) over those that count; 0 where none does."""
    if not counts.any():
        return 0.0
    most = values[counts].max()
    return float(most * np.mean((values[counts] / most) ** power) ** (1 / power))
