"""Soft methods are judged by soft truth, whoever asked for them, and what that takes is told."""

import json

import numpy as np
import pytest
from helpers.soft_cases import soft_case
from test_main_job import SENSOR

from asmjax import cli
from asmjax.compare_job import Comparing
from asmjax.errors import UseError
from asmjax.experiment.soft_rays import answers_softly, calls_for_soft_truth, soft_truth
from asmjax.geometry import sphere_light
from asmjax.main_job import measure_scene
from asmjax.memory import Memory
from asmjax.options import CompareOptions, RunOptions
from asmjax.render.load import load_scene
from asmjax.render.moving import MovingShapes
from asmjax.scene.soft_visibility import LightSamples, analytic_soft_visibility
from asmjax.shadow import (
    AccumulatedShadowMap,
    FilteredShadowMap,
    PCSSShadowMap,
    UniformShadowMap,
    write_settings,
)
from asmjax.walkthrough_job import measure_walkthrough

LAMP = """<scene version="3.0.0">{sensor}
<shape type="rectangle" id="panel"><transform name="to_world"><scale value="0.8"/>
<rotate x="1" angle="180"/><translate x="1" y="1" z="6"/></transform><emitter type="area">
<rgb name="radiance" value="5"/></emitter></shape>
<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform></shape>
<shape type="cube" id="box"><transform name="to_world"><scale value="0.5"/>
<translate x="0" y="0" z="1"/></transform></shape></scene>"""


@pytest.fixture(scope="module")
def lamp(tmp_path_factory) -> str:
    """A cube below a square lamp, whose penumbrae are some pixels wide."""
    path = tmp_path_factory.mktemp("lamp") / "lamp.xml"
    path.write_text(LAMP.format(sensor=SENSOR), encoding="utf-8")
    return str(path)


def small(scene: str, **more) -> RunOptions:
    return RunOptions(scene=scene, memory_mb=0.25, repeats=1, quiet=True, **more)


def test_which_methods_call_for_soft_truth():
    """Soft families and filters of them, and those only where the light has a size."""
    soft = [PCSSShadowMap(), AccumulatedShadowMap(), FilteredShadowMap(inner=PCSSShadowMap())]
    hard = [UniformShadowMap(), FilteredShadowMap()]
    assert all(map(answers_softly, soft)) and not any(map(answers_softly, hard))
    area = sphere_light((0, 0, 0), 1.0)
    assert calls_for_soft_truth(area, [*hard, soft[0]])
    assert not calls_for_soft_truth(area, hard) and not calls_for_soft_truth(None, soft)


@pytest.mark.slow
@pytest.mark.mitsuba
def test_a_settings_file_of_a_soft_method_is_judged_softly(lamp, tmp_path):
    """Though the plan was told to be hard; hard rays stand beside soft truth, and no two methods
    have one name, though the plan's own soft map may be that of the file."""
    filed = PCSSShadowMap(256)
    assert filed.name != PCSSShadowMap(256, filter_taps=16).name
    write_settings(tmp_path / "pcss.toml", filed)
    result = measure_scene(small(lamp, force=("hard",), settings=str(tmp_path / "pcss.toml")))
    assert result.standard_error is not None and result.plan is not None
    assert [row["kind"] for row in result.plan["decisions"]] == ["hard"]
    names = [one.name for one in result.methods]
    assert names == ["uniform-256", "adaptive-0.25MB", filed.name, "rays-1", "rays-64"]
    off = {
        one.name: np.abs(one.visibility - result.truth.visibility).mean() for one in result.methods
    }
    assert off[filed.name] < 0.5 * off["uniform-256"] and off["rays-64"] == 0
    # Of the two hard ones: what hard edges are off by.
    assert off["rays-1"] == pytest.approx(off["uniform-256"], rel=0.2)
    result = measure_scene(small(lamp, force=("soft",), settings=str(tmp_path / "pcss.toml")))
    names = [one.name for one in result.methods]
    assert len(set(names)) == len(names) == 6 and names[3].removesuffix("-settings") == names[2]


@pytest.mark.mitsuba
def test_memory_of_soft_truth_is_told_after_the_plan(lamp, monkeypatch):
    """A run that keeps to its limit until the plan asks for softness is refused then, in the words
    of soft truth, before any of its rays is made."""
    monkeypatch.setattr("asmjax.job_memory.SOFT_AIMING", Memory(host=1e9))
    monkeypatch.setattr("asmjax.render.load.SoftShadowRays", None)
    with pytest.raises(UseError, match="host memory for soft truth for 48 x 32 pixels"):
        measure_scene(small(lamp, force=("soft",)))


