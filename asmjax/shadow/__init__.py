"""Shadow algorithms: siblings behind one protocol, `ShadowAlgorithm`."""

from asmjax.shadow.adaptive import PRESETS, AdaptiveShadowMap, CostModel, calibrate, preset
from asmjax.shadow.base import Cost, MapMemory, NodeCounts, ShadowAlgorithm, Status
from asmjax.shadow.registry import ALGORITHMS
from asmjax.shadow.settings import (
    algorithm_of,
    family_of,
    read_settings,
    settings_text,
    write_settings,
)
from asmjax.shadow.uniform import UniformShadowMap, resolution_for
from asmjax.shadow.warped import (
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    PerspectiveShadowMap,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
    TunedShadowMap,
)

__all__ = [
    "ALGORITHMS",
    "PRESETS",
    "AdaptiveShadowMap",
    "Cost",
    "CostModel",
    "MapMemory",
    "NodeCounts",
    "ShadowAlgorithm",
    "Status",
    "LightSpaceShadowMap",
    "LogarithmicShadowMap",
    "PartitionedShadowMap",
    "PerspectiveShadowMap",
    "SubdividedShadowMap",
    "TrapezoidalShadowMap",
    "TunedShadowMap",
    "UniformShadowMap",
    "algorithm_of",
    "calibrate",
    "family_of",
    "preset",
    "read_settings",
    "resolution_for",
    "settings_text",
    "write_settings",
]
