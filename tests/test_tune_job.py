"""`asmjax tune`: views, goals, files, restarts, interruptions, wrong use; once with the search."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asmjax import cli, tune_job
from asmjax.cli.parse import parse
from asmjax.errors import UseError
from asmjax.experiment.bench import Bench
from asmjax.options import LEAST_EVALUATIONS, PRICE, TuneOptions
from asmjax.report import validate_report
from asmjax.report.outputs import MEASUREMENTS
from asmjax.shadow import (
    AdaptiveShadowMap,
    UniformShadowMap,
    preset,
    read_settings,
    write_settings,
)
from asmjax.tune_job import chosen_views, default_map, goal_of, run_tuning, tune
from asmjax.tuning import tuner
from asmjax.tuning.calibrate import Calibration
from asmjax.tuning.correction import no_correction
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Candidate, Outcome, TuneResult, best_of
from asmjax.tuning.rivals import grid_size
from asmjax.tuning.space import space_of
from asmjax.tuning.surrogate import Fit
from asmjax.tuning.tried import candidate

SIDE = 48
FEW = {"scene": "letter_f", "view": "angle", "size": (SIDE, SIDE), "memory_mb": 1.0, "repeats": 2}
WORDS = ["tune", "letter_f", "--view", "angle", "--size", str(SIDE), str(SIDE), "--memory-mb", "1",
         "--repeats", "2", "--quiet"]  # fmt: skip


class QuickTuner:
    """A search without a surrogate: the default, and the default with coarser edges."""

    outcome, advice = Outcome.FOUND, ""
    made: "list[QuickTuner]" = []

    def __init__(self, scene, benches, held_out, base, goal, **others):
        self.scene, self.benches, self.held_out = scene, benches, held_out
        self.base, self.goal, self.others = base, goal, others
        self.made.append(self)

    def run(self) -> TuneResult:
        box = space_of(self.base, self.benches[0].frame.faces, 0.05)
        coarser = replace(self.base, finest_ratio=0.5)
        maps = {"default": self.base, "neighbour": coarser}
        before = self.others["ledger"].taken

        def measured(benches, rounds) -> list[Candidate]:
            columns = [
                bench.try_all(list(maps.values()), rounds, self.others["ledger"])
                for bench in benches
            ]
            return [
                candidate(role, box.point(algorithm), algorithm, trials, benches)
                for (role, algorithm), trials in zip(
                    maps.items(), zip(*columns, strict=True), strict=True
                )
            ]

        self.others["progress"]("settings")
        tried = measured(self.benches, 1)
        stopped = self.outcome is Outcome.INTERRUPTED
        finals = tried if stopped else measured(self.held_out, self.others["rounds"])
        tuned = best_of(finals, self.goal)
        assert tuned is not None
        rules = Fit(*np.zeros(len(Fit._fields)))
        fit = Calibration(rules, no_correction(11, 20), 0.1, 0.1, 20, True)
        return TuneResult(
            scene=self.scene,
            goal=self.goal,
            space=box,
            views=tuple(bench.view for bench in self.benches),
            held_out=tuple(bench.view for bench in self.held_out),
            outcome=self.outcome,
            advice=self.advice,
            default=finals[0],
            tuned=tuned,
            grid_best=None,
            random_best=None,
            finalists=tuple(finals),
            tried=tuple(tried),
            calibrations=(fit,) * len(self.benches),
            said=np.full((2, len(tried)), 0.01),
            rank_correlation=1.0,
            sensitivity=None,
            front=(),
            evaluations=self.others["evaluations"],
            reused=self.others["ledger"].taken - before,
            seconds=1.0,
        )


@pytest.fixture
def quick(monkeypatch):
    """Jobs without a surrogate, which takes a minute to compile."""
    monkeypatch.setattr(tune_job, "Tuner", QuickTuner)
    monkeypatch.setattr(QuickTuner, "made", [])
    return QuickTuner


@pytest.mark.mitsuba
def test_files_numbers_and_restart(quick, tmp_path, monkeypatch):
    """Objectives are those of the measurements, errors those of direct calls; the same command
    measures nothing again; the settings file runs."""
    options = TuneOptions(**FEW, quiet=True, price=2.0, out=str(tmp_path))
    result = run_tuning(options)
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    written = {path.name for path in tmp_path.iterdir()}
    figures = {"tried.png", "surrogate.png"}
    assert written == {"report.json", "tuned.toml", "tried.csv", MEASUREMENTS} | figures
    names = [f"angle, turned {degrees} degrees" for degrees in (0, 10, 20)]
    assert [view["name"] for view in report["views"]] == names
    assert [view["held_out"] for view in report["views"]] == [False, True, True]
    default = report["objective"]["default"]
    assert default["objective"] == pytest.approx(
        default["edge_px"] + 2.0 * default["seconds"]["median"]
    )
    wrong = [view["error"]["misclassified_fraction"] for view in default["views"]]
    assert wrong == [direct_error(options, k) for k in (0, 1)]
    assert report["measurements"] == {"made": 2 + 2 * 2, "reused": 0}
    assert read_settings(tmp_path / "tuned.toml").name == "adaptive-1MB"
    monkeypatch.setattr(AdaptiveShadowMap, "build", forbidden)
    again = run_tuning(options)
    assert (again.made, again.found.reused) == (0, 6)
    assert again.found.tuned.trials == result.found.tuned.trials


def direct_error(options: TuneOptions, number: int) -> float:
    """Wrong part of a held-out view's pixels with the default settings, without the job."""
    from asmjax.render.load import load_scene

    scene = load_scene("letter_f")
    view = chosen_views(scene, options)[1][number]
    eye = scene.eye(view)
    frame, rays = scene.light_frame(eye), scene.light_rays()
    algorithm = preset("default", memory_bytes=2**20)
    lit = np.asarray(algorithm.visibility(algorithm.build(eye, frame, rays), eye.points))
    wrong = (lit >= 0.5) != scene.shadow_rays(eye, frame, rays).trace()
    return float((wrong & eye.valid).sum() / eye.valid.sum())


