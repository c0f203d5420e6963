"""Soft shadows: algorithms for lights that have a size."""

from asmjax.shadow.soft.accumulated import AccumulatedShadowMap
from asmjax.shadow.soft.moments import MomentShadowMap
from asmjax.shadow.soft.pcss import PCSSShadowMap

__all__ = ["AccumulatedShadowMap", "MomentShadowMap", "PCSSShadowMap"]
