"""Adaptive shadow maps: a tree of nodes, refined by benefit per cost."""

from asmjax.shadow.adaptive.asm import AdaptiveShadowMap
from asmjax.shadow.adaptive.calibration_store import (
    Calibrated,
    calibration_dir,
    kept_model,
    kept_or_measured,
    on_this_machine,
)
from asmjax.shadow.adaptive.cost_model import TYPICAL, CostModel, calibrate, fit_cost_model
from asmjax.shadow.adaptive.presets import PRESETS, preset
from asmjax.shadow.adaptive.state import AdaptiveState

__all__ = [
    "PRESETS",
    "TYPICAL",
    "AdaptiveShadowMap",
    "AdaptiveState",
    "Calibrated",
    "CostModel",
    "calibrate",
    "calibration_dir",
    "fit_cost_model",
    "kept_model",
    "kept_or_measured",
    "on_this_machine",
    "preset",
]
