"""Frames measured in turn: what each costs alone, what is kept, and what motion does."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case

from asmjax.experiment.walkthrough import FrameInput, FrameResult, Walkthrough
from asmjax.report.walk_record import WalkRecord, WalkSetting, summary_of
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import kept_light_frame, light_frame
from asmjax.scene.spec import Rectangle
from asmjax.shadow import AdaptiveShadowMap, CostModel

SIDE = 48
MODEL = CostModel(1e-8, 1e-5, 0.0)
ADAPTIVE = AdaptiveShadowMap(memory_bytes=2**18, pixel_share=1, cost_model=MODEL)
"""Its looks take every pixel, so that one size of them is compiled."""


@dataclass
class Traced:
    """Shadow rays against analytic shapes; a stand-in for the renderer's."""

    lit: np.ndarray
    count: int

    def trace(self):
        return self.lit


def frame_input(number: int, shift=0.0, light=None, shapes=None, kept=None, moved=None):
    """A frame of the square above a plane, its eye moved aside by `shift`."""
    case = analytic_case("a1_square", SIDE)
    shapes, light = shapes or case.shapes, light or case.light
    origin = tuple(np.add(case.view.origin, (shift, 0.0, 0.0)))
    view = replace(case.view, origin=origin)
    eye, bounds, rays = analytic_eye(shapes, view), scene_bounds(shapes), AnalyticRays(shapes)
    fitted = light_frame(light, eye, bounds)
    to_light = np.asarray(light.position)[:, None] - eye.world
    start = eye.world + 1e-6 * eye.normal
    lit = ~rays.occluded(np.where(eye.valid, start, 0.0), np.nan_to_num(to_light), 1.0)
    lit &= eye.valid & (np.einsum("in,in->n", eye.normal, np.nan_to_num(to_light)) > 0)
    return FrameInput(
        number=number,
        view=view,
        light=light,
        eyes=[eye],
        eye_seconds=0.01,
        fitted=fitted,
        kept=kept_light_frame(kept, light, eye, bounds),
        refitted=False,
        rays=rays,
        shadow_rays=[Traced(lit, lit.size)],
        moved=moved,
    )


def walk_through(frames: Sequence[FrameInput], record=None) -> list[FrameResult]:
    walk, results = Walkthrough(ADAPTIVE, repeats=1), []
    for frame in frames:
        results.append(walk.measure(frame))
        if record is not None:
            # Here, as the next frame takes the states over.
            record.add(results[-1])
    return results


@pytest.fixture(scope="module")
def recorded() -> tuple[list[FrameResult], WalkRecord]:
    """Three frames: twice the same, then a step aside."""
    first = frame_input(0)
    frames = [first, replace(first, number=1), frame_input(2, shift=0.02, kept=first.kept)]
    record = WalkRecord(setting())
    return walk_through(frames, record), record


@pytest.fixture(scope="module")
def resting(recorded) -> list[FrameResult]:
    return recorded[0]


def test_what_may_rest_costs_no_rays(resting):
    """The kept uniform map casts once; the other every time; the tree less and less: the first
    update at rest spends what memory the edges left."""
    anew, kept, tree, _ = ([r.methods[i].cost.rays for r in resting] for i in range(4))
    assert anew[0] == anew[1] == anew[2] > 0
    assert kept[0] > 0 and kept[1:] == [0, 0]
    assert tree[1] < tree[0] / 2 and tree[2] < tree[0] / 10


def test_a_kept_map_answers_as_one_drawn_anew_for_the_same_light_frame():
    """On one light frame, keeping changes nothing but the time."""
    first = frame_input(0)
    same = [replace(first, fitted=first.kept), replace(first, number=1, fitted=first.kept)]
    _, again = walk_through(same)
    np.testing.assert_array_equal(again.methods[0].visibility, again.methods[1].visibility)
    assert again.methods[1].cost.rays == 0
    assert again.methods[1].cost.seconds["build"] == 0


def test_methods_come_in_order_and_truth_is_right(resting):
    for result in resting:
        kinds = [method.name.split("-")[0] for method in result.methods]
        assert kinds == ["uniform", "uniform", "adaptive", "rays"]
        assert result.methods[1].name == f"{result.methods[0].name}-kept"
        assert result.adaptive.name.startswith("adaptive")
        wrong = [(m.visibility != result.truth.visibility).mean() for m in result.methods]
        assert wrong[3] == 0
        assert max(wrong) < 0.01


def test_times_are_of_the_frame_alone(resting):
    """Stages are not negative and fit into the total, which is this frame's wall time."""
    for result in resting:
        for method in result.methods:
            stages = dict(method.cost.seconds)
            total = stages.pop("total")
            assert set(stages) == {"build", "analysis", "query", "id_pass"}
            assert min(stages.values()) >= 0
            assert sum(stages.values()) <= total + 1e-9
    assert resting[0].methods[0].cost.seconds["id_pass"] == 0
    assert resting[0].adaptive.cost.seconds["id_pass"] > 0