def forbidden(self, view, frame, rays):
    raise AssertionError("measured again")


@pytest.mark.mitsuba
def test_what_the_search_is_told(quick):
    """Options arrive at the search; from Python nothing is written without a folder."""
    result = tune(**FEW, within_ms=250, evaluations=64, seed=3, minutes=5)
    told = quick.made[0]
    assert told.goal == Goal(seconds=0.25) and result.found.goal == told.goal
    assert told.others["rounds"] == 2 and told.others["evaluations"] == 64
    assert told.others["seed"] == 3 and told.others["deadline"] is not None
    assert told.base.memory_bytes == 2**20 and told.base.cost_model is not None
    assert told.others["ledger"].path is None
    assert result.best() is result.found.tuned and "tuned" in result.table()
    with pytest.raises(UseError, match=r"unknown option 'evalutions'.*Did you mean 'evaluations'"):
        tune("letter_f", evalutions=30)


@pytest.mark.mitsuba
def test_trouble_is_told_and_is_no_failure(quick, tmp_path, monkeypatch, caplog):
    """A limit that nothing meets: exit 0, loud, and the settings that came nearest are written."""
    monkeypatch.setattr(quick, "outcome", Outcome.NOT_MET)
    monkeypatch.setattr(quick, "advice", "no settings met the limit: the nearest have 0.1 px.")
    assert cli.main([*WORDS, "--error", "1e-9", "--out", str(tmp_path)]) == 0
    assert "the nearest have 0.1 px" in caplog.text
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["outcome"] == "not_met" and report["notices"][-1] == quick.advice
    assert (tmp_path / "tuned.toml").exists()


@pytest.mark.mitsuba
def test_an_interrupt_keeps_measurements_and_is_gone_on_from(quick, tmp_path, monkeypatch, capfd):
    out, before, calls = tmp_path / "out", Bench.try_all, []

    def stop(self, *args, **kwargs):
        calls.append(1)
        if len(calls) > 2:
            raise KeyboardInterrupt
        return before(self, *args, **kwargs)

    monkeypatch.setattr(Bench, "try_all", stop)
    assert cli.main([*WORDS, "--out", str(out)]) == 130
    said = capfd.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("asmjax: interrupted; 4 measurements are kept in")
    assert str(out / MEASUREMENTS) in said and said.endswith("run the same command again to go on")
    assert [path.name for path in out.iterdir()] == [MEASUREMENTS]
    assert cli.main([*WORDS, "--out", str(tmp_path / "none")]) == 130
    assert "nothing was measured yet" in capfd.readouterr().err
    assert not (tmp_path / "none").exists()
    monkeypatch.setattr(Bench, "try_all", before)
    assert cli.main([*WORDS, "--out", str(out)]) == 0
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["measurements"] == {"made": 2, "reused": 4}


