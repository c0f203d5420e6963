"""From an analysis to its files: report.json, table, arrays and figures."""

import numpy as np

from asmjax.experiment.light_angles import FIRST_DEG, theory_storage
from asmjax.report.analyze_record import AnalysisResult, LightSweep
from asmjax.report.analyze_table import analysis_csv
from asmjax.report.figures.aliasing_maps import MPanel, draw_aliasing_maps
from asmjax.report.figures.board import drawing
from asmjax.report.figures.edge_displacement import EdgePoint, draw_displacement
from asmjax.report.figures.light_angles import AngleCurve, draw_light_angles
from asmjax.report.measured import arrays_writer
from asmjax.report.outputs import Outputs
from asmjax.writing import Writer, text_writer

_THEORY_STEPS = 177
"""Directions at which the theory's lines are drawn: half a degree apart."""


def write_analysis(
    result: AnalysisResult, report: dict, outputs: Outputs, *, save_arrays: bool
) -> None:  # fmt: skip
    """Write report.json, the table as CSV, the figures, and with `save_arrays` arrays.npz.

    The numbers come first: a figure that fails cannot lose them.

    Args:
        report: as of `report_of_analysis`.

    Raises:
        WriteError: some of it cannot be written.
    """
    outputs.keep(report)
    outputs.add({"methods.csv": text_writer(lambda: analysis_csv(report["methods"]))})
    if save_arrays:
        outputs.add({"arrays.npz": _arrays(result)})
    figures = {
        "aliasing.png": drawing(lambda: draw_aliasing_maps(_panels(result), result.title)),
        "displacement.png": drawing(lambda: draw_displacement(_points(result), result.title)),
    }
    sweep = result.sweep
    if sweep is not None and sweep.errors:
        figures["light_angles.png"] = drawing(
            lambda: draw_light_angles(
                _curves(sweep), sweep.seen.alpha, sweep.seen.theta, result.title
            )
        )
    outputs.add(figures)
    outputs.finish()


def _arrays(result: AnalysisResult) -> Writer:
    maps = {
        f"{name}_{item.measured.name}": getattr(item.maps, name)
        for item in result.analysed
        for name in ("m", "perspective", "texels")
    }
    methods = [*(item.measured for item in result.analysed), *(result.traced or [result.truth])]
    return arrays_writer(result.eyes[0], result.truth, methods, maps)


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
