"""`asmjax tune`: the settings of an adaptive map for a price of time, or within a limit."""

import contextlib
import logging
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from asmjax.delivery import deliver
from asmjax.errors import UseError, require
from asmjax.experiment.bench import Bench
from asmjax.experiment.ledger import Ledger
from asmjax.folders import kept_measurements, results_folder
from asmjax.job_memory import held_besides, trial_stages
from asmjax.memory import check, limit_of
from asmjax.options import PRICE, TuneOptions, given_options
from asmjax.preparation import (
    ChosenMaps,
    Progress,
    StepBar,
    aimed,
    bench_of,
    calibrated,
    check_edges,
    chosen_scene,
    chosen_view,
    sight_of,
    sized,
)
from asmjax.render.load import Scene
from asmjax.report.compare_result import SeenView
from asmjax.report.measured import light_text
from asmjax.report.outputs import Outputs
from asmjax.report.tune_files import SETTINGS, write_tuning
from asmjax.report.tune_record import report_of_tuning
from asmjax.report.tune_result import TuningResult
from asmjax.report.tune_table import tuning_text
from asmjax.scene.path import turned
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import AdaptiveShadowMap, preset, read_settings
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Outcome
from asmjax.tuning.tuner import Tuner, steps_of

_log = logging.getLogger("asmjax")

TUNED_AT, HELD_OUT_AT = (0.0,), (10.0, 20.0)
"""Degrees on an arc about what the view sees: the view itself is tuned on, two others choose."""

OWN_STEPS = 3
"""Steps of progress besides those of the search: scene, views and figures."""

GO_ON = "run the same command again to go on"


def run_tuning(options: TuneOptions) -> TuningResult:
    """Tune, write the results below `options.out`, and print the tables.

    Every finished measurement is kept in the folder, and taken from there by the same command.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
        KeyboardInterrupt: with a message that says where the measurements are.
    """
    outputs = results_folder(options)
    with _bar(options, options.quiet or None) as bar:
        progress = StepBar(bar)
        result = _found(options, outputs, progress)
        progress("figures")
        given = len(result.notices) - result.told
        for notice in result.notices[given:]:
            _log.warning("%s", notice)
        text = (
            f"{tuning_text(result)}\n\n"
            f"{len(result.found.tried)} settings tried in {result.found.seconds:.0f} s; "
            f"measurements: {result.made} made, {result.found.reused} taken from an earlier run"
        )
        report = report_of_tuning(result, options.seed)
        write = partial(write_tuning, result, report, outputs)
        what = f"report, figures and {SETTINGS}"
        deliver(text, write, outputs, bar, quiet=options.quiet, what=what)
    if result.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt(f"the best settings so far are in {outputs}/; {GO_ON}")
    return result


def tune(
    scene: TuneOptions | str = "paper_room", *, quiet: bool = True, **options: Any
) -> TuningResult:
    """The settings of an adaptive map that suit a scene; `options` are those of `asmjax tune`, as
    of `TuneOptions`, which may stand in the scene's place.

    Nothing is written unless `out` names a folder, where measurements are kept and found again.
    `quiet=False` shows a progress bar.

    Raises:
        UseError: as `run_tuning`, or an unknown option.
        KeyboardInterrupt: before there were settings to choose from; later the result holds the
            best so far, its `outcome` tells, and a warning says so.
    """
    chosen = given_options(TuneOptions, scene, {"quiet": quiet, **options})
    outputs = None if chosen.out is None else results_folder(chosen)
    with _bar(chosen, quiet) as bar:
        progress = StepBar(bar)
        result = _found(chosen, outputs, progress)
        progress("figures")
    if outputs is not None:
        write_tuning(result, report_of_tuning(result, chosen.seed), outputs)
    if result.outcome is Outcome.INTERRUPTED:
        _log.warning("%s", result.outcome.value)
    return result


def _bar(options: TuneOptions, disable: bool | None) -> tqdm:
    held_out = len(options.held_out) or len(HELD_OUT_AT)
    steps = OWN_STEPS + steps_of(options.evaluations, held_out)
    return tqdm(total=steps, disable=disable, leave=False, unit="step")


def _found(options: TuneOptions, outputs: Outputs | None, progress: Progress) -> TuningResult:
    """What tuning gives, its measurements kept in a folder if there is one."""
    tuning = Tuning(options, progress)
    if outputs is None:
        return tuning.result(Ledger(), progress)
    outputs.make()
    path = outputs.path
    return _kept(tuning, kept_measurements(path, options.fresh), path, progress)


def _kept(tuning: "Tuning", ledger: Ledger, folder: Path, progress: Progress) -> TuningResult:
    """What tuning gives; an interruption says where its measurements are."""
    try:
        return tuning.result(ledger, progress)
    except KeyboardInterrupt as stop:
        if len(ledger) == 0:
            raise KeyboardInterrupt("nothing was measured yet") from stop
        raise KeyboardInterrupt(
            f"{len(ledger)} measurements are kept in {ledger.path}; {GO_ON}"
        ) from stop
    finally:
        # Only where nothing was written.
        with contextlib.suppress(OSError):
            folder.rmdir()


