"""From a measured run to its files: report.json, table, arrays and figures."""

import sys
from pathlib import Path

import jax
import numpy as np

from asmjax.buffers import TexelWindows
from asmjax.experiment import RunResult
from asmjax.report.figures import RunPictures, TreePicture, write_figures
from asmjax.report.measured import (
    cost_model_record,
    light_parts,
    light_text,
    method_records,
    missing_text,
    truth_notices,
    truth_record,
    write_arrays,
)
from asmjax.report.outputs import ANALYSIS, PLAN, WALKTHROUGH, remove
from asmjax.report.provenance import provenance
from asmjax.report.record import map_summary, run_report, write_json
from asmjax.report.table import METHOD_COLUMNS, SOFT_COLUMNS, has_penumbrae, write_csv
from asmjax.shadow.adaptive import AdaptiveState


def write_results(result: RunResult, folder: Path, *, seed: int, save_arrays: bool) -> dict:
    """Write report.json, the table as CSV, the figures, and with `save_arrays` arrays.npz.

    The numbers come first: a figure that fails cannot lose them. Returns the report.
    """
    report = report_of(result, seed)
    write_json(folder / "report.json", report)
    remove(folder, ("arrays.npz", *WALKTHROUGH, *ANALYSIS, *PLAN))
    columns = METHOD_COLUMNS + (SOFT_COLUMNS[1:] if has_penumbrae(report["methods"]) else ())
    write_csv(folder / "methods.csv", report["methods"], columns)
    if save_arrays:
        write_arrays(
            folder / "arrays.npz", result.eyes[0], result.truth, result.methods, result.maps
        )
    write_figures(_pictures(result, report), folder)
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


def _pictures(result: RunResult, report: dict) -> RunPictures:
    eye = result.eyes[0]
    size = eye.size
    direct, ambient = light_parts(eye, result.frame)
    tree = next(m.state for m in result.methods if isinstance(m.state, AdaptiveState))
    _, log2_resolution = result.adaptive.lookup(tree, eye.points)
    receives = np.isfinite(result.maps["m"])
    return RunPictures(
        title=f"{result.scene}, {result.view.name}{_missing(result)}",
        direct=direct,
        ambient=ambient,
        valid=eye.valid.reshape(size),
        truth=result.truth.visibility.reshape(size),
        visibilities={m.name: m.visibility.reshape(size) for m in result.methods},
        methods=report["methods"],
        maps={name: values.reshape(size) for name, values in result.maps.items()},
        log2_resolution=np.where(receives, np.asarray(log2_resolution), np.nan).reshape(size),
        tree=_tree_picture(result, tree),
    )


def _missing(result: RunResult) -> str:
    """What no method has, in the words that every figure's title ends with."""
    plan = result.plan or {"not_simulated": []}
    return missing_text(item["effect"] for item in plan["not_simulated"])


def _tree_picture(result: RunResult, state: AdaptiveState) -> TreePicture:
    nodes = result.adaptive.nodes(state)

    def cast(face: int, u: float, v: float, size: float, side: int) -> np.ndarray:
        corner, texel = np.array([[u], [v]]), np.full((2, 1), size / side)
        windows = TexelWindows(np.array([face]), corner, texel, side)
        return result.rays.light_buffer(result.frame, windows).depth[0]

    return TreePicture(
        level=nodes.level,
        face=nodes.face,
        lo=nodes.lo,
        size=nodes.size,
        node_resolution=result.adaptive.node_resolution,
        faces=result.frame.faces,
        cast=cast,
    )
