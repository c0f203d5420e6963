"""`asmjax tune`: the settings of an adaptive map for a price of time, or within a limit."""

import contextlib
import logging
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from asmjax.errors import UseError, require, unknown_name
from asmjax.experiment.bench import Bench
from asmjax.experiment.ledger import Ledger
from asmjax.options import PRICE, TuneOptions
from asmjax.preparation import (
    ChosenMaps,
    Progress,
    StepBar,
    aimed,
    bench_of,
    calibrated,
    check_edges,
    chosen_view,
    kept_measurements,
    make_folder,
    results_folder,
    sized,
)
from asmjax.render.load import Scene, load_scene
from asmjax.report.compare_result import SeenView
from asmjax.report.measured import light_text
from asmjax.report.tune_files import SETTINGS, write_tuning
from asmjax.report.tune_result import TuningResult
from asmjax.report.tune_table import tuning_text
from asmjax.scene.path import ORBIT_DEG, orbit_keys
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import AdaptiveShadowMap, preset, read_settings
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Outcome
from asmjax.tuning.tuner import STEPS, Tuner

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
    folder = results_folder(options)
    bar = tqdm(total=OWN_STEPS + STEPS, disable=options.quiet or None, leave=False, unit="step")
    with bar:
        progress = StepBar(bar)
        tuning = Tuning(options, progress)
        make_folder(folder)
        result = _kept(tuning, kept_measurements(folder, options.fresh), folder, progress)
        progress("figures")
        write_tuning(result, folder, seed=options.seed)
    for notice in result.notices[len(tuning.scene.notices) :]:
        _log.warning("%s", notice)
    if not options.quiet:
        print(tuning_text(result))
        print(
            f"\n{len(result.found.tried)} settings tried in {result.found.seconds:.0f} s; "
            f"measurements: {result.made} made, {result.found.reused} taken from an earlier run"
        )
        print(f"report, figures and {SETTINGS}: {folder}/")
    return result


def tune(scene: str = "paper_room", *, quiet: bool = True, **options: Any) -> TuningResult:
    """The settings of an adaptive map that suit a scene; `options` are those of `asmjax tune`, as
    of `TuneOptions`.

    Nothing is written unless `out` names a folder, where measurements are kept and found again.
    `quiet=False` shows a progress bar.

    Raises:
        UseError: as `run_tuning`, or an unknown option.
        KeyboardInterrupt: what was measured is lost without `out`.
    """
    known = [field.name for field in fields(TuneOptions)]
    for name in options:
        if name not in known:
            raise unknown_name("option", name, known)
    chosen = TuneOptions(scene=scene, quiet=quiet, **options)
    with tqdm(total=OWN_STEPS + STEPS, disable=quiet, leave=False, unit="step") as bar:
        progress = StepBar(bar)
        if chosen.out is None:
            return Tuning(chosen, progress).result(Ledger(), progress)
        folder = results_folder(chosen)
        tuning = Tuning(chosen, progress)
        make_folder(folder)
        result = _kept(tuning, kept_measurements(folder, chosen.fresh), folder, progress)
        progress("figures")
        write_tuning(result, folder, seed=chosen.seed)
    return result


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
        self.scene = scene = load_scene(options.scene, options.variant)
        tuned_on, held_out = chosen_views(scene, options)
        progress("views")
        self._benches = [bench_of(scene, view, options, 1) for view in tuned_on]
        self._held_out = [bench_of(scene, view, options, 1) for view in held_out]
        for bench in self._all:
            check_edges(bench, scene)
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
        told = [found.advice] if found.outcome is not Outcome.FOUND else []
        return TuningResult(
            found=found,
            variant=self.scene.variant,
            light=light_text(self._light, self._benches[0].frame),
            lit_by=f"light {self._light.name} ({self._light.kind})",
            seen=[_seen(bench) for bench in self._all],
            notices=[*self.scene.notices, *found.notices, *told],
            cost_model=self._model,
            made=ledger.added - before,
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
    view = chosen_view(scene, options)
    arc = dict(zip(ORBIT_DEG, orbit_keys(aimed(scene, view)), strict=True))

    def at(degrees: float) -> ViewSpec:
        return replace(arc[degrees], name=f"{view.name}, turned {degrees:g} degrees")

    return [at(degrees) for degrees in TUNED_AT], [at(degrees) for degrees in HELD_OUT_AT]


def _seen(bench: Bench) -> SeenView:
    eye = bench.eyes[0]
    return SeenView(
        name=bench.view,
        size=(eye.camera.width, eye.camera.height),
        valid_pixels=int(eye.valid.sum()),
        edges={1: bench.edge_length},
    )