@pytest.mark.mitsuba
def test_an_interrupted_search_still_writes_its_best(quick, tmp_path, monkeypatch, capfd):
    """Settings and report of what was measured on the views tuned on, and it says so."""
    monkeypatch.setattr(quick, "outcome", Outcome.INTERRUPTED)
    monkeypatch.setattr(quick, "advice", f"{Outcome.INTERRUPTED.value}.")
    assert cli.main([*WORDS, "--out", str(tmp_path)]) == 130
    said = capfd.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("asmjax: interrupted; the best settings so far are in")
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    assert report["outcome"] == "interrupted"
    assert [view["view"] for view in report["objective"]["tuned"]["views"]] == [
        "angle, turned 0 degrees"
    ]
    assert read_settings(tmp_path / "tuned.toml").name == "adaptive-1MB"


@pytest.mark.mitsuba
def test_an_interrupted_search_in_python_gives_its_best(quick, monkeypatch, caplog):
    monkeypatch.setattr(quick, "outcome", Outcome.INTERRUPTED)
    result = tune(**FEW)
    assert result.outcome is Outcome.INTERRUPTED and result.algorithm.memory_bytes == 2**20
    assert Outcome.INTERRUPTED.value in caplog.text


@pytest.mark.mitsuba
def test_a_turned_view_without_shadow_edges_is_turned_the_other_way(quick, monkeypatch):
    """Nobody named it, so it may not stop everything; a named one may."""
    before = tune_job.check_edges

    def bare(bench, scene):
        if bench.view.endswith("turned 10 degrees") or bench.view == "above":
            raise UseError(f"view '{bench.view}' sees no edge of a shadow.")
        before(bench, scene)

    monkeypatch.setattr(tune_job, "check_edges", bare)
    result = tune(**FEW, price=1.0)
    assert result.found.held_out == ("angle, turned -10 degrees", "angle, turned 20 degrees")
    named = {name: value for name, value in FEW.items() if name != "view"}
    with pytest.raises(UseError, match="'above' sees no edge"):
        tune(**named, views=("angle",), held_out=("above",))

    def all_bare(bench, scene):
        if bench.view != "angle, turned 0 degrees":
            raise UseError(f"view '{bench.view}' sees no edge of a shadow.")

    monkeypatch.setattr(tune_job, "check_edges", all_bare)
    with pytest.raises(UseError, match="Name other views with --views and --held-out"):
        tune(**FEW, price=1.0)


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--price", "1", "--error", "0.1"], "--price and --error are different goals"),
        (["--price", "0"], "--price is 0.0; allowed: a finite number above 0"),
        (["--within-ms", "-3"], "--within-ms is -3.0; allowed"),
        (["--error", "nan"], "--error is nan; allowed"),
        (["--evaluations", "12"], f"--evaluations is 12; allowed: .*{LEAST_EVALUATIONS}"),
        (["--views", "angle"], "--held-out what chooses; give both, or neither"),
        (["--views", "angle", "--held-out", "above", "angle"], "view 'angle' is named by --views"),
        (["--views", "angle", "--held-out", "abov"], "Did you mean 'above'"),
        (["--views", "angle", "--held-out", "above", "--view", "angle"], "both say what is looked"),
        (["--memory-mb", "0.0001", "--size", "40", "40"], "--memory-mb"),
        (["--size", "2", "2"], "sees no edge of a shadow"),
        (["--minutes", "0"], "--minutes is 0.0; allowed"),
        (["--preset", "paper_2001"], "--preset"),
    ],
)
def test_wrong_use_is_one_line_and_leaves_nothing(words, said, tmp_path, capfd):
    import re

    out = tmp_path / "out"
    assert cli.main(["tune", "letter_f", *words, "--out", str(out)]) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.startswith("asmjax: error: ") and printed.count("\n") == 0
    assert re.search(said, printed)
    assert not out.exists()


def test_options_arrive():
    words = (
        "terrain --views a b --held-out c --price 0.5 --memory-mb 4 --evaluations 70 --repeats 7 "
        "--minutes 2.5 --fresh --seed 9 --settings my.toml"
    )
    wanted = TuneOptions(
        scene="terrain", views=("a", "b"), held_out=("c",), price=0.5, memory_mb=4.0,
        evaluations=70, repeats=7, minutes=2.5, fresh=True, seed=9, settings="my.toml",
    )  # fmt: skip
    assert parse(["tune", *words.split()], cli.COMMANDS) == ("tune", wanted)
    assert parse(["tune"], cli.COMMANDS) == ("tune", TuneOptions())


