"""`asmjax run`: a scene in; buffers, maps, shadow maps, truth, errors, times and figures out."""

import logging
from collections.abc import Callable
from dataclasses import replace

from tqdm import tqdm

from asmjax.experiment import RunResult, analysis_maps, measure, measure_rays
from asmjax.options import RunOptions
from asmjax.preparation import (
    adaptive_map,
    calibrated,
    chosen_view,
    make_folder,
    results_folder,
    sample_offsets,
)
from asmjax.render.load import load_scene
from asmjax.report.run_files import write_results
from asmjax.report.table import comparison_table
from asmjax.shadow import UniformShadowMap, resolution_for

_log = logging.getLogger("asmjax")


def run_main_job(options: RunOptions) -> RunResult:
    """Measure, write the results below `options.out`, and print the table.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
    """
    folder = results_folder(options)
    with tqdm(total=8, disable=options.quiet or None, leave=False, unit="step") as bar:
        result = measure_scene(options, progress=_Progress(bar))
        bar.set_description("figures")
        make_folder(folder)
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
    view = chosen_view(scene, options)
    light = scene.light(options.light)
    progress("eye buffer")
    offsets = sample_offsets(options.samples, options.seed)
    eyes = [scene.eye(view, offset) for offset in offsets]
    frame = scene.light_frame(eyes[0], options.light)
    rays = scene.light_rays(options.light)
    adaptive = adaptive_map(options)
    adaptive.tree_shape(frame.faces)
    uniform = UniformShadowMap(resolution_for(adaptive.memory_bytes, frame.faces))
    progress("truth")
    truth = measure_rays(
        [scene.shadow_rays(eye, frame, rays) for eye in eyes], eyes, options.repeats
    )
    progress("cost model")
    cost_model = calibrated(scene, light, rays, frame, options)
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


class _Progress:
    """Names the step that begins, and counts the one that ended."""

    def __init__(self, bar: tqdm):
        self._bar, self._begun = bar, False

    def __call__(self, step: str) -> None:
        if self._begun:
            self._bar.update()
        self._begun = True
        self._bar.set_description(step)
