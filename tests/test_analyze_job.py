"""`asmjax analyze`: files, numbers against direct calls, theory against measurement, wrong use."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np
import pytest
from helpers.figures import texels_over, words

from asmjax import cli, theory
from asmjax.buffers import LightRays
from asmjax.errors import UseError
from asmjax.experiment.aliasing import aliasing_maps, aliasing_numbers
from asmjax.experiment.displacement import displacement
from asmjax.experiment.light_angles import (
    AngleCase,
    ViewRange,
    angle_errors,
    parallel_light,
    storage_factor,
    sweep_angles,
    theory_storage,
    view_range,
)
from asmjax.options import AnalyzeOptions
from asmjax.report import InvalidReport, validate_report
from asmjax.report.analyze_record import report_of_analysis
from asmjax.report.analyze_table import analysis_table
from asmjax.report.figures.aliasing_maps import MPanel, draw_aliasing_maps
from asmjax.report.figures.edge_displacement import EdgePoint, draw_displacement
from asmjax.report.keys import key_paths
from asmjax.report.outputs import ANALYSIS
from asmjax.report.schema import ALIASING_KEYS, RUN_KEYS
from asmjax.report.table import MAX_WIDTH
from asmjax.scene.analytic_rays import analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import Rectangle, ViewSpec
from asmjax.shadow import (
    ALGORITHMS,
    MAPS,
    LightSpaceShadowMap,
    PerspectiveShadowMap,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
    UniformShadowMap,
)

CHOSEN = ("uniform", "light-space")
WORDS = ["--size", "48", "48", "--memory-mb", "1", "--repeats", "1", "--angles", "2"]


@pytest.fixture(scope="module")
def options(tmp_path_factory) -> AnalyzeOptions:
    return AnalyzeOptions(
        scene="letter_f", size=(48, 48), methods=CHOSEN, memory_mb=1, repeats=1, angles=2,
        quiet=True, save_arrays=True, out=str(tmp_path_factory.mktemp("analysis") / "out"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def result(options):
    """One small analysis with everything written."""
    from asmjax.analyze_job import run_analysis

    return run_analysis(options)


@pytest.fixture(scope="module")
def report(result, options) -> dict:
    return json.loads((Path(options.out) / "report.json").read_text(encoding="utf-8"))


@pytest.mark.mitsuba
def test_everything_is_written_and_valid(report, options):
    """The report follows its schema; its methods are those asked for, and the rays come last."""
    validate_report(report)
    assert report["schema"] == "asmjax/aliasing/1"
    assert [method["family"] for method in report["methods"]] == [*CHOSEN, "rays"]
    assert report["memory_limit_bytes"] == 2**20
    assert report["methods"][0]["name"] == "uniform-512"
    assert {path.name for path in Path(options.out).iterdir()} == {*ANALYSIS, "report.json"}
    lines = (Path(options.out) / "methods.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + len(report["methods"])
    assert len(set(lines[0].split(","))) == len(lines[0].split(",")) > 15


@pytest.mark.mitsuba
def test_numbers_are_those_of_direct_calls(result, report):
    """The same scene, map and functions without the job: the same numbers, and their meaning."""
    from asmjax.render.load import load_scene

    scene = load_scene("letter_f")
    eye = scene.eye(scene.view().resized(48, 48))
    frame = scene.light_frame(eye)
    algorithm = LightSpaceShadowMap(resolution=512)
    state = algorithm.build(eye, frame, scene.light_rays())
    maps = aliasing_maps(algorithm, state, eye, frame)
    entry = report["methods"][1]
    assert entry["aliasing"] == aliasing_numbers(maps, 512**2).record()
    assert entry["aliasing"]["max_m"] == pytest.approx(np.nanmax(maps.m))
    assert entry["aliasing"]["above_1"] == pytest.approx(np.mean(maps.m[maps.known] > 1))
    seen = seen_lit(algorithm, state, eye)
    moved = displacement(result.truth.visibility, seen, eye, maps)
    assert entry["displacement"]["predicted"] == pytest.approx(moved.predicted)
    assert entry["displacement"]["measured"] == pytest.approx(moved.measured)
    wrong = np.mean((result.truth.visibility != seen)[eye.valid])
    assert entry["error"]["misclassified_fraction"] == pytest.approx(wrong)
    errors = [e for e in result.sweep.errors if e.family == "light-space"]
    light = parallel_light("sun", eye.camera, 90.0)
    overhead = light_frame(light, eye, scene.geometry.bounds)
    state = algorithm.build(eye, overhead, scene.light_rays())
    known = aliasing_maps(algorithm, state, eye, overhead)
    assert [e.angle_deg for e in errors] == [2.0, 90.0]
    assert errors[1].p95_m == pytest.approx(np.percentile(known.m[known.known], 95))


def seen_lit(algorithm, state, eye) -> np.ndarray:
    return np.where(eye.valid, np.asarray(algorithm.visibility(state, eye.points)), 0.0)


@pytest.mark.mitsuba
def test_arrays_and_table(report, options):
    """Maps of each method as images; a row for each, and no number where rays have none."""
    arrays = np.load(Path(options.out) / "arrays.npz")
    m = arrays["m_uniform-512"]
    assert m.shape == arrays["truth"].shape == (48, 48)
    known = np.isfinite(m)
    assert known.sum() == report["methods"][0]["aliasing"]["receivers"]
    assert m[known].max() == pytest.approx(report["methods"][0]["aliasing"]["max_m"])
    rows = analysis_table(report["methods"]).splitlines()
    assert max(map(len, rows)) <= MAX_WIDTH
    assert rows[-1].startswith("rays-1") and rows[-1].split()[1] == "-"
    assert len(rows) == 3 + len(report["methods"])


@pytest.mark.mitsuba
def test_what_cannot_be_used_is_left_out_and_said(tmp_path, monkeypatch, caplog):
    """Rationale: a map that is missing from a comparison without a word looks like a choice."""
    monkeypatch.setattr(UniformShadowMap, "build", refuse)
    out = tmp_path / "out"
    words = [*WORDS, "--methods", "uniform", "logarithmic", "--quiet", "--out", str(out)]
    assert cli.main(["analyze", "letter_f", *words]) == 0
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert [method["family"] for method in report["methods"]] == ["logarithmic", "rays"]
    assert report["cost_model"] is None
    assert any(line.startswith("uniform is left out: no scene suits") for line in report["notices"])
    assert caplog.text.count("uniform is left out") == 1
    assert cli.main(["analyze", "letter_f", *WORDS, "--methods", "uniform", "--quiet"]) == 2


def refuse(self, view, frame, rays):
    raise UseError("no scene suits it.")


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["letter_f", "--methods", "unifrom"], "Did you mean 'uniform'?"),
        (["letter_f", "--methods", "psm"], ", ".join(sorted(ALGORITHMS))),
        (["letter_f", "--angles", "-1"], "--angles is -1; allowed"),
        (["letter_f", "--memory-mb", "nan"], "--memory-mb is nan"),
        (["letter_f", "--memory-mb", "1e9"], "--memory-mb"),
        (["letter_g"], "letter_f"),
        (["letter_f", "--frames", "3"], "--frames"),
    ],
)
def test_wrong_use_is_one_line_and_leaves_nothing(words, said, tmp_path, capfd):
    out = tmp_path / "out"
    assert cli.main(["analyze", *words, "--out", str(out)]) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.startswith("asmjax: error: ") and printed.count("\n") == 0
    assert said in printed
    assert not out.exists()


def test_the_default_folder_names_command_and_scene():
    from asmjax.folders import results_folder

    found = results_folder(AnalyzeOptions(scene="a/munich.xml")).path
    assert found == Path("out/analyze-munich")


FAMILIES = ("uniform", "perspective", "light-space", "logarithmic", "partitioned", "subdivided")
"""Those that the theory knows with their default settings."""

GROUND = Rectangle("ground", (0, 0, 0), (500, 0, 0), (0, 500, 0))


class NoCasters(LightRays):
    """Rays that meet nothing: how large texels are does not depend on what they hold."""

    def closest(self, origins, directions, t_min=0.0):
        count = directions.shape[1]
        return np.full(count, np.inf), np.full(count, -1, np.int64)

    def occluded(self, origins, directions, t_max):
        return np.zeros(directions.shape[1], bool)


def ground(side: int = 160, fov_deg: float = 60.0, far: float = 20.0):
    """An eye 1 unit above endless ground that looks along it as far as `far`."""
    view = ViewSpec("along", (0, 0, 1), (0, 1, 1), fov_x_deg=fov_deg, width=side, height=side)
    eye = analytic_eye([GROUND], view)
    shape = np.where(eye.depth < far, eye.shape, -1).astype(np.int32)
    valid = eye.points.valid & (shape >= 0)
    points = eqx.tree_at(lambda points: points.valid, eye.points, valid)
    return replace(eye, shape=shape, points=points)


def ground_case(eye, angle_deg: float) -> AngleCase:
    frame = light_frame(parallel_light("sun", eye.camera, angle_deg), eye, scene_bounds([GROUND]))
    return AngleCase(angle_deg, frame, NoCasters())


@pytest.mark.parametrize("family", FAMILIES)
def test_measurement_follows_theory_on_level_ground(family):
    """Rationale: under an overhead light level ground fills the frustum as the light sees it, so
    a map fitted to what is seen is the theory's. Setup: 160 x 160 pixels, alpha of 10.6.
    Expected: equal storage factors but for half a pixel at the image's border (1 %), and for texels
    whose ends differ and rows of pixels that parts end between (3 %); below theory elsewhere, as
    ground is a slice of the frustum."""
    eye = ground()
    kind: Any = ALGORITHMS[family]
    algorithms = {family: kind(resolution=1024)}
    cases = [ground_case(eye, angle) for angle in (90.0, 40.0)]
    left_out: list[str] = []
    overhead, *others = angle_errors(cases, algorithms, eye, left_out)
    assert left_out == [] and len(others) == 1
    assert overhead.theory is not None
    assert overhead.storage == pytest.approx(overhead.theory, rel=0.04)
    for error in others:
        assert error.theory is None or error.storage < 1.02 * error.theory


@pytest.mark.parametrize("angle_deg", [20.0, 50.0, 90.0])
def test_uniform_storage_factor_on_level_ground_in_closed_form(angle_deg):
    """A flat map of ground from z_n to z_f, lit at gamma, is (z_f - z_n) sin(gamma) by 2 z_f
    tan(theta) large; the nearest pixels are z_n / f wide, and the image 2 f tan(theta) of them."""
    eye = ground()
    case = ground_case(eye, angle_deg)
    algorithm = UniformShadowMap(64)
    state = algorithm.build(eye, case.frame, case.rays)
    maps = aliasing_maps(algorithm, state, eye, case.frame)
    found = storage_factor(algorithm, state, eye, case.frame, maps.known)
    seen = view_range(eye)
    slant = np.sin(np.radians(angle_deg))
    expected = (seen.alpha - 1) * slant * seen.alpha / (2 * np.tan(seen.theta))
    assert seen.theta == pytest.approx(np.radians(30))
    assert found == pytest.approx(expected, rel=0.015)


def test_storage_factor_does_not_depend_on_resolution_or_roll():
    """Four times the texels halve both widths; an image plane that is rolled by a quarter turn has
    the same texels, and one by an eighth larger ones."""
    eye = ground(48)
    case = ground_case(eye, 70.0)
    known = np.asarray(eye.valid)

    def found(side: int, frame) -> float:
        algorithm = UniformShadowMap(side)
        return storage_factor(algorithm, algorithm.build(eye, frame, case.rays), eye, frame, known)

    expected = found(32, case.frame)
    assert found(128, case.frame) == pytest.approx(expected, rel=1e-4)
    assert found(32, rolled(case.frame, eye, 90.0)) == pytest.approx(expected, rel=1e-3)
    assert found(32, rolled(case.frame, eye, 45.0)) > 1.1 * expected
    algorithm, nothing = UniformShadowMap(8), np.zeros(eye.valid.size, bool)
    state = algorithm.build(eye, case.frame, case.rays)
    assert storage_factor(algorithm, state, eye, case.frame, nothing) == 0.0
    with pytest.raises(UseError, match="parallel light"):
        storage_factor(algorithm, state, eye, replace(case.frame, perspective=True), nothing)


def rolled(frame, eye, degrees: float):
    """The frame with its image plane turned about its axis, and fitted again."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1.0]])
    rotation = turn @ frame.rotation[0]
    seen = eye.world[:, eye.valid] - frame.origin[:, None]
    low, high = (edge(rotation[:2] @ seen, axis=1) for edge in (np.min, np.max))
    margin = 1e-4 * (high - low)
    return replace(
        frame,
        rotation=rotation[None],
        corner=(low - margin)[None],
        extent=(high - low + 2 * margin)[None],
    )


