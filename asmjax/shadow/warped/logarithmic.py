"""Logarithmic shadow maps: texels in proportion to the eye's pixels."""

from dataclasses import KW_ONLY
from typing import ClassVar, Literal

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import check_choice, require
from asmjax.geometry import LightFrame
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import perspective, rectangle

Across = Literal["perspective", "uniform"]


class LogarithmicShadowMap(ChartedShadowMap):
    """Logarithmic along the view, and across it uniform or with the eye's perspective (LogPSM).

    The optimum that graphics hardware could not draw: its texels are proportional to the eye's
    pixels in both directions where the light stands across the view.

    Attributes:
        resolution: texels a side, per face of the light.
        across: "perspective" (LogPSM) or "uniform".
        ratio: the largest ratio of far to near distance that the map is bent for; nearer places get
            the texels of that ratio. 1 bends nothing: the flat map.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    _: KW_ONLY
    across: Across = "perspective"
    ratio: float = np.inf
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = "Lloyd 2007, Logarithmic Perspective Shadow Maps"
    family: ClassVar[str] = "logarithmic"

    def __check_init__(self):
        self._check()
        check_choice("across", self.across, Across)
        require(
            self.ratio >= 1,
            f"a ratio of far to near of {self.ratio} is not possible; allowed: 1 or more.",
        )

    def most_charts(self, faces: int) -> int:
        return faces

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        charts = []
        for body in bodies(view, frame):
            length = float(np.ptp(body.turned[1]))
            least = length / (self.ratio - 1) if self.ratio > 1 else np.inf
            near = max(body.near, least)
            if self.across == "perspective" or not np.isfinite(near):
                charts.append(perspective(frame, body, near, logarithmic=True))
            else:
                charts.append(rectangle(frame, body, log=length / near))
        return Chosen(charts)
