"""`asmjax compare`: what accuracy costs in time and memory, for every algorithm over its range."""

import contextlib
import logging
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

from tqdm import tqdm

from asmjax.delivery import deliver
from asmjax.errors import UseError, require
from asmjax.experiment.bench import Bench
from asmjax.experiment.comparison import Compared, common_yardstick, pooled
from asmjax.experiment.ledger import Ledger, LedgerError
from asmjax.experiment.settings_range import (
    ADAPTIVE,
    LAST,
    Candidate,
    candidates,
    families_of,
)
from asmjax.experiment.soft_rays import SOFT_REPEATS, SOFT_STRATA, calls_for_soft_truth
from asmjax.experiment.trial import Trial
from asmjax.folders import kept_measurements, results_folder
from asmjax.job_memory import Sight, held_besides, trial_stages
from asmjax.memory import Forecast, Stage, check, limit_of
from asmjax.options import CompareOptions, given_options
from asmjax.preparation import (
    ChosenMaps,
    bench_of,
    calibrated,
    check_edges,
    check_named,
    chosen_maps,
    chosen_scene,
    chosen_view,
    sight_of,
    sized,
)
from asmjax.render.load import Scene
from asmjax.report.compare_files import write_comparison
from asmjax.report.compare_record import report_of_comparison
from asmjax.report.compare_result import ComparisonResult, SeenView
from asmjax.report.compare_table import comparison_text
from asmjax.report.measured import light_text
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import CostModel, ShadowAlgorithm, family_of

_log = logging.getLogger("asmjax")

YARDSTICKS = (1, 16)
"""Shadow rays per pixel that every chart shows, whatever number of samples was asked for."""

_SOFT = (
    "the light has a size and soft methods are measured, so that all are judged by soft truth, "
    f"{SOFT_STRATA**2 * SOFT_REPEATS} rays from each sample; the yardsticks are hard shadow rays "
    "to the light's centre"
)
"""A notice."""

BATCH = 3
"""Settings that are measured in turns: an interruption loses no more than these."""


def run_comparison(options: CompareOptions) -> ComparisonResult:
    """Measure, write the results below `options.out`, and print the tables.

    Every finished measurement is kept in the folder, and taken from there by the same command.

    Raises:
        UseError: wrong options or a scene that cannot be used, before anything is written; or
            measurements that cannot be kept.
        KeyboardInterrupt: with a message that says where the finished trials are.
    """
    outputs = results_folder(options)
    with tqdm(disable=options.quiet or None, leave=False, unit="trial") as bar:
        bar.set_description("scene")
        comparing = Comparing(options)
        outputs.make()
        result = comparing.measured(kept_measurements(outputs.path, options.fresh), bar)
        if not result.trials:
            with contextlib.suppress(OSError):
                outputs.path.rmdir()
            raise KeyboardInterrupt("no trial was finished")
        bar.set_description("figures")
        for notice in result.notices[len(comparing.scene.notices) :]:
            _log.warning("%s", notice)
        text = (
            f"{comparison_text(result)}\n\n"
            f"measurements: {result.made} made, {result.reused} taken from an earlier run"
        )
        report = report_of_comparison(result, options.seed)
        write = partial(write_comparison, result, report, outputs)
        deliver(text, write, outputs, bar, quiet=options.quiet)
    if result.ended == "interrupted":
        raise KeyboardInterrupt(
            f"{len(result.trials)} of {result.asked} trials are in {outputs}/; the same command "
            "goes on from there"
        )
    return result


def compare(
    scene: CompareOptions | str = "paper_room", *, quiet: bool = True, **options: Any
) -> ComparisonResult:
    """What accuracy costs on a scene; `options` are those of `asmjax compare`, as of
    `CompareOptions`, which may stand in the scene's place.

    Nothing is written unless `out` names a folder, where measurements are kept and found again.
    `quiet=False` shows a progress bar.

    Raises:
        UseError: as `run_comparison`, or an unknown option.
        KeyboardInterrupt: before the first trial was finished; of what was finished the result
            tells, `ended` is "interrupted", and a warning says so.
    """
    chosen = given_options(CompareOptions, scene, {"quiet": quiet, **options})
    comparing = Comparing(chosen)
    outputs = None
    if chosen.out is not None:
        outputs = results_folder(chosen)
        outputs.make()
    ledger = Ledger() if outputs is None else kept_measurements(outputs.path, chosen.fresh)
    with tqdm(disable=quiet, leave=False, unit="trial") as bar:
        result = comparing.measured(ledger, bar)
    if not result.trials:
        raise KeyboardInterrupt("no trial was finished")
    if outputs is not None:
        write_comparison(result, report_of_comparison(result, chosen.seed), outputs)
    if result.ended == "interrupted":
        _log.warning("interrupted: %d of %d trials are made", len(result.trials), result.asked)
    return result


@dataclass(frozen=True)
class _Batch:
    """Settings that are tried together, with so many samples per pixel."""

    samples: int
    items: tuple[Candidate, ...]


