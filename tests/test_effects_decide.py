"""Plans: decisions flip at their thresholds in scenes known in closed form, and looking is free
where nothing has to be decided."""

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.plans import CountedRays, asked_about, on_image

from asmjax.effects import (
    Decision,
    LightNumbers,
    Outcome,
    Rates,
    decide_light,
    plan_lights,
    probe_size,
)
from asmjax.effects.convex import is_convex
from asmjax.effects.decide import (
    LEAST_UMBRA,
    MAP_TEXELS,
    NARROW,
    SUBPIXEL,
    VERY_LARGE_SR,
    WIDE,
)
from asmjax.effects.probe import light_paths
from asmjax.effects.widths import CLEAR, RAYS, TEXELS, _largest_gap
from asmjax.errors import UseError
from asmjax.experiment.traces import counted_traces
from asmjax.geometry import SUN_DEG, sphere_light, sun_light
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye
from asmjax.scene.analytic_scenes import (
    a1_square,
    a2_square_light,
    a5_half_plane,
    a6_sphere_sun,
    a7_sphere_light,
)
from asmjax.scene.closed_forms import half_plane_disc_visibility
from asmjax.scene.materials import (
    Surroundings,
    even_directions,
    even_surroundings,
    opaque_materials,
)
from asmjax.scene.soft_visibility import LightSamples
from asmjax.scene.spec import LightSpec, Mesh, ViewSpec

CLOSE = 0.05
"""How near to a threshold a decision must flip: relative."""

LAMP = LightNumbers(
    "lamp", "point", shape="disk", faces=1, fov_deg=60.0, shadowed=0.2, edge_px=2000.0,
    width_p50=8.0, width_p95=20.0, width_mean=9.0, umbra=0.5,
)  # fmt: skip


def wide(width: float, **more) -> LightNumbers:
    return replace(LAMP, width_p50=width / 2, width_p95=width, width_mean=width / 2, **more)


def the_decision(outcome: Outcome) -> Decision:
    (decision,) = outcome.decisions
    return decision


def of(numbers: LightNumbers, *args, **more) -> Decision:
    return the_decision(decide_light(numbers, *args, **more))


@pytest.mark.parametrize(
    ("threshold", "below", "above"),
    [
        (SUBPIXEL, ("hard", ("adaptive",)), ("hard", ("uniform", "filtered"))),
        (NARROW, ("hard", ("uniform", "filtered")), ("soft", ("pcss",))),
        (WIDE, ("soft", ("pcss",)), ("soft", ("accumulated",))),
    ],
)
def test_width_chooses_the_method(threshold, below, above):
    """Hard, filtered, one map with a filter, many maps; each says the width and the threshold."""
    for width, expected in ((0.99 * threshold, below), (1.01 * threshold, above)):
        decision = of(wide(width), 0.0)
        assert (decision.kind, decision.methods) == expected
        assert decision.quantity == "width of penumbrae, px" and decision.number == width
    assert of(wide(0.99 * threshold), 0.0).threshold == threshold


def test_error_of_hard_edges_is_about_a_quarter_of_the_penumbra():
    """Edges x width / (4 pixels) for straight ramps; for round lights the integral of A5 on either
    side of its edge; and what it flips at."""
    straight = 2000 * 9 / (4 * 512 * 512)
    assert replace(LAMP, shape="rectangle").soft_error == pytest.approx(straight)
    t = (np.arange(20_000) + 0.5) / 10_000 - 1
    off = float(np.abs(half_plane_disc_visibility(t) - (t > 0)).mean())
    error = 4 * off * straight
    assert LAMP.soft_error == pytest.approx(error, rel=1e-6)
    assert of(LAMP, 1.01 * error).kind == "hard"
    assert of(LAMP, 1.01 * error).quantity == "change by hard edges"
    assert of(LAMP, 0.99 * error).kind == "soft"
    assert replace(LAMP, contrast=0.5).soft_error == pytest.approx(error / 2)


def test_no_umbra_takes_many_maps():
    assert of(replace(LAMP, umbra=0.99 * LEAST_UMBRA)).methods == ("accumulated",)
    assert of(replace(LAMP, umbra=1.01 * LEAST_UMBRA)).methods == ("pcss",)
    assert "stays dark" in of(replace(LAMP, umbra=0.0)).reason


