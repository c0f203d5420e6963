"""`asmjax run` from end to end: files, numbers, and every way to use it wrongly."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.mitsuba_scenes import real_scene

from asmjax import cli
from asmjax.options import RunOptions
from asmjax.report import validate_report
from asmjax.shadow import (
    AdaptiveShadowMap,
    LightSpaceShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
    write_settings,
)

pytestmark = pytest.mark.mitsuba

FIGURES = {"shadows", "errors", "maps", "tree", "levels", "accuracy_time"}
MAPS = ("area_ratio", "linear_ratio", "m", "n_required", "benefit")


def pictures(folder: Path) -> set[str]:
    """The figures in a folder, and pictures of the view under each map that its report names."""
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    names = [method["name"] for method in report["methods"]]
    maps = [name for name in names if not name.startswith("rays")]
    return FIGURES | {"seen_truth"} | {f"{kind}_{n}" for kind in ("seen", "wrong") for n in maps}


SCENE = """<scene version="3.0.0">{sensor}{light}
<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform></shape>
<shape type="cube"><transform name="to_world"><scale value="0.5"/>
<translate x="0" y="0" z="1"/></transform></shape></scene>"""
SENSOR = """<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
<lookat origin="3, -5, 5" target="0, 0, 0.5" up="0, 0, 1"/></transform>
<film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/></film>
</sensor>"""
LIGHT = '<emitter type="point" id="lamp"><point name="position" x="1" y="1" z="6"/></emitter>'
AWAY = SENSOR.replace('target="0, 0, 0.5"', 'target="6, -10, 9.5"')


def fractions(report: dict) -> dict[str, float]:
    """Misclassified fraction by kind of method."""
    return {
        method["name"].split("-")[0]: method["error"]["misclassified_fraction"]
        for method in report["methods"]
    }


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory) -> Path:
    """The output of one small run with everything written."""
    folder = tmp_path_factory.mktemp("run") / "deep" / "out"
    words = ["run", "letter_f", "--size", "96", "64", "--memory-mb", "1", "--repeats", "1"]
    assert cli.main([*words, "--save-arrays", "--quiet", "--out", str(folder)]) == 0
    return folder


def test_run_writes_a_valid_report_and_all_figures(run_folder):
    """report.json follows its schema; there is a PNG for each figure and a table."""
    report = json.loads((run_folder / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    assert report["size"] == [96, 64]
    assert [method["name"].split("-")[0] for method in report["methods"]] == [
        "uniform",
        "adaptive",
        "rays",
    ]
    assert {path.stem for path in run_folder.glob("*.png")} == pictures(run_folder)
    assert all((run_folder / f"{name}.png").stat().st_size > 5_000 for name in FIGURES)
    assert (run_folder / "methods.csv").read_text(encoding="utf-8").count("\n") == 4
    memory = report["memory"]
    assert 0 < memory["estimate_bytes"] < memory["limit_bytes"] - memory["held_bytes"]
    adaptive = report["methods"][1]
    assert adaptive["bytes"] <= 2**20
    assert adaptive["error"]["misclassified_fraction"] < 0.01


def test_arrays_are_images_with_the_first_row_at_the_top(run_folder):
    """Shapes as documented; the letter's caster stands above the plane, so up in the image."""
    arrays = np.load(run_folder / "arrays.npz")
    report = json.loads((run_folder / "report.json").read_text(encoding="utf-8"))
    names = {"valid", "position", "truth", *MAPS}
    names |= {f"visibility_{method['name']}" for method in report["methods"]}
    assert set(arrays.files) == names
    assert arrays["position"].shape == (3, 64, 96)
    for name in names - {"position"}:
        assert arrays[name].shape == (64, 96), name
    valid = arrays["valid"]
    assert valid.dtype == bool
    assert np.isfinite(arrays["position"][:, valid]).all()
    truth, adaptive = arrays["truth"], arrays[f"visibility_{report['methods'][1]['name']}"]
    wrong = np.abs(truth - adaptive)[valid].mean()
    stated = report["methods"][1]["error"]["misclassified_fraction"]
    assert wrong == pytest.approx(stated, abs=1e-12)
    # The eye looks down at the plane: rows further down see points nearer to the eye.
    from asmjax.scene import load_builtin

    eye = np.array(next(iter(load_builtin("letter_f").views.values())).origin)
    distance = np.linalg.norm(arrays["position"] - eye[:, None, None], axis=0)
    assert np.nanmedian(distance[-8:]) < np.nanmedian(distance[:8])


