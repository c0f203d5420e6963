"""The perspective shadow map: the eye's own perspective."""

from dataclasses import KW_ONLY
from typing import ClassVar

from asmjax.buffers import EyeBuffer
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import perspective


class PerspectiveShadowMap(ChartedShadowMap):
    """Perspective shadow map: the light's image after the eye's own perspective.

    The warp's centre is the eye (n = 1 near distance, u = 1, xi = +1 in TR05-024).

    Attributes:
        resolution: texels a side, per face of the light.
        slide: scene units by which the virtual camera is moved back along the view, as a rasteriser
            must until all casters are in front of it (Kozlov 2004); rays need none. Infinitely far
            there is no warp left.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    _: KW_ONLY
    slide: float = 0.0
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = "Stamminger, Drettakis 2002, Perspective Shadow Maps"
    family: ClassVar[str] = "perspective"

    def __check_init__(self):
        self._check()
        require(
            self.slide >= 0,
            f"a slide of {self.slide} is not possible; allowed: 0 or more scene units.",
        )

    def most_charts(self, faces: int) -> int:
        return faces

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        charts = []
        for body in bodies(view, frame):
            slide = self.slide / body.pace if body.pace > 0 else 0.0
            charts.append(perspective(frame, body, body.near + slide))
        return Chosen(charts)
