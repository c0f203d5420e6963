"""What a plan decides becomes maps, and what it leaves out is said; `test_first_run` has what that
costs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.plans import asked_about
from test_main_job import scene_file

from asmjax import cli
from asmjax.effects import Decision, plan_lights
from asmjax.effects.methods import soft_methods, wants_softness
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import a4_disc_light, a5_half_plane
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import (
    AccumulatedShadowMap,
    FilteredShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
)
from asmjax.shadow.registry import MAPS, SOFT


def decided(*methods: str, **settings: float) -> Decision:
    return Decision("lamp", "soft", methods=methods, settings=settings)


def test_decisions_become_algorithms():
    """The families of the registry, with the decision's numbers; hard ones need nothing more."""
    taps = {"blocker_taps": 16.0, "filter_taps": 25.0}
    assert soft_methods(decided("pcss", **taps), 512) == [
        PCSSShadowMap(512, blocker_taps=16, filter_taps=25)
    ]
    assert soft_methods(decided("moment", **taps), 512) == [MomentShadowMap(512)]
    for width, samples in ((0.0, 8), (1.0, 8), (0.05, 5), (1e-6, 2)):
        sampled = soft_methods(decided("accumulated", samples=8, width_map=width), 512)
        assert sampled == [AccumulatedShadowMap(512, samples)]
    (filtered,) = soft_methods(decided("uniform", "filtered", width_map=6 / 512), 512)
    assert isinstance(filtered, FilteredShadowMap)
    assert (filtered.kernel, filtered.width) == ("area", 6.0)
    (narrow,) = soft_methods(decided("uniform", "filtered", width_map=1e-4), 512)
    assert isinstance(narrow, FilteredShadowMap) and narrow.width == 1.0
    hard = Decision("lamp", "hard", methods=("adaptive",))
    assert soft_methods(hard, 512) == [] and not wants_softness(hard)
    missing = Decision("lamp", "soft", methods=("adaptive",), simulated=False)
    assert not wants_softness(missing)
    assert {
        type(soft_methods(decided(f, **taps, samples=2, width_map=0), 64)[0]) for f in SOFT
    } == set(SOFT.values())
    assert set(MAPS).isdisjoint(SOFT)


def test_a_planned_filter_beats_hard_edges_and_other_widths():
    """A5, a floor that recedes, so that the penumbra narrows from 3 pixels to one: the plan's
    filter against the closed form, beside the hard map and filters half and twice as wide."""
    scene = a5_half_plane(0.04)
    light, shapes = scene.soft_light(), scene.spec.shapes
    view = ViewSpec("receding", (0.8, -4.5, 1.5), (0.0, 0.0, 0.0), (0, 0, 1), fov_x_deg=50.0)
    plan = plan_lights(asked_about(scene, [light], view=view, side=128), 0.0)
    decision = plan.decision("centre")
    eye = analytic_eye(shapes, view.resized(128, 128))
    frame, rays = light_frame(light, eye, scene_bounds(shapes)), AnalyticRays(shapes)
    floor = eye.shape == 0
    assert scene.soft_visibility is not None
    truth = scene.soft_visibility(*eye.world[:2, floor])

    def error(algorithm) -> float:
        lit = algorithm.visibility(algorithm.build(eye, frame, rays), eye.points)
        return float(np.abs(np.asarray(lit)[floor] - truth).mean())

    # Half side 0.04 above a half-plane at 2 of 5: 2 x 0.04 x 2 / 3 on a floor at 5.
    down = frame.rotation[:, 2, 2].argmin()
    width = 0.16 / 3 / 5 / np.sqrt(np.prod(frame.extent[down]))
    assert decision.settings["width_map"] == pytest.approx(width, rel=0.05)
    (planned,) = soft_methods(decision, 512)
    assert isinstance(planned, FilteredShadowMap)
    least = error(planned)
    assert least < 0.4 * error(planned.inner)
    for factor in (0.5, 2.0):
        assert least < 0.9 * error(replace(planned, width=factor * planned.width))


def test_samples_are_as_many_as_their_maps_have_texels_for():
    """A4: the planned number beats half and twice as many of the same texels in all."""
    scene = a4_disc_light(light_half=1.2)
    light, shapes = scene.soft_light(), scene.spec.shapes
    (view,) = scene.spec.views.values()
    (numbers,) = plan_lights(asked_about(scene, [light])).numbers
    decision = decided("accumulated", samples=16, width_map=numbers.width_map)
    eye = analytic_eye(shapes, view.resized(64, 64))
    frame, rays = light_frame(light, eye, scene_bounds(shapes)), AnalyticRays(shapes)
    floor = eye.shape == 0
    assert scene.soft_visibility is not None
    truth = scene.soft_visibility(*eye.world[:2, floor])
    (planned,) = soft_methods(decision, 256)
    assert isinstance(planned, AccumulatedShadowMap) and 4 < planned.samples < 12
    errors = []
    for samples in (planned.samples, planned.samples // 2, 2 * planned.samples):
        algorithm = AccumulatedShadowMap(256, samples)
        lit = algorithm.visibility(algorithm.build(eye, frame, rays), eye.points)
        errors.append(float(np.abs(np.asarray(lit)[floor] - truth).mean()))
    assert errors[0] == min(errors)


@pytest.mark.slow
@pytest.mark.mitsuba
def test_what_is_not_simulated_is_in_every_title(tmp_path, monkeypatch):
    """A pane that lets light through is opaque here, and each figure says so."""
    titles = []

    def no_figures(pictures):
        titles.append(pictures.title)
        return {}

    monkeypatch.setattr("asmjax.report.run_files.figure_files", no_figures)
    pane = """<shape type="rectangle"><transform name="to_world"><scale value="1.5"/>
    <translate x="0" y="0" z="2"/></transform><bsdf type="mask"><float name="opacity" value="0.5"/>
    <bsdf type="diffuse"/></bsdf></shape>"""
    text = Path(scene_file(tmp_path)).read_text(encoding="utf-8")
    (tmp_path / "scene.xml").write_text(text.replace("</scene>", pane + "</scene>"))
    words = ["run", str(tmp_path / "scene.xml"), "--memory-mb", "0.25", "--repeats", "1", "--quiet"]
    assert cli.main([*words, "--out", str(tmp_path / "out")]) == 0
    report = json.loads((tmp_path / "out/report.json").read_text(encoding="utf-8"))
    missing = {item["effect"] for item in report["plan"]["not_simulated"]}
    assert "transmittance" in missing
    assert titles == [title for title in titles if "not simulated: transmittance" in title] != []
