"""From a measured run to its files: report.json, table, arrays and figures."""

import sys
from pathlib import Path

import jax
import numpy as np

from asmjax.experiment import RunResult
from asmjax.report.figures import RunPictures, write_figures
from asmjax.report.figures.seen import write_seen
from asmjax.report.measured import (
    cost_model_record,
    light_text,
    method_records,
    missing_text,
    truth_notices,
    truth_record,
    write_arrays,
)
from asmjax.report.outputs import ANALYSIS, PLAN, SEEN, WALKTHROUGH, remove
from asmjax.report.provenance import provenance
from asmjax.report.record import map_summary, run_report, write_json
from asmjax.report.table import METHOD_COLUMNS, SOFT_COLUMNS, has_penumbrae, write_csv
from asmjax.report.view_pictures import tree_picture, view_pictures
from asmjax.shadow.adaptive import AdaptiveState


def write_results(result: RunResult, folder: Path, *, seed: int, save_arrays: bool) -> dict:
    """Write report.json, the table as CSV, the figures, and with `save_arrays` arrays.npz.

    The numbers come first: a figure that fails cannot lose them. Returns the report.
    """
    report = report_of(result, seed)
    write_json(folder / "report.json", report)
    remove(folder, ("arrays.npz", *SEEN, *WALKTHROUGH, *ANALYSIS, *PLAN))
    columns = METHOD_COLUMNS + (SOFT_COLUMNS[1:] if has_penumbrae(report["methods"]) else ())
    write_csv(folder / "methods.csv", report["methods"], columns)
    if save_arrays:
        write_arrays(
            folder / "arrays.npz", result.eyes[0], result.truth, result.methods, result.maps
        )
    pictures = pictures_of(result, report)
    write_figures(pictures, folder)
    write_seen(pictures, folder)
    return report


def report_of(result: RunResult, seed: int) -> dict:
    """The validated `report.json` of a run with that seed."""
    eye = result.eyes[0]
    methods = method_records(
        eye, result.truth, result.methods, result.adaptive, result.standard_error
    )
    notices = list(result.notices)
    notices += [f"{m.name}: {m.status.value}" for m in result.methods if m.status.is_limit]
    notices += truth_notices(result.truth, result.standard_error)
    has_ratio = np.isfinite(result.maps["m"])
    return run_report(
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.variant, jax.devices()[0].device_kind),
        seed=seed,
        scene=result.scene,
        view=result.view.name,
        light=light_text(result.light, result.frame),
        size=(eye.camera.width, eye.camera.height),
        truth=truth_record(result.eyes, result.truth, result.standard_error),
        cost_model=cost_model_record(result.cost_model),
        maps={name: map_summary(values, has_ratio) for name, values in result.maps.items()},
        methods=methods,
        notices=notices,
        memory=result.memory,
        **({} if result.plan is None else {"plan": result.plan}),
    )


def pictures_of(result: RunResult, report: dict) -> RunPictures:
    """What the figures of a run are drawn from; `report` as of `report_of`."""
    tree = next(m.state for m in result.methods if isinstance(m.state, AdaptiveState))
    _, log2_resolution = result.adaptive.lookup(tree, result.eyes[0].points)
    receives = np.isfinite(result.maps["m"])
    return view_pictures(
        f"{result.scene}, {result.view.name}{_missing(result)}",
        result.eyes[0],
        result.frame,
        result.truth.visibility,
        {m.name: m.visibility for m in result.methods},
        maps=result.maps,
        methods=report["methods"],
        log2_resolution=np.where(receives, np.asarray(log2_resolution), np.nan),
        tree=tree_picture(result.adaptive, tree, result.frame, result.rays),
    )


def _missing(result: RunResult) -> str:
    """What no method has, in the words that every figure's title ends with."""
    plan = result.plan or {"not_simulated": []}
    return missing_text(item["effect"] for item in plan["not_simulated"])
