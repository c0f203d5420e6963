"""The section of a sweep: its axes, what is said of it, what is drawn, and wrong folders."""

import json
import sqlite3
from contextlib import closing

import pytest
from helpers.page_folders import PageReader, check_escaped
from helpers.sweep_folders import bad, done, grid, hostile_folder, key_of, sweep_folder

from asmjax import cli
from asmjax.report.page import page_of, read_results
from asmjax.report.page.drawing import LogAxis
from asmjax.report_job import ALL_SECTIONS, check_report
from asmjax.sweep.ended import End
from asmjax.sweep.page import costs
from asmjax.sweep.page.varied import axes_in
from asmjax.sweep.results import flat
from asmjax.sweep.store import BASE


def page_in(folder) -> str:
    """The page of a sweep's folder."""
    return page_of([read_results(folder, check_report)], ALL_SECTIONS)


def axes_of(configs) -> dict[str, tuple]:
    """The axes of configurations, by what people read."""
    return {axis.title: axis.value_words for axis in axes_in([dict(flat(c)) for c in configs])}


@pytest.fixture
def trials():
    """Two maps of three memories: an error of 1 / memory in memory x 10 ms, half of that under the
    adaptive one in twice the time; its last one failed."""
    found = []
    for config in grid(algorithm=["uniform", "adaptive"], memory_mb=[1.0, 4.0, 16.0]):
        factor = 2 if config["algorithm"] == "adaptive" else 1
        memory = config["memory_mb"]
        found.append((config, done(config, 1 / memory / factor, 0.01 * memory * factor)))
    found[-1] = found[-1][0], bad(End.TIMEOUT, "it took longer than its deadline", 2)
    return found


def test_all_texts_are_escaped(tmp_path):
    """Values of axes, names of settings, causes, machines, versions, and all of the report."""
    page = page_in(hostile_folder(tmp_path / "swept"))
    check_escaped(page)
    assert len(PageReader(page).of_class("point")) > 6


def test_the_summary_says_what_came_of_it(trials, tmp_path):
    known = [key_of(config) for config, _ in trials[:2]]
    folder = sweep_folder(tmp_path / "swept", trials, skipped=known)
    said = PageReader(page_in(folder)).texts["li"]
    assert said[0] == "6 trials: 5 done and 1 timed out."
    assert said[1] == (
        "The last run measured 4 in 75 s, by 2 workers; 2 finished before and not run again "
        "(cached)."
    )
    finest, fastest = (key_of(trials[k][0])[:8] for k in (2, 0))
    assert said[2] == (
        f"uniform-64 ({finest}) errs least: 0.062 px off in 160 ms; uniform-64 ({fastest}) is the "
        "fastest: 1.00 px off in 10.0 ms."
    )
    assert said[3].startswith("The median error changes most with memory_mb: 0.750 px with 1, ")


def test_the_tables_say_how_trials_ended_and_why(trials, tmp_path):
    folder = sweep_folder(tmp_path / "swept", trials, skipped=[key_of(trials[0][0])])
    read = PageReader(page_in(folder))
    cells = read.texts["td"]
    assert cells[:6] == ["4", "1", "5", "1", "0", "1"]
    where = cells.index("timed out")
    assert cells[where : where + 5] == [
        "timed out", "2", "2.50", "algorithm: adaptive; memory_mb: 16",
        "it took longer than its deadline",
    ]  # fmt: skip
    # The front: nothing is faster and errs as little. The adaptive map of 1 MB is as the uniform
    # one of 2 MB would be.
    front = [key_of(trials[k][0])[:8] for k in (0, 3, 1, 4, 2)]
    assert [cell for cell in cells if cell in front] == front