def test_samples_are_as_many_as_a_penumbra_has_pixels():
    """m x m samples, m = min(width, 1 / (2 error)): 1 / (2 m) is what they leave."""
    few = of(wide(5.5, umbra=0.0))
    assert few.samples == 36 and few.settings == {"samples": 6, "width_map": 0.0}
    assert few.sample_error == pytest.approx(1 / 12)
    many = of(wide(500.0))
    assert many.samples == 256 and many.sample_error == 1 / 32
    # The same texels, read once for each sample.
    assert few.rays == many.rays == MAP_TEXELS
    rates = Rates()
    assert many.seconds - few.seconds == pytest.approx((256 - 36) * LAMP.pixels * rates.tap)
    # 2048 texels a side: 32 of them are worth 6 samples.
    assert of(wide(500.0, width_map=1 / 64)).samples == 36
    assert many.seconds > of(LAMP).seconds > of(wide(0.5)).seconds > 0


def test_a_family_that_is_not_registered_is_not_simulated():
    """The next one is taken; where there is none the hard shadow is, and it is said."""
    outcome = decide_light(LAMP, available={"adaptive", "uniform", "moment"})
    assert the_decision(outcome).methods == ("moment",) and not outcome.not_simulated
    outcome = decide_light(LAMP, available={"adaptive", "uniform"})
    decision = the_decision(outcome)
    assert decision.methods == ("adaptive",) and not decision.simulated
    (missing,) = outcome.not_simulated
    assert missing.effect == "penumbra" and missing.error == LAMP.soft_error
    assert "pcss" in missing.reason
    outcome = decide_light(wide(3.0), available={"uniform"})
    assert the_decision(outcome).methods == ("uniform",)
    assert "filtered" in outcome.not_simulated[0].reason


@pytest.mark.parametrize(
    ("change", "effect", "said"),
    [
        ({"share": 1e-4}, "shadow", "below the tolerance"),
        ({"facing": 0.0}, "shadow", "nothing that the view sees"),
        ({"lone_convex": True}, "shadow", "one convex object"),
    ],
)
def test_lights_that_need_no_shadow(change, effect, said):
    outcome = decide_light(replace(LAMP, **change))
    decision = the_decision(outcome)
    assert decision.kind == "none" and decision.methods == () and decision.rays == 0
    assert outcome.skipped[0].effect == effect and said in outcome.skipped[0].reason


@pytest.mark.parametrize(
    ("kind", "said"), [("point", "a point"), ("spot", "cone"), ("directional", "parallel")]
)
def test_lights_without_size_are_hard_whatever_is_asked_for(kind, said):
    numbers = replace(LAMP, shape=None, kind=kind, fov_deg=None)
    for force in (None, "hard", "soft"):
        decision = of(numbers, force=force)
        assert decision.kind == "hard" and said in decision.reason
        assert decision.forced is (force == "hard")
        assert decision.reason.startswith("soft was asked for, but ") is (force == "soft")
        assert decision.error == pytest.approx(0.2)


def test_a_point_for_a_lamp_says_what_is_missing():
    """Hard, and its penumbrae not simulated; skipped where they would be below a pixel."""
    lamp = replace(LAMP, shape=None, point_for_lamp=True)
    outcome = decide_light(lamp)
    assert the_decision(outcome).kind == "hard" and not outcome.skipped
    (missing,) = outcome.not_simulated
    assert missing.effect == "penumbra" and missing.error == lamp.soft_error
    small = decide_light(replace(lamp, width_p95=0.5))
    assert not small.not_simulated and small.skipped[0].effect == "penumbra"


def test_force_overrides_the_numbers():
    outcome = decide_light(LAMP, force="hard")
    assert the_decision(outcome).kind == "hard" and the_decision(outcome).forced
    assert outcome.not_simulated[0].effect == "penumbra"
    for numbers in (wide(0.5), replace(LAMP, share=0.0, lone_convex=True)):
        decision = of(numbers, force="soft")
        assert decision.methods == ("pcss",) and decision.forced
    assert not of(LAMP, force="soft", available={"adaptive"}).forced
    assert of(LAMP, force="none").kind == "none" and of(LAMP, force="none").forced
    away = of(replace(LAMP, facing=0.0), force="soft")
    assert away.kind == "none" and not away.forced and away.reason.startswith("soft was asked for")