def test_the_plan_is_in_the_report(run_folder):
    """A point light's shadow is hard, so truth is one ray a pixel and nothing softer is made."""
    report = json.loads((run_folder / "report.json").read_text(encoding="utf-8"))
    (decision,) = report["plan"]["decisions"]
    assert (decision["kind"], decision["methods"]) == ("hard", ["adaptive"])
    assert report["truth"]["samples"] == 1 and "standard_error" not in report["truth"]
    assert all("soft" not in method["error"] for method in report["methods"])


@pytest.fixture
def no_figures(monkeypatch):
    """Drawing takes longer than all else in a small run."""
    monkeypatch.setattr("asmjax.report.run_files.figure_files", lambda pictures: {})


@pytest.mark.slow
def test_samples_give_fractions_and_the_seed_repeats_them(tmp_path, no_figures):
    """Four rays per pixel: visibility in quarters; the same seed gives the same truth."""
    truths = []
    for seed, folder in ((1, "a"), (1, "b"), (2, "c")):
        words = ["run", "a1_square", "--size", "48", "48", "--memory-mb", "1", "--repeats", "1"]
        words += ["--samples", "4", "--seed", str(seed), "--save-arrays", "--quiet"]
        assert cli.main([*words, "--out", str(tmp_path / folder)]) == 0
        truths.append(np.load(tmp_path / folder / "arrays.npz")["truth"])
    assert set(np.unique(truths[0])) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    assert ((truths[0] > 0) & (truths[0] < 1)).any()
    np.testing.assert_array_equal(truths[0], truths[1])
    assert (truths[0] != truths[2]).any()


@pytest.mark.slow
def test_one_pixel_and_a_folder_used_again(tmp_path):
    """A single receiver has a light frame too; files of an earlier run do not stay behind."""
    words = ["run", "letter_f", "--memory-mb", "1", "--repeats", "1", "--quiet"]
    words += ["--out", str(tmp_path)]
    assert cli.main([*words, "--size", "1", "1", "--save-arrays"]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["truth"]["lit_fraction"] == 1.0
    assert fractions(report) == {"uniform": 0.0, "adaptive": 0.0, "rays": 0.0}
    assert (tmp_path / "arrays.npz").exists()
    assert set(report["files"]) == {path.name for path in tmp_path.iterdir()} - {"report.json"}
    (tmp_path / "walkthrough.gif").touch()
    assert cli.main([*words, "--size", "8", "8"]) == 0
    assert not (tmp_path / "arrays.npz").exists()
    assert (tmp_path / "walkthrough.gif").exists()
    assert {path.stem for path in tmp_path.glob("*.png")} == pictures(tmp_path)


@pytest.mark.slow
def test_the_cost_model_is_kept_and_the_report_says_so(tmp_path, monkeypatch, no_figures):
    """Measured by the first run, kept for the second with its date, measured again on request."""
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(tmp_path / "cache"))
    words = ["run", "letter_f", "--size", "8", "8", "--memory-mb", "1", "--repeats", "1", "--quiet"]
    models = []
    for more in ([], [], ["--recalibrate"]):
        assert cli.main([*words, "--out", str(tmp_path / "out"), *more]) == 0
        report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
        models.append(report["cost_model"])
    assert [model["kept"] for model in models] == [False, True, False]
    assert models[1] == models[0] | {"kept": True}
    assert models[2]["measured_at"] >= models[0]["measured_at"]
    assert all(model["measured_at"].endswith("+00:00") for model in models)


