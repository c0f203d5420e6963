"""`asmjax run`: a scene in; buffers, maps, shadow maps, truth, errors, times and figures out."""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import jax
import numpy as np
from tqdm import tqdm

from asmjax.buffers import EyeBuffer, LightRays, TexelWindows
from asmjax.errors import UseError
from asmjax.experiment import Measured, analysis_maps, measure, measure_rays
from asmjax.geometry import LightFrame, towards_light
from asmjax.metrics import error_summary, surface_pairs
from asmjax.options import MEGABYTE, RunOptions
from asmjax.render.load import Scene, load_scene
from asmjax.report import map_summary, method_record, provenance, run_report, write_json
from asmjax.report.figures import RunPictures, TreePicture, linear_parts, write_figures
from asmjax.report.table import comparison_table, write_csv
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel, UniformShadowMap, calibrate, resolution_for
from asmjax.shadow.adaptive import AdaptiveState

T = TypeVar("T")

GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of the R2 sequence (Roberts 2018): evenly spread points for any number of samples."""


@dataclass(frozen=True, eq=False)
class MainResult:
    """Everything one run measured; `write_results` turns it into files.

    Attributes:
        eyes: the samples of each pixel, pixel centres first.
        truth: the traced rays; the last of `methods`, and what the others are judged by.
        methods: in the order of the table.
        maps: of the uniform map, (n,) each.
        adaptive: the algorithm whose state the tree is drawn from.
    """

    scene: Scene
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


def run_main_job(options: RunOptions) -> MainResult:
    """Measure, write the results below `options.out`, and print the table.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
    """
    folder = Path(options.out or f"out/run-{Path(options.scene).stem}")
    check_writable(folder)
    with tqdm(total=8, disable=options.quiet or None, leave=False, unit="step") as bar:
        result = measure_scene(options, progress=_Progress(bar))
        bar.set_description("figures")
        folder.mkdir(parents=True, exist_ok=True)
        report = write_results(result, options, folder)
        bar.update()
    if not options.quiet:
        for notice in report["notices"]:
            print(f"note: {notice}")
        print(comparison_table(report["methods"]))
        print(f"report and figures: {folder}/")
    return result


def measure_scene(options: RunOptions, progress: "Callable[[str], None]" = lambda _: None):
    """Everything that `asmjax run` measures, as a `MainResult`; writes nothing."""
    progress("scene")
    scene = load_scene(options.scene, options.variant)
    view = scene.view(options.view or options.sensor)
    if options.size is not None:
        view = view.resized(*options.size)
    light = scene.light(options.light)
    progress("eye buffer")
    offsets = sample_offsets(options.samples, options.seed)
    eyes = [scene.eye(view, offset) for offset in offsets]
    frame = scene.light_frame(eyes[0], options.light)
    rays = scene.light_rays(options.light)
    memory = int(options.memory_mb * MEGABYTE)
    limit = None if options.time_limit_ms is None else options.time_limit_ms / 1000
    adaptive = AdaptiveShadowMap(
        memory_bytes=memory,
        time_limit=limit,
        node_resolution=options.node_resolution,
        cells=options.cells,
    )
    adaptive.tree_shape(frame.faces)
    uniform = UniformShadowMap(resolution_for(memory, frame.faces))
    progress("truth")
    truth = measure_rays(
        [scene.shadow_rays(eye, frame, rays) for eye in eyes], eyes, options.repeats
    )
    progress("cost model")
    cost_model = calibrate(rays, frame)
    adaptive = replace(adaptive, cost_model=cost_model)
    progress(uniform.name)
    flat = measure(uniform, eyes, frame, rays, options.repeats)
    progress("maps")
    maps = analysis_maps(eyes[0], frame, uniform, flat.state)
    progress(adaptive.name)
    tree = measure(adaptive, eyes, frame, rays, options.repeats)
    return MainResult(
        scene,
        view,
        light,
        eyes,
        frame,
        rays,
        truth,
        cost_model,
        [flat, tree, truth],
        maps,
        adaptive,
    )


def sample_offsets(samples: int, seed: int) -> list[tuple[float, float]]:
    """Offsets (right, down) from the pixel centre in pixels: the centre, then an R2 sequence."""
    start = np.random.default_rng(seed).random(2)
    index = np.arange(1, samples)[:, None]
    spread = (start + index * np.array(GOLDEN)) % 1.0 - 0.5
    return [(0.0, 0.0), *((float(x), float(y)) for x, y in spread)]


def write_results(result: MainResult, options: RunOptions, folder: Path) -> dict:
    """Write report.json, the table as CSV, the figures, and arrays.npz if asked for.

    The numbers come first: a figure that fails cannot lose them. Returns the report.
    """
    report = report_of(result, options)
    write_json(folder / "report.json", report)
    write_csv(folder / "methods.csv", report["methods"])
    if options.save_arrays:
        _write_arrays(result, folder / "arrays.npz")
    write_figures(_pictures(result, report), folder)
    return report


def check_writable(folder: Path) -> None:
    """Raise `UseError` if `folder` cannot be made or written to: before any work is done for it."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise UseError(
            f"cannot write results to '{folder}': '{existing}' is not a writable folder; choose "
            "another --out."
        )


