"""Trials of a sweep: what is measured, what stays ready for the next one, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from hostile.building import BALL, scene_xml, text_scene

from asmjax import machine
from asmjax.errors import UseError
from asmjax.experiment.light_angles import parallel_light
from asmjax.memory import Limit, MemoryShort
from asmjax.options import RunOptions
from asmjax.preparation import bench_of
from asmjax.report.keys import first_unstorable
from asmjax.shadow import AdaptiveShadowMap, CostModel, FilteredShadowMap, UniformShadowMap
from asmjax.sweep import ready, trial
from asmjax.sweep.config import sweep_of
from asmjax.sweep.ready import ReadyViews, Recent
from asmjax.sweep.share import Share, share_of
from asmjax.sweep.trial import algorithm_for, run_trial

DOCS = Path(__file__).parents[1] / "docs"

BASE = """
[trial]
scene = "letter_f"
size = [40, 32]
algorithm = "uniform"
settings.resolution = 64
repeats = 1
warm_ups = 0
"""


@pytest.fixture
def config(tmp_path):
    """The configuration of a file's first trial."""

    def read(text: str, **options) -> dict:
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return sweep_of(path, **options).trials[0].config

    return read


@pytest.fixture
def views(monkeypatch) -> ReadyViews:
    """Nothing is ready yet."""
    monkeypatch.setattr(trial, "_READY", ReadyViews())
    return trial._READY


@pytest.mark.mitsuba
def test_a_trial_is_what_its_bench_measures(config, views):
    """The same errors and the same image; plain values, each explained on the page."""
    asked = config(f'{BASE}samples = 2\nkeep = ["visibility"]\n')
    outcome = run_trial(asked)
    record = outcome.record
    scene = views.of(asked, lambda _: UniformShadowMap(64)).scene
    view = scene.view("angle").resized(40, 32)
    bench = bench_of(scene, view, RunOptions(light="point"), 2)
    images: dict[int, np.ndarray] = {}
    [twin] = bench.try_all([UniformShadowMap(64)], 1, warm_ups=0, images=images)
    assert record["error"] == twin.error and record["predicted_px"] is None
    assert np.array_equal(outcome.arrays["visibility"], images[0].reshape(32, 40))
    assert bench.error(images[0]) == twin.error
    for name in ("bytes", "texels", "rays", "nodes", "status", "family", "view", "samples"):
        assert record[name] == getattr(twin, name)
    assert record["edge_length_px"] == bench.edge_length > 0
    assert record["triangles"] == 50 and record["size"] == [40, 32]
    assert record["settings"]["resolution"] == 64 and record["cost_model"] is None
    runs, seconds = record["runs_seconds"], record["seconds"]
    total = sum(runs[stage][0] for stage in seconds if stage in runs)
    assert seconds["total"] == pytest.approx(total)
    assert record["yardstick_ratio"] == pytest.approx(seconds["total"] / runs["yardstick"][0])
    assert first_unstorable(record) is None and json.loads(json.dumps(record)) == record
    page = (DOCS / "sweeps.md").read_text(encoding="utf-8").partition("The record of a trial")[2]
    assert all(f"`{name}`" in page for name in record)


@pytest.mark.mitsuba
def test_what_a_trial_leaves_is_ready_for_the_next(config, views, monkeypatch):
    """The scene is loaded once, a view cast once, and nothing compiled again."""
    made = {"scenes": 0, "views": 0}

    def counted(name, of):
        def call(*args, **named):
            made[name] += 1
            return of(*args, **named)

        return call

    monkeypatch.setattr(ready, "load_scene", counted("scenes", ready.load_scene))
    monkeypatch.setattr(ready, "bench_of", counted("views", ready.bench_of))
    first = run_trial(config(BASE)).record
    again = run_trial(config(BASE)).record
    assert made == {"scenes": 1, "views": 1}
    assert again["functions_traced"] == 0 and again["error"] == first["error"]
    turned = run_trial(config(f"{BASE}light_angle_deg = 60\n")).record
    assert made == {"scenes": 1, "views": 2}
    assert turned["light"] == first["light"] and turned["error"] != first["error"]


@pytest.mark.mitsuba
def test_a_parallel_light_stands_where_the_angle_says(config, views):
    """As `asmjax analyze` turns it."""
    asked = config(f"{BASE}light_angle_deg = 60\n")
    found = views.of(asked, lambda _: UniformShadowMap(64))
    light = found.scene.light(None)
    camera = found.bench.eyes[0].camera
    assert light == parallel_light("point", camera, 60.0)
    along = np.dot(light.direction, camera.rotation[2])
    assert along == pytest.approx(0.5) and not found.bench.frame.perspective


@pytest.mark.mitsuba
def test_a_scene_that_changed_is_not_taken_for_the_one_that_was_read(config, views, tmp_path):
    """A row of the results is of the scene that its key names; a missing view is told."""
    path = text_scene(tmp_path, scene_xml(BALL))
    text = BASE.replace('"letter_f"', '"scene.xml"')
    asked = config(text)
    with pytest.raises(UseError, match="unknown view .*'nowhere'"):
        run_trial({**asked, "view": "nowhere"})
    path.write_text(scene_xml(BALL, "<!-- another -->"))
    trial._READY = ReadyViews()
    with pytest.raises(UseError, match="scene.xml' has changed since the sweep was read"):
        run_trial(asked)


