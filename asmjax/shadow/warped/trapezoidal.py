"""The trapezoidal shadow map: 80 % of the rows for what is in focus."""

from dataclasses import KW_ONLY
from typing import ClassVar

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import Body, bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import perspective


class TrapezoidalShadowMap(ChartedShadowMap):
    """Trapezoidal shadow map (TSM) by its 80 % rule.

    The part of the body up to `focus` gets 80 % of the rows:
    n = 0.2 L d / (0.8 L - d), L the body's length and d the focus's, both from the near end.

    Attributes:
        resolution: texels a side, per face of the light.
        focus: eye depth that the focus reaches to, scene units; None takes the median place along
            the axis of what is seen. Where 0.8 of the body is in focus there is no warp.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    _: KW_ONLY
    focus: float | None = None
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = (
        "Martin, Tan 2004, Anti-aliasing and Continuity with Trapezoidal Shadow Maps"
    )
    family: ClassVar[str] = "trapezoidal"

    def __check_init__(self):
        self._check()
        require(
            self.focus is None or (np.isfinite(self.focus) and self.focus > 0),
            f"a focus of {self.focus} is not possible; allowed: a depth above 0, or none.",
        )

    def most_charts(self, faces: int) -> int:
        return faces

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        return Chosen([perspective(frame, body, self._n(body)) for body in bodies(view, frame)])

    def _n(self, body: Body) -> float:
        if body.pace == 0:
            return np.inf
        along = body.turned[1]
        length = float(np.ptp(along))
        if self.focus is None:
            reach = float(np.median(along) - along.min())
        else:
            reach = (self.focus - float(body.eye_depth.min())) / body.pace
        if not 0 < reach < 0.8 * length:
            return np.inf
        return 0.2 * length * reach / (0.8 * length - reach)
