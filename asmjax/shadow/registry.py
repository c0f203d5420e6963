"""All shadow algorithms by family name; a new sibling is one line here."""

from typing import Any

from asmjax.shadow.adaptive import AdaptiveShadowMap
from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.filtered import FilteredShadowMap
from asmjax.shadow.soft import (
    AccumulatedShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
)
from asmjax.shadow.uniform import UniformShadowMap
from asmjax.shadow.warped import (
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    PerspectiveShadowMap,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
    TunedShadowMap,
)

MAPS: dict[str, type[ShadowAlgorithm]] = {
    "uniform": UniformShadowMap,
    "adaptive": AdaptiveShadowMap,
    "perspective": PerspectiveShadowMap,
    "light-space": LightSpaceShadowMap,
    "trapezoidal": TrapezoidalShadowMap,
    "logarithmic": LogarithmicShadowMap,
    "partitioned": PartitionedShadowMap,
    "subdivided": SubdividedShadowMap,
    "tuned": TunedShadowMap,
}
"""Family name, with which the names of its results begin, to class: maps with texels of their own,
which answer 0 or 1."""

FILTERS: dict[str, type[ShadowAlgorithm]] = {"filtered": FilteredShadowMap}
"""Those that answer with shares of light, from texels of another one, their setting `inner`."""

SOFT: dict[str, type[ShadowAlgorithm]] = {
    "pcss": PCSSShadowMap,
    "moment": MomentShadowMap,
    "accumulated": AccumulatedShadowMap,
}
"""Those that answer with shares of light where a light has a size. Of any other they are the
uniform map, so that comparisons of hard shadows leave them out."""

ALGORITHMS = MAPS | FILTERS | SOFT


def of_resolution(family: str, resolution: int, **settings: Any) -> ShadowAlgorithm:
    """An algorithm of a family that has texels in proportion to a `resolution`, texels a side; a
    filter is of the uniform map.

    Raises:
        UseError: as its settings do.
    """
    kind: Any = ALGORITHMS[family]
    if family in FILTERS:
        return kind(inner=UniformShadowMap(resolution), **settings)
    return kind(resolution=resolution, **settings)