def test_what_passes_through_is_named():
    """Light through casters is a decision of its own that nobody simulates; a little is skipped."""
    outcome = decide_light(replace(LAMP, transmitted=0.01, refracted=0.02))
    shadow, through = outcome.decisions
    assert shadow.kind == "soft" and through.kind == "transmittance" and not through.simulated
    assert [item.effect for item in outcome.not_simulated] == ["transmittance", "refraction"]
    outcome = decide_light(replace(LAMP, transmitted=1e-5))
    assert [item.effect for item in outcome.skipped] == ["transmittance"]
    assert not outcome.not_simulated


def test_other_reasons():
    outcome = decide_light(replace(LAMP, faces=5, facing=0.75))
    assert the_decision(outcome).geometry == "5 of 6 cube faces"
    assert [item.effect for item in outcome.skipped] == ["cube faces", "pixels turned away"]
    for change, effect in (
        ({"solid_angle": 1.1 * VERY_LARGE_SR}, "very large light"),
        ({"spread": 0.5}, "textured light"),
        ({"spread": None}, "textured light"),
    ):
        numbers = replace(LAMP, **change)
        (missing,) = decide_light(numbers).not_simulated
        assert missing.effect == effect and 0 < missing.error <= LAMP.soft_error
        little = decide_light(numbers, 2 * missing.error)
        assert not little.not_simulated and effect in [item.effect for item in little.skipped]
    with pytest.raises(UseError, match="the tolerance is -1"):
        decide_light(LAMP, -1.0)
    decision = of(wide(0.5), rates=Rates(texel=1.0, tap=0.0))
    assert decision.seconds == MAP_TEXELS


def widths_of_a5(view: ViewSpec, light_half: float) -> np.ndarray:
    """Width in pixels of the penumbra across the edge x = 0 of A5: both of its rims through the
    camera, at right angles to the edge's image; over the part that is seen."""
    width = 2 * light_half * 2.0 / (5.0 - 2.0)
    y = np.linspace(-3, 3, 601)
    at = np.stack([np.zeros_like(y), y, np.zeros_like(y)])
    across = np.array([[width / 2], [0.0], [0.0]])
    edge = np.diff(on_image(view, at[:, [0, -1]]))[:, 0]
    normal = np.array([-edge[1], edge[0]]) / np.linalg.norm(edge)
    found = normal @ (on_image(view, at + across) - on_image(view, at - across))
    u, v = on_image(view, at)
    seen = (u > 0) & (u < view.width) & (v > 0) & (v < view.height)
    return np.abs(found[seen])


@pytest.mark.parametrize("threshold", [SUBPIXEL, NARROW, WIDE])
def test_a_growing_light_flips_where_its_penumbra_does(threshold):
    """A5, disk light: the radius at which the widest 5 % of the penumbra reach the threshold, in
    closed form, flips the decision to within 5 %."""
    view = next(iter(a5_half_plane().spec.views.values())).resized(512, 512)
    radius = threshold / float(np.percentile(widths_of_a5(view, 0.01), 95)) * 0.01
    kinds = []
    for light_half in (radius / (1 + CLOSE), radius * (1 + CLOSE)):
        scene = a5_half_plane(light_half)
        plan = plan_lights(asked_about(scene, [scene.soft_light()]), tolerance=0.0)
        (numbers,) = plan.numbers
        assert numbers.width_p95 == pytest.approx(
            np.percentile(widths_of_a5(view, light_half), 95), rel=CLOSE
        )
        assert numbers.width_p50 == pytest.approx(
            np.median(widths_of_a5(view, light_half)), rel=CLOSE
        )
        kinds.append(plan.decision("centre").methods)
    assert kinds[0] != kinds[1]
    assert plan_lights(asked_about(scene, [scene.soft_light()]), 0.0).record() == plan.record()


def test_the_error_of_hard_edges_flips_where_it_should():
    """A2: edges are the square's outline, which the view sees whole; mean width and length in
    closed form, edges x width / (4 pixels) at the tolerance."""
    scene = a2_square_light()
    view = next(iter(scene.spec.views.values())).resized(512, 512)
    edge = 1.0 * 5.0 / 3.0
    corners = edge * np.array([[-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], [0, 0, 0, 0, 0.0]])
    length = np.linalg.norm(np.diff(on_image(view, corners)), axis=0).sum()
    per_unit = length / (8 * edge)
    tolerance = 2e-3
    light_half = tolerance * 4 * 512**2 / length / per_unit * 3.0 / (2 * 2.0)
    for factor, kind in ((1 / (1 + CLOSE), "hard"), (1 + CLOSE, "soft")):
        scene = a2_square_light(light_half=factor * light_half)
        plan = plan_lights(asked_about(scene, [scene.soft_light()]), tolerance)
        assert plan.numbers[0].edge_px == pytest.approx(length, rel=0.04)
        decision = plan.decision("centre")
        assert (decision.kind == "soft" or "filtered" in decision.methods) is (kind == "soft")