@pytest.mark.slow
def test_a_moving_light_lets_nothing_rest():
    """Truth changes with it, both uniform maps are drawn, and the tree answers for the new one."""
    first = frame_input(0)
    assert first.light.position is not None
    x, y, z = first.light.position
    light = replace(first.light, position=(x + 0.2, y, z))
    second = frame_input(1, light=light, kept=first.kept)
    was, now = walk_through([first, second])
    assert (was.truth.visibility != now.truth.visibility).any()
    assert now.methods[1].cost.rays == now.methods[0].cost.rays
    assert now.adaptive.cost.rays > 0
    assert (now.adaptive.visibility != now.truth.visibility).mean() < 0.02


@pytest.mark.slow
def test_a_moving_object_is_told_by_its_boxes():
    """Truth and maps change where the caster was and is."""
    case = analytic_case("a1_square", SIDE)
    caster = case.shapes[1]
    assert isinstance(caster, Rectangle)
    aside = replace(caster, centre=tuple(np.add(caster.centre, (0.15, 0.0, 0.0))))
    boxes = np.stack([scene_bounds([caster]), scene_bounds([aside])])
    first = frame_input(0)
    second = frame_input(1, shapes=(case.shapes[0], aside), kept=first.kept, moved=boxes)
    was, now = walk_through([first, second])
    assert (was.truth.visibility != now.truth.visibility).any()
    assert now.methods[1].cost.rays > 0
    for method in now.methods:
        assert (method.visibility != now.truth.visibility).mean() < 0.05


@pytest.mark.slow
def test_warming_up_leaves_no_trace():
    """Frame 0 builds from nothing, whatever was measured to warm up."""
    walk = Walkthrough(ADAPTIVE, repeats=1)
    first = frame_input(0)
    walk.warm_up([first, frame_input(1, shift=0.02, kept=first.kept)])
    again = walk.measure(first)
    fresh = walk_through([first])[0]
    assert again.adaptive.cost.rays == fresh.adaptive.cost.rays
    assert again.methods[1].cost.rays > 0


def setting(frames=3) -> WalkSetting:
    return WalkSetting(
        scene="a1_square",
        variant="none",
        notices=("a notice",),
        view="aside",
        motion="camera",
        frames=frames,
        adaptive=ADAPTIVE,
        cost_model=MODEL,
        seed=0,
    )


def test_the_record_of_frames_is_a_valid_report(recorded):
    """One entry per frame with the keys of a single run, and medians over the warm ones."""
    report = recorded[1].report()
    assert [frame["frame"] for frame in report["frames"]] == [0, 1, 2]
    assert report["summary"]["first_frame"] == 1
    assert report["summary"]["frames"] == 2
    for frame in report["frames"]:
        tree = frame["methods"][2]
        assert {"nodes", "passes", "max_level", "status", "nodes_made"} <= set(tree)
        assert frame["methods"][0]["seconds"]["id_pass"] == 0
    assert report["frames"][0]["methods"][2]["nodes_reused"] == 0
    assert report["frames"][1]["methods"][2]["nodes_reused"] > 0
    assert report["notices"][0] == "a notice"


def test_ratios_are_formed_in_each_frame():
    """The median of ratios, not the ratio of medians; frames without an error are left out."""

    def method(name, total, wrong):
        return {
            "name": name,
            "seconds": {"query": total, "total": total},
            "effective_resolution": 4,
            "bytes": 1,
            "rays": 1,
            "error": {
                "misclassified_fraction": wrong,
                "boundary_displacement_px": {"mean": 0.0},
            },
        }

    def frame(number, tree, flat, wrong):
        return {
            "frame": number,
            "methods": [method("uniform-4", flat, wrong), method("adaptive-1MB", tree, 0.01)],
        }

    frames = [frame(0, 99.0, 1.0, 0.5), frame(1, 1.0, 2.0, 0.0), frame(2, 4.0, 1.0, 0.1)]
    flat, tree = summary_of([*frames, frame(3, 3.0, 3.0, 0.02)])["methods"]
    assert flat["time_ratio"] == 1.0
    assert flat["error_ratio"] == pytest.approx(0.3)
    assert flat["slowest_seconds"] == 3.0
    assert tree["time_ratio"] is None
    assert summary_of(frames[:1])["methods"][0]["time_ratio"] == 99.0


def test_ids_are_copied_to_the_device(resting):
    """What `id_pass` times: the host's ids, as an array of the device."""
    eye = resting[0].input.eyes[0]
    np.testing.assert_array_equal(jnp.array(eye.prim, copy=True), eye.prim)
