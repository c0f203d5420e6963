"""Closed-form scenes A1 to A9: golden numbers, Monte Carlo twins, and the analytic caster."""

import math

import numpy as np
import pytest
from helpers.effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from asmjax.scene import analytic_scenes, closed_forms
from asmjax.scene.analytic import closest, occluded
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.closed_forms import Ellipse

# The reference prints its numbers to six decimals.
PRINTED = 5.1e-7
# Points nearer to an edge than this are left out.
EDGE_MARGIN = 1e-5

A2 = {"half": 1.0, "light_half": 0.6, "light_height": 5.0, "occluder_height": 2.0}


def plane_points(scene, count=20_000, seed=7):
    """Random plane points over the receiver, three quarters of them near the shadow."""
    rng = np.random.default_rng(seed)
    reach = np.where(np.arange(count) % 4 == 0, 9.9, 3.0)
    centre = 2.2 if "sphere" in scene.spec.name and "a6" in scene.spec.name else 0.0
    x = np.clip(centre + rng.uniform(-1.0, 1.0, count) * reach, -9.9, 9.9)
    return x, rng.uniform(-1.0, 1.0, count) * reach


def ref_hard_visibility(scene, x, y):
    """Shadow rays of the analytic caster, the receiver itself left out."""
    occluders = scene.spec.shapes[1:]
    points = np.stack([x, y, np.zeros_like(x)])
    light = next(iter(scene.spec.lights.values()))
    if light.kind == "directional":
        towards = -np.asarray(light.direction)[:, None]
        return np.where(closest(occluders, points, towards)[1] >= 0, 0.0, 1.0)
    return np.where(occluded(occluders, points, np.asarray(light.position)), 0.0, 1.0)


def test_a1_square():
    assert closed_forms.square_shadow_half(1.0, 5.0, 2.0) == pytest.approx(5.0 / 3.0, abs=1e-15)


def test_a2_penumbra_and_area_visibility():
    penumbra = closed_forms.square_penumbra(**A2)
    assert penumbra.umbra == pytest.approx(1.266667, abs=PRINTED)
    assert penumbra.outer == pytest.approx(2.066667, abs=PRINTED)
    assert penumbra.width == pytest.approx(0.8, abs=1e-15)
    golden = closed_forms.square_area_visibility(np.array([1.5, 1.6]), np.array([0.0, 1.7]), **A2)
    assert golden == pytest.approx([0.291667, 0.732639], abs=PRINTED)


def test_a3_lambert():
    golden = closed_forms.square_irradiance_ratio(np.array([1.5, 1.6]), np.array([0.0, 1.7]), **A2)
    assert golden == pytest.approx([0.317705, 0.764219], abs=PRINTED)


def test_a4_disc():
    golden = closed_forms.disc_visibility(np.array([1.3, 1.6, 1.9]), np.zeros(3), **A2)
    assert golden == pytest.approx([0.016212, 0.419596, 0.861440], abs=PRINTED)


def test_a5_half_plane():
    golden = closed_forms.half_plane_disc_visibility(np.array([-0.5, 0.375, 0.75, -2.0, 2.0]))
    assert golden == pytest.approx([0.195501, 0.733013, 0.927853, 0.0, 1.0], abs=PRINTED)
    ramp = closed_forms.half_plane_square_visibility(np.array([-1.0, 0.0, 0.2, 1.0]), 0.8)
    assert ramp == pytest.approx([0.0, 0.5, 0.75, 1.0], abs=1e-15)


def test_a6_ellipse():
    ellipse = closed_forms.sphere_shadow((0.0, 0.0, 6.0), (1.5, 0.0, 2.0), 0.8)
    got = [ellipse.semi_x, ellipse.semi_y, ellipse.centre[0]]
    assert got == pytest.approx([1.311383, 1.224745, 2.343750], abs=PRINTED)


def test_a6_unbounded_is_refused():
    with pytest.raises(ValueError, match="unbounded"):
        closed_forms.sphere_shadow((0.0, 0.0, 2.0), (5.0, 0.0, 1.8), 1.0)


def test_a7_radii():
    radii = closed_forms.coaxial_sphere_radii(0.8, 0.5, 4.0, 2.0)
    assert radii == pytest.approx([0.952683, 1.533233], abs=PRINTED)


def test_a7_rims_bracket_sampled_light():
    """Just inside the umbra no light point is seen, just outside some is; the same at the rim."""
    umbra, rim = closed_forms.coaxial_sphere_radii(0.8, 0.5, 4.0, 2.0)
    light = np.array([0.0, 0.0, 6.0])[:, None] + 0.5 * ref_sphere_points(200_000, seed=3)
    occluder = ANALYTIC_SCENES["a7_sphere_light"]().spec.shapes[1:]
    share = {}
    for radius in (umbra - 0.01, umbra + 0.02, rim - 0.02, rim + 0.01):
        point = np.array([[radius], [0.0], [0.0]])
        share[radius] = np.mean(closest(occluder, point, light - point, 0.0, 1.0)[1] < 0)
    inside, after_umbra, before_rim, outside = share.values()
    assert inside == 0.0 and 0.0 < after_umbra < 0.1
    assert outside == 1.0 and 0.9 < before_rim < 1.0