class _Extents(NamedTuple):
    """Of each view: length of its shadow edges in pixels, and its valid pixels."""

    edges: list[float]
    pixels: list[int]


class _Found(NamedTuple):
    """A setting as tried, on all views together and on each."""

    label: str
    trial: Trial
    views: tuple[Trial, ...]
    algorithm: ShadowAlgorithm | None


class Comparing:
    """A scene, its views and all settings that are to be tried on them, ready to be measured.

    Attributes:
        scene: as loaded.
        views: on which all is tried.

    Raises:
        UseError: wrong options, a scene that cannot be used, a view without shadow edges, or no
            algorithm that is possible.
    """

    def __init__(self, options: CompareOptions):
        self._options, self._start = options, time.monotonic()
        families = families_of(options.methods)
        chosen = chosen_maps(options)
        check_named(options, chosen, families)
        self.scene = chosen_scene(options)
        self.views = _views(self.scene, options)
        self._samples = list(dict.fromkeys(options.samples))
        limit = limit_of(options.max_memory_mb)
        # Of the yardsticks' benches, which are not kept, one at a time.
        counts = [*self._samples, *sorted({*YARDSTICKS} - {*self._samples})[-1:]]
        light = self.scene.light(options.light)
        tried = [item.algorithm for item in _possible(families, chosen, 1)[0]]
        self._soft = calls_for_soft_truth(light.area, [item for item in tried if item is not None])
        lamp = self.scene.light_rays_memory(options.light)

        def checked(faces: int) -> Forecast:
            stages = _stages(sights, families, chosen, faces, self._soft)
            return check(held_besides(lamp, stages), limit)

        sights = [sight_of(self.scene, view, count) for view in self.views for count in counts]
        checked(1)
        self._kept: dict[int, list[Bench]] = {}
        self._extents: dict[int, _Extents] = {}
        first, *_ = benches = self._benches(self._samples[0])
        for bench in benches:
            check_edges(bench, self.scene)
        faces = max(bench.frame.faces for bench in benches)
        self._forecast = checked(faces)
        self._model: CostModel | None = None
        if ADAPTIVE in families:
            self._model = calibrated(self.scene, light, first.rays, first.frame, options)
            chosen = replace(chosen, adaptive=replace(chosen.adaptive, cost_model=self._model))
        self._memory = chosen.adaptive.memory_bytes
        self._candidates, self._left_out = _possible(families, chosen, faces)

    def _benches(self, samples: int) -> list[Bench]:
        """Of all views, made when they are first wanted. Those of a yardstick alone are not kept:
        16 samples a pixel are 16 eye buffers a view."""
        if samples in self._kept:
            return self._kept[samples]
        found = [
            bench_of(self.scene, view, self._options, samples, self._soft) for view in self.views
        ]
        edges = [bench.edge_length for bench in found]
        self._extents[samples] = _Extents(edges, [int(b.eyes[0].valid.sum()) for b in found])
        if samples in self._samples:
            self._kept[samples] = found
        return found

    def measured(self, ledger: Ledger, bar: tqdm) -> ComparisonResult:
        """Try all settings until time or patience ends; `ended` says which.

        Raises:
            UseError: no algorithm can be used on the views.
        """
        batches = list(_batches(self._candidates, self._samples))
        asked = sum(len(batch.items) for batch in batches)
        bar.reset(total=asked)
        trials: list[_Found] = []
        yardsticks: list[_Found] = []
        done = 0
        left_out, hopeless = list(self._left_out), set()
        ended = "complete"
        try:
            bar.set_description("rays")
            counts = sorted({*YARDSTICKS, *self._samples})
            yardsticks += [self._rays(samples, ledger) for samples in counts]
            for batch in batches:
                if self._is_late():
                    ended = "time limit"
                    break
                items = [item for item in batch.items if item.family not in hopeless]
                names = ", ".join(item.family for item in items)
                bar.set_description(f"{names} ({batch.samples} per pixel)")
                found, problems = self._tried(replace(batch, items=tuple(items)), ledger)
                trials += found
                for item, problem in problems:
                    if item.rank == 0:
                        hopeless.add(item.family)
                    name = item.family if item.rank == 0 else f"{item.family} {item.label}"
                    left_out.append(f"{name} is left out: {problem}")
                done += len(batch.items)
                bar.update(len(batch.items))
        except KeyboardInterrupt:
            ended = "interrupted"
        require(
            len(trials) > 0 or ended != "complete",
            f"no algorithm can be used here: {'; '.join(left_out)}",
        )
        require(
            len(trials) > 0 or ended != "time limit",
            f"--minutes {self._options.minutes} ended before the first trial; give more.",
        )
        missing = asked - done
        if ended != "complete":
            left_out.append(
                f"{ended}: {missing} of {asked} trials are missing; the same command goes on there"
            )
        light = self.scene.light(self._options.light)
        judged = [_SOFT] if self._soft else []
        return ComparisonResult(
            scene=self.scene.name,
            variant=self.scene.variant,
            light=light_text(light, self._benches(self._samples[0])[0].frame),
            lit_by=f"light {light.name} ({light.kind})",
            notices=[*self.scene.notices, *judged, *dict.fromkeys(left_out)],
            views=[self._seen(i) for i in range(len(self.views))],
            samples=self._samples,
            trials=self._compared(trials, [*trials, *yardsticks]),
            yardsticks=self._compared(yardsticks, [*trials, *yardsticks]),
            memory_bytes=self._memory,
            cost_model=self._model,
            ended=ended,
            asked=asked,
            made=ledger.added,
            reused=ledger.taken,
            memory=self._forecast,
        )

    def _is_late(self) -> bool:
        minutes = self._options.minutes
        return minutes is not None and time.monotonic() - self._start > 60 * minutes

    def _rays(self, samples: int, ledger: Ledger) -> _Found:
        repeats = self._options.repeats
        trials = [bench.shadow_rays(repeats, ledger) for bench in self._benches(samples)]
        return self._found("per pixel", trials, None)

    def _tried(
        self, batch: _Batch, ledger: Ledger
    ) -> tuple[list[_Found], list[tuple[Candidate, str]]]:
        """The trials of a batch on all views, and what cannot be used on one of them."""
        algorithms = [item.algorithm for item in batch.items if item.algorithm is not None]
        try:
            found = self._on_views(batch.samples, algorithms, ledger)
        except LedgerError:
            raise
        except UseError as problem:
            if len(batch.items) == 1:
                return [], [(batch.items[0], str(problem))]
            alone = [self._tried(_Batch(batch.samples, (item,)), ledger) for item in batch.items]
            return [x for some, _ in alone for x in some], [x for _, some in alone for x in some]
        return [
            self._found(item.label, trials, item.algorithm)
            for item, trials in zip(batch.items, found, strict=True)
        ], []

    def _on_views(
        self, samples: int, algorithms: Sequence[ShadowAlgorithm], ledger: Ledger
    ) -> list[tuple[Trial, ...]]:
        """For each algorithm its trials on all views."""
        by_view = [
            bench.try_all(algorithms, self._options.repeats, ledger, predicted=True)
            for bench in self._benches(samples)
        ]
        return list(zip(*by_view, strict=True))

    def _found(
        self, label: str, trials: Sequence[Trial], algorithm: ShadowAlgorithm | None
    ) -> _Found:
        whole = pooled(trials, *self._extents[trials[0].samples])
        return _Found(label, whole, tuple(trials), algorithm)

    @staticmethod
    def _compared(found: Sequence[_Found], all_found: Sequence[_Found]) -> list[Compared]:
        """What was found, all with as many samples on one yardstick."""
        counts = {one.trial.samples for one in all_found}
        yardsticks = {
            count: common_yardstick([one.trial for one in all_found if one.trial.samples == count])
            for count in counts
        }
        return [
            Compared(one.label, one.trial, one.views, yardsticks[one.trial.samples], one.algorithm)
            for one in found
        ]

    def _seen(self, index: int) -> SeenView:
        eye = self._benches(self._samples[0])[index].eyes[0]
        return SeenView(
            name=self.views[index].name,
            size=(eye.camera.width, eye.camera.height),
            valid_pixels=int(eye.valid.sum()),
            edges={count: self._extents[count].edges[index] for count in sorted(self._extents)},
        )


