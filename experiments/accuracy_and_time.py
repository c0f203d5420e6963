"""Do tuned settings hold what they promise, and can the surrogate behind them be trusted?

Measures every bound on tuning: the surrogate's gradient, how well it ranks 100 random settings,
tuned against default, grid and random settings on views that were not tuned on (five scenes, three
prices), the time that `asmjax tune` takes, the front by continuation, and replays of one record.

    python experiments/accuracy_and_time.py [--smoke] [--out DIR] [--scenes NAME ...]

Takes about 20 minutes on 2 cores. Times decide, so nothing else may run beside it.
Scenes that the project did not make are left out where absent (docs/other_scenes.md).
"""

import argparse
import gc
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np
from scipy.stats import qmc, spearmanr

from asmjax.cli import prepare_to_measure
from asmjax.experiment.bench import Bench
from asmjax.experiment.bounds import Bound
from asmjax.experiment.ledger import Ledger
from asmjax.experiment.trial import Trial
from asmjax.options import TuneOptions
from asmjax.preparation import bench_of, calibrated
from asmjax.render.load import load_scene
from asmjax.report.stepwise import StepwiseRecord, exit_code, head_of
from asmjax.scene.other_scenes import OTHER_SCENES, other_scene, why_left_out
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tune_job import chosen_views, held_out_benches
from asmjax.tuning.calibrate import calibrated_fit
from asmjax.tuning.evidence import evidence_of
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Candidate, TuneResult
from asmjax.tuning.search import Model, loss, model_of, said_of
from asmjax.tuning.space import Space
from asmjax.tuning.tried import settings_key
from asmjax.tuning.tuner import Tuner

SCENES = ("paper_room", "terrain", "munich", "breakfast_room", "victorian_house")
"""Built-in names, and some of `OTHER_SCENES`."""

RANKED = {"paper_room": 0.9, "munich": 0.8, "terrain": 0.8, "breakfast_room": 0.8}
"""Scenes whose settings are ranked, and the least rank correlation."""

PRICES = (0.01, 10.0, 20.0)
"""Pixels of edge displacement that a second is worth: accuracy first, time as well, time first.

Between them, from 0.1 to 5, the default is near the front itself (docs/accuracy_and_time.md)."""

PRICE = 1.0
"""Of the ranking."""

RANDOM = 100
"""Settings that are ranked."""

KNOWN = 100
"""Random settings that the surrogate is fitted to, beside all that the searches measured, before it
ranks as many others."""

ROUNDS = 5
"""Runs of each setting that is ranked: where a limit of time ends a build, errors differ from run
to run, and are means over them. What the surrogate is fitted to has one, as in a search."""

WARM_RUNS = 3
"""Of the command, of which the median counts."""

STEP = 1e-6
"""Of central differences, in parts of the box."""


@dataclass(frozen=True)
class Subject:
    """A scene, ready to be tuned.

    Attributes:
        benches, held_out: views tuned on, and views that choose.
        base: the default map, with its cost model.
    """

    name: str
    benches: list[Bench]
    held_out: list[Bench]
    base: AdaptiveShadowMap


def subject_of(name: str, size: tuple[int, int] | None) -> Subject | None:
    """The scene of that name; None where its file is not there."""
    where = other_scene(name) if name in OTHER_SCENES else name
    if where is None:
        return None
    where = str(where)
    options = TuneOptions(scene=where, size=size, quiet=True)
    scene = load_scene(where, options.variant)
    tuned_on, held_out = chosen_views(scene, options)
    benches = [bench_of(scene, view, options, 1) for view in tuned_on]
    others = held_out_benches(scene, held_out, options)
    light = scene.light(options.light)
    model = calibrated(scene, light, benches[0].rays, benches[0].frame, options)
    return Subject(name, benches, others, replace(AdaptiveShadowMap(), cost_model=model))