def test_directions_of_light():
    """From 2 degrees to overhead; the light travels forward first, and down in the end."""
    camera = ground(8).camera
    assert sweep_angles(0) == [] and sweep_angles(1) == [2.0]
    assert sweep_angles(3) == pytest.approx([2.0, 46.0, 90.0])
    for angle in sweep_angles(5):
        direction = np.array(parallel_light("sun", camera, angle).direction)
        assert np.degrees(np.arccos(direction @ camera.rotation[2])) == pytest.approx(angle)
        assert direction @ camera.rotation[1] > 0
        assert direction @ camera.rotation[0] == pytest.approx(0, abs=1e-12)


def test_theory_knows_what_it_does_not_know():
    """None for other settings and fields of view; the sine falloff is the one of LiSPSM."""
    seen, angles = ViewRange(50.0, 0.5, 0.5), np.array([10.0, 60.0, 90.0])

    def found(algorithm) -> np.ndarray:
        expected = theory_storage(algorithm, seen, angles)
        assert expected is not None
        return expected

    paper = theory.direction_storage(50.0, 0.5, np.radians(angles), "lispsm").storage
    sine, shaped = found(LightSpaceShadowMap(falloff="sine")), found(LightSpaceShadowMap())
    np.testing.assert_allclose(sine, np.asarray(paper), rtol=1e-6)
    unwarped = found(LightSpaceShadowMap(falloff="none"))
    np.testing.assert_allclose(unwarped, found(UniformShadowMap()), rtol=1e-6)
    assert shaped[0] < sine[0] and shaped[2] == pytest.approx(sine[2], rel=1e-5)
    assert np.isnan(found(SubdividedShadowMap())).tolist() == [True, True, False]
    for other in (PerspectiveShadowMap(slide=1.0), TrapezoidalShadowMap()):
        assert theory_storage(other, seen, angles) is None
    assert theory_storage(UniformShadowMap(), ViewRange(50.0, 1e-5, 1e-5), angles) is None


