"""Experiments: algorithms measured side by side on one view, and the maps that explain them."""

from asmjax.experiment.bench import Bench
from asmjax.experiment.clock import (
    Median,
    in_turns,
    median_by_stage,
    median_of,
    ratio_of,
    repeated,
    timed,
)
from asmjax.experiment.ledger import Ledger
from asmjax.experiment.maps import analysis_maps
from asmjax.experiment.methods import Measured, measure, measure_rays, settings_of
from asmjax.experiment.result import RunResult
from asmjax.experiment.trial import Trial

__all__ = [
    "Bench",
    "Ledger",
    "Measured",
    "Median",
    "RunResult",
    "Trial",
    "analysis_maps",
    "in_turns",
    "measure",
    "measure_rays",
    "median_by_stage",
    "median_of",
    "ratio_of",
    "repeated",
    "settings_of",
    "timed",
]
