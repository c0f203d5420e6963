"""What part of the light each light and the surroundings bring, and what passes through casters."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.plans import CLOSE, CountedRays, asked_about

from asmjax.effects import plan_lights
from asmjax.effects.probe import sky_visibility
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye
from asmjax.scene.analytic_scenes import a1_square, a6_sphere
from asmjax.scene.materials import (
    Surroundings,
    even_directions,
    even_surroundings,
    opaque_materials,
)
from asmjax.scene.spec import LightSpec, ViewSpec


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
    up = np.array([[0.6, 0.6], [0.0, 0.0], [0.8, -0.8]])
    np.testing.assert_array_equal(sky.towards(up), [0.5, 0.0])


def test_what_is_dark_is_not_hidden():
    """A sphere on a floor: of an even room the floor hides half of a wall's light, of a sky that
    ends at the horizon it hides nothing."""
    shapes = a6_sphere().spec.shapes
    (view,) = a6_sphere().spec.views.values()
    eye, rays = analytic_eye(shapes, view.resized(48, 48)), AnalyticRays(shapes)
    upright = (eye.shape == 1) & (np.abs(eye.normal[2]) < 0.2)
    directions = even_directions(4096)
    sky = Surroundings("sky", directions, np.where(directions[2] > 0, 0.5, 0.0))
    room, _ = sky_visibility(eye, rays, [even_surroundings("room", 0.5)])
    dome, _ = sky_visibility(eye, rays, [sky])
    assert upright.sum() > 5
    assert room[upright].mean() < 0.7 and dome[upright].mean() > 0.95


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
