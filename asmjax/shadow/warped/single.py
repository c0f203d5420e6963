"""Maps with one warp for all that is seen: perspective, light-space, trapezoidal, logarithmic."""

from typing import ClassVar

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import require
from asmjax.geometry import Chart, LightFrame
from asmjax.shadow.comparison import BIAS, Compare
from asmjax.shadow.warped.body import Body, bodies
from asmjax.shadow.warped.charted import ChartedShadowMap
from asmjax.shadow.warped.fit import perspective, rectangle


def near_distance(body: Body) -> float:
    """Distance (plane units) along the axis at which the eye lies before the body's near end."""
    return float(body.eye_depth.min()) / body.pace if body.pace > 0 else np.inf


def far_distance(body: Body) -> float:
    """The same to the body's far end."""
    return near_distance(body) + float(np.ptp(body.turned[1]))


class PerspectiveShadowMap(ChartedShadowMap):
    """Perspective shadow map: the light's image after the eye's own perspective.

    The warp's centre is the eye (n = 1 near distance, u = 1, xi = +1 in Lloyd et al. 2006).

    Attributes:
        resolution: texels a side, per face of the light.
        slide: scene units by which the virtual camera is moved back along the view, as a rasteriser
            must until all casters are in front of it (Kozlov 2004); rays need none. Infinitely far
            there is no warp left.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
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

    def charts(self, view: EyeBuffer, frame: LightFrame) -> list[Chart]:
        charts = []
        for body in bodies(view, frame):
            slide = self.slide / body.pace if body.pace > 0 else 0.0
            charts.append(perspective(frame, body, near_distance(body) + slide))
        return charts


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
    falloff: str = "shaped"
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = "Wimmer, Scherzer, Purgathofer 2004, Light Space Perspective Maps"
    family: ClassVar[str] = "light-space"

    def __check_init__(self):
        self._check()
        require(
            self.falloff in ("sine", "shaped", "none"),
            f"falloff='{self.falloff}' is not known; allowed: sine, shaped, none.",
        )

    def most_charts(self, faces: int) -> int:
        return faces

    def charts(self, view: EyeBuffer, frame: LightFrame) -> list[Chart]:
        half = half_view(view)
        return [
            perspective(frame, body, light_space_n(body, half, self.falloff))
            for body in bodies(view, frame)
        ]


def half_view(view: EyeBuffer) -> float:
    """Half of the larger field of view, radians."""
    camera = view.camera
    return float(
        np.arctan(0.5 * max(camera.width / camera.focal[0], camera.height / camera.focal[1]))
    )


def light_space_n(body: Body, half_view: float, falloff: str) -> float:
    """n (plane units) of a light-space perspective map; infinite where there is no warp."""
    near, far = near_distance(body), far_distance(body)
    if not np.isfinite(near) or falloff == "none":
        return np.inf
    if falloff == "sine":
        return near + float(np.sqrt(near * far))
    # In units of the near distance, with the strength of the warp shaped by the angle.
    alpha = far / near
    strength = shaped_strength(float(np.arcsin(body.sine)), half_view)
    return near * n_of_strength(strength, alpha)


def shaped_strength(gamma: float, half_view: float) -> float:
    """Lloyd's warp strength eta in [-1, 0] for the angle gamma between light and view (radians):
    -1 is no warp, 0 the optimum of light-space maps. Continuous; the intent of the published
    formula, whose ramp begins with the wrong value as it is handed down (docs/theory.md)."""
    first, second = half_view / 3, half_view
    third = half_view + 0.3 * (np.pi / 2 - half_view)
    kink = -0.2
    if gamma < first:
        return -1.0
    if gamma < second:
        way = (gamma - first) / (second - first)
        return float(-1 + (kink + 1) * (1 - np.cos(np.pi / 2 * way)))
    if gamma < third:
        way = (gamma - second) / (third - second)
        return float(kink - kink * np.sin(np.pi / 2 * way))
    return 0.0


def n_of_strength(strength: float, alpha: float) -> float:
    """n in near distances for a warp strength xi (Lloyd et al. 2006, equation 4)."""
    root = np.sqrt(alpha)
    if strength <= 0:
        u = (1 + strength) / (root + 1 - strength * (alpha - 1))
    else:
        u = (1 + strength * root) / (1 + root)
    return float(1 / u) if u > 0 else np.inf


class TrapezoidalShadowMap(ChartedShadowMap):
    """Trapezoidal shadow map (TSM) by its 80 % rule.

    The part of the body up to `focus` gets 80 % of the rows:
    n = 0.2 L d / (0.8 L - d), L the body's length and d the focus's, both from the near end.

    Attributes:
        resolution: texels a side, per face of the light.
        focus: eye depth that the focus reaches to, scene units; None takes the median depth of what
            is seen. Where 0.8 of the body is in focus there is no warp.
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
    """

    resolution: int = 2048
    focus: float | None = None
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = (
        "Martin, Tan 2004, Anti-aliasing and Continuity with Trapezoidal Maps"
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

    def charts(self, view: EyeBuffer, frame: LightFrame) -> list[Chart]:
        return [perspective(frame, body, self._n(body)) for body in bodies(view, frame)]

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
    across: str = "perspective"
    ratio: float = np.inf
    compare: Compare = "depth"
    bias: float = BIAS

    reference: ClassVar[str] = "Lloyd 2007, Logarithmic Perspective Shadow Maps"
    family: ClassVar[str] = "logarithmic"

    def __check_init__(self):
        self._check()
        require(
            self.across in ("perspective", "uniform"),
            f"across='{self.across}' is not known; allowed: perspective, uniform.",
        )
        require(
            self.ratio >= 1,
            f"a ratio of far to near of {self.ratio} is not possible; allowed: 1 or more.",
        )

    def most_charts(self, faces: int) -> int:
        return faces

    def charts(self, view: EyeBuffer, frame: LightFrame) -> list[Chart]:
        charts = []
        for body in bodies(view, frame):
            length = float(np.ptp(body.turned[1]))
            least = length / (self.ratio - 1) if self.ratio > 1 else np.inf
            near = max(near_distance(body), least)
            if self.across == "perspective" or not np.isfinite(near):
                charts.append(perspective(frame, body, near, logarithmic=True))
            else:
                charts.append(rectangle(frame, body, log=length / near))
        return charts