def test_no_umbra_is_seen_where_the_light_hides_behind_nothing():
    """A2 from below its occluder: the umbra's half side (a H - s h) / (H - h) passes 0."""
    view = ViewSpec("below", (0.0, 0.0, 1.9), (0.0, 0.0, 0.0), (0, 1, 0), fov_x_deg=100.0)
    for half, some in ((2.5 / (1 + CLOSE), True), (2.5 * (1 + CLOSE), False)):
        scene = a2_square_light(light_half=half)
        asked = asked_about(scene, [scene.soft_light()], view=view)
        (numbers,) = plan_lights(asked).numbers
        assert (numbers.umbra >= LEAST_UMBRA) is some


def test_a_sun_is_as_wide_as_its_angle():
    """A6 under a sun: 2 tan(angle / 2) for each unit of gap, seen from straight above."""
    scene = a6_sphere_sun()
    direction = scene.spec.lights["sun"].direction
    assert direction is not None
    angle = math.radians(2.0)
    light = LightSpec("sun", "directional", direction=direction, area=sun_light(direction, angle))
    view = ViewSpec("above", (2.2, 0.0, 30.0), (2.2, 0.0, 0.0), (0, 1, 0), fov_x_deg=12.0)
    (numbers,) = plan_lights(asked_about(scene, [light], view=view)).numbers
    # The silhouette circle is 2 / cos above the floor along the light, through the centre.
    gap = 2.0 / -direction[2]
    pixels_a_unit = 256 / math.tan(math.radians(6.0)) / 30.0
    narrow = 2 * math.tan(angle / 2) * gap * pixels_a_unit
    assert numbers.shape == "sun" and numbers.fov_deg is None
    assert 0.9 * narrow < numbers.width_p50 < 1.1 * narrow / -direction[2]
    assert numbers.solid_angle == pytest.approx(math.pi * math.tan(angle / 2) ** 2)


def test_parallel_light_says_what_it_would_be_as_the_sun():
    """From the same rays: the widths of a light of the sun's angle; no note below the tolerance."""
    scene = a6_sphere_sun()
    (parallel,) = scene.spec.lights.values()
    assert parallel.direction is not None
    sun = replace(parallel, area=sun_light(parallel.direction, math.radians(SUN_DEG)))
    rays = CountedRays(AnalyticRays(scene.spec.shapes))
    hard = plan_lights(asked_about(scene, [parallel], rays=rays), 1e-4)
    assert rays.texels == 0 and rays.single < 4096
    soft = plan_lights(asked_about(scene, [sun]), 1e-4)
    for name in ("width_p50", "width_p95", "soft_error"):
        assert getattr(hard.numbers[0], name) == pytest.approx(getattr(soft.numbers[0], name))
    assert hard.decision("sun").width_p95 == 0 and hard.decision("sun").kind == "hard"
    (note,) = hard.notes
    assert "if it stands for the sun" in note and "note: 'sun' is parallel" in hard.explain()
    assert not any("the sun" in note for note in soft.notes)
    assert not plan_lights(asked_about(scene, [parallel]), 0.1).notes


