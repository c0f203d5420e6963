"""`asmjax run`: a scene in; buffers, maps, shadow maps, truth, errors, times and figures out."""

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from asmjax.errors import UseError, require
from asmjax.experiment import RunResult, analysis_maps, measure, measure_rays
from asmjax.options import MEGABYTE, RunOptions
from asmjax.render.load import load_scene
from asmjax.report.run_files import write_results
from asmjax.report.table import comparison_table
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap, calibrate, resolution_for

_log = logging.getLogger("asmjax")

GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of the R2 sequence (Roberts 2018): evenly spread points for any number of samples."""


def run_main_job(options: RunOptions) -> RunResult:
    """Measure, write the results below `options.out`, and print the table.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
    """
    folder = Path(options.out or f"out/run-{Path(options.scene).stem}")
    check_writable(folder)
    with tqdm(total=8, disable=options.quiet or None, leave=False, unit="step") as bar:
        result = measure_scene(options, progress=_Progress(bar))
        bar.set_description("figures")
        _make(folder)
        report = write_results(result, folder, seed=options.seed, save_arrays=options.save_arrays)
        bar.update()
    for notice in report["notices"][len(result.notices) :]:
        _log.warning("%s", notice)
    if not options.quiet:
        print(comparison_table(report["methods"]))
        print(f"report and figures: {folder}/")
    return result


def measure_scene(
    options: RunOptions, progress: Callable[[str], None] = lambda _: None
) -> RunResult:
    """Everything that `asmjax run` measures; writes nothing. `progress` hears of each step.

    Raises:
        UseError: wrong options or a scene that cannot be used.
    """
    progress("scene")
    scene = load_scene(options.scene, options.variant)
    require(
        options.view is None or options.sensor is None,
        "--view and --sensor both name what sees the scene; give one of them.",
    )
    view = scene.view(options.sensor if options.view is None else options.view)
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
    return RunResult(
        scene=scene.name,
        variant=scene.variant,
        notices=scene.notices,
        view=view,
        light=light,
        eyes=eyes,
        frame=frame,
        rays=rays,
        truth=truth,
        cost_model=cost_model,
        methods=[flat, tree, truth],
        maps=maps,
        adaptive=adaptive,
    )


def sample_offsets(samples: int, seed: int) -> list[tuple[float, float]]:
    """Offsets (right, down) from the pixel centre in pixels: the centre, then an R2 sequence."""
    start = np.random.default_rng(seed).random(2)
    index = np.arange(1, samples)[:, None]
    spread = (start + index * np.array(GOLDEN)) % 1.0 - 0.5
    return [(0.0, 0.0), *((float(x), float(y)) for x, y in spread)]


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise UseError(
            f"cannot write results to '{folder}' ({problem.strerror}); choose another --out."
        ) from problem


def check_writable(folder: Path) -> None:
    """Raise `UseError` if `folder` cannot be made or written to: before any work is done for it."""
    try:
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    except OSError as problem:
        raise UseError(
            f"cannot write results to '{str(folder)[:80]}' ({problem.strerror}); choose another "
            "--out."
        ) from problem
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