class Study:
    """The steps of the experiment; each adds to the record."""

    def __init__(self, folder: Path, scenes: tuple[str, ...], smoke: bool):
        self.folder, self.smoke = folder, smoke
        self.size = (96, 96) if smoke else None
        self.known, self.random = (20, 12) if smoke else (KNOWN, RANDOM)
        self.record = StepwiseRecord(
            folder,
            "What accuracy costs in time, and settings that are tuned",
            {"scenes": list(scenes), "prices": list(PRICES), "smoke": smoke},
            bounds,
            document,
        )
        self.scenes = scenes

    def steps(self) -> dict:
        """Names to what is done, in order."""
        steps = {"command": self.command}
        for name in self.scenes:
            steps[name] = lambda name=name: self.scene(name)
        steps["replays"] = self.replayed
        return steps

    def command(self) -> None:
        """`asmjax tune paper_room` as a user runs it; all but the first run find caches warm."""
        if self.smoke:
            return
        runs = []
        for _ in range(1 + WARM_RUNS):
            out = self.folder / "command"
            start = time.perf_counter()
            call = [sys.executable, "-m", "asmjax", "tune", "paper_room", "--quiet", "--fresh"]
            subprocess.run([*call, "--out", str(out)], check=True)
            runs.append(time.perf_counter() - start)
        self.record.record["command_runs"] = runs
        self.record.record["command_seconds"] = statistics.median(runs[1:])

    def scene(self, name: str) -> None:
        """Everything about one scene."""
        subject = subject_of(name, self.size)
        if subject is None:
            self.record.record.setdefault("left_out", []).append(f"{name}: {why_left_out(name)}")
            return
        ledger = Ledger(self.folder / f"{name}.jsonl")
        results = []
        for price in PRICES:
            results.append(self.tuned(subject, price, ledger))
            self.record.write()
        if name in RANKED:
            searched = [one for result in results for one in result.tried]
            self.ranked(subject, results[0].space, ledger, searched)
        gc.collect()

    def tuned(self, subject: Subject, price: float, ledger: Ledger) -> TuneResult:
        """One search; its rivals on the held-out views, and the gaps of its front."""
        result = tuner(subject, price, ledger).run()
        rivals = {
            kind: {
                "objective": one.objective(result.goal),
                "edge_px": one.edge_px,
                "seconds": one.seconds,
                "ratio": one.ratio.record(),
                "settings": one.settings,
            }
            for kind, one in result.rivals.items()
        }
        entry = {
            "scene": subject.name,
            "price": price,
            "outcome": result.outcome.name.lower(),
            "rivals": rivals,
            "front": [
                {
                    "price": point.price,
                    "edge_px": point.edge_px,
                    "seconds": point.seconds,
                    "gap": point.gap,
                    "taken_over": point.taken_over,
                }
                for point in result.front
            ],
            "seconds": result.seconds,
        }
        self.record.record.setdefault("tuned", []).append(entry)
        return result

    def ranked(
        self, subject: Subject, space: Space, ledger: Ledger, searched: Sequence[Candidate]
    ) -> None:
        """Random settings by the surrogate, fitted to all others, and as measured; and the
        gradient."""
        bench = subject.benches[0]
        drawn = qmc.Sobol(len(space.knobs), seed=11)  # pyright: ignore[reportCallIssue]
        points = drawn.random(256)[: self.known + self.random]
        rounds_of = [1] * self.known + [ROUNDS] * self.random
        # By turns: a machine that grows slower or faster meanwhile does so for both kinds.
        turns = np.r_[np.arange(self.known) / self.known, np.arange(self.random) / self.random]
        order = np.argsort(turns, kind="stable").tolist()
        measured = {
            k: bench.try_all([space.algorithm(points[k])], rounds_of[k], ledger, warm_ups=0)[0]
            for k in self.record.bar(order, f"{subject.name}: random settings")
        }
        trials = [measured[k] for k in range(len(points))]
        points = [space.snapped(point) for point in points]
        asked = {settings_key(space.algorithm(point)) for point in points[self.known :]}
        others = {settings_key(one.algorithm): one for one in searched}
        known = [
            *zip(points[: self.known], trials[: self.known], strict=True),
            *((one.point, one.trials[0]) for key, one in others.items() if key not in asked),
        ]
        evidence = evidence_of(bench, subject.base)
        with jax.enable_x64(True):
            places = np.stack([point for point, _ in known])
            fit = calibrated_fit(evidence, space, places, *_measured([one for _, one in known]))
            model = model_of([evidence], [fit], space)
            guessed = said_of(model, np.stack(points[self.known :]))
            deviation = gradient_deviation(model, np.stack(points))
        real = _measured(trials[self.known :])
        correlations = {
            f"{price:g}": _spearman(_objective(guessed, price), _objective(real, price))
            for price in (PRICE, *PRICES)
        }
        self.record.record.setdefault("ranked", {})[subject.name] = {
            "settings": self.random,
            "fitted_to": len(known),
            "spearman_by_price": correlations,
            "spearman_error": _spearman(guessed[0], real[0]),
            "spearman_seconds": _spearman(guessed[1], real[1]),
            "fit_error_misfit": fit.error_misfit,
            "fit_seconds_misfit": fit.seconds_misfit,
            "guessed": guessed.T.tolist(),
            "measured": real.T.tolist(),
        }
        self.record.record.setdefault("gradient", {})[subject.name] = deviation

    def replayed(self) -> None:
        """The same search again and again from its record: what is chosen, and what is measured."""
        subject = subject_of(self.scenes[0], self.size)
        assert subject is not None
        ledger, chosen, made = Ledger(self.folder / f"{subject.name}.jsonl"), [], 0
        for _ in self.record.bar(range(3 if self.smoke else 20), "replays"):
            before = ledger.added
            result = tuner(subject, PRICES[1], ledger).run()
            chosen.append(repr(sorted(result.settings.items(), key=str)))
            made += ledger.added - before
        first = next(
            entry["rivals"]["tuned"]["settings"]
            for entry in self.record.record["tuned"]
            if entry["scene"] == subject.name and entry["price"] == PRICES[1]
        )
        same = repr(sorted(first.items(), key=str))
        self.record.record["replays"] = {
            "count": len(chosen),
            "same": sum(one == same for one in chosen),
            "measured_again": made,
        }


