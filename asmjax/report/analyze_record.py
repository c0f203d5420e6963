"""What `asmjax analyze` measured, and its report."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import jax
import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.experiment import Measured
from asmjax.experiment.aliasing import AliasingMaps, AliasingNumbers
from asmjax.experiment.displacement import Displacement
from asmjax.experiment.light_angles import AngleError, ViewRange
from asmjax.geometry import LightFrame
from asmjax.memory import Forecast
from asmjax.report.measured import (
    cost_model_record,
    light_text,
    method_records,
    truth_notices,
    truth_record,
)
from asmjax.report.provenance import provenance
from asmjax.report.record import report_of_entries
from asmjax.report.schema import ALIASING_SCHEMA
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel, ShadowAlgorithm


@dataclass(frozen=True, eq=False)
class Analysed:
    """One algorithm on one view.

    Attributes:
        family: of the registry.
        algorithm: as it was built.
        measured: visibility, cost and state.
    """

    family: str
    algorithm: ShadowAlgorithm
    measured: Measured
    maps: AliasingMaps
    numbers: AliasingNumbers
    displacement: Displacement


@dataclass(frozen=True, eq=False)
class LightSweep:
    """The same algorithms under other directions of light.

    Attributes:
        seen: depth range and field of view, which the theory is asked for.
        algorithms: by family, as they were built for one face of texels.
        errors: by angle, then in the order of `algorithms`.
    """

    seen: ViewRange
    algorithms: dict[str, ShadowAlgorithm]
    errors: list[AngleError]


@dataclass(frozen=True, eq=False)
class AnalysisResult:
    """All that an analysis measured, and its figures and report are made of.

    Attributes:
        scene: name of the scene.
        variant: the Mitsuba variant that cast the rays.
        notices: what of the scene is simulated differently from what it says.
        left_out: what could not be measured, and why, one line each.
        eyes: the samples of each pixel, pixel centres first.
        truth: the traced rays by which all is judged.
        traced: the rays of the table: one a sample, and where truth is soft, those besides.
        standard_error: (n,) of truth's visibility; None of hard truth.
        adaptive: its settings, whether or not it is among `analysed`.
        cost_model: None where nothing needed one.
        sweep: None where no direction was asked for.
        memory: what it was estimated to take; None where nobody asked.
    """

    scene: str
    variant: str
    notices: tuple[str, ...]
    left_out: list[str]
    view: ViewSpec
    light: LightSpec
    eyes: list[EyeBuffer]
    frame: LightFrame
    truth: Measured
    adaptive: AdaptiveShadowMap
    cost_model: CostModel | None
    analysed: list[Analysed]
    sweep: LightSweep | None
    memory: Forecast | None = None
    traced: Sequence[Measured] = ()
    standard_error: np.ndarray | None = None

    @property
    def title(self) -> str:
        """Scene and view, for figures."""
        return f"{self.scene}, {self.view.name}"

    def image(self, values: np.ndarray) -> np.ndarray:
        """(height, width) of values (n,) per pixel."""
        return values.reshape(self.eyes[0].size)


def report_of_analysis(result: AnalysisResult, seed: int) -> dict:
    """The validated `report.json` of an analysis with that seed."""
    camera = result.eyes[0].camera
    limits = [
        f"{item.measured.name}: {item.measured.status.value}"
        for item in result.analysed
        if item.measured.status.is_limit
    ]
    model = result.cost_model
    return report_of_entries(
        schema=ALIASING_SCHEMA,
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.variant, jax.devices()[0].device_kind),
        seed=seed,
        memory=result.memory,
        scene=result.scene,
        view=result.view.name,
        light=light_text(result.light, result.frame),
        size=(camera.width, camera.height),
        memory_limit_bytes=result.adaptive.memory_bytes,
        truth=truth_record(result.eyes, result.truth, result.standard_error),
        cost_model=None if model is None else cost_model_record(model),
        methods=_methods(result),
        light_angles=None if result.sweep is None else _sweep_record(result.sweep),
        notices=[
            *result.notices,
            *result.left_out,
            *limits,
            *truth_notices(result.truth, result.standard_error),
        ],
    )


def _methods(result: AnalysisResult) -> list[dict]:
    traced = result.traced or [result.truth]
    measured = [*(item.measured for item in result.analysed), *traced]
    records = method_records(
        result.eyes[0], result.truth, measured, result.adaptive, result.standard_error
    )
    more: list[dict[str, Any]] = [
        {
            "family": item.family,
            "aliasing": item.numbers.record(),
            "displacement": asdict(item.displacement),
        }
        for item in result.analysed
    ]
    more += [{"family": "rays"} for _ in traced]
    return [record | extra for record, extra in zip(records, more, strict=True)]


def _sweep_record(sweep: LightSweep) -> dict:
    return {
        "alpha": sweep.seen.alpha,
        "half_view_deg": float(np.degrees(sweep.seen.theta)),
        "angles": [
            {"angle_deg": angle, "methods": _at(angle, sweep.errors)}
            for angle in dict.fromkeys(error.angle_deg for error in sweep.errors)
        ],
    }


def _at(angle_deg: float, errors: Sequence[AngleError]) -> list[dict]:
    return [
        {
            "family": error.family,
            "max_perspective": error.max_perspective,
            "p95_perspective": error.p95_perspective,
            "p95_m": error.p95_m,
            "storage_factor": error.storage,
            "theory_storage_factor": error.theory,
        }
        for error in errors
        if error.angle_deg == angle_deg
    ]