@pytest.mark.parametrize("kind", ["lamp", "sun"])
def test_what_a_light_shines_on_is_what_soft_truth_asks_about(kind):
    """A sphere half below the floor's plane, and a sun that half sets: all that any part of it
    shines on counts, and the pixels in whose plane it stands are said."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    low = (1.0, 0.0, -0.01)
    sun = LightSpec("centre", "directional", direction=low, area=sun_light(low, math.radians(4)))
    ball = replace(lamp, position=(4.0, 0.0, -0.1), area=sphere_light((4.0, 0.0, -0.1), 0.5))
    asked = asked_about(scene, [sun if kind == "sun" else ball])
    frame = asked.lights[0].frame
    assert frame is not None
    samples = LightSamples(asked.eye, frame)
    plan = plan_lights(asked, 0.0)
    (numbers,) = plan.numbers
    assert numbers.facing == samples.pixels.size / asked.eye.valid.sum()
    floor = asked.eye.valid & (asked.eye.shape == 0)
    assert 0 < floor.sum() / asked.eye.valid.sum() <= numbers.straddled <= numbers.facing
    paths = light_paths(asked.eye, frame)
    assert (paths.facing <= paths.reached).all() and (paths.straddled <= paths.reached).all()


def test_a_sphere_light_has_the_width_of_its_disk():
    scene = a7_sphere_light()
    (numbers,) = plan_lights(asked_about(scene, [scene.soft_light()])).numbers
    assert numbers.shape == "sphere"
    assert numbers.solid_angle == pytest.approx(math.pi * 0.5**2 / 6**2, rel=0.2)
    assert numbers.width_p50 > 5


def test_a_pane_that_turns_transparent_flips_at_its_shadow():
    """A1: (1 - opacity) x the part of the picture that is in shadow, at the tolerance."""
    scene = a1_square()
    (view,) = scene.spec.views.values()
    eye = analytic_eye(scene.spec.shapes, view.resized(512, 512))
    floor = eye.shape == 0
    x, y = eye.world[0, floor], eye.world[1, floor]
    part = float((scene.hard_visibility(x, y) == 0).sum() / eye.valid.sum())
    tolerance = 5e-3
    light = list(scene.spec.lights.values())
    for factor, through in ((1 / (1 + CLOSE), False), (1 + CLOSE, True)):
        opaque = opaque_materials(2)
        passes = replace(opaque, straight=np.array([0.0, factor * tolerance / part]))
        plan = plan_lights(asked_about(scene, light, materials=passes), tolerance)
        kinds = [decision.kind for decision in plan.decisions]
        assert kinds == (["hard", "transmittance"] if through else ["hard"])
        assert any(item.effect == "transmittance" for item in plan.not_simulated) is through
        assert any(item.effect == "transmittance" for item in plan.skipped) is not through
        assert plan.lights == ("centre",)


def test_a_medium_dims_by_its_extinction():
    """A slab of two null surfaces with a medium between: exp(-extinction x thickness)."""
    upper, lower = a1_square(half=3.0, occluder_height=2.0), a1_square(half=3.0)
    floor, top = upper.spec.shapes
    low = replace(lower.spec.shapes[1], centre=(0.0, 0.0, 1.5), name="lower")
    scene = replace(upper, spec=replace(upper.spec, shapes=(floor, top, low)))
    view = ViewSpec("below", (0.0, 0.0, 1.4), (0.0, 0.0, 0.0), (0, 1, 0), fov_x_deg=10.0)
    slab = replace(
        opaque_materials(3),
        straight=np.array([0.0, 1.0, 1.0]),
        extinction=np.array([0.0, 2.0, 2.0]),
    )
    light = list(scene.spec.lights.values())
    (numbers,) = plan_lights(asked_about(scene, light, view=view, materials=slab)).numbers
    assert numbers.transmitted == pytest.approx(math.exp(-2.0 * 0.5), rel=5e-3)
    glass = replace(opaque_materials(3), refracts=np.array([False, True, True]))
    (numbers,) = plan_lights(asked_about(scene, light, view=view, materials=glass)).numbers
    assert numbers.transmitted == 0 and numbers.refracted == 1.0


def test_a_lamp_that_dims_flips_at_its_share():
    """Two lamps at one place: shares are those of their intensities, whatever the receiver."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    tolerance = 1e-3
    for factor, kind in ((1 / (1 + CLOSE), "none"), (1 + CLOSE, "hard")):
        dim = factor * tolerance / (1 - tolerance)
        lights = [replace(lamp, name="dim", intensity=dim), replace(lamp, name="main")]
        plan = plan_lights(asked_about(scene, lights), tolerance)
        assert [decision.light for decision in plan.decisions] == ["main", "dim"]
        assert plan.decision("dim").kind == kind
        assert plan.lights == (("main",) if kind == "none" else ("main", "dim"))
        assert plan.methods_for("dim") == (() if kind == "none" else ("adaptive",))
        assert plan.numbers[1].share == pytest.approx(dim / (1 + dim), rel=1e-6)