def _measured(trials: Sequence[Trial]) -> np.ndarray:
    """(2, k) edge_px and seconds."""
    return np.array([(trial.edge_px, trial.total.value) for trial in trials]).T


def tuner(subject: Subject, price: float, ledger: Ledger) -> Tuner:
    """The search of one scene at one price."""
    return Tuner(
        subject.name,
        subject.benches,
        subject.held_out,
        subject.base,
        Goal(price=price),
        ledger=ledger,
    )


def gradient_deviation(model: Model, points: np.ndarray, count: int = 24) -> float:
    """The largest difference of gradient and central differences, beside the largest slope."""
    generator = np.random.default_rng(3)
    inside = np.clip(points[:count] + 0.02 * generator.standard_normal((count, 9)), 0.05, 0.95)
    log_price = np.log(PRICE)

    @jax.jit
    def value(point):
        return loss(model, "price", log_price, point, 0.5)

    slope, worst = jax.jit(jax.grad(value)), 0.0
    for point in inside:
        analytic = np.asarray(slope(point))
        numeric = np.array([
            float(value(point + step) - value(point - step)) / (2 * STEP)
            for step in STEP * np.eye(point.size)
        ])  # fmt: skip
        worst = max(worst, float(np.abs(analytic - numeric).max() / np.abs(numeric).max()))
    return worst


def _spearman(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.asarray(spearmanr(one, other)[0]))


def _objective(pair: np.ndarray, price: float) -> np.ndarray:
    return pair[0] + price * pair[1]


def bounds(record: Mapping) -> list[Bound]:
    """The requirements; smaller is better."""
    return list(_bounds(record))


