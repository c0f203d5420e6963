"""Trials on a bench: what they hold is what was measured, in turns, once, and little at a time."""

import gc
import json
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar

import jax
import numpy as np
import pytest
from helpers.registry import FAST
from helpers.traced_cases import traced_case

from asmjax.buffers import EyeBuffer
from asmjax.errors import UseError
from asmjax.experiment import bench as bench_module
from asmjax.experiment import measure
from asmjax.experiment.aliasing import aliasing_maps
from asmjax.experiment.bench import RAYS, Bench
from asmjax.experiment.displacement import displacement
from asmjax.experiment.ledger import Ledger
from asmjax.experiment.methods import pixel_mean
from asmjax.experiment.trial import STAGES, trial_of
from asmjax.metrics import boundary_edges, boundary_length, error_summary, surface_pairs
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.shadow import (
    ALGORITHMS,
    AdaptiveShadowMap,
    CostModel,
    LogarithmicShadowMap,
    MapMemory,
    ShadowAlgorithm,
    Status,
    UniformShadowMap,
    family_of,
)

SIDE = 48
"""Pixels a side."""

FACTS = {"scene": "a disc", "machine": "of a test"}


@dataclass
class Clock:
    """A clock of a machine on which everything takes `slowness` times as long."""

    now: float = 0.0
    slowness: Callable[[], float] = lambda: 1.0

    def pass_time(self, seconds: float) -> None:
        self.now += seconds * self.slowness()


CLOCK = Clock()


@dataclass
class Exact:
    """Shadow rays whose answer is known; each call is noted in `log` and takes 0.5 s by `CLOCK`."""

    visible: np.ndarray
    count: int
    log: list[str] = field(default_factory=list)

    def trace(self) -> np.ndarray:
        self.log.append(RAYS)
        CLOCK.pass_time(0.5)
        return self.visible


class Held:
    """A state that can be watched: it counts as kept as long as anyone refers to it."""

    def __init__(self, algorithm: UniformShadowMap, state):
        self.algorithm, self.state = algorithm, state


class Varying(ShadowAlgorithm[Held]):
    """Uniform maps of another resolution in each build: what a time limit makes of a map.

    By `CLOCK` it builds in 2 s and is queried in 1 s.
    """

    label: str = "varying"

    reference: ClassVar[str] = "this file"
    sizes: ClassVar[tuple[int, ...]] = (16,)
    log: ClassVar[list[str]] = []
    alive: ClassVar[list[weakref.ref]] = []
    most_alive: ClassVar[int] = 0

    @property
    def name(self) -> str:
        return self.label

    def build(self, view, frame, rays) -> Held:
        cls = type(self)
        algorithm = UniformShadowMap(self.sizes[cls.log.count(self.label) % len(self.sizes)])
        cls.log.append(self.label)
        held = Held(algorithm, algorithm.build(view, frame, rays))
        cls.alive = [one for one in cls.alive if one() is not None] + [weakref.ref(held)]
        cls.most_alive = max(cls.most_alive, len(cls.alive))
        return held

    def visibility(self, state: Held, points):
        CLOCK.pass_time(1.0)
        return state.algorithm.visibility(state.state, points)

    def around(self, state: Held, points):
        raise NotImplementedError

    def density(self, state: Held, points):
        return state.algorithm.density(state.state, points)

    def cost(self, state: Held):
        seconds = {"build": 2.0 * CLOCK.slowness(), "analysis": 0.0}
        return replace(state.algorithm.cost(state.state), seconds=seconds)

    def memory(self, faces: int) -> MapMemory:
        return UniformShadowMap(max(self.sizes)).memory(faces)

    def status(self, state: Held) -> Status:
        return Status.TIME_LIMIT

    def effective_resolution(self, state: Held) -> int:
        return state.algorithm.resolution

    def update(self, state, view, frame, rays, moved=None) -> Held:
        raise NotImplementedError

    def warm_up(self, state, view, frame) -> None:
        pass

    def program(self, frame) -> str:
        return "varying"

    def rehearse(self, view, frame, rays) -> Held:
        return self.build(view, frame, rays)

    def copied(self, state: Held) -> Held:
        raise NotImplementedError


@pytest.fixture
def varying(monkeypatch):
    """`Varying` in the registry, its log fresh, and `CLOCK` the one that times go by."""
    for name in ("log", "alive"):
        monkeypatch.setattr(Varying, name, [])
    monkeypatch.setattr(Varying, "most_alive", 0)
    monkeypatch.setattr(CLOCK, "slowness", lambda: 1.0)
    monkeypatch.setitem(ALGORITHMS, "varying", Varying)
    monkeypatch.setattr("asmjax.experiment.clock.time.perf_counter", lambda: CLOCK.now)
    return Varying