def test_the_charts_show_every_trial_and_every_value(trials, tmp_path):
    """Three charts of five trials; of two axes five rows on two scales."""
    read = PageReader(page_in(sweep_folder(tmp_path / "swept", trials)))
    tabs = [a["data-tab"] for a in read.of_class("chart")]
    assert tabs == ["time", "time in rays", "memory", "algorithm", "memory_mb"]
    assert len(read.of_class("point")) == 3 * 5 + 5 * 2
    told = next(text for text in read.texts["title"] if f"trial {key_of(trials[3][0])[:8]}" in text)
    assert told.split("\n")[:4] == [
        "adaptive-64", "algorithm: adaptive", "memory_mb: 1",
        "0.500 wrong pixels per pixel of shadow edge",
    ]  # fmt: skip
    (rows,) = [text for text in read.texts["title"] if text.startswith("algorithm: uniform\nwrong")]
    assert rows.split("\n")[2:] == [
        "median 0.250 of 3", "half of them 0.156 to 0.625", "all 0.062 to 1.00",
    ]  # fmt: skip


def test_each_scene_has_its_own_front(tmp_path):
    """Rationale: an easy scene's trials would be better than all of a hard one's."""
    configs = grid(scene=["easy", "hard"], memory_mb=[1.0, 2.0])
    ends = [done(c, (1, 50)[c["scene"] == "hard"] / c["memory_mb"], 0.1) for c in configs]
    folder = sweep_folder(tmp_path / "swept", list(zip(configs, ends, strict=True)))
    read = PageReader(page_in(folder))
    tabs = [a["data-tab"] for a in read.of_class("chart")]
    assert tabs[3:5] == ["easy", "hard"]
    assert [cell for cell in read.texts["td"] if cell in ("easy", "hard")] == ["easy", "hard"]
    assert len(read.of_class("front")) == 2
    said = read.texts["li"]
    assert said[2].startswith("easy: uniform-64") and said[3].startswith("hard: uniform-64")


def test_many_trials_are_thinned_and_it_is_said(trials, tmp_path, monkeypatch):
    monkeypatch.setattr(costs, "MOST_POINTS", 2)
    page = page_in(sweep_folder(tmp_path / "swept", trials))
    assert "one in 3 is drawn" in page
    # All of the front stay: the five points of time; of the others two charts with two each.
    assert len(PageReader(page).of_class("point")) == 5 + 2 * 2 + 5 * 2


def test_a_sweep_that_was_killed_has_a_page(trials, tmp_path):
    """What is kept is shown, and what is left and how to go on is said."""
    folder = sweep_folder(
        tmp_path / "swept",
        trials[:3],
        keys=[key_of(config) for config, _ in trials],
        status="running",
        seconds=0.0,
    )
    said = PageReader(page_in(folder)).texts["li"]
    assert said[0] == "6 trials: 3 done and 3 still to be run."
    assert said[1].startswith("It is not complete: the last run was ended from outside, or goes on")
    assert said[2] == "The last run measured 3, by 2 workers."


def test_trials_of_other_files_are_not_mixed_in(trials, tmp_path):
    keys = [key_of(config) for config, _ in trials[:2]]
    read = PageReader(page_in(sweep_folder(tmp_path / "swept", trials, keys=keys)))
    assert read.texts["li"][0] == "2 trials: 2 done."
    assert any(text.startswith("The folder has 4 more trials, which") for text in read.texts["li"])
    assert len(read.of_class("point")) == 3 * 2 + 2 * 2


def test_a_sweep_without_a_finished_trial_has_a_page(tmp_path):
    empty = page_in(sweep_folder(tmp_path / "empty", [], keys=["0" * 32], status="interrupted"))
    assert "1 trial: 1 still to be run." in empty and "No trial is done yet." in empty
    config = grid(memory_mb=[1.0])[0]
    failed = page_in(sweep_folder(tmp_path / "failed", [(config, bad(End.FAILED, "no"))]))
    assert "1 trial: 1 failed." in failed and "<svg" not in failed