def of_file(folder: Path, algorithm: ShadowAlgorithm, *words: str) -> dict:
    """The report of a small run with a settings file of `algorithm`."""
    write_settings(folder / "my.toml", algorithm)
    small = ["--size", "96", "64", "--repeats", "1", "--quiet", "--out", str(folder / "out")]
    settings = ["--settings", str(folder / "my.toml")]
    assert cli.main(["run", "letter_f", *small, *settings, *words]) == 0
    report = json.loads((folder / "out" / "report.json").read_text(encoding="utf-8"))
    validate_report(report)
    return report


def test_an_adaptive_settings_file_is_the_adaptive_map(tmp_path, no_figures):
    """All its settings are the report's, and the uniform map keeps no more than it may use."""
    report = of_file(tmp_path, AdaptiveShadowMap(memory_bytes=2**20, bias=1e-5, cover=False))
    uniform, adaptive, rays = report["methods"]
    assert [uniform["name"], adaptive["name"], rays["name"]] == [
        "uniform-512", "adaptive-1MB", "rays-1",
    ]  # fmt: skip
    assert adaptive["settings"]["bias"] == 1e-5 and adaptive["settings"]["cover"] is False
    assert adaptive["settings"]["node_resolution"] == 16
    assert max(uniform["bytes"], adaptive["bytes"]) <= 2**20


@pytest.mark.slow
def test_another_settings_file_is_one_more_method(tmp_path):
    """In report, table and figures, beside the maps of the other options."""
    chosen = LightSpaceShadowMap(resolution=64, falloff="sine")
    report = of_file(tmp_path, chosen, "--memory-mb", "1", "--save-arrays")
    names = [method["name"] for method in report["methods"]]
    assert names == ["uniform-512", "adaptive-1MB", "light-space-64", "rays-1"]
    assert report["methods"][2]["settings"]["falloff"] == "sine"
    assert report["methods"][2]["bytes"] >= 64 * 64 * 4
    assert fractions(report)["uniform"] < fractions(report)["light"] < 0.5
    out = tmp_path / "out"
    assert {path.stem for path in out.glob("*.png")} == pictures(out)
    assert "visibility_light-space-64" in np.load(out / "arrays.npz").files
    assert "\nlight-space-64," in (out / "methods.csv").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_uniform_settings_file_keeps_its_own_name(tmp_path, no_figures):
    """Of the same resolution as the map that all are compared with, but not the same map."""
    report = of_file(tmp_path, UniformShadowMap(512, bias=0.5), "--memory-mb", "1")
    plain, _, own, _ = report["methods"]
    assert [plain["name"], own["name"]] == ["uniform-512", "uniform-512-settings"]
    assert own["settings"] == plain["settings"] | {"bias": 0.5}
    lit = [method["error"]["false_lit_fraction"] for method in (plain, own)]
    assert lit[1] > lit[0]  # half of the depth hides every caster


LAMP = """<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.6"/>
<rotate x="1" angle="180"/><translate x="1" y="1" z="6"/></transform>
<emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>"""


