"""The folder of a run: nothing of somebody else's is deleted, nothing of an earlier run stays."""

import json
from fnmatch import fnmatchcase
from pathlib import Path

import pytest
from helpers.page_folders import report_of

from asmjax import cli
from asmjax.errors import UseError
from asmjax.folders import results_folder
from asmjax.options import CompareOptions, PlanOptions, RunOptions
from asmjax.report.outputs import KINDS, MEASUREMENTS, PAGE, Outputs
from asmjax.report.schema import SCHEMAS

SCHEMA_OF = {schema.split("/")[1]: schema for schema in SCHEMAS}
NAMES = {
    "run": ["methods.csv", "maps.png", "seen_truth.png"],
    "walkthrough": ["frames.csv", "frame_0003.npz", "frame_12345.npz"],
    "aliasing": ["methods.csv", "arrays.npz", "aliasing.png"],
    "comparison": ["trials.csv", "costs_16.png"],
    "tuning": ["tuned.toml", "tried.png"],
    "plan": ["plan.png"],
}
OWN = ("notes.txt", "photo.png", "shadows.jpg")
"""Of the user, in every folder."""


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch):
    """Hundreds of small files are written; that they survive a power cut is asked elsewhere."""
    monkeypatch.setattr("os.fsync", lambda descriptor: None)


def put(folder: Path, *names: str) -> Path:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_text(name, encoding="utf-8")
    return folder


def here(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def ran(folder: Path, kind: str) -> Outputs:
    """A run of that kind, all of whose files are there."""
    outputs = Outputs(folder, kind)
    outputs.make()
    outputs.keep(report_of(SCHEMA_OF[kind]))
    outputs.add({name: lambda file, name=name: file.write(name.encode()) for name in NAMES[kind]})
    outputs.finish()
    return outputs


def test_every_kind_of_report_has_its_files():
    assert set(KINDS) == {*SCHEMA_OF, "sweep"} and set(NAMES) == set(SCHEMA_OF)


@pytest.mark.parametrize("before", NAMES)
@pytest.mark.parametrize("after", NAMES)
def test_a_folder_holds_one_run_and_all_that_is_the_users(before, after, tmp_path):
    """Whatever ran before, and whatever is called as if some other command had written it."""
    folder = tmp_path / "out"
    first = ran(folder, before)
    assert first.report["files"] == sorted(NAMES[before])
    others = [name for names in NAMES.values() for name in names if name not in NAMES[before]]
    mine = [n for n in others if not any(fnmatchcase(n, pattern) for pattern in KINDS[after])]
    put(folder, *OWN, *mine)
    put(folder / "arrays", "arrays.npz")
    ran(folder, after)
    assert here(folder) == {"report.json", "arrays", *OWN, *mine, *NAMES[after]}
    assert all((folder / name).read_text(encoding="utf-8") == name for name in (*OWN, *mine))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["maps.png"], "maps.png"),
        (["notes.txt"], "notes.txt"),
        (["a.txt", "b.txt", "c.txt", "d.txt"], "(a.txt, b.txt, c.txt and 1 more)"),
        (["report.html"], "report.html"),
        (["report.json"], "report.json"),
    ],
)
def test_a_folder_of_somebody_else_is_refused_before_anything_is_computed(
    names, said, tmp_path, capfd
):
    """In one line with a remedy; the scene, which does not exist, is not even looked for."""
    folder = put(tmp_path / "mine", *names)
    words = ["run", str(tmp_path / "no.xml"), "--out", str(folder)]
    assert cli.main(words) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.count("\n") == 0 and said in printed
    assert "asmjax did not write" in printed and "choose another --out" in printed
    assert here(folder) == set(names)


def test_a_file_that_would_be_overwritten_is_refused(tmp_path):
    """The folder is asmjax's, the file is not: it came after the run, under a name of results."""
    folder = tmp_path / "out"
    ran(folder, "plan")
    put(folder, "maps.png", "seen_anything.png", "trials.csv")
    with pytest.raises(UseError, match=r"not\s+list \(maps.png, seen_anything.png\); move them"):
        Outputs(folder, "run")
    Outputs(folder, "tuning")
    assert (folder / "maps.png").read_text(encoding="utf-8") == "maps.png"


def test_hidden_files_folders_and_what_outlives_runs_stand_in_nobodys_way(tmp_path):
    """A folder of results of other commands, measurements of a run that was killed, an editor's."""
    folder = put(tmp_path / "out", MEASUREMENTS, ".DS_Store")
    put(folder / "run-paper_room", "report.json", "maps.png")
    ran(folder, "tuning")
    assert here(folder) >= {MEASUREMENTS, ".DS_Store", "run-paper_room"}
    assert here(folder / "run-paper_room") == {"report.json", "maps.png"}


def test_a_sweep_is_no_folder_for_others(tmp_path):
    folder = put(tmp_path / "out", "sweep.sqlite", "sweep.lock")
    with pytest.raises(UseError, match=r"holds a sweep \(sweep.lock, sweep.sqlite\)"):
        Outputs(folder, "run")
    Outputs(folder, "sweep")