def test_axes_are_what_trials_differ_in():
    """Settings that step together are one; what scene and algorithm say by themselves is none; a
    setting of one algorithm is an axis of that."""
    zipped = grid(memory_mb=[1.0, 2.0], settings__node=[8, 16])
    for config in zipped:
        config["view"] = {8: "near", 16: "far"}[config["settings"]["node"]]
    assert axes_of(zipped) == {"node, view": ("8, near", "16, far"), "memory_mb": ("1", "2")}
    scenes = grid(scene=["room", "hall"], samples=[1, 4])
    for config in scenes:
        config |= {"view": config["scene"][::-1], "content": f"built-in {config['scene']}"}
    assert axes_of(scenes) == {"scene": ("room", "hall"), "samples": ("1", "4")}
    mixed = grid(algorithm=["uniform", "adaptive"], settings__node=[8, 16])
    for config in mixed[:2]:
        config["settings"] = {"size": 64}
    for config in mixed:
        config["settings"]["compare"] = config["algorithm"][:1]
    assert axes_of(mixed) == {"algorithm": ("uniform", "adaptive"), "node": ("8", "16")}
    assert axes_of(grid(memory_mb=[1.0])) == axes_of([]) == {}


def test_what_is_drawn_at_random_is_not_one_axis_and_has_ranges(tmp_path):
    """Forty points of two settings differ in both at once; their rows are ranges of each."""
    configs = [
        config | {"settings": {"least": 0.25 * k, "finest": 100.0 - k}}
        for k, config in enumerate(grid(number=list(range(40))))
    ]
    for config in configs:
        del config["number"]
    assert list(axes_of(configs)) == ["least", "finest"]
    ended = [(config, done(config, 0.5, 0.1)) for config in configs]
    texts = PageReader(page_in(sweep_folder(tmp_path / "swept", ended))).texts["text"]
    assert {"0 to 1", "8.75 to 9.75", "61 to 65"} <= set(texts)


def test_a_label_that_has_no_room_beside_zero_is_left_out():
    """Zero is a third of the smallest value; nothing is labelled between them."""
    axis = LogAxis(1e-3, 10, 0, 500, zero=2e-3, room=50)
    labels = dict((words, at) for at, words in axis.labels())
    assert list(labels) == ["0", "0.01", "0.1", "1", "10"]
    assert labels["0"] == pytest.approx(axis.at(2e-3)) == pytest.approx(axis.at(0))
    crowded = LogAxis(1e-3, 10, 0, 250, zero=6e-3, room=50)
    assert [words for _, words in crowded.labels()] == ["0", "0.1", "1", "10"]
    assert len(LogAxis(1e-12, 1e12, 0, 500).labels()) < 10


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("DELETE FROM trials", None),
        ("UPDATE trials SET record = '{}'", "has a record that this version does not know"),
        ("UPDATE trials SET record = '{\"error\": 3}'", "has a record that this version"),
        ("UPDATE trials SET record = '[]'", "record of trial"),
        ("UPDATE trials SET config = '{'", "cannot read"),
        ("UPDATE trials SET config = x'00ff'", "config of trial"),
        ("UPDATE trials SET started = 9e99", "started at no time"),
        ("UPDATE trials SET started = 'soon'", "started of trial"),
        ("PRAGMA user_version = 7", "is of version 7"),
        ("ALTER TABLE trials RENAME TO others", "cannot read"),
    ],
)
def test_wrong_rows_are_one_line_and_exit_2(change, said, trials, tmp_path, capsys):
    folder = sweep_folder(tmp_path / "swept", trials)
    with closing(sqlite3.connect(folder / BASE)) as base, base:
        base.execute(change)
    code = cli.main(["report", str(folder), "--quiet"])
    captured = capsys.readouterr()
    if said is None:
        assert code == 0 and captured.err == ""
    else:
        assert code == 2 and captured.err.count("\n") == 1 and said in captured.err


def test_wrong_folders_are_one_line_and_exit_2(trials, tmp_path, capsys):
    """A report without its trials, and reports that contradict themselves."""
    folder = sweep_folder(tmp_path / "swept", trials)
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    (folder / BASE).unlink()
    for changed, said in (
        ({}, f"holds no sweep ({BASE} is missing)"),
        ({"trials": 7}, "trials: 7 is not the number of keys, 6"),
        ({"keys": 3}, "keys: expected a list of texts"),
        ({"schema": "asmjax/sweep/9"}, "got 'asmjax/sweep/9'"),
    ):
        (folder / "report.json").write_text(json.dumps(report | changed), encoding="utf-8")
        assert cli.main(["report", str(folder)]) == 2
        captured = capsys.readouterr()
        assert captured.err.count("\n") == 1 and said in captured.err, captured.err
