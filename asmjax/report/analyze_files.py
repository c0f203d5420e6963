"""From an analysis to its files: report.json, table, arrays and figures."""

from pathlib import Path

import numpy as np

from asmjax.experiment.light_angles import FIRST_DEG, theory_storage
from asmjax.report.analyze_record import AnalysisResult, LightSweep, report_of_analysis
from asmjax.report.analyze_table import write_analysis_csv
from asmjax.report.figures.aliasing_maps import MPanel, draw_aliasing_maps
from asmjax.report.figures.board import save
from asmjax.report.figures.edge_displacement import EdgePoint, draw_displacement
from asmjax.report.figures.light_angles import AngleCurve, draw_light_angles
from asmjax.report.measured import write_arrays
from asmjax.report.outputs import ANALYSIS, PLAN, SINGLE_RUN, WALKTHROUGH, remove
from asmjax.report.record import write_json

_THEORY_STEPS = 177
"""Directions at which the theory's lines are drawn: half a degree apart."""


def write_analysis(
    result: AnalysisResult, folder: Path, *, seed: int, save_arrays: bool
) -> dict:  # fmt: skip
    """Write report.json, the table as CSV, the figures, and with `save_arrays` arrays.npz.

    The numbers come first: a figure that fails cannot lose them. Returns the report.
    """
    report = report_of_analysis(result, seed)
    write_json(folder / "report.json", report)
    remove(folder, (*SINGLE_RUN, *WALKTHROUGH, *ANALYSIS, *PLAN))
    write_analysis_csv(folder / "methods.csv", report["methods"])
    if save_arrays:
        maps = {
            f"{name}_{item.measured.name}": getattr(item.maps, name)
            for item in result.analysed
            for name in ("m", "perspective", "texels")
        }
        methods = [*(item.measured for item in result.analysed), *(result.traced or [result.truth])]
        write_arrays(folder / "arrays.npz", result.eyes[0], result.truth, methods, maps)
    save(draw_aliasing_maps(_panels(result), result.title), folder / "aliasing.png")
    save(draw_displacement(_points(result), result.title), folder / "displacement.png")
    if result.sweep is not None and result.sweep.errors:
        seen = result.sweep.seen
        drawn = draw_light_angles(_curves(result.sweep), seen.alpha, seen.theta, result.title)
        save(drawn, folder / "light_angles.png")
    return report


def _panels(result: AnalysisResult) -> list[MPanel]:
    valid = result.image(result.eyes[0].valid)
    return [
        MPanel(item.measured.name, result.image(item.maps.m), valid) for item in result.analysed
    ]


def _points(result: AnalysisResult) -> list[EdgePoint]:
    return [
        EdgePoint(
            item.family,
            item.measured.name,
            item.displacement.predicted,
            item.displacement.measured,
        )
        for item in result.analysed
    ]


def _curves(sweep: LightSweep) -> list[AngleCurve]:
    lines = np.linspace(FIRST_DEG, 90, _THEORY_STEPS)
    curves = []
    for family, algorithm in sweep.algorithms.items():
        errors = [error for error in sweep.errors if error.family == family]
        expected = theory_storage(algorithm, sweep.seen, lines)
        curves.append(
            AngleCurve(
                family=family,
                angle_deg=np.array([error.angle_deg for error in errors]),
                max_perspective=np.array([error.max_perspective for error in errors]),
                p95_m=np.array([error.p95_m for error in errors]),
                storage=np.array([error.storage for error in errors]),
                theory=None if expected is None else np.stack([lines, expected]),
            )
        )
    return curves
