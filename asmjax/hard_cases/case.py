"""What a hard case is: plain data that the measurement, the page and the tests read."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from asmjax.hard_cases.scene import Setup

ROWS = {
    1: "light into the view, and along it",
    2: "light parallel to the receiver",
    3: "eye grazing the receiver",
    4: "light at the eye",
    5: "light near the camera's plane",
    6: "points behind the light",
    7: "triangles that cross the light's plane",
    8: "near-plane singularity of warps, casters behind their centre",
    9: "fields of view of 122 to 179 degrees, cube seams",
    10: "effective resolutions in float32",
    11: "large world offsets",
    12: "addresses of texels in tiles",
    13: "borders of pages",
    14: "tiny and huge scenes",
    15: "far / near towards 1",
    16: "the paper's xi from differences",
    17: "far / near of 1e6 and more, a warp's centre at infinity",
    18: "precision of depth",
    19: "bias: acne, and light through walls",
    20: "slivers and triangles without area",
    21: "coplanar and duplicate faces",
    22: "two-sided and self-intersecting surfaces",
    23: "casters smaller than texels and pixels",
    24: "gradients of masked pixels",
    25: "gradients of maxima",
    26: "overflow of numbers of texels and primitives",
    27: "empty sets",
    28: "fold-over of warps",
    29: "parallel up vectors",
    30: "point lights at a great distance",
    31: "penumbrae without width",
    32: "lights so large that no umbra is left",
    33: "casters at a light with a size",
    34: "cones to a light of 90 degrees and more, cube seams below it",
    35: "lights that cross the receiver's horizon",
    36: "moments of depths in float32",
}
"""The thirty numerical traps of hard shadows and six of soft ones, in the order in which the page
lists them."""

Theme = Literal["projections", "addresses", "warps", "lights", "views", "surfaces", "soft"]

THEMES: dict[Theme, str] = {
    "projections": "Projections and depths",
    "addresses": "Hits and texel addresses",
    "warps": "Warps, splits and gradients",
    "lights": "Scenes: lights",
    "views": "Scenes: eyes, scales and offsets",
    "surfaces": "Scenes: surfaces and bias",
    "soft": "Scenes: lights with a size",
}
"""What cases are drawn and listed together."""


@dataclass(frozen=True)
class Bound:
    """Up to which error a case counts as stable.

    Attributes:
        float32, float64: by the precision that JAX computes in.
        unit: what errors are counted in.
        gradient: of the error of gradients, relative to the largest; in float32, and a hundredth
            of it in float64.
    """

    float32: float
    float64: float
    unit: str
    gradient: float = 1e-4

    def of(self, precision: str) -> float:
        return self.float32 if precision == "float32" else self.float64

    def of_gradient(self, precision: str) -> float:
        return self.gradient if precision == "float32" else self.gradient / 100


@dataclass(frozen=True, eq=False)
class Kernel:
    """A kernel at one severity. Truth is that of the inputs as the precision rounds them.

    Attributes:
        inputs: float64 arrays.
        value: of the inputs in either precision, in JAX.
        truth: of the rounded inputs, float64 in and out.
        gradient: of the inputs, in JAX; None where none is asked for.
        gradient_truth: as `truth`.
        unit: what an error of 1 is in `value`; None for relative errors.
        marks: of the inputs, whether the kernel says that an entry is beyond it, or its case that
            asmjax never asks that of it; in JAX.
        refusal: raises `UseError` where the toolkit does not take this severity.
        goes_on: whether the kernel is asked all the same, to show what is refused.
        host: whether `value` is called as it is, and not compiled.
    """

    inputs: tuple[np.ndarray, ...]
    value: Callable
    truth: Callable[..., np.ndarray]
    gradient: Callable | None = None
    gradient_truth: Callable[..., np.ndarray] | None = None
    unit: float | None = None
    marks: Callable | None = None
    refusal: Callable[[], object] | None = None
    goes_on: bool = False
    host: bool = False


@dataclass(frozen=True, eq=False)
class HardCase:
    """One trap, at any severity.

    Attributes:
        name: unique, in words.
        rows: which of `ROWS` it covers.
        theme: of `THEMES`.
        breaks: what goes wrong in the naive formulation.
        source: where the stable formulation comes from.
        truth: what results are compared with.
        axis: what the severity is, with its unit.
        severities: ascending; the last ones lie beyond where it is expected to hold, if any do.
        bound: errors up to which it is stable.
        fails_from: severity from which it may fail, and has to say so; None if it holds at all.
        announced: how it says so.
        build: of a severity: a `Kernel`, or the `Setup` of a scene for all algorithms.
    """

    name: str
    rows: tuple[int, ...]
    theme: Theme
    breaks: str
    source: str
    truth: str
    axis: str
    severities: tuple[float, ...]
    bound: Bound
    build: Callable[[float], Kernel | Setup]
    fails_from: float | None = None
    announced: str = ""

    @property
    def is_scene(self) -> bool:
        """Whether algorithms are run on it, and not a kernel alone."""
        return self.theme in ("lights", "views", "surfaces", "soft")

    @property
    def is_soft(self) -> bool:
        """Whether the scene's light has a size, so that soft maps are run on it."""
        return self.theme == "soft"

    @property
    def few(self) -> tuple[float, ...]:
        """Its mildest, middle and worst severity."""
        all_of_them = self.severities
        return tuple(dict.fromkeys((all_of_them[0], all_of_them[len(all_of_them) // 2],
                                    all_of_them[-1])))  # fmt: skip
