"""The light-space perspective shadow map: the same error at both ends."""

from dataclasses import KW_ONLY
from typing import ClassVar, Literal

from asmjax.buffers import EyeBuffer
from asmjax.errors import check_choice
from asmjax.geometry import LightFrame
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import bodies
from asmjax.shadow.warped.charted import ChartedShadowMap, Chosen
from asmjax.shadow.warped.fit import perspective
from asmjax.shadow.warped.strength import half_view, light_space_n

Falloff = Literal["sine", "shaped", "none"]


class LightSpaceShadowMap(ChartedShadowMap):
    """Light-space perspective shadow map (LiSPSM).

    The warp's centre lies n = z + sqrt(z z') before the near end, z and z' = z + d the distances of
    the eye from the body's ends along the axis (n_opt = (z_n + sqrt(z_n z_f')) / sin gamma of the
    paper, whose z_n and z_f' are eye depths: ours are divided by sin gamma already).

    Attributes:
        resolution: texels a side, per face of the light.
        falloff: what happens as the light turns into the view: "sine" is the paper's 1 / sin gamma;
            "shaped" is Lloyd's function, which has no warp left at a third of half the field of
            view, before the paper's becomes worse than none (reference: Lloyd 2007); "none" is no
            warp, the flat map.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    _: KW_ONLY
    falloff: Falloff = "shaped"
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = (
        "Wimmer, Scherzer, Purgathofer 2004, Light Space Perspective Shadow Maps"
    )
    family: ClassVar[str] = "light-space"

    def __check_init__(self):
        self._check()
        check_choice("falloff", self.falloff, Falloff)

    def most_charts(self, faces: int) -> int:
        return faces

    def chosen(self, view: EyeBuffer, frame: LightFrame) -> Chosen:
        half = half_view(view)
        return Chosen([
            perspective(frame, body, light_space_n(body, half, self.falloff))
            for body in bodies(view, frame)
        ])  # fmt: skip
