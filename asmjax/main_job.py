"""`asmjax run`: a scene in; buffers, maps, shadow maps, truth, errors, times and figures out."""

import logging
from dataclasses import replace
from functools import partial
from typing import Any

from tqdm import tqdm

from asmjax.delivery import deliver
from asmjax.effects.methods import soft_methods, wants_softness
from asmjax.experiment import Measured, RunResult, analysis_maps, measure
from asmjax.experiment.soft_rays import calls_for_soft_truth
from asmjax.folders import results_folder
from asmjax.job_memory import Sight, run_stages
from asmjax.memory import Stage
from asmjax.options import RunOptions, force_of, given_options
from asmjax.planning import plan_effects
from asmjax.preparation import (
    ChosenMaps,
    Progress,
    StepBar,
    calibrated,
    chosen_maps,
    sight_of,
    subject_of,
)
from asmjax.report.plan_table import plan_summary
from asmjax.report.run_files import report_of, write_results
from asmjax.report.table import comparison_table
from asmjax.shadow import UniformShadowMap, resolution_for

_log = logging.getLogger("asmjax")

_STEPS = 9
"""Steps of progress without a further method."""


def run_main_job(options: RunOptions) -> RunResult:
    """Measure, write the results below `options.out`, and print the table.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
    """
    outputs = results_folder(options)
    chosen = chosen_maps(options)
    steps = _STEPS + (chosen.other is not None)
    with tqdm(total=steps, disable=options.quiet or None, leave=False, unit="step") as bar:
        result = measure_scene(options, progress=StepBar(bar))
        bar.set_description("figures")
        report = report_of(result, options.seed)
        for notice in report["notices"][len(result.notices) :]:
            _log.warning("%s", notice)
        write = partial(write_results, result, report, outputs, save_arrays=options.save_arrays)
        deliver(_text(report), write, outputs, bar, quiet=options.quiet)
    return result


def _text(report: dict) -> str:
    """The table, and what the plan says of it."""
    lines = [comparison_table(report["methods"]), plan_summary(report["plan"])]
    if not any(row["faces"] for row in report["plan"]["decisions"]):
        lines.append("hard maps and truth are measured all the same, to compare")
    return "\n".join(lines)


def measure_scene(
    options: RunOptions | str = "paper_room",
    progress: Progress = lambda _: None,
    **changes: Any,
) -> RunResult:
    """Everything that `asmjax run` measures with the options, or
    `measure_scene("terrain", memory_mb=4)`; writes nothing. `progress` hears of each step.

    Raises:
        UseError: wrong options or a scene that cannot be used.
    """
    options = given_options(RunOptions, options, changes)
    chosen = chosen_maps(options)

    def stages(sight: Sight, faces: int) -> list[Stage]:
        chosen.check(faces)
        others = [] if chosen.other is None else [chosen.other]
        return run_stages(sight, [_uniform(chosen, faces), chosen.adaptive, *others], faces)

    subject = subject_of(options, stages, progress)
    eyes, frame, rays = subject.eyes, subject.frame, subject.rays
    adaptive, uniform = chosen.adaptive, _uniform(chosen, frame.faces)
    progress("plan")
    plan = plan_effects(
        subject.scene, subject.view, options.tolerance,
        force=force_of(options.force), lights=[subject.light.name], seed=options.seed,
    )  # fmt: skip
    decision = plan.decision(subject.light.name)
    others = [] if chosen.other is None else [chosen.other]
    soft = wants_softness(decision) or calls_for_soft_truth(frame.area, others)
    memory = subject.checked(
        run_stages(
            sight_of(subject.scene, subject.view, options.samples),
            [uniform, adaptive, *soft_methods(decision, uniform.resolution), *others],
            frame.faces,
            soft,
        )
    )
    progress("truth")
    truth, standard_error = subject.truth(options.repeats), None
    traced = [truth]
    if soft:
        truth, standard_error = subject.soft_truth(options.seed)
        traced.append(truth)
    progress("cost model")
    cost_model = calibrated(subject.scene, subject.light, rays, frame, options)
    adaptive = replace(adaptive, cost_model=cost_model)
    progress(uniform.name)
    flat = measure(uniform, eyes, frame, rays, options.repeats)
    progress("maps")
    maps = analysis_maps(eyes[0], frame, uniform, flat.state)
    progress(adaptive.name)
    methods = [flat, measure(adaptive, eyes, frame, rays, options.repeats)]
    for planned in soft_methods(decision, uniform.resolution):
        progress(planned.name)
        methods.append(measure(planned, eyes, frame, rays, options.repeats))
    for other in others:
        progress(other.name)
        found = measure(other, eyes, frame, rays, options.repeats)
        methods.append(_of_its_own_name(found, methods))
    return RunResult(
        scene=subject.scene.name,
        variant=subject.scene.variant,
        notices=subject.scene.notices,
        view=subject.view,
        light=subject.light,
        eyes=eyes,
        frame=frame,
        rays=rays,
        truth=truth,
        cost_model=cost_model,
        methods=[*methods, *traced],
        maps=maps,
        adaptive=adaptive,
        memory=memory,
        plan=plan.record(),
        standard_error=standard_error,
    )


def _of_its_own_name(found: Measured, methods: list[Measured]) -> Measured:
    """The map of the settings file may have the name of one that is measured anyway."""
    taken = any(found.name == other.name for other in methods)
    return replace(found, name=f"{found.name}-settings") if taken else found


def _uniform(chosen: ChosenMaps, faces: int) -> UniformShadowMap:
    """The flat map of the adaptive one's memory."""
    return UniformShadowMap(resolution_for(chosen.adaptive.memory_bytes, faces))