def test_a_report_decides_about_no_other_file(tmp_path):
    """Names that no command writes, or that lead elsewhere, are not deleted whoever lists them."""
    folder = put(tmp_path / "out", "thesis.tex", "maps.png")
    put(tmp_path, "arrays.npz")
    listed = ["thesis.tex", "../arrays.npz", "maps.png", ".", "", 3, None]
    report = {"schema": "asmjax/run/1", "files": listed}
    (folder / "report.json").write_text(json.dumps(report), encoding="utf-8")
    ran(folder, "plan")
    assert here(folder) == {"report.json", "thesis.tex", "plan.png"}
    assert (tmp_path / "arrays.npz").exists()


@pytest.mark.parametrize("text", ["{", "[]", '{"schema": 3}', '{"schema": "other/run/1"}', "\xff"])
def test_a_report_of_somebody_else_is_none(text, tmp_path):
    folder = put(tmp_path / "out")
    (folder / "report.json").write_text(text, encoding="latin-1")
    with pytest.raises(UseError, match="asmjax did not write"):
        Outputs(folder, "run")


def test_reports_that_list_nothing_are_of_an_earlier_version(tmp_path):
    """Its files are those that its command wrote then."""
    folder = put(tmp_path / "out", "maps.png", "trials.csv")
    (folder / "report.json").write_text('{"schema": "asmjax/run/1"}', encoding="utf-8")
    ran(folder, "plan")
    assert here(folder) == {"report.json", "trials.csv", "plan.png"}


@pytest.mark.parametrize("kind", NAMES)
def test_a_run_that_is_killed_anywhere_can_be_started_again(kind, tmp_path):
    """Rationale: report.json lists a file before the file is there. Between any two writes what is
    there is a folder that the same command takes."""
    folder = tmp_path / "out"
    outputs = Outputs(folder, kind)
    outputs.make()
    Outputs(folder, kind)
    outputs.keep(report_of(SCHEMA_OF[kind]))
    for name in NAMES[kind]:
        Outputs(folder, kind)
        outputs.add({name: lambda file: (Outputs(folder, kind), file.write(b"x"))})
    Outputs(folder, kind)


def test_a_page_is_deleted_with_its_run_and_no_other_page(tmp_path):
    folder = tmp_path / "out"
    ran(folder, "plan")
    put(folder, PAGE)
    ran(folder, "plan")
    assert PAGE in here(folder)
    (folder / PAGE).unlink()
    (folder / "plan.png").unlink()
    assert cli.main(["report", str(folder), "--quiet"]) == 0
    ran(folder, "plan")
    assert PAGE not in here(folder)


def test_a_settings_file_of_the_run_that_is_replaced_is_spared(tmp_path):
    folder = tmp_path / "out"
    ran(folder, "tuning")
    options = RunOptions(out=str(folder), settings=str(folder / "tuned.toml"))
    with pytest.raises(UseError, match="belongs to the run in .* copy it to another folder"):
        results_folder(options)
    (tmp_path / "link").symlink_to(folder)
    (tmp_path / "linked.toml").symlink_to(folder / "tuned.toml")
    (tmp_path / "other").mkdir()
    roundabout = tmp_path / "other" / ".." / "out"
    for out, settings in (
        (folder, tmp_path / "link" / "tuned.toml"), (folder, tmp_path / "linked.toml"),
        (tmp_path / "link", folder / "tuned.toml"), (roundabout, folder / "tuned.toml"),
    ):  # fmt: skip
        with pytest.raises(UseError, match="belongs to the run"):
            results_folder(RunOptions(out=str(out), settings=str(settings)))
    put(folder, "mine.toml")
    results_folder(RunOptions(out=str(folder), settings=str(folder / "mine.toml")))


def test_two_scenes_of_one_name_have_two_folders(tmp_path, monkeypatch):
    """Without --out: names that say nothing are their folders', and of two that are the same still
    the second gets one of its own, again and again the same."""
    monkeypatch.chdir(tmp_path)
    folder = "out/run-villa"
    villa = results_folder(RunOptions(scene="villa/scene.xml"))
    assert str(villa) == folder
    assert str(results_folder(RunOptions(scene="house/scene.xml"))) == "out/run-house"
    assert str(results_folder(PlanOptions(scene="villa/scene.xml"))) == "out/plan-villa"
    villa.make()
    villa.keep(report_of(SCHEMA_OF["run"]))
    assert villa.report["scene_file"] == str((tmp_path / "villa/scene.xml").resolve())
    assert str(results_folder(RunOptions(scene="./villa/../villa/scene.xml"))) == folder
    others = {
        str(results_folder(RunOptions(scene=scene)))
        for scene in ("other/villa/scene.xml", "villa.xml", "other/../other/villa/scene.xml")
    }
    assert len(others) == 2 and all(name.startswith(f"{folder}-") for name in others)


def test_a_scene_file_called_as_a_built_in_one_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    room = results_folder(CompareOptions(scene="paper_room.xml"))
    room.make()
    room.keep(report_of(SCHEMA_OF["comparison"]))
    built_in = results_folder(CompareOptions(scene="paper_room"))
    assert str(room) == "out/compare-paper_room" != str(built_in)
    assert str(results_folder(CompareOptions(scene="paper_room.xml"))) == str(room)
