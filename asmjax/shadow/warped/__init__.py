"""Warped, partitioned and subdivided shadow maps: each chooses charts, the rest is shared."""

from asmjax.shadow.warped.charted import ChartedShadowMap, ChartedState
from asmjax.shadow.warped.light_space import LightSpaceShadowMap
from asmjax.shadow.warped.logarithmic import LogarithmicShadowMap
from asmjax.shadow.warped.perspective import PerspectiveShadowMap
from asmjax.shadow.warped.subdivided import SubdividedShadowMap
from asmjax.shadow.warped.trapezoidal import TrapezoidalShadowMap
from asmjax.shadow.warped.tuned import TunedShadowMap
from asmjax.shadow.warped.z_partition import PartitionedShadowMap

__all__ = [
    "ChartedShadowMap",
    "ChartedState",
    "LightSpaceShadowMap",
    "LogarithmicShadowMap",
    "PartitionedShadowMap",
    "PerspectiveShadowMap",
    "SubdividedShadowMap",
    "TrapezoidalShadowMap",
    "TunedShadowMap",
]