@pytest.mark.parametrize(("force", "softly"), [((), True), (("hard",), False)])
def test_a_lamp_with_a_size_is_soft_unless_hard_is_asked_for(force, softly, tmp_path, no_figures):
    """Truth is many rays to all of the lamp, the planned map is one more method and better than the
    hard ones; what was asked for is said to be missing."""
    path = scene_file(tmp_path, light=LAMP)
    words = ["run", path, "--size", "96", "64", "--memory-mb", "1", "--repeats", "1", "--quiet"]
    words += ["--out", str(tmp_path / "out"), *(["--force", *force] if force else [])]
    assert cli.main(words) == 0
    report = json.loads((tmp_path / "out/report.json").read_text(encoding="utf-8"))
    validate_report(report)
    (decision,) = report["plan"]["decisions"]
    table = (tmp_path / "out/methods.csv").read_text(encoding="utf-8")
    if not softly:
        assert decision["kind"] == "hard" and decision["forced"]
        assert [item["effect"] for item in report["plan"]["not_simulated"]] == ["penumbra"]
        assert report["truth"]["samples"] == 1 and "soft_mae" not in table
        return
    assert decision["kind"] == "soft" and report["truth"]["samples"] == 64
    assert 0 < report["truth"]["standard_error"] < 0.02
    uniform, _, soft, single, rays = report["methods"]
    assert (single["name"], rays["name"]) == ("rays-1", "rays-64")
    assert any(line.startswith("rays-64 is truth") for line in report["notices"])
    assert single["error"]["soft"]["mae"] == pytest.approx(uniform["error"]["soft"]["mae"], rel=0.2)
    assert soft["name"].startswith(decision["methods"][-1])
    assert soft["error"]["soft"]["mae"] < 0.5 * uniform["error"]["soft"]["mae"]
    assert uniform["error"]["soft"]["penumbra_width_px"] < -1
    assert rays["error"]["soft"]["max"] == 0 and "soft_mae_percent" in table


def scene_file(folder: Path, sensor: str = SENSOR, light: str = LIGHT) -> str:
    path = folder / "scene.xml"
    path.write_text(SCENE.format(sensor=sensor, light=light), encoding="utf-8")
    return str(path)


NAN_EYE = SENSOR.replace('origin="3, -5, 5"', 'origin="nan, -5, 5"')

BAD = {
    "missing file": (lambda f: [str(f / "nothing.xml")], "nothing.xml"),
    "folder": (lambda f: [str(f)], "is a folder"),
    "malformed": (lambda f: [_written(f, "<scene version='3.0.0'><shape")], "scene.xml"),
    "unknown plugin": (
        lambda f: [_written(f, "<scene version='3.0.0'><shape type='blob'/></scene>")],
        "blob",
    ),
    "no sensor": (lambda f: [scene_file(f, sensor="")], "sensor"),
    "no light": (lambda f: [scene_file(f, light="")], "light"),
    "empty view": (lambda f: [scene_file(f, sensor=AWAY)], "sees no surface"),
    "NaN camera": (lambda f: [scene_file(f, sensor=NAN_EYE)], ""),
    "size 0": (lambda f: ["letter_f", "--size", "0", "64"], "1 to 16384"),
    "size too large": (lambda f: ["letter_f", "--size", "64", "16385"], "1 to 16384"),
    "below one node": (lambda f: ["letter_f", "--memory-mb", "0.001"], "--memory-mb"),
    "unknown scene": (lambda f: ["paper_rom"], "paper_room"),
    "unknown view": (lambda f: ["paper_room", "--view", "closup"], "closeup"),
    "unknown light": (lambda f: ["letter_f", "--light", "pont"], "point"),
    "unknown sensor": (lambda f: [scene_file(f), "--sensor", "7"], "sensor"),
    "unknown variant": (lambda f: ["letter_f", "--variant", "llvm"], "llvm_ad_rgb"),
    "node resolution": (lambda f: ["letter_f", "--node-resolution", "17"], "powers of two"),
    "cells": (lambda f: ["letter_f", "--cells", "3"], "2, 4, 8"),
    "tolerance": (lambda f: ["letter_f", "--tolerance", "-1"], "--tolerance"),
    "effect": (lambda f: ["letter_f", "--force", "soft", "hard"], "two things"),
    "time limit": (lambda f: ["letter_f", "--time-limit-ms", "0"], "--time-limit-ms"),
    "no settings file": (lambda f: ["--settings", str(f / "my.toml")], "No such file"),
    "settings folder": (lambda f: ["--settings", str(f)], "Is a directory"),
    "broken settings": (lambda f: _settings(f, "keep true"), "line 3"),
    "misspelt settings": (lambda f: _settings(f, "kep = true"), "Did you mean 'keep'?"),
    "quoted settings": (lambda f: _settings(f, 'bias = "0"'), "a number, without quotes"),
    "settings of no kind": (lambda f: _settings(f, "", "unifrom"), "Did you mean 'uniform'?"),
    "settings said twice": (
        lambda f: [*_settings(f, "", "adaptive"), "--preset", "paper_2001"],
        "--preset and the settings file",
    ),
    "settings below one node": (
        lambda f: ["letter_f", *_settings(f, "memory_mb = 0.001", "adaptive")],
        "raise memory_mb",
    ),
}


