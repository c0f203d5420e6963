"""Scenes that the siblings of the uniform map are made for, and who should win on which.

An avenue: a long ground with discs above it that recede from an eye a little above the ground, so
that pixels near the eye are a hundred times finer than those at the far end. For what answers with
shares of light, a table under a window, whose shadow is mostly penumbra.
"""

import functools
from dataclasses import dataclass, replace
from math import isqrt

from asmjax.geometry import disk_light
from asmjax.scene.soft_visibility import analytic_soft_visibility
from asmjax.scene.spec import Disk, LightSpec, Rectangle, ViewSpec
from asmjax.shadow import (
    MomentShadowMap,
    PartitionedShadowMap,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
)
from asmjax.shadow.comparison import texel_bytes
from asmjax.shadow.soft.summed import BYTES
from helpers.analytic_cases import Case
from helpers.registry import SIBLINGS, Sibling, charted, filtered
from helpers.traced_cases import traced_case

SIDE = 128
"""Pixels a side."""

TEXELS = 4**7
"""Texels of each map in all; 6 bytes each, tables included."""

DISCS = 16

AVENUE = (
    Rectangle("ground", (0.0, 150.0, 0.0), (40.0, 0.0, 0.0), (0.0, 160.0, 0.0)),
    *(
        Disk(f"disc_{k}", ((-1) ** k * 0.5 * 1.15**k, 1.6 * 1.32**k, 0.6), (0.0, 0.0, 1.0), 0.35)
        for k in range(DISCS)
    ),
)

EYE = ViewSpec(
    "avenue", (0.0, 0.0, 1.0), (0.0, 10.0, -1.0), fov_x_deg=60.0, width=SIDE, height=SIDE
)

LIGHTS = {
    "across": LightSpec("sun", "directional", direction=(0.3, 0.0, -1.0)),
    # 16 degrees from the view's direction: inside its field of view.
    "along": LightSpec("sun", "directional", direction=(0.1, 1.0, -0.45)),
    # Far ahead of the eye, and something is seen on all its sides: faces of a cube.
    "lamp": LightSpec("lamp", "point", position=(0.4, 30.0, 6.0)),
}


@functools.cache
def avenue(light: str) -> Case:
    """The avenue under one of `LIGHTS`."""
    return traced_case(AVENUE, EYE, LIGHTS[light])


TABLE = (
    Rectangle("floor", (0.0, 0.0, 0.0), (6.0, 0.0, 0.0), (0.0, 6.0, 0.0)),
    Disk("table", (0.0, 0.0, 1.2), (0.0, 0.0, 1.0), 0.7),
)
ABOVE = ViewSpec(
    "above", (0.8, -1.0, 9.0), (0.0, 0.0, 0.0), fov_x_deg=30.0, width=SIDE, height=SIDE
)
WINDOW = LightSpec(
    "window",
    "point",
    position=(0.3, 0.2, 4.0),
    area=disk_light((0.3, 0.2, 4.0), (0.8, 0.0, 0.0), (0.0, -0.8, 0.0)),
)


@functools.cache
def table() -> Case:
    """The table under the window; what is expected are shares of the light."""
    case = traced_case(TABLE, ABOVE, WINDOW)
    return replace(case, expected=analytic_soft_visibility(TABLE, case.eye, case.frame).visibility)


def made_case(light: str) -> Case:
    """The table under the "window", the avenue under any other light."""
    return table() if light == "window" else avenue(light)


@dataclass(frozen=True)
class Made:
    """One algorithm under a light that it is made for.

    Attributes:
        sibling: with its settings.
        light: of `LIGHTS`, or "window".
        most: its wrong pixels, as a part of those of the uniform map of as many texels, at most:
            the measured part, a half more, and rounded up. Under the window each pixel counts by
            how wrong it is.
    """

    sibling: Sibling
    light: str
    most: float

    @property
    def name(self) -> str:
        return f"{self.sibling.name}-{self.light}"


_PLAIN = {sibling.name: sibling for sibling in SIBLINGS}
_FACES = charted("subdivided-faces", SubdividedShadowMap, {}, parts=1)
_FOCUS = charted("trapezoidal-focus", TrapezoidalShadowMap, {}, focus=6.0)
# Splits for the whole frustum; without these depths they are for those that are seen.
_LOG = charted("partitioned-log", PartitionedShadowMap, {}, near=1.0, far=300.0)
_PRACTICAL = charted(
    "partitioned-practical", PartitionedShadowMap, {}, blend=0.5, near=1.0, far=300.0
)
# Under a light with a size, of as many bytes.
_SUMS = replace(
    _PLAIN["moment"],
    of_budget=lambda texels, faces: MomentShadowMap(
        isqrt(texels * texel_bytes("both") // (BYTES * faces)) - 2
    ),
)
_SOFT = filtered("filtered-light-space", _PLAIN["light-space"], kernel="bilinear")

MADE = (
    Made(_PLAIN["perspective"], "across", 0.15),
    Made(_PLAIN["light-space"], "across", 0.2),
    Made(_PLAIN["trapezoidal"], "across", 0.35),
    Made(_FOCUS, "across", 0.15),
    Made(_PLAIN["logarithmic"], "across", 0.25),
    Made(_LOG, "across", 0.15),
    Made(_PRACTICAL, "across", 0.6),
    Made(_PLAIN["partitioned"], "across", 0.15),
    Made(_FACES, "across", 0.15),
    Made(_PLAIN["subdivided"], "across", 0.1),
    Made(_PLAIN["tuned"], "across", 0.1),
    Made(_PLAIN["adaptive"], "across", 0.1),
    # Edges smoother than the steps of its texels.
    Made(_SOFT, "across", 0.15),
    Made(_PLAIN["partitioned"], "along", 0.25),
    Made(_FACES, "along", 0.35),
    Made(_PLAIN["subdivided"], "along", 0.2),
    Made(_PLAIN["tuned"], "along", 0.35),
    Made(_PLAIN["accumulated"], "window", 0.45),
    Made(_PLAIN["pcss"], "window", 0.12),
    Made(_SUMS, "window", 0.17),
    # A warp of its own for each face of the cube: the conjecture that ends TR05-024.
    Made(_PLAIN["perspective"], "lamp", 0.25),
    Made(_PLAIN["trapezoidal"], "lamp", 0.35),
    Made(_PLAIN["logarithmic"], "lamp", 0.4),
    Made(_PLAIN["subdivided"], "lamp", 0.2),
)
