"""The script of the 2001 paper's section 5 at tiny sizes: all files, every bound, nothing lost."""

import dataclasses
import json
import runpy
import sys
from pathlib import Path

import pytest

from asmjax.report.keys import check_keys
from asmjax.report.schema import WALKTHROUGH_KEYS

pytestmark = pytest.mark.mitsuba

SCRIPT = Path(__file__).parents[1] / "analysis/adaptive_shadow_maps_2001.py"


@pytest.fixture(scope="module")
def script():
    """The names of the script, which runs nothing by being read."""
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def quick(script, tmp_path_factory):
    """Folder and record of a quick run, of fewer frames and triangles yet."""
    folder = tmp_path_factory.mktemp("analysis")
    sizes = dataclasses.replace(
        script["QUICK"], frames=4, large_frames=2, large="surface:5k", growth_frames=2,
        triangles=(4_000, 8_000), growth_triangles=5_000,
    )  # fmt: skip
    return folder, script["run"](folder, sizes, quiet=True)


@pytest.mark.slow
def test_quick_run_writes_everything(quick):
    """Every step done; the record on disk is the one returned; every figure is a file."""
    folder, record = quick
    assert {step["status"] for step in record["steps"].values()} == {"done"}
    stored = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert stored["bounds"] == record["bounds"] and set(stored) == set(record)
    text = (folder / "report.md").read_text(encoding="utf-8")
    for name in record["figures"]:
        assert (folder / f"{name}.png").stat().st_size > 1_000
        assert f"]({name}.png)" in text
    assert set(record["figures"]) == {"growth", "closeup", "closeup_memory"}
    assert record["machine"]["cpu"] in text and record["versions"]["mitsuba"] in text
    assert "1 GHz Pentium III" in text


@pytest.mark.slow
def test_quick_run_measures_what_its_sizes_allow(quick):
    """One view, two numbers of triangles; no large scene, one image size, one memory limit."""
    _, record = quick
    measured = {b["name"] for b in record["bounds"] if b["verdict"] != "skipped"}
    assert measured == {
        "warm frame", "error, closeup", "retraces", "memory",
        "growth with triangles, warm frame", "growth with triangles, cold start",
    }  # fmt: skip
    by_name = {bound["name"]: bound for bound in record["bounds"]}
    # What does not depend on time must hold at any size.
    for name in ("memory", "retraces", "error, closeup"):
        assert by_name[name]["verdict"] == "pass", by_name[name]


@pytest.mark.slow
def test_shared_keys_follow_the_schema(quick):
    """Frames, methods, versions and machine are those of a walkthrough's report."""
    _, record = quick
    stored = json.loads(json.dumps(record))
    frames = WALKTHROUGH_KEYS["frames"]
    summary = WALKTHROUGH_KEYS["summary"].kind
    assert isinstance(summary, dict)
    check_keys(
        {"frames": stored["frames"], "methods": stored["methods"], "machine": stored["machine"],
         "versions": stored["versions"], "seed": stored["seed"], "command": stored["command"]},
        {"frames": frames, "methods": summary["methods"],
         **{name: WALKTHROUGH_KEYS[name] for name in ("machine", "versions", "seed", "command")}},
    )  # fmt: skip
    assert len(stored["frames"]) == 4
    for walk in stored["walkthroughs"].values():
        check_keys(walk | {"frames": stored["frames"]}, WALKTHROUGH_KEYS)


def test_a_step_that_fails_costs_only_itself(script, tmp_path, caplog):
    """The next steps go on, the reason is kept; an interruption ends all but loses nothing."""

    def fails():
        raise ValueError("no such thing\nand more")

    def stops():
        kept.record["half"] = 1
        raise KeyboardInterrupt

    kept, done = script["Analysis"](tmp_path, script["QUICK"], quiet=True).kept, []
    steps = {"a": fails, "b": lambda: done.append("b"), "c": stops, "d": lambda: done.append("d")}
    with pytest.raises(KeyboardInterrupt):
        kept.run(steps)
    stored = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert {k: v["status"] for k, v in stored["steps"].items()} == {
        "a": "failed", "b": "done", "c": "interrupted",
    }  # fmt: skip
    assert stored["steps"]["a"]["reason"] == "ValueError: no such thing"
    assert stored["half"] == 1 and done == ["b"]
    assert "failed: ValueError" in (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "step 'a' failed" in caplog.text


def test_absent_house_is_skipped_with_a_reason(script, tmp_path, monkeypatch):
    """Its bounds say why they are not measured."""
    monkeypatch.setenv("ASMJAX_SCENES", str(tmp_path))
    sizes = dataclasses.replace(script["QUICK"], house="victorian_house", many_samples=16)
    analysis = script["Analysis"](tmp_path / "out", sizes, True)
    script["house_walk"](analysis, 1)
    script["house_walk"](analysis, 16)
    analysis.kept.write()
    bounds = {bound["name"]: bound for bound in analysis.record["bounds"]}
    for name in ("victorian_house", "victorian_house, 16 samples"):
        assert "there is no victorian_house/victorian_house.xml" in bounds[name]["reason"]


def test_command_line(script, tmp_path, monkeypatch, capsys):
    """--out and --quick reach the run; the table of bounds is printed."""
    names = script["main"].__globals__
    seen = []
    monkeypatch.setitem(
        names, "run", lambda folder, sizes: seen.append((folder, sizes)) or empty(script, tmp_path)
    )
    monkeypatch.setitem(names, "enable_compilation_cache", lambda: None)
    monkeypatch.setattr(sys, "argv", ["x", "--quick", "--out", str(tmp_path)])
    script["main"]()
    assert seen == [(tmp_path, script["QUICK"])]
    assert "| requirement |" in capsys.readouterr().out


def empty(script, folder):
    return script["Analysis"](folder, script["QUICK"], True).record
