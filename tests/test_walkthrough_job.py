"""`asmjax run --frames` from end to end: files, numbers, interruption, and wrong use."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_main_job import SENSOR, scene_file

from asmjax import cli
from asmjax.errors import UseError
from asmjax.options import RunOptions
from asmjax.render.load import load_scene
from asmjax.report import validate_report
from asmjax.report.outputs import SINGLE_RUN
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap, write_settings
from asmjax.walkthrough_job import camera_path, measure_walkthrough

pytestmark = pytest.mark.mitsuba

SMALL = ["--size", "48", "32", "--memory-mb", "0.25", "--repeats", "1", "--quiet"]
FILES = {"report.json", "frames.csv", "walkthrough.png", "frames.png", "walkthrough.gif"}


def walk(folder: Path, *words: str) -> dict:
    assert cli.main(["run", *words, *SMALL, "--out", str(folder)]) == 0
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    return report


@pytest.fixture(scope="module")
def camera_walk(tmp_path_factory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("walk") / "deep" / "out"
    return folder, walk(folder, "letter_f", "--frames", "4", "--save-arrays")


def test_a_walk_leaves_its_files(camera_walk):
    """Report, table, plot, strip and animation, and each frame's images."""
    folder, report = camera_walk
    arrays = {f"frame_{k:04d}.npz" for k in range(4)}
    assert {path.name for path in folder.iterdir()} == FILES | arrays
    assert report["ended"] == "complete"
    assert report["view"] == "arc from angle"
    assert [frame["frame"] for frame in report["frames"]] == [0, 1, 2, 3]
    with Image.open(folder / "walkthrough.gif") as animation:
        assert getattr(animation, "n_frames", 1) == 4
    for name in ("walkthrough.png", "frames.png"):
        with Image.open(folder / name) as image:
            assert 1000 < image.width < 2200 and 400 < image.height < 2200


def test_every_frame_has_the_methods_of_a_single_run(camera_walk):
    """Uniform anew, uniform kept, adaptive and rays, with the keys that a single run has."""
    folder, report = camera_walk
    for frame in report["frames"]:
        names = [method["name"] for method in frame["methods"]]
        assert names == ["uniform-256", "uniform-256-kept", "adaptive-0.25MB", "rays-1"]
        assert all(method["bytes"] <= 2**18 for method in frame["methods"])
    arrays = np.load(folder / "frame_0002.npz")
    stated = report["frames"][2]["methods"][2]["error"]["misclassified_fraction"]
    wrong = np.abs(arrays["truth"] - arrays["visibility_adaptive-0.25MB"])[arrays["valid"]]
    assert wrong.mean() == pytest.approx(stated, abs=1e-12)
    rows = list(csv.DictReader((folder / "frames.csv").read_text().splitlines()))
    assert [(row["frame"], row["method"]) for row in rows[:5]] == [
        ("0", "uniform-256"), ("0", "uniform-256-kept"), ("0", "adaptive-0.25MB"),
        ("0", "rays-1"), ("1", "uniform-256"),
    ]  # fmt: skip
    assert float(rows[6]["nodes_reused"]) > 0


def test_the_light_moves_and_nothing_can_rest(tmp_path):
    """Both uniform maps are drawn in every frame, and the light is where the report says."""
    report = walk(tmp_path, "letter_f", "--frames", "3", "--motion", "light")
    places = np.array([frame["light_position"] for frame in report["frames"]])
    assert (np.diff(places, axis=0) != 0).any(axis=1).all()
    eyes = [frame["eye"]["origin"] for frame in report["frames"]]
    assert eyes[0] == eyes[1] == eyes[2]
    for frame in report["frames"]:
        assert frame["methods"][1]["rays"] == frame["methods"][0]["rays"]
    assert report["motion"] == "light"


@pytest.mark.slow
def test_an_object_moves(tmp_path):
    """It is named, its boxes are counted, and the maps answer for where it is."""
    report = walk(tmp_path, "letter_f", "--frames", "3", "--motion", "object")
    assert report["motion"] == "object (letter)"
    assert [frame["moved_boxes"] for frame in report["frames"]] == [0, 2, 2]
    for frame in report["frames"]:
        for method in frame["methods"]:
            assert method["error"]["misclassified_fraction"] < 0.03, (
                frame["frame"],
                method["name"],
            )


