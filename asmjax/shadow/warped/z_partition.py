"""Maps partitioned along the view: cascades with practical, logarithmic or visible-depth splits."""

import math
from dataclasses import KW_ONLY, replace
from typing import ClassVar, Literal

import numpy as np

from asmjax.buffers import BLUR, EyeBuffer
from asmjax.errors import check_choice, require
from asmjax.geometry import Chart, LightFrame
from asmjax.shadow.base import Status
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import Body, bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import perspective, rectangle, whole_face
from asmjax.shadow.warped.strength import half_view, light_space_n
from asmjax.theory.subdivision import blended_splits

Warp = Literal["none", "light-space"]

MOST_PARTITIONS = 16

THINNEST = 8 * BLUR
"""A slab's mean thickness is at least this part of its depth."""


def split_depths(near: float, far: float, count: int, blend: float) -> np.ndarray:
    """(count + 1,) eye depths: blend of logarithmic (1) and even (0) splits.

    C_i = blend near (far / near)^(i / count) + (1 - blend) (near + (far - near) i / count)
    (Zhang et al. 2006, practical split).
    """
    return blended_splits(near, np.float64(far / near - 1), count, blend, np)


class PartitionedShadowMap(ChartedShadowMap):
    """One chart for each slab of eye depths; all together hold as many texels as one map.

    Attributes:
        resolution: texels a side of a square map of as many texels, per face of the light.
        partitions: number of slabs, 1 to 16.
        blend: of logarithmic (1) and even (0) splits; 0.5 is the practical split scheme.
        near, far: eye depths that the splits are made for, scene units; None for the range that is
            seen, as sample distribution maps (SDSM) do. Beyond them the end slabs go on; where they
            hold nothing that is seen, one slab is left, and the status is `FALLBACK`.
        warp: "none", or "light-space": a perspective in each slab.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    _: KW_ONLY
    partitions: int = 4
    blend: float = 1.0
    near: float | None = None
    far: float | None = None
    warp: Warp = "none"
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = (
        "Zhang, Sun, Xu, Lun 2006, Parallel-Split Shadow Maps; Lauritzen, Salvi, Lefohn 2011, "
        "Sample Distribution Shadow Maps"
    )
    family: ClassVar[str] = "partitioned"

    def __check_init__(self):
        self._check()
        require(
            1 <= self.partitions <= MOST_PARTITIONS,
            f"{self.partitions} partitions are not possible; allowed: 1 to {MOST_PARTITIONS}.",
        )
        require(
            0 <= self.blend <= 1,
            f"a blend of {self.blend} is not possible; allowed: 0 (even) to 1 (logarithmic).",
        )
        require(
            self.near is None or 0 < self.near < math.inf,
            f"splits from {self.near} on have no logarithm; allowed: finite and above 0, or none.",
        )
        require(
            self.far is None or (self.near or 0) < self.far < math.inf,
            f"splits from {self.near} to {self.far} are empty or endless; allowed: a finite far "
            "beyond near, or none.",
        )
        check_choice("warp", self.warp, Warp)

    @property
    def name(self) -> str:
        return f"{super().name}-{self.partitions}{'-warped' if self.warp != 'none' else ''}"

    def most_charts(self, faces: int) -> int:
        return self.partitions * faces

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        found = bodies(view, frame)
        if not found:
            return Chosen([])
        near, far = depth_range(found, self.near, self.far)
        asked = self.near is not None or self.far is not None
        status = Status.FALLBACK if asked and near >= far else Status.COMPLETE
        far = max(far, near * (1 + 1e-9))
        # Slabs that float32 depths do not tell apart would only share out the texels.
        count = 1 if far - near < THINNEST * far * self.partitions else self.partitions
        splits = split_depths(near, far, count, self.blend)
        # The end slabs have no outer end: nothing that is seen may be left out.
        splits[0], splits[-1] = -np.inf, np.inf
        half, charts = half_view(view), []
        for body in found:
            slabs = []
            for least, most in zip(splits[:-1], splits[1:], strict=True):
                which = in_slab(body, least, most)
                if which.any():
                    chart = self._chart(frame, body.part(which), bool(which.all()), half)
                    slabs.append((float(least), chart))
            charts += joined(slabs)
        return Chosen(charts, status)

    def _chart(self, frame: LightFrame, part: Body, whole: bool, half_view: float) -> Chart:
        if self.warp != "none":
            return perspective(frame, part, light_space_n(part, half_view, "shaped"))
        return whole_face(part) if whole else rectangle(frame, part)


def in_slab(body: Body, least: float, most: float) -> np.ndarray:
    """Which receivers (m,) a chart of two eye depths holds: all that float32 may put there."""
    blur = BLUR * body.eye_depth
    return (body.eye_depth >= least - blur) & (body.eye_depth < most + blur)


def joined(slabs: list[tuple[float, Chart]]) -> list[Chart]:
    """The charts of one face, nearest first, from the least depth of each on to the next one's.

    They leave no gap: a slab that holds no receiver in float64 may hold one in float32, such as all
    of them where the whole view has one depth.
    """
    ends = [-np.inf, *(least for least, _ in slabs[1:]), np.inf]
    return [
        replace(chart, depths=(least, most))
        for (_, chart), least, most in zip(slabs, ends[:-1], ends[1:], strict=True)
    ]


def depth_range(found: list[Body], near: float | None, far: float | None) -> tuple[float, float]:
    """Eye depths (near, far): those given, else those seen; far before near where the former hold
    none of the latter."""
    depths = np.concatenate([body.eye_depth for body in found])
    near = float(depths.min()) if near is None else near
    far = float(depths.max()) if far is None else far
    return near, far