def test_a_light_that_is_asked_about_alone_has_no_larger_share():
    """Parts are of all lights; those that nobody asks about take no ray and no decision, and may be
    forced by name without harm."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    lights = [lamp, replace(lamp, name="dim", intensity=2e-4)]
    rays = CountedRays(AnalyticRays(scene.spec.shapes))
    alone = plan_lights(
        asked_about(scene, lights, chosen=["dim"], rays=rays), force={"centre": "soft"}
    )
    assert rays.all == 0 and alone.numbers == plan_lights(asked_about(scene, lights)).numbers[1:]
    assert alone.lights == () and "below the tolerance" in alone.decision("dim").reason


def test_shares_by_distance_and_angle():
    """A lamp elsewhere: I cos / d^2 of each, pixel by pixel, against the formula written out."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    other = replace(lamp, name="other", position=(6.0, 1.0, 3.0), intensity=0.5)
    asked = asked_about(scene, [lamp, other])
    plan = plan_lights(asked)
    found = {numbers.name: numbers.share for numbers in plan.numbers}
    brought = []
    for light in (lamp, other):
        assert light.position is not None
        away = np.array(light.position)[:, None] - asked.eye.world
        cosine = np.einsum("in,in->n", asked.eye.normal, away)
        brought.append(light.intensity * np.maximum(cosine, 0) / np.linalg.norm(away, axis=0) ** 3)
    assert found["other"] == pytest.approx(np.mean(brought[1] / (brought[0] + brought[1])))


def test_lights_of_unknown_brightness_are_planned_one_by_one():
    """Kinds whose intensities of 1 have different units."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    sun = LightSpec("sun", "directional", direction=(0.2, 0.0, -1.0))
    plan = plan_lights(asked_about(scene, [lamp, sun]))
    assert [numbers.share for numbers in plan.numbers] == [1.0, 1.0]
    assert "as if alone" in plan.explain() and plan.notes


def test_surroundings_are_not_simulated_unless_they_are_dim():
    """Their share by pi times radiance; what is hidden of them by rays, none where they are dim."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    bright, dim = even_surroundings("sky", 0.05), even_surroundings("sky", 1e-7)
    rays = CountedRays(AnalyticRays(scene.spec.shapes))
    plan = plan_lights(asked_about(scene, [lamp], surroundings=[bright], rays=rays))
    (missing,) = [item for item in plan.not_simulated if item.effect == "surroundings"]
    assert 0 < missing.error < 0.5 and rays.occlusion > 0
    rays = CountedRays(AnalyticRays(scene.spec.shapes))
    plan = plan_lights(asked_about(scene, [lamp], surroundings=[dim], rays=rays))
    assert not plan.not_simulated and rays.occlusion == 0
    assert any(item.effect == "surroundings" for item in plan.skipped)


def test_a_sky_brings_a_floor_twice_what_it_brings_a_wall():
    """Irradiance of an even sphere is pi times its radiance; of its upper half all of that on a
    floor, half on a wall, none on a ceiling."""
    normal = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, -1.0]])
    np.testing.assert_allclose(even_surroundings("room", 0.5).irradiance(normal), math.pi / 2)
    directions = even_directions()
    sky = Surroundings("sky", directions, np.where(directions[2] > 0, 0.5, 0.0))
    expected = math.pi / 2 * np.array([1.0, 0.5, 0.0])
    np.testing.assert_allclose(sky.irradiance(normal), expected, atol=0.01)