def ref_sphere_points(count, seed):
    """Points spread evenly over the unit sphere."""
    points = np.random.default_rng(seed).normal(size=(3, count))
    return points / np.linalg.norm(points, axis=0)


def test_a8_slabs_and_medium():
    depths = np.array([0.5, 1.5, 3.0])
    through = closed_forms.slab_transmittance(depths, [1.0, 2.0], [0.4, 0.25])
    assert through == pytest.approx([1.0, 0.6, 0.45], abs=1e-15)
    medium = closed_forms.medium_transmittance(depths, 1.0, 2.0)
    assert medium == pytest.approx([1.0, math.exp(-1.0), math.exp(-4.0)], abs=1e-15)


def test_a8_blurred_gratings_are_slabs():
    """Over whole periods of both gratings the mean hard visibility is the soft one."""
    scene = ANALYTIC_SCENES["a8_slabs"]()
    assert scene.soft_visibility is not None
    # Four of the six periods of 0.4 of either layer, scaled on to the plane by its own height.
    x = (np.arange(1200) + 0.5) / 1200 * 2.4 - 1.2
    xs, ys = np.meshgrid(x * 6.0 / 4.5, x * 6.0 / 4.8)
    inside = np.abs(x) < 0.8
    xs, ys = xs[np.ix_(inside, inside)], ys[np.ix_(inside, inside)]
    assert scene.hard_visibility(xs, ys).mean() == pytest.approx(0.6 * 0.75, abs=1e-3)
    assert scene.soft_visibility(np.zeros(1), np.zeros(1)) == pytest.approx([0.45])


@pytest.mark.parametrize("side", [1.0, -1.0])
@given(angle=st.floats(-math.pi, math.pi), offset=st.floats(0.0, 0.8))
@settings(max_examples=examples(40))
def test_a9_coverage_is_supersampling(side, angle, offset):
    a, b, c = math.cos(angle), math.sin(angle), side * offset
    grid = (np.arange(400) + 0.5) / 400 - 0.5
    u, v = np.meshgrid(grid, grid)
    ref = np.mean(a * u + b * v + c >= 0.0)
    # An edge along the grid moves the count by up to one row of 400.
    assert closed_forms.slanted_edge_coverage(a, b, c) == pytest.approx(ref, abs=1.3e-3)


@pytest.mark.parametrize(
    ("soft", "round_light"),
    [(closed_forms.square_area_visibility, False), (closed_forms.disc_visibility, True)],
)
def test_area_visibility_is_monte_carlo(soft, round_light):
    """A2 and A4 against 200,000 shadow rays to the light; 4 sigma of a fair coin."""
    name = "a4_disc_light" if round_light else "a2_square_light"
    occluders = ANALYTIC_SCENES[name]().spec.shapes[1:]
    rng = np.random.default_rng(11)
    light = rng.uniform(-0.6, 0.6, (2, 200_000))
    if round_light:
        light = light[:, np.hypot(*light) < 0.6]
    targets = np.stack([*light, np.full(light.shape[1], 5.0)])
    for x, y in rng.uniform(-2.2, 2.2, (8, 2)):
        point = np.array([[x], [y], [0.0]])
        seen = np.mean(closest(occluders, point, targets - point, 0.0, 1.0)[1] < 0)
        got = soft(np.array([x]), np.array([y]), **A2)[0]
        assert got == pytest.approx(seen, abs=4.0 * 0.5 / math.sqrt(light.shape[1]))


def test_lambert_ratio_is_monte_carlo():
    """A3 weighs each light point by both cosines over the squared distance."""
    rng = np.random.default_rng(12)
    targets = np.stack([*rng.uniform(-0.6, 0.6, (2, 200_000)), np.full(200_000, 5.0)])
    occluders = ANALYTIC_SCENES["a3_lambert"]().spec.shapes[1:]
    for x, y in rng.uniform(-2.2, 2.2, (8, 2)):
        point = np.array([[x], [y], [0.0]])
        spoke = targets - point
        weight = spoke[2] ** 2 / np.sum(spoke * spoke, axis=0) ** 2
        seen = closest(occluders, point, spoke, 0.0, 1.0)[1] < 0
        got = closed_forms.square_irradiance_ratio(np.array([x]), np.array([y]), **A2)[0]
        assert got == pytest.approx(np.sum(weight * seen) / np.sum(weight), abs=5e-3)


@given(distance=st.floats(0.0, 3.0), other=st.floats(0.1, 2.0))
@settings(max_examples=examples(60))
def test_lens_area_bounds_and_symmetry(distance, other):
    area = float(closed_forms.lens_area(1.0, other, distance))
    assert -1e-12 <= area <= math.pi * min(1.0, other) ** 2 + 1e-12
    assert area == pytest.approx(float(closed_forms.lens_area(other, 1.0, distance)), abs=1e-12)
    if distance >= 1.0 + other:
        assert area == 0.0