def _bounds(record: Mapping) -> Iterator[Bound]:
    gradient = record.get("gradient", {})
    yield Bound(
        "gradient",
        "surrogate's gradient against central differences, float64, relative",
        max(gradient.values(), default=None),
        1e-4,
    )
    for scene, least in RANKED.items():
        ranked = record.get("ranked", {}).get(scene)
        yield Bound(
            f"ranking {scene}",
            f"1 - rank correlation of surrogate and measured, price {PRICE:g} px/s",
            None if ranked is None else 1 - ranked["spearman_by_price"][f"{PRICE:g}"],
            1 - least,
        )
    tuned = record.get("tuned", [])
    better = [_ratio(entry, "default") for entry in tuned]
    yield Bound(
        "against default",
        f"cases of {len(tuned)} that are not 20 % better than the default (a fifth may not be)",
        float(sum(ratio > 0.8 for ratio in better)) if tuned else None,
        0.2 * len(tuned),
    )
    yield Bound(
        "against grid",
        "largest objective, tuned / best of the grid of 32",
        max((_ratio(entry, "grid_best") for entry in tuned), default=None),
        1.02,
    )
    yield Bound(
        "command",
        "`asmjax tune paper_room` with warm caches, seconds",
        record.get("command_seconds"),
        60.0,
    )
    gaps = [point["gap"] for entry in tuned for point in entry["front"]]
    yield Bound(
        "front",
        "objective along the front by continuation above that of another search, largest",
        max(gaps, default=None),
        0.05,
    )
    replays = record.get("replays")
    yield Bound(
        "replays",
        "replays of 20 from one record that chose other settings or measured anything",
        None
        if replays is None
        else float(replays["count"] - replays["same"] + replays["measured_again"]),
        0.0,
    )


def _ratio(entry: Mapping, rival: str) -> float:
    return entry["rivals"]["tuned"]["objective"] / entry["rivals"][rival]["objective"]


def document(record: Mapping) -> str:
    """The record as Markdown."""
    lines = head_of(record)
    lines += ["", "## Tuned against its rivals, on views that were not tuned on", ""]
    lines += [
        "Objective: edge error in pixels + price x seconds. In brackets error and milliseconds.",
        "",
        "| scene | price, px/s | default | tuned | best of the grid | best at random |",
        "| --- | ---: | --- | --- | --- | --- |",
    ]
    for entry in record.get("tuned", []):
        cells = [
            f"{one['objective']:.3g} ({one['edge_px']:.3g} px, {1e3 * one['seconds']:.3g} ms)"
            for one in (
                entry["rivals"][kind] for kind in ("default", "tuned", "grid_best", "random_best")
            )
        ]
        lines.append(f"| {entry['scene']} | {entry['price']:g} | {' | '.join(cells)} |")
    lines += ["", "## How well the surrogate ranks settings it has not seen", ""]
    lines += ["| scene | settings | error | seconds | " + " | ".join(
        f"price {price:g}" for price in (PRICE, *PRICES)) + " |",
        "| --- | ---: | ---: | ---: |" + " ---: |" * (1 + len(PRICES))]  # fmt: skip
    for scene, ranked in record.get("ranked", {}).items():
        numbers = [
            ranked["spearman_error"], ranked["spearman_seconds"],
            *ranked["spearman_by_price"].values(),
        ]  # fmt: skip
        cells = " | ".join(f"{number:.3f}" for number in numbers)
        lines.append(f"| {scene} | {ranked['settings']} | {cells} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="tiny sizes, a few minutes")
    parser.add_argument("--out", type=Path, default=Path("out/accuracy_and_time"))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    arguments = parser.parse_args()
    prepare_to_measure()
    scenes = tuple(arguments.scenes[:1] if arguments.smoke else arguments.scenes)
    study = Study(arguments.out, scenes, arguments.smoke)
    study.record.run(study.steps())
    print((arguments.out / "report.md").read_text(encoding="utf-8"))
    return exit_code(study.record.record)


if __name__ == "__main__":
    sys.exit(main())
