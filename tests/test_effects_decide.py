"""From numbers to decisions: what chooses a method, what is forced, skipped and missing."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.plans import asked_about

from asmjax.effects import Decision, LightNumbers, Outcome, Rates, decide_light, plan_lights
from asmjax.effects.decide import LEAST_UMBRA, MAP_TEXELS, NARROW, SUBPIXEL, WIDE
from asmjax.effects.missing import VERY_LARGE_SR
from asmjax.errors import UseError
from asmjax.scene.analytic_scenes import a1_square
from asmjax.scene.closed_forms import half_plane_disc_visibility

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
    assert many.seconds - few.seconds == pytest.approx((256 - 36) * LAMP.pixels * rates.look_up)
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
    decision = of(wide(0.5), rates=Rates(texel=1.0, look_up=0.0))
    assert decision.seconds == MAP_TEXELS


@pytest.mark.parametrize(
    ("force", "said"),
    [({"lamp": "hard"}, "unknown light to force 'lamp'"), ({"*": "sfot"}, "Did you mean 'soft'")],
)
def test_wrong_force_is_one_line(force, said):
    scene = a1_square()
    with pytest.raises(UseError, match=said):
        plan_lights(asked_about(scene, list(scene.spec.lights.values())), force=force)
