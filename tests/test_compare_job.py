"""`asmjax compare`: files, numbers against direct calls, restarts, interruptions, wrong use."""

import csv
import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asmjax import cli
from asmjax.cli.parse import parse
from asmjax.compare_job import Comparing, compare, run_comparison
from asmjax.errors import UseError
from asmjax.experiment import settings_range
from asmjax.experiment.bench import Bench
from asmjax.metrics import error_summary, surface_pairs
from asmjax.options import CompareOptions
from asmjax.report import InvalidReport, validate_report
from asmjax.report.compare_schema import COMPARISON_KEYS
from asmjax.report.keys import key_paths
from asmjax.report.outputs import MEASUREMENTS
from asmjax.report.schema import RUN_KEYS
from asmjax.report.table import MAX_WIDTH
from asmjax.shadow import UniformShadowMap

SIDE = 40
WORDS = [
    "letter_f", "--size", str(SIDE), str(SIDE), "--methods", "uniform", "--memory-mb", "0.0625",
    "--repeats", "1", "--samples", "1", "--quiet",
]  # fmt: skip


@pytest.fixture(scope="module")
def options(tmp_path_factory) -> CompareOptions:
    return CompareOptions(
        scene="letter_f", size=(SIDE, SIDE), methods=("uniform",), views=("angle", "above"),
        memory_mb=0.0625, repeats=2, samples=(1,), quiet=True,
        out=str(tmp_path_factory.mktemp("comparison") / "out"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def result(options):
    """A small comparison on two views with everything written."""
    return run_comparison(options)


@pytest.fixture(scope="module")
def report(result, options) -> dict:
    return json.loads((Path(options.out) / "report.json").read_text(encoding="utf-8"))


@pytest.mark.mitsuba
def test_everything_is_written_and_valid(report, options):
    """Four memory limits on two views, and both yardsticks beside them."""
    validate_report(report)
    assert report["schema"] == "asmjax/comparison/1" and report["ended"] == "complete"
    labels = ["0.0625 MB", "0.00390625 MB", "0.25 MB", "0.015625 MB"]
    assert [trial["label"] for trial in report["trials"]] == labels
    assert report["trials_asked"] == 4
    # A measurement for each view, also of the yardsticks: 1 and 16 rays.
    assert report["measurements"] == {"made": 2 * 4 + 2 * 2, "reused": 0}
    assert [trial["samples"] for trial in report["yardsticks"]] == [1, 16]
    assert [view["name"] for view in report["views"]] == ["angle", "above"]
    written = {path.name for path in Path(options.out).iterdir()}
    assert written == {"report.json", "trials.csv", MEASUREMENTS, "costs_1.png"}
    with (Path(options.out) / "trials.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * (4 + 2)
    assert float(rows[1]["build_ms"]) == pytest.approx(
        1e3 * report["trials"][0]["views"][0]["seconds"]["build"]["median"]
    )


@pytest.mark.mitsuba
def test_numbers_are_those_of_direct_calls(report):
    """The same scene, map and truth without the job: the same errors on each view, and of both
    views together wrong pixels / length of edges."""
    from asmjax.render.load import load_scene

    scene = load_scene("letter_f")
    wrong = []
    for k, name in enumerate(("angle", "above")):
        eye = scene.eye(scene.view(name).resized(SIDE, SIDE))
        frame, rays = scene.light_frame(eye), scene.light_rays()
        algorithm = UniformShadowMap(128)
        lit = algorithm.visibility(algorithm.build(eye, frame, rays), eye.points)
        truth = scene.shadow_rays(eye, frame, rays).trace()
        size = SIDE, SIDE
        valid, depth = eye.valid.reshape(size), np.where(eye.valid, eye.depth, 1.0).reshape(size)
        expected = error_summary(
            truth.reshape(size), np.asarray(lit).reshape(size), valid, surface_pairs(valid, depth)
        )
        assert report["trials"][0]["views"][k]["error"] == expected
        wrong.append(np.count_nonzero((truth != np.asarray(lit)) & eye.valid))
        assert report["views"][k]["valid_pixels"] == np.count_nonzero(eye.valid)
    length = sum(view["samples"][0]["edge_length_px"] for view in report["views"])
    together = report["trials"][0]["error"]["boundary_displacement_px"]["per_edge_length"]
    assert together == pytest.approx(sum(wrong) / length)
    # All on one yardstick: the same for all, and of the rays the time itself.
    rays = report["yardsticks"][0]["ranked_seconds"]["median"]
    for one in report["trials"]:
        assert seconds_of(one) == pytest.approx(one["ratio"]["median"] * rays)
    for kind, cost in (("bytes", bytes_of), ("seconds", seconds_of)):
        for one in report["trials"]:
            beaten = any(
                cost(other) <= cost(one)
                and edge_px(other) < edge_px(one)
                or cost(other) < cost(one)
                and edge_px(other) <= edge_px(one)
                for other in report["trials"]
            )
            assert one["on_front"][kind] is not beaten


def bytes_of(trial: dict) -> int:
    return trial["bytes"]


def seconds_of(trial: dict) -> float:
    return trial["ranked_seconds"]["median"]


def edge_px(trial: dict) -> float:
    return trial["error"]["boundary_displacement_px"]["per_edge_length"]


@pytest.mark.slow
@pytest.mark.mitsuba
def test_a_restart_measures_nothing_again(result, options, monkeypatch):
    """Rationale: whoever stops a comparison of an hour must not pay for it twice."""
    monkeypatch.setattr(UniformShadowMap, "build", forbidden)
    again = run_comparison(options)
    assert (again.made, again.reused) == (0, result.made)
    assert [item.trial for item in again.trials] == [item.trial for item in result.trials]
    monkeypatch.undo()
    fresh = run_comparison(replace(options, fresh=True, views=("angle",)))
    assert fresh.reused == 0 and fresh.made == 4 + 2


def forbidden(self, view, frame, rays):
    raise AssertionError("measured again")


def interrupted_after(monkeypatch, count: int, problem=KeyboardInterrupt) -> None:
    """Let the first `count` batches be measured."""
    before, calls = Bench.try_all, []

    def stop(self, *args, **kwargs):
        calls.append(1)
        if len(calls) > count:
            raise problem
        return before(self, *args, **kwargs)

    monkeypatch.setattr(Bench, "try_all", stop)


@pytest.mark.mitsuba
def test_an_interrupt_leaves_a_report_and_is_gone_on_from(tmp_path, monkeypatch, capfd):
    out = tmp_path / "out"
    words = ["compare", *WORDS, "--out", str(out)]
    interrupted_after(monkeypatch, 2)
    assert cli.main(words) == 130
    said = capfd.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("asmjax: interrupted; 2 of 4 trials are in") and str(out) in said
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    assert report["ended"] == "interrupted" and len(report["trials"]) == 2
    assert any("2 of 4 trials are missing" in line for line in report["notices"])
    monkeypatch.undo()
    assert cli.main(words) == 0
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["ended"] == "complete" and report["measurements"] == {"made": 2, "reused": 4}
    interrupted_after(monkeypatch, 0)
    assert cli.main(["compare", *WORDS, "--out", str(tmp_path / "none"), "--fresh"]) == 130
    assert "no trial was finished" in capfd.readouterr().err


@pytest.mark.mitsuba
def test_an_interrupt_in_python_gives_what_was_measured(monkeypatch, caplog):
    """A notebook keeps its hour of trials; without any there is nothing to keep."""
    few = {"size": (SIDE, SIDE), "methods": ("uniform",), "memory_mb": 0.0625, "samples": (1,)}
    interrupted_after(monkeypatch, 2)
    result = compare("letter_f", repeats=1, **few)
    assert result.ended == "interrupted" and (len(result.trials), result.asked) == (2, 4)
    assert "interrupted: 2 of 4 trials" in caplog.text
    monkeypatch.undo()
    interrupted_after(monkeypatch, 0)
    with pytest.raises(KeyboardInterrupt, match="no trial was finished"):
        compare("letter_f", repeats=1, **few)


@pytest.mark.mitsuba
@pytest.mark.slow
def test_time_ends_it_and_a_broken_figure_loses_nothing(tmp_path, monkeypatch):
    """What time leaves out is said; numbers are on disk before a figure is drawn."""
    late = iter([False, True])
    monkeypatch.setattr(Comparing, "_is_late", lambda self: next(late))
    monkeypatch.setattr("asmjax.report.compare_files.draw_comparison", broken)
    out = tmp_path / "out"
    with pytest.raises(RuntimeError, match="no ink"):
        cli.main(["compare", *WORDS, "--out", str(out), "--minutes", "5"])
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["ended"] == "time limit" and len(report["trials"]) == 1
    assert any("3 of 4 trials are missing" in line for line in report["notices"])
    assert len((out / MEASUREMENTS).read_text(encoding="utf-8").splitlines()) == 1 + 2
    monkeypatch.setattr(Comparing, "_is_late", lambda self: True)
    assert cli.main(["compare", *WORDS, "--out", str(out), "--minutes", "5"]) == 2


def broken(result, samples):
    raise RuntimeError("no ink")


@pytest.mark.mitsuba
@pytest.mark.slow
def test_what_cannot_be_used_is_left_out_and_said(tmp_path, monkeypatch):
    """A family that refuses the view is named once, and the others of its batch are measured."""
    from asmjax.shadow import LightSpaceShadowMap

    monkeypatch.setattr(LightSpaceShadowMap, "build", refuse)
    words = ["compare", *WORDS, "--out", str(tmp_path)]
    words[words.index("uniform")] = "light-space"
    assert cli.main(words) == 2
    assert cli.main([*words, "--methods", "light-space", "uniform"]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert {trial["family"] for trial in report["trials"]} == {"uniform"}
    assert report["notices"].count("light-space is left out: no scene suits it.") == 1


@pytest.mark.slow
@pytest.mark.mitsuba
def test_adaptive_maps_and_a_settings_file(tmp_path, monkeypatch):
    """An adaptive map has nodes, keeps to its memory, and needs a cost model; a file's settings are
    tried beside the range of their family."""
    monkeypatch.setattr(settings_range, "MEMORY_FACTORS", (1,))
    monkeypatch.setattr(settings_range, "VARIANTS", {"adaptive": [{"finest_ratio": 1.0}]})
    monkeypatch.setattr(settings_range, "BETWEEN", {})
    file = tmp_path / "flat.toml"
    file.write_text('algorithm = "uniform"\n[settings]\nresolution = 32\n', encoding="utf-8")
    words = ["compare", *WORDS, "--out", str(tmp_path / "out"), "--settings", str(file)]
    assert cli.main([*words, "--methods", "uniform", "adaptive"]) == 0
    report = json.loads((tmp_path / "out/report.json").read_text(encoding="utf-8"))
    trials = {f"{trial['family']} {trial['label']}": trial for trial in report["trials"]}
    names = ["uniform settings file", "uniform 0.0625 MB", "adaptive 0.0625 MB"]
    assert list(trials) == [*names, "adaptive 0.0625 MB, finest ratio 1"]
    assert trials[names[0]]["settings"]["resolution"] == 32
    assert trials[names[0]]["nodes"] is None and trials[names[0]]["bytes"] == 4 * 32**2
    assert trials[names[2]]["nodes"] > 0 and trials[names[2]]["bytes"] <= 2**16
    assert report["cost_model"]["a_seconds_per_texel"] > 0
    words[words.index("uniform")] = "light-space"
    assert cli.main(words) == 2


def refuse(self, view, frame, rays):
    raise UseError("no scene suits it.")


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["letter_f", "--methods", "unifrom"], "Did you mean 'uniform'?"),
        (["letter_f", "--views", "angel"], "Did you mean 'angle'?"),
        (["letter_f", "--views", "angle", "--view", "angle"], "both say what is looked at"),
        (["letter_f", "--samples", "0"], "--samples is 0; allowed"),
        (["letter_f", "--minutes", "0"], "--minutes is 0.0; allowed"),
        (["letter_f", "--minutes", "-1"], "--minutes is -1.0; allowed"),
        (["letter_f", "--memory-mb", "0.0001", "--size", "40", "40"], "--memory-mb"),
        (["letter_f", "--size", "2", "2"], "sees no edge of a shadow"),
        (["letter_g"], "letter_f"),
        (["letter_f", "--angles", "3"], "--angles"),
    ],
)
def test_wrong_use_is_one_line_and_leaves_nothing(words, said, tmp_path, capfd):
    out = tmp_path / "out"
    assert cli.main(["compare", *words, "--out", str(out)]) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.startswith("asmjax: error: ") and printed.count("\n") == 0
    assert said in printed
    assert not out.exists()


@pytest.mark.mitsuba
def test_the_result_answers_questions(result, report):
    """The best is what the report has; the tables fit; a plot for each number of samples."""
    trials = report["trials"]
    errors = {trial["label"]: edge_px(trial) for trial in trials}
    best = result.best()
    assert best.trial.edge_px == min(errors.values()) == errors[best.label]
    assert best.algorithm == UniformShadowMap(settings_side(trials, best.label))
    least = min(trials, key=seconds_of)
    assert result.best(error=1e3).label == least["label"]
    with pytest.raises(UseError, match="the least error was"):
        result.best(error=-1.0)
    with pytest.raises(UseError, match="3 samples per pixel were not tried; tried: 1"):
        result.best(samples=3)
    lines = result.table().splitlines()
    assert max(map(len, lines)) <= MAX_WIDTH
    assert sum(line.startswith("rays per pixel") for line in lines) == 1
    assert result.plot(1).axes and "<pre>" in result._repr_html_()


def settings_side(trials: list[dict], label: str) -> int:
    """Resolution of the trial of that label."""
    return next(trial["settings"]["resolution"] for trial in trials if trial["label"] == label)


@pytest.mark.mitsuba
def test_measurements_that_cannot_be_kept_end_it(tmp_path, monkeypatch, capfd):
    """A full disk is no fault of an algorithm: none is left out for it, and it is one line."""

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("asmjax.experiment.ledger.os.fsync", full)
    assert cli.main(["compare", *WORDS, "--out", str(tmp_path / "out")]) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.startswith("asmjax: error: cannot write measurements to")
    assert "No space left" in printed and printed.count("\n") == 0


@pytest.mark.mitsuba
def test_what_was_left_out_is_not_missing(tmp_path, monkeypatch):
    """One setting refused, one measured, then time ends: of four two are still to be tried."""
    before, calls = Bench.try_all, []

    def second_is_refused(self, algorithms, *args, **kwargs):
        calls.append(1)
        if len(calls) == 2:
            raise UseError("no scene suits it.")
        return before(self, algorithms, *args, **kwargs)

    late = iter([False, False, True])
    monkeypatch.setattr(Comparing, "_is_late", lambda self: next(late))
    monkeypatch.setattr(Bench, "try_all", second_is_refused)
    assert cli.main(["compare", *WORDS, "--out", str(tmp_path), "--minutes", "5"]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(report["trials"]) == 1
    assert any("time limit: 2 of 4 trials are missing" in line for line in report["notices"])


@pytest.mark.slow
@pytest.mark.mitsuba
def test_from_python_nothing_is_written_without_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few = {"size": (SIDE, SIDE), "methods": ("uniform",), "memory_mb": 0.0625, "repeats": 1}
    found = compare("letter_f", samples=(1,), **few)
    assert len(found.trials) == 4 and list(tmp_path.iterdir()) == []
    kept = compare("letter_f", samples=(2, 1), out="here", **few)
    assert [item.trial.samples for item in kept.trials] == [2, 1] * 4
    assert len(kept.of(2)) == 4 and [item.trial.samples for item in kept.yardsticks] == [1, 2, 16]
    assert kept.made == compare("letter_f", samples=(2, 1), out="here", **few).reused == 8 + 3
    assert {path.name for path in (tmp_path / "here").glob("*.png")} == {
        "costs_1.png",
        "costs_2.png",
    }
    with pytest.raises(UseError, match=r"unknown option 'sampels'.*Did you mean 'samples'"):
        compare("letter_f", sampels=1)


def test_options_arrive():
    words = "terrain --views a b --samples 1 4 --minutes 2.5 --fresh --methods uniform --repeats 7"
    wanted = CompareOptions(
        scene="terrain", views=("a", "b"), samples=(1, 4), minutes=2.5, fresh=True,
        methods=("uniform",), repeats=7,
    )  # fmt: skip
    assert parse(["compare", *words.split()], cli.COMMANDS) == ("compare", wanted)
    assert parse(["compare"], cli.COMMANDS) == ("compare", CompareOptions())


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: r.update(ended="tired"), "ended: expected one of complete"),
        (lambda r: r["trials"][0].update(family="adaptive"), "trials[0].name: 'uniform"),
        (lambda r: r["trials"].append(r["trials"][0]), "occurs twice"),
        (lambda r: r["trials"][1]["views"].pop(), "trials[1].views: expected"),
        (lambda r: r["yardsticks"][0].pop("ratio"), "yardsticks[0].ratio: missing"),
        (lambda r: r["equal_error"][0].update(seconds=1), "equal_error[0].seconds: expected"),
    ],
)
def test_broken_reports_are_refused(report, change, said):
    found = json.loads(json.dumps(report))
    change(found)
    with pytest.raises(InvalidReport) as problem:
        validate_report(found)
    assert said in str(problem.value)


TOLD_ONCE = ("trials[].error.", "trials[].ratio.", "trials[].views[].", "yardsticks[].",
             "equal_error[].bytes.")  # fmt: skip
"""Keys below these are those of another entry, and the page says so."""


def test_every_key_is_documented():
    """What a comparison has in common with a run stands under the run; the four keys of an
    interval stand under the total's."""
    text = (Path(__file__).parents[1] / "docs/comparisons.md").read_text(encoding="utf-8")
    common = {path for path, _ in key_paths(RUN_KEYS)}
    for path, key in key_paths(COMPARISON_KEYS):
        assert key.means
        path = path.replace(".build.", ".total.").replace(".analysis.", ".total.")
        path = path.replace(".query.", ".total.")
        path = path.replace("].ranked_seconds.", "].seconds.total.")
        if path in common or path.startswith(TOLD_ONCE):
            continue
        assert f"`{path.removesuffix('[]')}" in text or f"`{path}." in text, path
    for path in TOLD_ONCE:
        assert f"`{path.removesuffix('.').removesuffix('[]')}" in text
    assert "`trials.csv`" in text and "`costs_1.png`" in text