def _settings(folder: Path, line: str, family: str = "uniform") -> list[str]:
    path = folder / "my.toml"
    path.write_text(f'algorithm = "{family}"\n[settings]\n{line}\n', encoding="utf-8")
    return ["--settings", str(path)]


def _written(folder: Path, text: str) -> str:
    path = folder / "scene.xml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(case, tmp_path, capfd):
    """One line that names the trouble, exit code 2, no traceback, no half-written report."""
    words, expected = BAD[case]
    out = tmp_path / "out"
    code = cli.main(["run", *words(tmp_path), "--out", str(out), "--repeats", "1"])
    printed = capfd.readouterr().err.strip()
    assert code == 2
    assert printed.count("\n") == 0, printed
    assert printed.startswith("asmjax: error: ")
    assert expected in printed
    assert "Traceback" not in printed
    assert not out.exists()


def test_results_that_cannot_be_written_are_refused_before_the_work(tmp_path, capfd):
    """A file where the folder should be: said at once, not after everything was measured."""
    blocker = tmp_path / "file"
    blocker.write_text("", encoding="utf-8")
    assert cli.main(["run", "paper_room", "--out", str(blocker / "below")]) == 2
    assert "--out" in capfd.readouterr().err


@pytest.mark.slow
def test_notices_are_told_once(tmp_path, caplog, no_figures):
    """An area lamp becomes a point and a sky is left out: a line each, in the report too."""
    lights = LIGHT + '<emitter type="constant" id="sky"/>'
    path = scene_file(tmp_path, light=lights)
    words = ["run", path, "--memory-mb", "1", "--repeats", "1", "--out", str(tmp_path / "o")]
    assert cli.main(words) == 0
    assert caplog.text.count("'sky'") == 1
    report = json.loads((tmp_path / "o" / "report.json").read_text(encoding="utf-8"))
    assert any("'sky'" in notice for notice in report["notices"])


@pytest.mark.parametrize(
    ("view", "factor", "resolution"),
    [
        ("overview", 3, 0),
        pytest.param("closeup", 10, 65_536, marks=pytest.mark.slow),
        pytest.param("macro", 10, 524_288, marks=pytest.mark.slow),
    ],
)
def test_paper_room_bounds(view, factor, resolution):
    """16 MB at 512 x 512: so many times fewer wrong pixels than the 2048 x 2048 depth map."""
    from asmjax.main_job import measure_scene
    from asmjax.report.run_files import report_of

    options = RunOptions(scene="paper_room", view=view, repeats=1)
    report = report_of(measure_scene(options), options.seed)
    error = fractions(report)
    assert report["size"] == [512, 512]
    uniform, adaptive = report["methods"][:2]
    assert uniform["effective_resolution"] == 2048
    assert error["adaptive"] <= error["uniform"] / factor
    assert adaptive["effective_resolution"] >= resolution
    assert adaptive["bytes"] <= 16 * 2**20
    assert adaptive["error"]["boundary_displacement_px"]["mean"] <= 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["munich_merged", "breakfast_room", "victorian_house", "japanese_classroom", "cornell_box"],
)
def test_real_scenes_gain(name):
    """On every real scene the adaptive map is better than the uniform one of its memory."""
    from asmjax.main_job import measure_scene
    from asmjax.report.run_files import report_of

    options = RunOptions(scene=real_scene(name), size=(320, 240), memory_mb=4, repeats=1)
    error = fractions(report_of(measure_scene(options), options.seed))
    assert error["adaptive"] < error["uniform"]