@pytest.mark.slow
@pytest.mark.mitsuba
def test_a_comparison_with_a_soft_method_is_judged_softly(lamp):
    """The soft map is nearer to truth than hard shadow rays; and measurements of either truth are
    not taken for the other's."""
    options = CompareOptions(
        scene=lamp, memory_mb=0.25, repeats=1, samples=(1,), methods=("pcss", "uniform")
    )
    soft = Comparing(options)._benches(1)[0]
    hard = Comparing(CompareOptions(scene=lamp, memory_mb=0.25, repeats=1, samples=(1,)))
    plain = hard._benches(1)[0]
    assert set(np.unique(plain.truth)) == {0.0, 1.0} and np.unique(soft.truth).size > 10
    uniform = UniformShadowMap(256)
    assert soft.key(uniform, 1, False) != plain.key(uniform, 1, False)
    pcss, flat = soft.try_all([PCSSShadowMap(256), uniform], 1)
    assert pcss.wrong < 0.5 * flat.wrong
    assert soft.shadow_rays(1).wrong == pytest.approx(flat.wrong, rel=0.2)
    assert plain.shadow_rays(1).wrong == 0


@pytest.mark.slow
@pytest.mark.mitsuba
def test_a_light_without_a_shadow_is_measured_all_the_same(tmp_path, capsys, monkeypatch):
    """`--force none`: the two hard maps and truth, and a line that says why."""
    monkeypatch.setattr("asmjax.report.run_files.figure_files", lambda pictures: {})
    words = ["run", "letter_f", "--size", "48", "32", "--memory-mb", "0.25", "--repeats", "1"]
    assert cli.main([*words, "--force", "none", "--out", str(tmp_path)]) == 0
    assert "hard maps and truth are measured all the same" in capsys.readouterr().out
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(report["methods"]) == 3


@pytest.mark.slow
@pytest.mark.mitsuba
def test_walks_say_that_penumbrae_are_missing(lamp):
    """Walkthroughs are hard: what they leave out is in the notices, and `--force` is refused."""
    report = measure_walkthrough(small(lamp, frames=1, motion="still"))
    (notice,) = (line for line in report["notices"] if line.startswith("not simulated"))
    assert "penumbra" in notice and "hard shadows only" in notice
    report = measure_walkthrough(small(lamp, frames=1, motion="still", tolerance=0.5))
    assert not any(line.startswith("not simulated") for line in report["notices"])
    with pytest.raises(UseError, match="leave out --force, or --frames"):
        small(lamp, frames=2, force=("soft",))


@pytest.mark.slow
@pytest.mark.mitsuba
def test_rays_of_a_lamp_are_made_once(lamp):
    """With the light moved too, whose lamp stays; not where a caster moved. Their second tree is
    counted until it is there."""
    scene = load_scene(lamp)
    assert scene.light_rays_memory().renderer > 0
    rays = scene.light_rays()
    assert scene.light_rays() is rays and scene.light_rays_memory().bytes == 0
    light = scene.light()
    moved = scene.with_light(light.moved_to((1.0, 1.0, 5.0)))
    assert moved.light_rays() is rays
    mover = MovingShapes(scene, "box")
    other, _ = mover.at(np.array([0.5, 0.0, 0.0]))
    assert other.light_rays() is not rays
    assert load_scene("letter_f").light_rays_memory().bytes == 0


def test_samples_of_neighbouring_seeds_are_their_own():
    """The second sample of one seed is not the first of the next."""
    case = soft_case("a5_square", 24)

    def places(seed) -> list[np.ndarray]:
        samples, asked = LightSamples(case.eye, case.frame, 1, 2, seed), []
        samples.estimate(lambda at: asked.append(at.copy()) or np.zeros(at.shape[1], bool))
        return asked

    assert not np.array_equal(places((0, 1))[0], places((1, 0))[0])
    np.testing.assert_array_equal(places((0, 1))[1], places((0, 1))[1])
    calls = []

    class Rays:
        count = 5

        def __init__(self, k: int):
            calls.append(k)

        def estimate(self):
            return analytic_soft_visibility(case.shapes, case.eye, case.frame, 2, 2, (3, calls[-1]))

    truth, error = soft_truth(lambda k, eye: Rays(k), [case.eye, case.eye])
    assert calls == [0, 1] and truth.cost.rays == 10 and truth.name == "rays-128"
    both = [
        analytic_soft_visibility(case.shapes, case.eye, case.frame, 2, 2, (3, k)) for k in (0, 1)
    ]
    np.testing.assert_allclose(truth.visibility, np.mean([one.visibility for one in both], axis=0))
    np.testing.assert_allclose(error, np.hypot(*(one.error for one in both)) / 2)
