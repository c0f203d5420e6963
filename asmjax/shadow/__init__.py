"""Shadow algorithms: siblings behind one protocol, `ShadowAlgorithm`."""

from asmjax.shadow.adaptive import PRESETS, AdaptiveShadowMap, CostModel, calibrate, preset
from asmjax.shadow.base import Cost, MapMemory, NodeCounts, ShadowAlgorithm, Status
from asmjax.shadow.filtered import FilteredShadowMap
from asmjax.shadow.registry import ALGORITHMS, FILTERS, MAPS, SOFT, of_resolution
from asmjax.shadow.settings import (
    algorithm_of,
    family_of,
    read_settings,
    settings_text,
    write_settings,
)
from asmjax.shadow.soft import (
    AccumulatedShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
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
    "AccumulatedShadowMap",
    "AdaptiveShadowMap",
    "Cost",
    "CostModel",
    "FILTERS",
    "FilteredShadowMap",
    "MAPS",
    "MapMemory",
    "MomentShadowMap",
    "NodeCounts",
    "PCSSShadowMap",
    "SOFT",
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
    "of_resolution",
    "preset",
    "read_settings",
    "resolution_for",
    "settings_text",
    "write_settings",
]
