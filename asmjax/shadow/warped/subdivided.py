"""Subdivided shadow maps: a warp of its own for each face of the view frustum, and for parts of it.

A shadow beam crosses the frustum from face to face, and the narrowest pixel beams that it meets are
where it enters or leaves on the side of the near plane. Seen from the light, those faces lie side
by side, whatever the angle between light and view, so none needs a warp against another's direction
(TR05-024, section 4).
"""

from dataclasses import KW_ONLY, replace
from typing import ClassVar

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import require
from asmjax.geometry import Chart, LightFrame
from asmjax.shadow.base import Status
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import Body, affine, bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import errors_of, perspective, rectangle, whole_face
from asmjax.shadow.warped.frustum import SIDES, Region, frustum_regions
from asmjax.shadow.warped.strength import n_of_strength

MOST_PARTS = 8


class SubdividedShadowMap(ChartedShadowMap):
    """Frustum and face subdivisions, laid out in one map in proportion to their errors.

    Attributes:
        resolution: texels a side of a square map of as many texels, per face of the light.
        parts: subdivisions along each side face, 1 (SSM) to 8; 2 and more are SSM*. 0 is no
            subdivision at all: the flat map.
        strength: the warp parameter xi of all subdivisions, -1 (none) to 1 (the perspective's own).
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.

    Where a corner of the frustum lies behind a lamp's plane, the faces have no image there, and the
    face of the light gets one chart (as many cube faces have), and the status is `FALLBACK`.
    """

    resolution: int = 2048
    _: KW_ONLY
    parts: int = 2
    strength: float = 0.0
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = "Lloyd, Yoon, Tuft, Manocha 2005, Subdivided Shadow Maps (TR05-024)"
    family: ClassVar[str] = "subdivided"

    def __check_init__(self):
        self._check()
        require(
            0 <= self.parts <= MOST_PARTS,
            f"{self.parts} parts of a face are not possible; allowed: 0 to {MOST_PARTS}.",
        )
        require(
            -1 <= self.strength <= 1,
            f"a warp strength of {self.strength} is not possible; allowed: -1 to 1.",
        )

    @property
    def name(self) -> str:
        return f"{super().name}-{self.parts}"

    def most_charts(self, faces: int) -> int:
        return faces * (SIDES * self.parts + 2)

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        found = bodies(view, frame)
        if self.parts == 0:
            return Chosen([whole_face(body) for body in found])
        charts, status = [], Status.COMPLETE
        for body in found:
            regions = frustum_regions(view, frame, body, self.parts)
            if regions is None:
                regions, status = [], Status.FALLBACK
            charts += self._of_face(frame, body, regions)
        return Chosen(charts, status)

    def _of_face(self, frame: LightFrame, body: Body, regions: list[Region]) -> list[Chart]:
        """The charts of one face of the light; the last one holds what no other does."""
        charts, left = [], body
        for region in regions:
            inside = region.holds(left.plane)
            if not inside.any():
                continue
            part, left = left.part(inside), left.part(~inside)
            y = affine(region.onto[1], part.plane)
            near, far = float(y.min()), float(y.max())
            n = near * n_of_strength(self.strength, far / near) if near > 0 else np.inf
            chart = perspective(frame, part, n, onto=region.onto)
            charts.append((replace(chart, lines=region.in_image(frame, body.face)), part))
        if left.eye_depth.size or not charts:
            rest = left if left.eye_depth.size else body
            charts.append((rectangle(frame, rest), rest))
        charts[-1] = (replace(charts[-1][0], lines=()), charts[-1][1])
        return [replace(chart, error=errors_of(frame, chart, part)) for chart, part in charts]