@given(
    semi=st.tuples(st.floats(0.2, 3.0), st.floats(0.2, 3.0)),
    point=st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
)
@settings(max_examples=examples(60))
def test_ellipse_distance_is_the_nearest_curve_point(semi, point):
    ellipse = Ellipse((0.3, -0.2), *semi)
    angle = np.linspace(0.0, 2.0 * math.pi, 20_001)
    curve_x, curve_y = 0.3 + semi[0] * np.cos(angle), -0.2 + semi[1] * np.sin(angle)
    ref = np.min(np.hypot(point[0] - curve_x, point[1] - curve_y))
    got = ellipse.distance(np.array([point[0]]), np.array([point[1]]))[0]
    # The sampled curve is at most half a chord (3 pi / 20,000) too far at the nearest point.
    assert ref - 5e-4 <= got <= ref + 1e-9


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_hard_visibility_is_the_analytic_caster(name):
    scene = ANALYTIC_SCENES[name]()
    x, y = plane_points(scene)
    clear = scene.edge_distance(x, y) > EDGE_MARGIN
    assert clear.mean() > 0.99
    got, ref = scene.hard_visibility(x, y)[clear], ref_hard_visibility(scene, x, y)[clear]
    assert 0.02 < ref.mean() < 0.98
    assert np.array_equal(got, ref)


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_edge_distance_says_where_visibility_can_change(name):
    """A step shorter than the edge distance never changes visibility, in any direction."""
    scene = ANALYTIC_SCENES[name]()
    x, y = plane_points(scene, count=4000, seed=8)
    reach = 0.999 * scene.edge_distance(x, y)
    here = scene.hard_visibility(x, y)
    for angle in np.linspace(0.0, 2.0 * math.pi, 13):
        there = scene.hard_visibility(x + reach * math.cos(angle), y + reach * math.sin(angle))
        assert np.array_equal(here, there)


@pytest.mark.parametrize("name", [n for n in ANALYTIC_SCENES if n != "a8_slabs"])
def test_edge_distance_is_not_too_small(name):
    """A step 2 % longer than the edge distance changes visibility in some direction."""
    scene = ANALYTIC_SCENES[name]()
    x, y = plane_points(scene, count=400, seed=9)
    reach = 1.02 * scene.edge_distance(x, y) + 1e-9
    angle = np.linspace(0.0, 2.0 * math.pi, 721)[:, None]
    there = scene.hard_visibility(x + reach * np.cos(angle), y + reach * np.sin(angle))
    assert np.all(np.any(there != scene.hard_visibility(x, y), axis=0))


@pytest.mark.parametrize(
    "name",
    ["a2_square_light", "a3_lambert", "a4_disc_light", "a5_half_plane", "a8_slabs",
     "a9_slanted_edge"],
)  # fmt: skip
def test_soft_visibility_agrees_far_from_the_edges(name):
    """Further from the hard edge than the widest penumbra (0.8 / 2) both say the same."""
    scene = ANALYTIC_SCENES[name]()
    assert scene.soft_visibility is not None
    x, y = plane_points(scene, count=4000)
    soft = scene.soft_visibility(x, y)
    assert soft.shape == x.shape and np.all((soft >= -1e-12) & (soft <= 1.0 + 1e-12))
    far = scene.edge_distance(x, y) > 0.7
    assert far.any()
    assert soft[far] == pytest.approx(scene.hard_visibility(x, y)[far], abs=1e-9)


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_the_eye_sees_the_shadow_boundary(name):
    """Plane points beside an edge, at most 3 units from the middle, are in view and unhidden."""
    scene = ANALYTIC_SCENES[name]()
    x, y = plane_points(scene, count=60_000, seed=10)
    near = (scene.edge_distance(x, y) < 0.03) & (np.hypot(x, y) < 1.2 if _open(name) else True)
    points = np.stack([x, y, np.zeros_like(x)])[:, near]
    assert points.shape[1] > 50
    view = next(iter(scene.spec.views.values()))
    origin = np.asarray(view.origin)
    assert not occluded(scene.spec.shapes[1:], points, origin).any()
    forward = np.asarray(view.target) - origin
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, view.up)
    right = right / np.linalg.norm(right)
    spoke = points - origin[:, None]
    reach = math.tan(math.radians(0.5 * view.fov_x_deg)) * (forward @ spoke)
    assert np.all(np.abs(right @ spoke) < reach)
    assert np.all(np.abs(np.cross(right, forward) @ spoke) < reach)


def _open(name):
    """Scenes whose shadow edge is an endless line."""
    return name in ("a5_half_plane", "a9_slanted_edge")


@given(half=st.floats(0.2, 2.0), height=st.floats(2.0, 8.0), share=st.floats(0.1, 0.7))
@settings(max_examples=examples(20))
def test_a1_any_size_is_the_analytic_caster(half, height, share):
    scene = analytic_scenes.a1_square(half, height, share * height)
    x, y = plane_points(scene, count=1000)
    clear = scene.edge_distance(x, y) > EDGE_MARGIN
    assert np.array_equal(
        scene.hard_visibility(x, y)[clear], ref_hard_visibility(scene, x, y)[clear]
    )