def disc_bench(samples: int = 1, log: list[str] | None = None) -> Bench:
    """A disc over a plane, with exact shadow rays; further samples are those of an eye that stands
    a little aside."""
    spec = ANALYTIC_SCENES["a4_disc_light"]().spec
    view = next(iter(spec.views.values())).resized(SIDE, SIDE)
    light = next(iter(spec.lights.values()))
    x, y, z = view.origin
    views = [replace(view, origin=(x + 0.01 * k, y, z)) for k in range(samples)]
    first = traced_case(spec.shapes, view, light)
    cases = [traced_case(spec.shapes, one, light, first.frame) for one in views]
    log = [] if log is None else log
    return Bench(
        view="above",
        facts=FACTS,
        eyes=[case.eye for case in cases],
        frame=first.frame,
        rays=first.rays,
        traced=[Exact(case.expected > 0.5, int(case.judged.sum()), log) for case in cases],
    )


@pytest.fixture(scope="module")
def bench() -> Bench:
    return disc_bench()


def ready(bench: Bench, varying) -> Bench:
    """The bench, with its truth known and what it tries once compiled, as if nothing had run."""
    bench.try_all([varying()], 1)
    varying.log.clear()
    return bench


ADAPTIVE = AdaptiveShadowMap(memory_bytes=2**19, node_resolution=8, cost_model=FAST)
KINDS = [UniformShadowMap(64), LogarithmicShadowMap(64), ADAPTIVE]
"""One map, a warped one with a setting that has no end, and a tree."""


def error_of(bench: Bench, visibility: np.ndarray) -> dict:
    """The errors from the images alone."""
    eye: EyeBuffer = bench.eyes[0]
    pairs = surface_pairs(eye.valid.reshape(eye.size), eye.depth.reshape(eye.size))
    truth = pixel_mean([rays.trace() for rays in bench.traced], bench.eyes)
    images = (image.reshape(eye.size) for image in (truth, visibility, eye.valid))
    return error_summary(*images, pairs=pairs)


