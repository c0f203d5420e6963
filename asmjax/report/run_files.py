"""From a measured run to its files: report.json, table, arrays and figures."""

import sys
from pathlib import Path

import jax
import numpy as np

from asmjax.buffers import TexelWindows
from asmjax.experiment import Measured, RunResult
from asmjax.geometry import towards_light
from asmjax.metrics import error_summary, surface_pairs
from asmjax.report.figures import RunPictures, TreePicture, linear_parts, write_figures
from asmjax.report.provenance import provenance
from asmjax.report.record import map_summary, method_record, run_report, write_json
from asmjax.report.table import write_csv
from asmjax.shadow.adaptive import AdaptiveState


def write_results(result: RunResult, folder: Path, *, seed: int, save_arrays: bool) -> dict:
    """Write report.json, the table as CSV, the figures, and with `save_arrays` arrays.npz.

    The numbers come first: a figure that fails cannot lose them. Returns the report.
    """
    report = report_of(result, seed)
    write_json(folder / "report.json", report)
    write_csv(folder / "methods.csv", report["methods"])
    # Arrays of an earlier run would not belong to this report.
    (folder / "arrays.npz").unlink(missing_ok=True)
    if save_arrays:
        _write_arrays(result, folder / "arrays.npz")
    write_figures(_pictures(result, report), folder)
    return report


def report_of(result: RunResult, seed: int) -> dict:
    """The validated `report.json` of a run with that seed."""
    eye, truth = result.eyes[0], result.truth
    size = eye.size
    valid = eye.valid.reshape(size)
    pairs = surface_pairs(valid, np.where(eye.valid, eye.depth, 1.0).reshape(size))
    expected = truth.visibility.reshape(size)
    methods = [
        method_record(
            method.name,
            settings=method.settings,
            effective_resolution=method.effective_resolution,
            bytes=method.cost.bytes,
            rays=method.cost.rays,
            seconds=method.cost.seconds,
            error=error_summary(expected, method.visibility.reshape(size), valid, pairs),
            **_tree_keys(result, method),
        )
        for method in result.methods
    ]
    notices = list(result.notices)
    notices += [f"{m.name}: {m.status.value}" for m in result.methods if m.status.is_limit]
    has_ratio = np.isfinite(result.maps["m"])
    return run_report(
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.variant, jax.devices()[0].device_kind),
        seed=seed,
        scene=result.scene,
        view=result.view.name,
        light=f"{result.light.name} ({result.light.kind}, {result.frame.faces} face(s))",
        size=(eye.camera.width, eye.camera.height),
        truth={
            "samples": len(result.eyes),
            "rays": truth.cost.rays,
            "seconds": truth.cost.seconds["query"],
            "valid_pixels": int(eye.valid.sum()),
            "lit_fraction": float(truth.visibility[eye.valid].mean()),
        },
        cost_model={
            "a_seconds_per_texel": result.cost_model.a_seconds_per_texel,
            "b_seconds": result.cost_model.b_seconds,
            "residual": result.cost_model.residual,
        },
        maps={name: map_summary(values, has_ratio) for name, values in result.maps.items()},
        methods=methods,
        notices=notices,
    )


def _tree_keys(result: RunResult, method: Measured) -> dict:
    if not isinstance(method.state, AdaptiveState):
        return {}
    return {
        "nodes": result.adaptive.nodes(method.state).size.size,
        "passes": method.cost.passes,
        "max_level": result.adaptive.max_level(method.state),
        "status": method.status.name.lower(),
    }


def _write_arrays(result: RunResult, path: Path) -> None:
    eye = result.eyes[0]
    size = eye.size
    arrays = {
        "valid": eye.valid.reshape(size),
        "position": eye.world.reshape(3, *size),
        "truth": result.truth.visibility.reshape(size),
        **{name: values.reshape(size) for name, values in result.maps.items()},
        **{f"visibility_{m.name}": m.visibility.reshape(size) for m in result.methods},
    }
    scratch = path.with_name(f".{path.name}.part")
    with scratch.open("wb") as file:
        np.savez_compressed(file, **arrays)
    scratch.replace(path)


def _pictures(result: RunResult, report: dict) -> RunPictures:
    eye = result.eyes[0]
    size = eye.size
    to_light = towards_light(result.frame, np.where(eye.valid, eye.world, 0.0))
    length = np.linalg.norm(to_light, axis=0)
    cosine = np.einsum("in,in->n", eye.normal, to_light) / np.where(length > 0, length, 1.0)
    direct, ambient = linear_parts(eye.albedo.reshape(3, *size), cosine.reshape(size))
    tree = next(m.state for m in result.methods if isinstance(m.state, AdaptiveState))
    _, log2_resolution = result.adaptive.lookup(tree, eye.points)
    receives = np.isfinite(result.maps["m"])
    return RunPictures(
        title=f"{result.scene}, {result.view.name}",
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


def _tree_picture(result: RunResult, state: AdaptiveState) -> TreePicture:
    nodes = result.adaptive.nodes(state)

    def cast(face: int, u: float, v: float, size: float, side: int) -> np.ndarray:
        corner, texel = np.array([[u], [v]]), np.full((2, 1), size / side)
        windows = TexelWindows(np.array([face]), corner, texel, side)
        return np.asarray(result.rays.light_buffer(result.frame, windows).depth)[0]

    return TreePicture(
        level=nodes.level,
        face=nodes.face,
        lo=nodes.lo,
        size=nodes.size,
        node_resolution=result.adaptive.node_resolution,
        faces=result.frame.faces,
        cast=cast,
    )