@pytest.mark.mitsuba
def test_costs_are_what_the_file_says(config, views):
    """Of an adaptive map, and of one that is filtered; nothing is calibrated then."""
    model = CostModel(2e-8, 1e-4, 0.0)
    found = views.of(config(BASE), lambda _: UniformShadowMap(64))
    for family, settings in (("adaptive", ""), ("filtered", 'inner.algorithm = "adaptive"')):
        asked = config(
            f'[trial]\ncost_model = [2e-8, 1e-4]\nalgorithm = "{family}"\n'
            f"[trial.settings]\n{settings}"
        )
        algorithm = trial._with_costs(algorithm_for(asked, 1), found, asked)
        inner = algorithm.inner if isinstance(algorithm, FilteredShadowMap) else algorithm
        assert inner == AdaptiveShadowMap(cost_model=model)
        assert trial._costs_of(algorithm) == model
        assert trial._costs_of(UniformShadowMap()) is None


@pytest.mark.slow
@pytest.mark.mitsuba
def test_adaptive_trials_are_the_same_each_time(config, views):
    """With a given cost model all but times; in the record is what the map decided by."""
    asked = config(
        '[trial]\nscene = "letter_f"\nsize = [64, 64]\nmemory_mb = 0.5\ncost_model = [2e-8, 1e-4]\n'
    )
    first, second = run_trial(asked).record, run_trial(asked).record
    assert first["cost_model"] == [2e-8, 1e-4] and first["nodes"] > 0
    timed = {"seconds", "runs_seconds", "yardstick_seconds", "yardstick_ratio", "wall_seconds",
             "prepared_seconds", "functions_traced"}  # fmt: skip
    assert {k: v for k, v in first.items() if k not in timed} == {
        k: v for k, v in second.items() if k not in timed
    }
    assert second["functions_traced"] == 0


def test_what_was_used_longest_ago_is_let_go():
    """Within so many bytes; one that is larger stays alone."""
    recent: Recent[str, str] = Recent()
    made: list[str] = []

    def get(key: str, size: int) -> str:
        def make() -> tuple[str, int]:
            made.append(key)
            return key.upper(), size

        return recent.get(key, make, 10)

    assert [get(key, 4) for key in "abab"] == ["A", "B", "A", "B"] and made == ["a", "b"]
    get("a", 4)
    get("c", 4)
    assert recent.keys == ["a", "c"]
    get("d", 99)
    assert recent.keys == ["d"]
    get("a", 4)
    assert recent.keys == ["a"] and made == ["a", "b", "c", "d", "a"]
    recent.drop("a")
    recent.drop("a")
    assert recent.keys == []


def test_what_stays_keeps_to_a_part_of_what_may_be_held(config):
    """Two gigabytes of scenes where nobody says less, a quarter of it where that is less."""
    free, held = Limit(None, 0, ""), Limit(2**30, 2**29, "")
    assert ReadyViews(lambda: free)._most(ready.SCENE_BYTES, ready.SCENE_PART) == 2 * 2**30
    assert ReadyViews(lambda: held)._most(ready.SCENE_BYTES, ready.SCENE_PART) == 2**28


@pytest.mark.mitsuba
def test_a_trial_keeps_to_its_share(config, views):
    """What would take more is refused by what the process may hold, not by what the machine has."""
    share = Share(machine.process_bytes() + 2**20, "a share of each of 9 workers")
    with pytest.raises(MemoryShort, match="allowed are .* MB in all .a share of each of 9 workers"):
        run_trial(config(BASE), share)


def test_a_share_is_a_part_of_what_is_free_or_what_was_asked_for(monkeypatch):
    monkeypatch.setattr(machine, "free_memory_bytes", lambda: 10 * 2**30)
    monkeypatch.setattr(machine, "process_bytes", lambda: 2**30)
    found = share_of(4, None)
    assert found is not None and found.bytes == 2 * 2**30
    assert found.reason.endswith("each of 4 workers; fewer --workers have more each")
    assert share_of(4, 100.0) == share_of(0, 100.0) == Share(100 * 2**20, "--max-memory")
    assert share_of(0, None) is None
    limit = found.limit()
    assert limit.bytes == found.bytes and limit.held == 2**30


@pytest.mark.mitsuba
def test_views_go_with_their_scene(config):
    """A view holds the whole scene, so that keeping it would keep both."""
    views = ReadyViews(scene_bytes=1)
    first = config(BASE)
    for asked in (first, replace_scene(first), first):
        views.of(asked, lambda _: UniformShadowMap(64))
        assert len(views._scenes.keys) == len(views._views.keys) == 1


def replace_scene(config: dict) -> dict:
    """The same of another scene, which has its first view and light."""
    return {**config, "scene": "a1_square", "content": "another", "view": None, "light": None}
