"""What one run measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.experiment.methods import Measured
from asmjax.geometry import LightFrame
from asmjax.memory import Forecast
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel


@dataclass(frozen=True, eq=False)
class RunResult:
    """Methods measured on one view and light, and all that figures and report are made of.

    Attributes:
        scene: name of the scene.
        variant: the Mitsuba variant that cast the rays.
        notices: what of the scene is simulated differently from what it says.
        eyes: the samples of each pixel, pixel centres first.
        truth: the traced rays; one of `methods`, and what the others are judged by.
        methods: in the order of the table.
        maps: of the uniform map, (n,) each; see `analysis_maps`.
        adaptive: the algorithm whose state the tree is drawn from.
        memory: what it was estimated to take; None where nobody asked.
        plan: which effects were simulated and why, as a report has it (`Plan.record`); None where
            nobody made one.
        standard_error: (n,) of truth's visibility; None of hard truth.
    """

    scene: str
    variant: str
    notices: tuple[str, ...]
    view: ViewSpec
    light: LightSpec
    eyes: list[EyeBuffer]
    frame: LightFrame
    rays: LightRays
    truth: Measured
    cost_model: CostModel
    methods: list[Measured]
    maps: dict[str, np.ndarray]
    adaptive: AdaptiveShadowMap
    memory: Forecast | None = None
    plan: Mapping[str, Any] | None = None
    standard_error: np.ndarray | None = None
