"""What a plan skips is free: a point light casts and compiles as if softness did not exist."""

import json
from pathlib import Path

import pytest
from test_main_job import scene_file

from asmjax import cli
from asmjax.effects import Decision
from asmjax.effects.methods import soft_methods, wants_softness
from asmjax.experiment.traces import counted_traces
from asmjax.main_job import measure_scene
from asmjax.options import RunOptions
from asmjax.render.caster import MitsubaRays
from asmjax.render.soft_truth import SoftShadowRays
from asmjax.shadow import (
    ALGORITHMS,
    AccumulatedShadowMap,
    FilteredShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
)
from asmjax.shadow.registry import FILTERS, MAPS, SOFT

OPTIONS = RunOptions(scene="letter_f", size=(48, 32), memory_mb=0.25, repeats=1)


class Counting:
    """Rays of a run, by what casts them."""

    def __init__(self, patch: pytest.MonkeyPatch):
        self.rays: dict[str, int] = {}
        for name in ("light_buffer", "closest", "occluded", "prepare_occlusion", "first_surfaces"):
            patch.setattr(MitsubaRays, name, self._counted(name, getattr(MitsubaRays, name)))

    def _counted(self, name, before):
        def counted(rays, *args, **kwargs):
            size = args[1].texels if name == "light_buffer" else args[0].shape[1]
            self.rays[name] = self.rays.get(name, 0) + size
            return before(rays, *args, **kwargs)

        return counted


@pytest.mark.mitsuba
def test_a_point_light_pays_nothing_for_softness(monkeypatch):
    """Rays and traces with the soft and filtered families, and without any of them registered."""
    measure_scene(OPTIONS)
    counts = []
    for without in (False, True):
        with pytest.MonkeyPatch.context() as patch:
            if without:
                for family in (*SOFT, *FILTERS):
                    patch.delitem(ALGORITHMS, family)
            patch.setattr(SoftShadowRays, "__init__", forbidden)
            counting = Counting(patch)
            with counted_traces() as traces:
                result = measure_scene(OPTIONS)
            counts.append((counting.rays, list(traces), [one.name for one in result.methods]))
    assert counts[0] == counts[1]
    rays, traces, names = counts[0]
    assert rays["light_buffer"] > 0 and rays["prepare_occlusion"] > 0 and traces == []
    assert [name.split("-")[0] for name in names] == ["uniform", "adaptive", "rays"]


def forbidden(self, *args):
    raise AssertionError("soft truth of a light without a size")


def decided(*methods: str, **settings: float) -> Decision:
    return Decision("lamp", "soft", methods=methods, settings=settings)


def test_decisions_become_algorithms():
    """The families of the registry, with the decision's numbers; hard ones need nothing more."""
    taps = {"blocker_taps": 16.0, "filter_taps": 25.0, "widest_px": 40.0}
    assert soft_methods(decided("pcss", **taps), 512, 1.0) == [PCSSShadowMap(512, 16, 25)]
    assert soft_methods(decided("moment", **taps), 512, 1.0) == [MomentShadowMap(512)]
    sampled = soft_methods(decided("accumulated", samples=8), 512, 1.0)
    assert sampled == [AccumulatedShadowMap(512, 8)]
    (filtered,) = soft_methods(decided("adaptive", "filtered", kernel_px=3.0), 512, 0.5)
    assert isinstance(filtered, FilteredShadowMap)
    assert (filtered.kernel, filtered.width) == ("area", 6.0)
    hard = Decision("lamp", "hard", methods=("adaptive",))
    assert soft_methods(hard, 512, 1.0) == [] and not wants_softness(hard)
    missing = Decision("lamp", "soft", methods=("adaptive",), simulated=False)
    assert not wants_softness(missing)
    assert {type(soft_methods(decided(f, **taps, samples=2), 64, 1.0)[0]) for f in SOFT} == set(
        SOFT.values()
    )
    assert set(MAPS).isdisjoint(SOFT)


@pytest.mark.mitsuba
def test_what_is_not_simulated_is_in_every_title(tmp_path, monkeypatch):
    """A pane that lets light through is opaque here, and each figure says so."""
    titles = []
    monkeypatch.setattr(
        "asmjax.report.run_files.write_figures", lambda pictures, _: titles.append(pictures.title)
    )
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
