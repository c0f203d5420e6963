"""How wide penumbrae are, and that decisions flip where they should in scenes in closed form."""

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.plans import CLOSE, CountedRays, asked_about, on_image

from asmjax.effects import plan_lights
from asmjax.effects.decide import LEAST_UMBRA, NARROW, SUBPIXEL, WIDE
from asmjax.effects.widths import _largest_gap
from asmjax.geometry import SUN_DEG, sphere_light, sun_light
from asmjax.scene.analytic_rays import AnalyticRays
from asmjax.scene.analytic_scenes import (
    a2_square_light,
    a5_half_plane,
    a6_sphere_sun,
    a7_sphere_light,
)
from asmjax.scene.spec import LightSpec, ViewSpec


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


def test_a_sphere_light_has_the_width_of_its_disk():
    scene = a7_sphere_light()
    (numbers,) = plan_lights(asked_about(scene, [scene.soft_light()])).numbers
    assert numbers.shape == "sphere"
    assert numbers.solid_angle == pytest.approx(math.pi * 0.5**2 / 6**2, rel=0.2)
    assert numbers.width_p50 > 5


def test_a_lamp_far_away_is_as_soft_as_a_near_one_of_its_angle():
    """A thousand diagonals away: margins in parts of the lamp's distance hid every caster there,
    and the plan said "hard" of it."""
    scene = a7_sphere_light()
    near = scene.soft_light()
    assert near.position is not None and near.area is not None
    found = []
    for far in (1e2, 1e4):
        place = far * np.asarray(near.position)
        lamp = replace(
            near, position=tuple(place), area=sphere_light(place, far * near.area.radius)
        )
        (numbers,) = plan_lights(asked_about(scene, [lamp])).numbers
        found.append((numbers.shadowed, numbers.umbra, numbers.width_p50, numbers.width_p95))
    assert found[0][0] > 0 and found[0][2] > 5
    np.testing.assert_allclose(found[1], found[0], rtol=0.05)


CLEAR = 1e-3


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
        above = normal @ (blocker - receiver) > CLEAR
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
        jnp.full(24, CLEAR, jnp.float32),
        *(jnp.asarray(a, jnp.float32) for a in (blockers, radii, 0.4)),
        not sun,
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert 5 < np.count_nonzero(expected) < 24
