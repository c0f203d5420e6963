"""Adaptive shadow maps: a tree of nodes, refined by benefit per cost."""

from asmjax.shadow.adaptive.asm import AdaptiveShadowMap, AdaptiveState
from asmjax.shadow.adaptive.cost_model import CostModel, calibrate, fit_cost_model

__all__ = ["AdaptiveShadowMap", "AdaptiveState", "CostModel", "calibrate", "fit_cost_model"]