@pytest.mark.parametrize("samples", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_trial_holds_what_measuring_alone_gives(samples, tmp_path):
    """Errors, memory, texels, rays and status of each kind of map; through a file and back."""
    bench = disc_bench(samples)
    path = tmp_path / "m.jsonl"
    trials = bench.try_all(KINDS, rounds=2, ledger=Ledger(path))
    assert bench.try_all(KINDS, 2, Ledger(path)) == trials
    for algorithm, trial in zip(KINDS, trials, strict=True):
        alone = measure(algorithm, bench.eyes, bench.frame, bench.rays, 1)
        assert trial.error == error_of(bench, alone.visibility)
        assert trial.error["misclassified_fraction"] == trial.wrong
        cost = alone.cost
        assert (trial.bytes, trial.texels, trial.rays) == (cost.bytes, cost.texels, cost.rays)
        assert trial.nodes == (cost.nodes.held if cost.nodes else None)
        assert (trial.name, trial.settings, trial.samples) == (alone.name, alone.settings, samples)
        assert (trial.family, trial.view) == (family_of(algorithm), "above")
        assert trial.status == "complete"
        assert all(len(trial.seconds[stage]) == 2 for stage in STAGES)
        assert trial.total.runs == trial.ratio.runs == len(trial.yardstick) == 2
        assert min(trial.totals) > 0
        assert trial.total.value == pytest.approx(
            np.median(np.sum(list(trial.seconds.values()), axis=0))
        )
        assert trial.predicted_px is None
        # Of plain values alone.
        assert trial_of(json.loads(json.dumps(trial.record()))) == trial
    assert trials[2].edge_px < trials[0].edge_px / 4


def test_the_prediction_is_that_of_the_state(bench):
    """M4 of the map that was built, and near what was measured."""
    algorithm = UniformShadowMap(64)
    (trial,) = bench.try_all([algorithm], 1, predicted=True)
    state = algorithm.build(bench.eyes[0], bench.frame, bench.rays)
    maps = aliasing_maps(algorithm, state, bench.eyes[0], bench.frame)
    truth = bench.traced[0].trace()
    expected = displacement(truth, truth, bench.eyes[0], maps).predicted
    assert trial.predicted_px == expected == pytest.approx(trial.edge_px, rel=0.5)


def test_errors_are_per_pixel_of_the_edge_of_truth(bench):
    """M2 times the edge's length is M1 times the pixels that count; the edge is a circle's."""
    (trial,) = bench.try_all([UniformShadowMap(64)], 1)
    pixels = bench.eyes[0].valid.sum()
    assert trial.edge_px * bench.edge_length == pytest.approx(trial.wrong * pixels)
    assert trial.p95_px == trial.error["boundary_displacement_px"]["p95"]
    eye = bench.eyes[0]
    pairs = surface_pairs(eye.valid.reshape(eye.size), eye.depth.reshape(eye.size))
    edges = boundary_edges(bench.truth.reshape(eye.size), pairs)
    assert bench.edge_length == boundary_length(edges)


def test_algorithms_and_yardstick_take_turns(varying):
    """Forwards, backwards, forwards, the yardstick with them; and truth is found but once."""
    bench = ready(disc_bench(log=varying.log), varying)
    bench.try_all([varying(label) for label in ("a", "b")], rounds=2)
    turn = [RAYS, "a", "b"]
    assert varying.log == [*turn, *turn[::-1], *turn]


def test_seconds_are_by_stage_and_ratios_by_turn(varying, monkeypatch):
    """On a machine that takes once more as long in each further turn, ratios are those of a calm
    one, (2 + 1 s) / 0.5 s, without any spread."""
    bench = ready(disc_bench(log=varying.log), varying)
    monkeypatch.setattr(CLOCK, "slowness", lambda: max(map(varying.log.count, ("a", RAYS))))
    (trial,) = bench.try_all([varying("a")], 3)
    assert trial.seconds == {
        "build": [4.0, 6.0, 8.0], "analysis": [0.0] * 3, "query": [2.0, 3.0, 4.0]
    }  # fmt: skip
    assert trial.yardstick == [1.0, 1.5, 2.0]
    assert (trial.total.value, trial.total.low, trial.total.high) == (9.0, 6.0, 12.0)
    assert (trial.ratio.value, trial.ratio.low, trial.ratio.high) == (6.0, 6.0, 6.0)


def test_what_a_time_limit_ends_is_judged_run_by_run(varying, bench, monkeypatch):
    """Errors and predictions are means over the runs that count, of maps that differ; the memory is
    that of the last. The warm-up, by far the coarsest, does not count."""
    sizes = (16, 64, 32, 64)
    ready(bench, varying)
    monkeypatch.setattr(varying, "sizes", sizes)
    (trial,) = bench.try_all([varying()], 3, predicted=True)
    alone = bench.try_all([UniformShadowMap(size) for size in sizes[1:]], 1, predicted=True)
    for name in ("misclassified_fraction", "false_lit_fraction", "false_dark_fraction"):
        assert trial.error[name] == pytest.approx(np.mean([one.error[name] for one in alone]))
    assert trial.edge_px == pytest.approx(np.mean([one.edge_px for one in alone]))
    assert trial.predicted_px == pytest.approx(np.mean([one.predicted_px for one in alone]))
    assert len({one.edge_px for one in alone}) == 2
    assert (trial.texels, trial.status) == (64**2, "time_limit")


def test_what_runs_the_same_code_is_rehearsed_once(varying, monkeypatch):
    """Before its first turn, and not counted: a time limit would end a build that compiles."""
    monkeypatch.setattr(bench_module, "_REHEARSED", set())
    bench = disc_bench(log=varying.log)
    for again in range(2):
        varying.log.clear()
        trials = bench.try_all([varying("a"), varying("b")], 2, warm_ups=0)
        assert [trial.total.runs for trial in trials] == [2, 2]
        assert [varying.log.count(label) for label in ("a", "b")] == [3 - again, 2]


def test_other_lights_are_rehearsed_where_they_run_other_code(varying, monkeypatch):
    """Arrays of another precision, but not other places and cones: arrays of the same."""
    monkeypatch.setattr(bench_module, "_REHEARSED", set())
    bench = disc_bench(log=varying.log)
    frame = bench.frame
    for one, builds in (
        (frame, 2),
        (replace(frame, origin=frame.origin + 1e-6), 1),
        (replace(frame, cos_cutoff=-0.5), 1),
        (replace(frame, origin=frame.origin.astype(np.float32)), 2),
    ):
        varying.log.clear()
        replace(bench, frame=one).try_all([varying("a")], 1, warm_ups=0)
        assert varying.log.count("a") == builds


def test_the_same_image_is_judged_once(varying, bench, monkeypatch):
    ready(bench, varying)
    judged = []
    error_of = Bench.error
    monkeypatch.setattr(Bench, "error", lambda *a: judged.append(1) or error_of(*a))
    bench.try_all([varying()], 4)
    assert len(varying.log) - varying.log.count(RAYS) == 5
    assert len(judged) == 1


def test_no_state_is_kept_beyond_its_turn(varying, bench):
    """Of five maps in three turns each, one at a time is in memory and none in the end: freed at
    once, not when garbage is collected."""
    ready(bench, varying)
    gc.collect()
    gc.disable()
    try:
        bench.try_all([varying(f"map {k}") for k in range(5)], 3)
    finally:
        gc.enable()
    assert varying.most_alive == 1
    assert len(varying.log) > 15 and all(one() is None for one in varying.alive)


@pytest.mark.parametrize("algorithm", KINDS, ids=lambda one: one.name)
def test_the_arrays_of_a_state_go_with_it(algorithm, bench):
    """Nothing in a state refers back to it."""
    state = algorithm.build(bench.eyes[0], bench.frame, bench.rays)
    arrays = [weakref.ref(leaf) for leaf in jax.tree.leaves(state) if isinstance(leaf, jax.Array)]
    gc.disable()
    try:
        del state
        assert arrays and all(array() is None for array in arrays)
    finally:
        gc.enable()


def test_what_the_ledger_knows_is_not_measured_again(varying, tmp_path):
    """No build, no ray; only what is new is, beside a yardstick of its own turns."""
    bench = ready(disc_bench(log=varying.log), varying)
    ledger = Ledger(tmp_path / "m.jsonl")
    first = bench.try_all([varying("a"), varying("b")], 2, ledger)
    rays = bench.shadow_rays(2, ledger)
    assert (ledger.taken, ledger.added) == (0, 3)
    varying.log.clear()
    again = Ledger(tmp_path / "m.jsonl")
    assert bench.try_all([varying("b"), varying("a")], 2, again) == first[::-1]
    assert bench.shadow_rays(2, again) == rays
    assert varying.log == []
    assert (again.taken, again.added) == (3, 0)
    more = bench.try_all([varying("a"), varying("c"), varying("b")], 2, again)
    assert [more[0], more[2]] == first
    assert more[1].name == "c"
    assert varying.log == [RAYS, "c", "c", RAYS, RAYS, "c"]
    assert (again.taken, again.added) == (5, 1)


def test_a_key_says_all_that_a_trial_depends_on(bench):
    """Settings, rounds, prediction, facts and what the cost model says; not when it was measured:
    a restart finds the calibration of the run before."""
    adaptive = replace(ADAPTIVE, cost_model=CostModel(1e-8, 1e-4, 0.1, measured_at="now"))
    keys = [
        bench.key(adaptive, 3, False),
        bench.key(adaptive, 2, False),
        bench.key(adaptive, 3, True),
        bench.key(replace(adaptive, discontinuity=0.1), 3, False),
        bench.key(replace(adaptive, cost_model=CostModel(2e-8, 1e-4, 0.1)), 3, False),
        bench.key(replace(adaptive, cost_model=CostModel(1e-8, 2e-4, 0.1)), 3, False),
        bench.key(replace(adaptive, cost_model=None), 3, False),
        replace(bench, facts={**FACTS, "machine": "another"}).key(adaptive, 3, False),
        bench.key(UniformShadowMap(64), 3, False),
        bench.key(UniformShadowMap(64, compare="both"), 3, False),
        bench.key(LogarithmicShadowMap(64), 3, False),
    ]
    ledger = Ledger()
    for number, key in enumerate(keys):
        assert ledger.get(key) is None, number
        ledger.add(key, {"number": number})
    kept = CostModel(1e-8, 1e-4, 0.2, False, "yesterday", kept=True)
    found = ledger.get(bench.key(replace(adaptive, cost_model=kept), 3, False))
    assert found == {"number": 0}


def test_the_yardstick_is_tried_like_an_algorithm(varying):
    """A ray for each sample: exact, without memory, and once as long as itself."""
    bench = disc_bench(samples=2)
    rays = bench.shadow_rays(3)
    assert rays.seconds == {"build": [0.0] * 3, "analysis": [0.0] * 3, "query": [1.0] * 3}
    assert (rays.ratio.low, rays.ratio.high) == (1.0, 1.0)
    assert (rays.wrong, rays.edge_px, rays.p95_px, rays.bytes) == (0.0, 0.0, 0.0, 0)
    assert rays.rays == sum(one.count for one in bench.traced)
    assert (rays.name, rays.family, rays.predicted_px) == ("rays-2", RAYS, None)


def test_nothing_to_try_takes_no_time(varying):
    bench = disc_bench(log=varying.log)
    assert bench.try_all([], 3) == []
    assert varying.log == []


def test_what_cannot_be_built_says_why(bench):
    """And the other one of the same turns is not written as if it had been measured."""
    ledger = Ledger()
    small = AdaptiveShadowMap(memory_bytes=100, cost_model=FAST)
    with pytest.raises(UseError, match="memory"):
        bench.try_all([UniformShadowMap(64), small], 1, ledger)
    assert len(ledger) == 0