def test_looking_is_no_closer_than_decisions_need():
    """A point light: one ray for each pixel of the probe that faces it, and no texel. A light with
    a size: its map of minima on top. A light below the tolerance: nothing at all."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()

    def cast(lights, **more) -> tuple[CountedRays, int]:
        rays = CountedRays(AnalyticRays(scene.spec.shapes))
        asked = asked_about(scene, lights, rays=rays)
        plan = plan_lights(asked, **more)
        assert plan.probe_rays == asked.eye.valid.size + rays.all
        frame = asked.lights[0].frame
        assert frame is not None
        return rays, int(light_paths(asked.eye, frame).facing.sum())

    rays, facing = cast([lamp])
    assert (rays.single, rays.texels, rays.occlusion) == (facing, 0, 0)
    soft = a2_square_light().soft_light()
    rays, facing = cast([soft])
    assert (rays.single, rays.texels) == (facing, (TEXELS * RAYS) ** 2)
    dim = replace(soft, name="dim", intensity=0.0)
    rays, facing = cast([lamp, dim])
    assert (rays.single, rays.texels) == (facing, 0)
    rays, _ = cast([lamp], force={"*": "none"})
    assert rays.all == 0
    with counted_traces() as traced:
        cast([soft])
    assert traced == []


def test_probe_sizes():
    assert probe_size(512, 512) == (64, 64)
    assert probe_size(1024, 256) == (128, 32)
    assert probe_size(16, 2000) == (6, 716) and probe_size(3, 2) == (3, 2)


def test_a_light_that_shines_on_nothing_says_so():
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    below = replace(lamp, position=(0.0, 0.0, -5.0))
    plan = plan_lights(asked_about(scene, [below]))
    assert plan.lights == () and plan.methods_for("centre") == ()
    assert "shines on no surface" in plan.decision("centre").reason
    with pytest.raises(KeyError):
        plan.decision("other")


@pytest.mark.parametrize(
    ("force", "said"),
    [({"lamp": "hard"}, "unknown light to force 'lamp'"), ({"*": "sfot"}, "Did you mean 'soft'")],
)
def test_wrong_force_is_one_line(force, said):
    scene = a1_square()
    with pytest.raises(UseError, match=said):
        plan_lights(asked_about(scene, list(scene.spec.lights.values())), force=force)


def cube(*moved: tuple[int, float]) -> Mesh:
    """The unit cube around the origin; corners `moved` along z."""
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij")).reshape(3, 8)
    for corner, by in moved:
        corners[2, corner] += by
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))]
    return Mesh("cube", corners, np.array(faces, np.int32).T)


def test_convex_objects():
    """A cube seen from outside is; with a corner pushed in, or from inside, it is not; a flat
    square is, from anywhere."""
    whole, dented = cube(), cube((7, -0.4))
    out, inside = np.array([0.0, 0.0, 3.0]), np.zeros(3)
    assert is_convex(whole.vertices, whole.faces, out)
    assert not is_convex(whole.vertices, whole.faces, inside)
    assert not is_convex(dented.vertices, dented.faces, out)
    square = np.array([[0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 0.0]])
    assert is_convex(square, np.array([[0, 0], [1, 2], [2, 3]]), inside)
    assert not is_convex(square, np.zeros((3, 0), np.int32), out)


def ref_widest_gap(receiver, normal, blockers, radii, light_radius, sun) -> float:
    """One receiver, blocker by blocker, in float64; the light at the origin, or along -z."""
    distance = -receiver[2] if sun else float(np.linalg.norm(receiver))
    axis = np.array([0.0, 0.0, -1.0]) if sun else receiver / distance
    best = 0.0
    for blocker, radius in zip(blockers.T, radii, strict=True):
        along = float(axis @ blocker)
        gap = distance - along
        aside = np.linalg.norm((blocker - receiver) - axis * (axis @ (blocker - receiver)))
        cone = light_radius * (gap if sun else gap / distance)
        above = normal @ (blocker - receiver) > CLEAR * distance
        if radius > 0 and gap > 0 and along > 0 and above and aside <= cone + radius:
            best = max(best, gap if sun else gap / along)
    return best


@pytest.mark.parametrize("sun", [False, True])
def test_widest_gaps_agree_with_a_loop(sun):
    """Random receivers and blockers below a light, some of them no hits."""
    random = np.random.default_rng(5)
    receiver = random.uniform(-2, 2, (3, 24)) - [[0.0], [0.0], [5.0]]
    normal = random.normal(size=(3, 24)) * [[0.3], [0.3], [0.0]] + [[0.0], [0.0], [1.0]]
    normal /= np.linalg.norm(normal, axis=0)
    blockers = random.uniform(-2, 2, (3, 40)) - [[0.0], [0.0], [3.0]]
    radii = np.where(random.random(40) < 0.2, 0.0, 0.1)
    expected = [
        ref_widest_gap(r, n, blockers, radii, 0.4, sun)
        for r, n in zip(receiver.T, normal.T, strict=True)
    ]
    axis = np.array([[0.0], [0.0], [-1.0]]) + 0 * receiver
    distance = -receiver[2] if sun else np.linalg.norm(receiver, axis=0)
    unit = axis if sun else receiver / distance
    found = _largest_gap(
        *(jnp.asarray(a, jnp.float32) for a in (receiver, normal, distance, unit)),
        *(jnp.asarray(a, jnp.float32) for a in (blockers, radii, 0.4)),
        not sun,
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert 5 < np.count_nonzero(expected) < 24
