"""`asmjax analyze`: how every algorithm aliases on a scene at equal memory, beside the theory."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from tqdm import tqdm

from asmjax.delivery import deliver
from asmjax.errors import UseError, require
from asmjax.experiment import Measured, measure
from asmjax.experiment.aliasing import aliasing_maps, aliasing_numbers
from asmjax.experiment.displacement import displacement
from asmjax.experiment.light_angles import (
    AngleCase,
    angle_errors,
    parallel_light,
    sweep_angles,
    view_range,
)
from asmjax.experiment.settings_range import ADAPTIVE, families_of
from asmjax.experiment.soft_rays import answers_softly, calls_for_soft_truth
from asmjax.folders import results_folder
from asmjax.job_memory import Sight, analyze_stages
from asmjax.memory import Stage
from asmjax.options import AnalyzeOptions, given_options
from asmjax.preparation import (
    ChosenMaps,
    Progress,
    StepBar,
    Subject,
    calibrated,
    check_named,
    chosen_maps,
    subject_of,
)
from asmjax.report.analyze_files import write_analysis
from asmjax.report.analyze_record import Analysed, AnalysisResult, LightSweep, report_of_analysis
from asmjax.report.analyze_table import analysis_table
from asmjax.shadow import (
    ShadowAlgorithm,
    family_of,
    of_resolution,
    resolution_for,
)

_log = logging.getLogger("asmjax")

_STEPS = 5
"""Steps of progress besides algorithms and directions: scene, eye, truth, cost model, figures."""


def run_analysis(options: AnalyzeOptions) -> AnalysisResult:
    """Measure, write the results below `options.out`, and print the table.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
    """
    outputs = results_folder(options)
    steps = _STEPS + len(families_of(options.methods)) + options.angles
    with tqdm(total=steps, disable=options.quiet or None, leave=False, unit="step") as bar:
        progress = StepBar(bar)
        result = analyse_scene(options, progress)
        progress("figures")
        report = report_of_analysis(result, options.seed)
        for notice in report["notices"][len(result.notices) :]:
            _log.warning("%s", notice)
        write = partial(write_analysis, result, report, outputs, save_arrays=options.save_arrays)
        table = analysis_table(report["methods"])
        deliver(table, write, outputs, bar, quiet=options.quiet)
    return result


def analyse_scene(
    options: AnalyzeOptions | str = "paper_room",
    progress: Progress = lambda _: None,
    **changes: Any,
) -> AnalysisResult:
    """Everything that `asmjax analyze` measures with the options, or
    `analyse_scene("terrain", angles=0)`; writes nothing. `progress` hears of each step.

    An algorithm that cannot be used on the scene is left out; `left_out` of the result says why.

    Raises:
        UseError: wrong options, a scene that cannot be used, or no algorithm that can.
    """
    options = given_options(AnalyzeOptions, options, changes)
    families = families_of(options.methods)
    chosen = chosen_maps(options)
    check_named(options, chosen, families)

    def stages(sight: Sight, faces: int) -> list[Stage]:
        if ADAPTIVE in families:
            chosen.check(faces)
        maps = [*algorithms_of(families, chosen, faces).values()]
        # Of a light whose size is not known yet soft methods are taken to need it.
        return analyze_stages(sight, maps, faces, any(map(answers_softly, maps)))

    subject = subject_of(options, stages, progress)
    progress("truth")
    truth, standard_error = subject.truth(options.repeats), None
    traced = [truth]
    maps = algorithms_of(families, chosen, subject.frame.faces).values()
    if calls_for_soft_truth(subject.frame.area, maps):
        truth, standard_error = subject.soft_truth(options.seed)
        traced.append(truth)
    progress("cost model")
    if ADAPTIVE in families:
        model = calibrated(subject.scene, subject.light, subject.rays, subject.frame, options)
        chosen = replace(chosen, adaptive=replace(chosen.adaptive, cost_model=model))
    left_out: list[str] = []
    analysed = []
    for family, algorithm in algorithms_of(families, chosen, subject.frame.faces).items():
        progress(family)
        try:
            analysed.append(_analysed(family, algorithm, subject, truth, options.repeats))
        except UseError as problem:
            left_out.append(f"{family} is left out: {problem}")
    require(len(analysed) > 0, f"no algorithm can be used here: {'; '.join(left_out)}")
    found = [item.family for item in analysed]
    return AnalysisResult(
        scene=subject.scene.name,
        variant=subject.scene.variant,
        notices=subject.scene.notices,
        left_out=left_out,
        view=subject.view,
        light=subject.light,
        eyes=subject.eyes,
        frame=subject.frame,
        truth=truth,
        traced=traced,
        standard_error=standard_error,
        adaptive=chosen.adaptive,
        cost_model=chosen.adaptive.cost_model,
        analysed=analysed,
        sweep=_sweep(found, chosen, subject, options, left_out, progress),
        memory=subject.memory,
    )


def algorithms_of(
    families: Sequence[str], chosen: ChosenMaps, faces: int
) -> dict[str, ShadowAlgorithm]:
    """An algorithm of each family, those that were chosen among them; the others have as many
    texels as fit into the adaptive map's memory for a light of so many faces (tables of charts,
    some kB, not counted)."""
    resolution = resolution_for(chosen.adaptive.memory_bytes, faces)
    own: dict[str, ShadowAlgorithm] = {ADAPTIVE: chosen.adaptive}
    if chosen.other is not None:
        own[family_of(chosen.other)] = chosen.other
    return {
        family: own[family] if family in own else of_resolution(family, resolution)
        for family in families
    }


def _analysed(
    family: str, algorithm: ShadowAlgorithm, subject: Subject, truth: Measured, repeats: int
) -> Analysed:
    eye, frame = subject.eyes[0], subject.frame
    measured = measure(algorithm, subject.eyes, frame, subject.rays, repeats)
    maps = aliasing_maps(algorithm, measured.state, eye, frame)
    return Analysed(
        family=family,
        algorithm=algorithm,
        measured=measured,
        maps=maps,
        numbers=aliasing_numbers(maps, measured.cost.texels),
        displacement=displacement(truth.visibility, measured.visibility, eye, maps),
    )


def _sweep(
    families: Sequence[str],
    chosen: ChosenMaps,
    subject: Subject,
    options: AnalyzeOptions,
    left_out: list[str],
    progress: Progress,
) -> LightSweep | None:
    """The same families under parallel lights; None without any direction."""
    if options.angles == 0:
        return None
    eye = subject.eyes[0]
    algorithms = algorithms_of(families, chosen, 1)
    cases = _cases(subject, options, left_out, progress)
    return LightSweep(
        seen=view_range(eye),
        algorithms=algorithms,
        errors=list(angle_errors(cases, algorithms, eye, left_out)),
    )


def _cases(
    subject: Subject, options: AnalyzeOptions, left_out: list[str], progress: Progress
) -> Iterator[AngleCase]:
    eye = subject.eyes[0]
    for angle in sweep_angles(options.angles):
        progress(f"light at {angle:.0f} degrees")
        light = parallel_light(subject.light.name, eye.camera, angle)
        scene = subject.scene.with_light(light, options.light)
        try:
            frame = scene.light_frame(eye, options.light)
        except UseError as problem:
            left_out.append(f"light at {angle:.0f} degrees is left out: {problem}")
            continue
        yield AngleCase(angle, frame, scene.light_rays(options.light))