class Tuning:
    """A scene, the views to tune on and to choose by, and the map to start from.

    Attributes:
        scene: as loaded.

    Raises:
        UseError: wrong options, a scene that cannot be used, or a view without shadow edges.
    """

    def __init__(self, options: TuneOptions, progress: Progress = lambda _: None):
        self._options, self._start = options, time.perf_counter()
        chosen = default_map(options)
        progress("scene")
        self.scene = scene = chosen_scene(options)
        tuned_on, held_out = chosen_views(scene, options)
        sights = [sight_of(scene, view, 1) for view in (*tuned_on, *held_out)]
        lamp = scene.light_rays_memory(options.light)
        stages = held_besides(lamp, trial_stages(sights, [chosen.adaptive], 1, evidence=True))
        self._forecast = check(stages, limit_of(options.max_memory_mb))
        progress("views")
        self._benches = [bench_of(scene, view, options, 1) for view in tuned_on]
        for bench in self._benches:
            check_edges(bench, scene)
        self._held_out = held_out_benches(scene, held_out, options)
        first = self._benches[0]
        chosen.check(max(bench.frame.faces for bench in self._all))
        light = scene.light(options.light)
        self._light = light
        self._model = calibrated(scene, light, first.rays, first.frame, options)
        self._base = replace(chosen.adaptive, cost_model=self._model)

    @property
    def _all(self) -> list[Bench]:
        return [*self._benches, *self._held_out]

    def result(self, ledger: Ledger, progress: Progress = lambda _: None) -> TuningResult:
        """Search, measure and choose; trouble on the way is the result's `outcome`.

        Raises:
            UseError: as `Tuner`.
            KeyboardInterrupt: finished measurements are in `ledger`.
        """
        options, before = self._options, ledger.added
        deadline = None if options.minutes is None else self._start + 60 * options.minutes
        found = Tuner(
            self.scene.name,
            self._benches,
            self._held_out,
            self._base,
            goal_of(options),
            ledger=ledger,
            seed=options.seed,
            evaluations=options.evaluations,
            rounds=options.repeats,
            deadline=deadline,
            progress=progress,
        ).run()
        told = [found.advice] if found.advice else []
        return TuningResult(
            found=found,
            variant=self.scene.variant,
            light=light_text(self._light, self._benches[0].frame),
            lit_by=f"light {self._light.name} ({self._light.kind})",
            seen=[_seen(bench) for bench in self._all],
            notices=[*self.scene.notices, *told],
            told=len(told),
            cost_model=self._model,
            made=ledger.added - before,
            memory=self._forecast,
        )


def goal_of(options: TuneOptions) -> Goal:
    """What the options ask for; a price of `PRICE` where they ask for nothing."""
    if options.within_ms is not None:
        return Goal(seconds=options.within_ms / 1e3)
    if options.error is not None:
        return Goal(error=options.error)
    return Goal(price=PRICE if options.price is None else options.price)


def default_map(options: TuneOptions) -> ChosenMaps:
    """The map that tuning starts from, not calibrated yet.

    Raises:
        UseError: the settings file is not of an adaptive map, or --memory-mb is given as well.
    """
    if options.settings is None:
        return ChosenMaps(preset("default", memory_bytes=options.memory_bytes))
    chosen = read_settings(options.settings)
    if not isinstance(chosen, AdaptiveShadowMap):
        raise UseError(
            f"settings file '{options.settings}' is of {chosen.name}, but tuning is for adaptive "
            "maps; name a file of one, or leave out --settings."
        )
    require(
        options.memory_mb is None,
        f"--memory-mb and the settings file '{options.settings}' both say how much memory there "
        "is; give it in the file, or leave out --settings.",
    )
    return ChosenMaps(chosen, source=options.settings)


def chosen_views(scene: Scene, options: TuneOptions) -> tuple[list[ViewSpec], list[ViewSpec]]:
    """The views to tune on, and those to choose by: named, or on an arc about the view.

    Raises:
        UseError: no such view, or one that is both.
    """
    if options.views:
        tuned_on, held_out = (
            list({(view := sized(scene.view(name), options)).name: view for name in names}.values())
            for names in (options.views, options.held_out)
        )
        for view in tuned_on:
            require(
                view not in held_out,
                f"view '{view.name}' is named by --views and by --held-out; views that choose must "
                "not be tuned on: leave it out of one.",
            )
        return tuned_on, held_out
    tuned_on, held_out = (
        [_on_arc(scene, options, degrees) for degrees in at] for at in (TUNED_AT, HELD_OUT_AT)
    )
    return tuned_on, held_out


def _on_arc(scene: Scene, options: TuneOptions, degrees: float) -> ViewSpec:
    """The view of the options, turned about what it sees."""
    view = chosen_view(scene, options)
    name = f"{view.name}, turned {degrees:g} degrees"
    return replace(turned(aimed(scene, view), degrees), name=name)


def held_out_benches(scene: Scene, views: Sequence[ViewSpec], options: TuneOptions) -> list[Bench]:
    """The views that choose. One that nobody named, and that sees no edge of a shadow, is turned
    the other way.

    Raises:
        UseError: that sees none either, or a view that was named does not.
    """
    if options.views:
        found = [bench_of(scene, view, options, 1) for view in views]
        for bench in found:
            check_edges(bench, scene)
        return found
    return [
        _turned_bench(scene, view, degrees, options)
        for view, degrees in zip(views, HELD_OUT_AT, strict=True)
    ]


def _turned_bench(scene: Scene, view: ViewSpec, degrees: float, options: TuneOptions) -> Bench:
    problem = None
    for way in (view, _on_arc(scene, options, -degrees)):
        try:
            bench = bench_of(scene, way, options, 1)
            check_edges(bench, scene)
            return bench
        except UseError as refused:
            problem = refused
    raise UseError(
        f"no view beside the one that is tuned on can choose ({problem}) Name other views with "
        "--views and --held-out."
    ) from problem


def _seen(bench: Bench) -> SeenView:
    eye = bench.eyes[0]
    return SeenView(
        name=bench.view,
        size=(eye.camera.width, eye.camera.height),
        valid_pixels=int(eye.valid.sum()),
        edges={1: bench.edge_length},
    )
