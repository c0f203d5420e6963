"""From a measured run to its files: report.json, table, arrays and figures."""

import sys

import jax
import numpy as np

from asmjax.experiment import RunResult
from asmjax.report.figures import RunPictures, figure_files
from asmjax.report.figures.seen import seen_files
from asmjax.report.measured import (
    arrays_writer,
    cost_model_record,
    light_text,
    method_records,
    missing_text,
    truth_notices,
    truth_record,
)
from asmjax.report.outputs import Outputs
from asmjax.report.provenance import provenance
from asmjax.report.record import map_summary, run_report
from asmjax.report.table import METHOD_COLUMNS, SOFT_COLUMNS, csv_text, has_penumbrae
from asmjax.report.view_pictures import tree_picture, view_pictures
from asmjax.shadow.adaptive import AdaptiveState
from asmjax.writing import text_writer


def write_results(
    result: RunResult, report: dict, outputs: Outputs, *, save_arrays: bool
) -> None:  # fmt: skip
    """Write report.json, the table as CSV, the figures, and with `save_arrays` arrays.npz.

    The numbers come first: a figure that fails cannot lose them.

    Args:
        report: as of `report_of`.

    Raises:
        WriteError: some of it cannot be written.
    """
    outputs.keep(report)
    columns = METHOD_COLUMNS + (SOFT_COLUMNS[1:] if has_penumbrae(report["methods"]) else ())
    outputs.add({"methods.csv": text_writer(lambda: csv_text(report["methods"], columns))})
    if save_arrays:
        arrays = arrays_writer(result.eyes[0], result.truth, result.methods, result.maps)
        outputs.add({"arrays.npz": arrays})
    pictures = pictures_of(result, report)
    outputs.add({**figure_files(pictures), **seen_files(pictures)})
    outputs.finish()


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
