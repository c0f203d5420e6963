"""All shadow algorithms by family name; a new sibling is one line here."""

from asmjax.shadow.adaptive import AdaptiveShadowMap
from asmjax.shadow.base import ShadowAlgorithm
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

ALGORITHMS: dict[str, type[ShadowAlgorithm]] = {
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
"""Family name, with which the names of its results begin, to class."""