def _views(scene: Scene, options: CompareOptions) -> list[ViewSpec]:
    if not options.views:
        return [chosen_view(scene, options)]
    return [sized(scene.view(name), options) for name in dict.fromkeys(options.views)]


def _possible(
    families: Sequence[str], chosen: ChosenMaps, faces: int
) -> tuple[list[Candidate], list[str]]:  # fmt: skip
    """What can be tried, and a line for everything else."""
    found = candidates(families, chosen.adaptive, faces)
    if chosen.other is not None:
        found.insert(0, Candidate(family_of(chosen.other), "settings file", -1, chosen.other))
    left_out = [
        f"{item.family} {item.label} is left out: {item.problem}"
        for item in found
        if item.algorithm is None
    ]
    possible = [item for item in found if item.algorithm is not None]
    require(len(possible) > 0, f"no algorithm can be used here: {'; '.join(left_out)}")
    return possible, left_out


def _stages(
    sights: Sequence[Sight], families: Sequence[str], chosen: ChosenMaps, faces: int, soft: bool
) -> list[Stage]:
    """Of a comparison of all that can be tried."""
    if ADAPTIVE in families:
        chosen.check(faces)
    found = [item.algorithm for item in _possible(families, chosen, faces)[0]]
    return trial_stages(sights, [item for item in found if item is not None], faces, soft=soft)


def _batches(found: Sequence[Candidate], samples: Sequence[int]) -> Iterator[_Batch]:
    """All of it, the most telling first for each number of samples."""
    for rank, group in groupby(found, key=lambda item: item.rank):
        items = list(group)
        for count in samples if rank < LAST else samples[:1]:
            for start in range(0, len(items), BATCH):
                yield _Batch(count, tuple(items[start : start + BATCH]))