def test_help_and_pages_say_the_numbers_of_the_search(capsys, monkeypatch):
    """What is asked for is what the search refuses to go below, and what it does."""
    monkeypatch.setenv("COLUMNS", "1000")
    with pytest.raises(SystemExit):
        cli.main(["tune", "--help"])
    said = capsys.readouterr().out
    assert f"real map, {LEAST_EVALUATIONS} or more" in said
    assert LEAST_EVALUATIONS == tuner.LEAST_EVALUATIONS == 14 + 36 + 2 * 5
    assert f"its first {tuner.SAMPLES} samples" in said
    assert f"a grid of {grid_size()}, the rest" in said
    docs = Path(__file__).parents[1] / "docs"
    pages = {path.name: path.read_text(encoding="utf-8") for path in docs.glob("*.md")}
    assert f"its first {tuner.SAMPLES} are the search's own samples" in " ".join(pages.values())
    found = f"at most {tuner.SINGLES}), and {tuner.SAMPLES} settings drawn at random"
    assert found in pages["accuracy_and_time.md"]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, Goal(price=PRICE)),
        ({"price": 3.0}, Goal(price=3.0)),
        ({"within_ms": 40.0}, Goal(seconds=0.04)),
        ({"error": 0.02}, Goal(error=0.02)),
    ],
)
def test_goals_are_in_seconds_and_pixels(given, expected):
    assert goal_of(TuneOptions(**given)) == expected


def test_a_settings_file_is_where_tuning_starts(tmp_path):
    mine = AdaptiveShadowMap(memory_bytes=2**21, compare="depth", node_resolution=32)
    write_settings(tmp_path / "mine.toml", mine)
    options = TuneOptions(settings=str(tmp_path / "mine.toml"))
    assert default_map(options).adaptive == mine
    assert default_map(TuneOptions(memory_mb=3)).adaptive.memory_bytes == 3 * 2**20
    with pytest.raises(UseError, match="both say how much memory"):
        default_map(replace(options, memory_mb=2.0))
    write_settings(tmp_path / "other.toml", UniformShadowMap(64))
    with pytest.raises(UseError, match="tuning is for adaptive maps"):
        default_map(TuneOptions(settings=str(tmp_path / "other.toml")))
    (tmp_path / "tiny.toml").write_text('algorithm = "adaptive"\n[settings]\nmemory_mb = 1e-3\n')
    with pytest.raises(UseError, match=r"tiny.toml': .*memory_mb"):
        default_map(TuneOptions(settings=str(tmp_path / "tiny.toml"))).check(1)


@pytest.mark.mitsuba
def test_views_are_turned_about_what_is_seen():
    """By 0 and by 10 and 20 degrees, from as far away; named ones as they are, each once."""
    from asmjax.render.load import load_scene

    scene = load_scene("letter_f")
    tuned_on, held_out = chosen_views(scene, TuneOptions(**FEW))
    assert (len(tuned_on), len(held_out)) == (1, 2)
    assert tuned_on[0].origin == pytest.approx(scene.view("angle").origin)
    turned = [angle_about(view, tuned_on[0]) for view in (*tuned_on, *held_out)]
    assert turned == pytest.approx([0, 10, 20], abs=1e-5)
    assert [view.name for view in held_out] == [f"angle, turned {k} degrees" for k in (10, 20)]
    assert all(view.width == SIDE for view in held_out)
    named = TuneOptions(scene="letter_f", views=("angle", "angle"), held_out=("above",))
    some, others = chosen_views(scene, named)
    assert [view.name for view in some] == ["angle"] and others == [scene.view("above")]
    number = str(list(scene.views).index("angle"))
    with pytest.raises(UseError, match="named by --views and by --held-out"):
        chosen_views(scene, TuneOptions(views=("angle",), held_out=(number,)))


def angle_about(view, first) -> float:
    """Degrees between two eyes about their target, around the up vector."""
    up = np.asarray(view.up) / np.linalg.norm(view.up)
    arms = [np.subtract(v.origin, v.target) for v in (view, first)]
    flat = [arm - up * (up @ arm) for arm in arms]
    cosine = flat[0] @ flat[1] / np.linalg.norm(flat[0]) / np.linalg.norm(flat[1])
    return float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))


@pytest.mark.slow
@pytest.mark.mitsuba
def test_the_whole_search(tmp_path):
    """Minutes, most of them compiling. On the held-out views tuned settings are about as good as
    the best of the grid, or better: of a view this small times are noise."""
    words = ["tune", "letter_f", "--view", "angle", "--size", "64", "64", "--memory-mb", "1"]
    words += ["--price", "1", "--evaluations", str(LEAST_EVALUATIONS), "--repeats", "2"]
    assert cli.main([*words, "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    assert report["objective"]["grid_best"]["gain"] > -0.25
    assert len(report["front"]) > 2 and report["sensitivity"]["price"] == 1
    assert {one["role"] for one in report["tried"]} >= {"default", "sample", "grid", "surrogate"}
    assert all(Path(tmp_path / f"{name}.png").exists() for name in ("tried", "sensitivity"))
