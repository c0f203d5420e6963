"""Experiments: algorithms measured side by side on one view, and the maps that explain them."""

from asmjax.experiment.maps import analysis_maps
from asmjax.experiment.methods import Measured, measure, measure_rays, settings_of
from asmjax.experiment.result import RunResult
from asmjax.experiment.timing import median_by_stage, repeated, timed

__all__ = [
    "Measured",
    "RunResult",
    "analysis_maps",
    "measure",
    "measure_rays",
    "median_by_stage",
    "repeated",
    "settings_of",
    "timed",
]