class _Progress:
    """Names the step that begins, and counts the one that ended."""

    def __init__(self, bar: tqdm):
        self._bar, self._begun = bar, False

    def __call__(self, step: str) -> None:
        if self._begun:
            self._bar.update()
        self._begun = True
        self._bar.set_description(step)


def report_of(result: MainResult, options: RunOptions) -> dict:
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
    notices = list(result.scene.notices)
    notices += [f"{m.name}: {m.status.value}" for m in result.methods if m.status.is_limit]
    has_ratio = np.isfinite(result.maps["m"])
    return run_report(
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.scene.variant, jax.devices()[0].device_kind),
        seed=options.seed,
        scene=result.scene.name,
        view=result.view.name,
        light=f"{result.light.name} ({result.light.kind}, {result.frame.faces} face(s))",
        size=(eye.camera.width, eye.camera.height),
        truth={
            "samples": options.samples,
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


def _tree_keys(result: MainResult, method: Measured) -> dict:
    if not isinstance(method.state, AdaptiveState):
        return {}
    return {
        "nodes": method.state.pool.used_pages,
        "passes": method.cost.passes,
        "max_level": result.adaptive.max_level(method.state),
        "status": method.status.name.lower(),
    }


def _write_arrays(result: MainResult, path: Path) -> None:
    eye = result.eyes[0]
    size = eye.size
    arrays = {
        "valid": eye.valid.reshape(size),
        "position": eye.world.reshape(3, *size),
        "truth": result.truth.visibility.reshape(size),
        **{name: values.reshape(size) for name, values in result.maps.items()},
        **{f"visibility_{m.name}": m.visibility.reshape(size) for m in result.methods},
    }
    np.savez_compressed(path, **arrays)


def _pictures(result: MainResult, report: dict) -> RunPictures:
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
        title=f"{result.scene.name}, {result.view.name}",
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


def _tree_picture(result: MainResult, state: AdaptiveState) -> TreePicture:
    face, level, column, row = state.pool.squares[:, : state.pool.used_pages]
    size = np.ldexp(1.0, -state.shape.log2_nodes_at(level))

    def cast(face: int, u: float, v: float, size: float, side: int) -> np.ndarray:
        corner, texel = np.array([[u], [v]]), np.full((2, 1), size / side)
        windows = TexelWindows(np.array([face]), corner, texel, side)
        return np.asarray(result.rays.light_buffer(result.frame, windows).depth)[0]

    return TreePicture(
        level=level,
        face=face,
        lo=np.stack([column, row]) * size,
        size=size,
        node_resolution=1 << state.shape.log2_node,
        faces=result.frame.faces,
        cast=cast,
    )