def test_theory_shapes_warps_by_the_angle_that_maps_go_by():
    """Half the larger field of view: in an image three times as high as wide, light 15 degrees off
    the view leaves no warp. Half the width alone, 20 degrees, would leave half of it."""
    view = ViewSpec("high", (0, 0, 1), (0, 1, 1), fov_x_deg=40, width=24, height=72)
    eye = analytic_eye([GROUND], view)
    seen, angle = view_range(eye), np.array([15.0])
    assert seen.theta == pytest.approx(np.radians(20))
    assert seen.half_view == pytest.approx(np.arctan(3 * np.tan(np.radians(20))))
    theirs = theory_storage(LightSpaceShadowMap(), seen, angle)
    unwarped = theory_storage(UniformShadowMap(), seen, angle)
    assert theirs is not None and unwarped is not None
    np.testing.assert_allclose(theirs, unwarped, rtol=1e-6)
    frame = ground_case(eye, 15.0).frame
    (chart,) = LightSpaceShadowMap(64).charts(eye, frame)
    np.testing.assert_array_equal(chart.to_chart, np.eye(3))


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: r["methods"][0].pop("aliasing"), "methods[0].aliasing: missing"),
        (lambda r: r["methods"][0].update(family="light-space"), "must begin with 'light-space'"),
        (lambda r: r["methods"][1]["aliasing"].update(wasted=1.5), "methods[1].aliasing.wasted"),
        (lambda r: r["light_angles"].update(beta=1.0), "light_angles.beta: unknown key"),
        (lambda r: r.update(schema="asmjax/analysis/2"), "schema: expected"),
    ],
)
def test_a_report_that_breaks_its_schema_is_named(report, change, said):
    broken = json.loads(json.dumps(report))
    change(broken)
    with pytest.raises(InvalidReport) as problem:
        validate_report(broken)
    assert said in str(problem.value)


