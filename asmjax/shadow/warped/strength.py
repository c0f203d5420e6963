"""How strongly to warp: the distance n of the warp's centre, and what shapes it.

n = infinity is no warp, the near distance is the eye's own perspective; xi of Lloyd et al. 2005
runs from -1 to 1 between them, with 0 where the error is the same at both ends.
"""

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.shadow.warped.body import Body
from asmjax.theory.parameterization import equation_4


def half_view(view: EyeBuffer) -> float:
    """Half of the larger field of view, radians."""
    camera = view.camera
    return float(
        np.arctan(0.5 * max(camera.width / camera.focal[0], camera.height / camera.focal[1]))
    )


def light_space_n(body: Body, half_view: float, falloff: str) -> float:
    """n (plane units) of a light-space perspective map; infinite where there is no warp."""
    near, far = body.near, body.far
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
    """n in near distances for a warp strength xi (TR05-024, equation 4)."""
    u = equation_4(strength, alpha - 1, np)
    return float(1 / u) if u > 0 else np.inf