@pytest.mark.slow
def test_a_settings_file_is_the_adaptive_map_of_the_walk(tmp_path):
    """Its memory limit is the report's, and the uniform maps have as many bytes."""
    write_settings(tmp_path / "my.toml", AdaptiveShadowMap(memory_bytes=2**18, bias=1e-5))
    options = RunOptions(
        scene="letter_f", frames=2, size=(48, 32), repeats=1, settings=str(tmp_path / "my.toml")
    )
    report = measure_walkthrough(options)
    validate_report(report)
    assert report["memory_limit_bytes"] == 2**18
    names = [method["name"] for method in report["frames"][1]["methods"]]
    assert names == ["uniform-256", "uniform-256-kept", "adaptive-0.25MB", "rays-1"]
    assert report["frames"][1]["methods"][2]["settings"]["bias"] == 1e-5


def test_a_walk_takes_no_settings_of_another_algorithm(tmp_path, capfd):
    """One line says why, and what can be done."""
    write_settings(tmp_path / "my.toml", UniformShadowMap(64))
    words = ["--frames", "2", "--settings", str(tmp_path / "my.toml"), "--out", str(tmp_path / "o")]
    assert cli.main(["run", "letter_f", *words]) == 2
    printed = capfd.readouterr().err.strip()
    assert "name a file of an adaptive map, or leave out --frames" in printed
    assert printed.count("\n") == 0 and not (tmp_path / "o").exists()


@pytest.mark.slow
def test_nothing_moves_and_python_writes_no_files(tmp_path, monkeypatch):
    """What rests costs nothing more: no rays for the kept map, few for a converged tree. Called
    from Python: options in, a report out."""
    import asmjax

    monkeypatch.chdir(tmp_path)
    options = asmjax.RunOptions(
        scene="letter_f", frames=3, size=(48, 32), memory_mb=0.25, repeats=1, motion="still"
    )
    report = asmjax.measure_walkthrough(options)
    validate_report(report)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(asmjax.UseError, match="--frames"):
        asmjax.measure_walkthrough(asmjax.RunOptions())
    assert report["motion"] == "still"
    assert [frame["methods"][1]["rays"] > 0 for frame in report["frames"]] == [True, False, False]
    tree = [frame["methods"][2]["rays"] for frame in report["frames"]]
    assert tree[2] <= tree[0] / 10


@pytest.mark.slow
def test_keys_are_walked_between_and_a_folder_holds_one_run(tmp_path):
    """From the first view towards the second; a scene file's sensors have names too. Files of a
    single view or of a longer walk do not stay behind; a user's own do."""
    out = tmp_path / "out"
    out.mkdir()
    listed = [*(name for name in SINGLE_RUN if "*" not in name), "frame_0007.npz"]
    for name in (*listed, "notes.txt"):
        (out / name).touch()
    earlier = {"schema": "asmjax/run/1", "files": listed}
    (out / "report.json").write_text(json.dumps(earlier), encoding="utf-8")
    report = walk(out, "letter_f", "--frames", "2", "--keys", "angle", "above")
    assert {path.name for path in out.iterdir()} == FILES | {"notes.txt"}
    assert report["view"] == "path angle - above"
    other = SENSOR.replace("3, -5, 5", "4, -4, 5").replace("<sensor ", '<sensor id="b" ')
    path = scene_file(tmp_path, sensor=SENSOR.replace("<sensor ", '<sensor id="a" ') + other)
    way, name = camera_path(load_scene(path), RunOptions(scene=path, frames=2, keys=("a", "b")))
    assert name == "path a - b"
    first, second = (np.array(way.view(k).origin) for k in (0, 1))
    np.testing.assert_allclose(first, (3, -5, 5), atol=1e-5)
    step = (second - first) / np.linalg.norm(second - first)
    np.testing.assert_allclose(step, (0.5**0.5, 0.5**0.5, 0), atol=0.05)


def test_a_path_is_chosen_by_what_is_named():
    """Keys, else the scene's own path, else an arc; a camera at rest has none."""
    scene = load_scene("paper_room")
    named = {
        "path of the scene": {},
        "arc from closeup": {"view": "closeup"},
        "path closeup - macro": {"keys": ("closeup", "macro")},
        "overview": {"motion": "still"},
    }
    for name, words in named.items():
        path, said = camera_path(scene, RunOptions(frames=2, size=(8, 8), **words))
        assert said == name
        assert (path.length > 0) == (name != "overview")
        assert (path.view(1).width, path.view(1).height) == (8, 8)