def test_every_key_is_documented():
    """What an analysis has in common with a run stands under the run."""
    text = (Path(__file__).parents[1] / "docs/analyses.md").read_text(encoding="utf-8")
    common = {path for path, _ in key_paths(RUN_KEYS)}
    for path, key in key_paths(ALIASING_KEYS):
        assert key.means
        short = path.removesuffix("[]")
        assert path in common or f"`{short}`" in text or f"`{path}." in text, path
    assert all(f"`{file}`" in text for file in ANALYSIS)


@pytest.mark.mitsuba
def test_no_directions_no_sweep(result):
    """0 directions leave null."""
    report = report_of_analysis(replace(result, sweep=None), 0)
    assert report["light_angles"] is None


def test_maps_share_one_scale_and_leave_out_what_is_not_lit():
    """Two panels coloured alike where m is alike, grey where it is not known."""
    m = np.full((16, 16), 4.0)
    m[:4] = np.nan
    valid = np.ones((16, 16), bool)
    panels = [MPanel("uniform-8", m, valid), MPanel("adaptive-1MB", np.where(m > 1, 1.0, m), valid)]
    images = [axes.get_images()[0].get_array() for axes in texels_over(draw_aliasing_maps(panels))]
    coarse, clean = (np.asarray(image)[:, :, :3].astype(int) for image in images[:2])
    assert (coarse[0, 0] == clean[0, 0]).all() and np.ptp(coarse[0, 0]) == 0
    assert coarse[-1, -1, 0] > coarse[-1, -1, 2] + 40
    assert np.ptp(clean[-1, -1]) < 8 and clean[-1, -1].min() > 235


def test_displacements_of_zero_are_named_not_drawn():
    points = [EdgePoint("uniform", "uniform-8", 0.5, 0.4), EdgePoint("tuned", "tuned-8", 0.1, 0.0)]
    figure = draw_displacement(points, "wall")
    assert any("tuned-8" in text for text in words(figure))
    assert draw_displacement([], "").axes


@pytest.mark.slow
@pytest.mark.mitsuba
def test_all_algorithms_in_one_report(tmp_path):
    """All maps of the registry: a row each, and of the adaptive map what a run says of it."""
    words = [*WORDS[:-1], "1", "--quiet", "--out", str(tmp_path)]
    assert cli.main(["analyze", "letter_f", *words]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    families = [method["family"] for method in report["methods"]]
    assert families == [*MAPS, "rays"]
    assert report["cost_model"]["a_seconds_per_texel"] > 0
    adaptive = report["methods"][families.index("adaptive")]
    assert adaptive["nodes"] > 0 and adaptive["bytes"] <= 2**20
    (angle,) = report["light_angles"]["angles"]
    assert [error["family"] for error in angle["methods"]] == [*MAPS]
    assert report["methods"][families.index("logarithmic")]["settings"]["ratio"] == "inf"