@pytest.fixture
def fails_once(monkeypatch):
    """Measuring a frame raises what the test asks for, the first time that frame 2 is measured."""
    from asmjax.experiment.walkthrough import Walkthrough

    measured, raised = Walkthrough.measure, []

    def fail_with(problem: BaseException) -> None:
        def measure(self, frame):
            if frame.number == 2 and not raised:
                raised.append(frame)
                raise problem
            return measured(self, frame)

        monkeypatch.setattr(Walkthrough, "measure", measure)

    return fail_with


def test_ctrl_c_keeps_the_finished_frames(tmp_path, capfd, fails_once):
    """Two frames are done when it comes: they are written, and one line says where."""
    fails_once(KeyboardInterrupt())
    out = tmp_path / "out"
    assert cli.main(["run", "letter_f", "--frames", "5", *SMALL, "--out", str(out)]) == 130
    printed = capfd.readouterr().err.strip().splitlines()[-1]
    assert printed == f"asmjax: interrupted; the 2 finished of 5 frames are in {out}/"
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    assert report["ended"] == "interrupted"
    assert len(report["frames"]) == 2 and report["frames_asked"] == 5
    assert {path.name for path in out.iterdir()} == FILES


def test_a_later_frame_that_fails_loses_nothing(tmp_path, capfd, fails_once):
    """A view into nothing, say: the frames before it are written, then the error is told."""
    fails_once(UseError("it sees nothing"))
    out = tmp_path / "out"
    assert cli.main(["run", "letter_f", "--frames", "5", *SMALL, "--out", str(out)]) == 2
    said = capfd.readouterr().err.strip().splitlines()[-1]
    finished = f"the 2 finished of 5 frames are in {out}/"
    assert said == f"asmjax: error: frame 2: it sees nothing ({finished})"
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert len(report["frames"]) == 2
    assert report["ended"] == "UseError: it sees nothing"


def test_ctrl_c_before_the_first_frame_leaves_nothing(tmp_path, capfd, monkeypatch):
    from asmjax.experiment.walkthrough import Walkthrough

    def interrupted(self, frames):
        raise KeyboardInterrupt

    monkeypatch.setattr(Walkthrough, "warm_up", interrupted)
    out = tmp_path / "out"
    assert cli.main(["run", "letter_f", "--frames", "5", *SMALL, "--out", str(out)]) == 130
    assert "asmjax: interrupted" in capfd.readouterr().err
    assert not out.exists()


BAD = {
    "no frames": (["--frames", "0"], "--frames is 0; allowed"),
    "half a frame": (["--frames", "1.5"], "expected INT"),
    "unknown motion": (["--frames", "2", "--motion", "camara"], "'camera'"),
    "unknown key": (["--frames", "2", "--keys", "angle", "abov"], "Did you mean 'above'"),
    "one key": (["--frames", "2", "--keys", "angle"], "two views or more"),
    "keys and view": (["--frames", "2", "--keys", "angle", "above", "--view", "angle"], "--view"),
    "keys of a light": (
        ["--frames", "2", "--motion", "light", "--keys", "angle", "above"],
        "--keys",
    ),
    "motion of one view": (["--motion", "light"], "--frames"),
    "keys of one view": (["--keys", "angle", "above"], "--frames"),
    "object at rest": (["--frames", "2", "--object", "letter"], "--motion object"),
    "unknown object": (
        ["--frames", "2", "--motion", "object", "--object", "leter"],
        "Did you mean 'letter'",
    ),
    "unknown scene view": (["--frames", "2", "--view", "abov"], "above"),
    "below one node": (["--frames", "2", "--memory-mb", "0.001"], "--memory-mb"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(case, tmp_path, capfd):
    words, expected = BAD[case]
    out = tmp_path / "out"
    assert cli.main(["run", "letter_f", "--quiet", *words, "--out", str(out)]) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.count("\n") == 0, printed
    assert printed.startswith("asmjax: error: ")
    assert expected in printed
    assert not out.exists()
