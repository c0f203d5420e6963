"""What the shadow test cannot tell is stated in scene units, and holds: no acne on planes at any
angle, and no light through a wall that stands farther above a receiver than the stated bias."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.effort import each_of
from helpers.planes import Plane, surface_points
from helpers.poses import projected
from helpers.registry import SIBLINGS

from asmjax.experiment.bias import bias_summary, stated_bias
from asmjax.geometry import fixed_frame
from asmjax.scene.analytic import closest
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, Rectangle, ViewSpec
from asmjax.shadow import FilteredShadowMap, ShadowAlgorithm, UniformShadowMap
from asmjax.shadow.comparison import BIAS, CURVATURE_BIAS, bias_distance

SIDE = 96
TEXELS = 4**7
FLOOR = Rectangle("floor", (0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 3.0, 0.0))
VIEW = ViewSpec("v", (0.4, -2.5, 2.2), (0.1, 0.2, 0.0), fov_x_deg=40.0, width=SIDE, height=SIDE)

each_sibling = pytest.mark.parametrize("sibling", each_of(SIBLINGS))


def by_depth(algorithm: ShadowAlgorithm) -> ShadowAlgorithm:
    """The algorithm, or the map that it filters, with depth alone."""
    if isinstance(algorithm, FilteredShadowMap):
        return replace(algorithm, inner=by_depth(algorithm.inner))
    return replace(algorithm, compare="depth")


def towards(tilt_deg: float) -> np.ndarray:
    """A unit vector that many degrees off the floor's normal."""
    tilt = np.radians(tilt_deg)
    return np.array([np.sin(tilt) * 0.8, np.sin(tilt) * 0.6, np.cos(tilt)])


def light_at(tilt_deg: float, kind: str) -> LightSpec:
    if kind == "directional":
        return LightSpec("sun", "directional", direction=tuple(-towards(tilt_deg)))
    return LightSpec("lamp", "point", position=tuple(9.0 * towards(tilt_deg)))


def seen(shapes, light: LightSpec):
    """Eye, light frame and rays."""
    eye = analytic_eye(shapes, VIEW)
    return eye, light_frame(light, eye, scene_bounds(shapes)), AnalyticRays(shapes)


@pytest.mark.parametrize("tilt_deg", [85.0, 89.9])
@pytest.mark.parametrize("kind", ["point", "directional"])
@each_sibling
def test_a_plane_has_no_acne_at_any_angle(sibling, kind, tilt_deg):
    """Alone under a light it is lit all over, to 89.9 degrees."""
    eye, frame, rays = seen([FLOOR], light_at(tilt_deg, kind))
    algorithm = by_depth(sibling.of_budget(TEXELS, frame.faces))
    state = algorithm.build(eye, frame, rays)
    assert np.array_equal(np.asarray(algorithm.visibility(state, eye.points)) > 0, eye.valid)


HEIGHTS = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1)
"""Of the plates above the floor, scene units."""


def plates() -> list[Rectangle]:
    """Plates parallel to the floor, side by side, each at its own height."""
    found = []
    for k, height in enumerate(HEIGHTS):
        centre = (-0.6 + 0.6 * (k % 3), -0.45 + 0.55 * (k // 3), height)
        found.append(Rectangle(f"plate{k}", centre, (0.22, 0.0, 0.0), (0.0, 0.22, 0.0)))
    return found


def below_plates(light: LightSpec):
    """The scene, and for each pixel of the floor how high the caster is above it: 0 where lit.

    The eye looks through the plates, as what a wall hides is what its light would leak onto.
    """
    casters = plates()
    eye, frame, _ = seen([FLOOR], light)
    everything = [FLOOR, *casters]
    start = np.where(eye.valid, eye.world, 0.0)
    way = np.asarray(light.position)[:, None] - start
    _, prim, _ = closest(everything, start, way, 1e-9, 1.0)
    height = np.where(prim > 0, np.r_[0.0, HEIGHTS][np.maximum(prim, 0)], 0.0)
    # A shadow's edge is where the answer changes with the start moved a little.
    margin = np.zeros(prim.size, bool)
    for aside in 0.04 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], float):
        margin |= closest(everything, start + aside[:, None], way, 1e-9, 1.0)[1] != prim
    return eye, frame, AnalyticRays(everything), np.where(margin | ~eye.valid, np.nan, height)


@each_sibling
def test_no_light_leaks_through_walls_beyond_the_stated_bias(sibling):
    """Nor is it more than a fifth of a texel and a few roundings that is stated."""
    light = light_at(25.0, "point")
    eye, frame, rays, height = below_plates(light)
    algorithm = by_depth(sibling.of_budget(TEXELS, frame.faces))
    state = algorithm.build(eye, frame, rays)
    lit = np.asarray(algorithm.visibility(state, eye.points)) > 0
    bias = stated_bias(algorithm, state, eye, frame)
    assert (np.isfinite(bias) == eye.valid).all() and (bias[eye.valid] > 0).all()
    judged = np.isfinite(height)
    assert (judged & (height > bias)).sum() > 100
    assert not lit[judged & (height > bias)].any()
    # Texels may be wider than the margin that is kept to the edges of shadows.
    assert lit[judged & (height == 0)].mean() > 0.99
    summary = bias_summary(bias)
    assert 0 < summary["median"] <= summary["max"] < 0.1
    assert summary["max"] == np.nanmax(bias)


def test_the_stated_bias_is_what_the_test_forgives():
    """On the uniform map, whose texels are all alike: half of it hides a wall, twice shows it."""
    light = light_at(25.0, "point")
    eye, frame, rays, height = below_plates(light)
    algorithm = UniformShadowMap(64)
    state = algorithm.build(eye, frame, rays)
    lit = np.asarray(algorithm.visibility(state, eye.points)) > 0
    bias = stated_bias(algorithm, state, eye, frame)
    hidden = np.isfinite(height) & (height > 0) & (height < 0.5 * bias)
    assert hidden.sum() > 100 and lit[hidden].mean() > 0.95
    width = 9.0 * np.max(frame.extent) / 64
    assert np.nanmedian(bias) == pytest.approx(BIAS * 9 + CURVATURE_BIAS * width, rel=0.25)


def test_the_stated_bias_holds_far_off_the_axis():
    """In the corner of a lamp of 125 degrees, whose rays are 2.9 times as long as they are deep:
    what is a little nearer than stated is hidden, and what is a little farther is seen."""
    frame = fixed_frame((0.0, 0.0, 5.0), (0.0, 0.0, -1.0), 125.0, 1e-3)
    floor = Plane(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    world = floor.seen(frame, 0.02 + 0.01 * np.random.default_rng(3).random((2, 500)))
    points = surface_points(world, floor.normal)
    algorithm, eye = UniformShadowMap(2048, compare="depth"), analytic_eye([FLOOR], VIEW)
    stated = np.asarray(bias_distance(projected(points, frame), frame, 1 / 2048, BIAS))
    deep = BIAS * 5 + CURVATURE_BIAS * 5 * np.max(frame.extent) / 2048
    assert stated.min() > 2.5 * deep
    for part, expected in ((0.98, 1.0), (1.02, 0.0)):
        plate = floor.shape("plate", lift=part * float(np.median(stated)), half=1e3)
        state = algorithm.build(eye, frame, AnalyticRays([plate]))
        assert np.mean(np.asarray(algorithm.visibility(state, points)) == expected) > 0.9


def test_ids_need_no_bias():
    eye, frame, rays = seen([FLOOR], light_at(25.0, "point"))
    algorithm = UniformShadowMap(64, compare="id")
    bias = stated_bias(algorithm, algorithm.build(eye, frame, rays), eye, frame)
    assert not np.nan_to_num(bias).any() and bias_summary(bias) == {"median": 0.0, "max": 0.0}
    assert bias_summary(np.full(4, np.nan)) == {"median": 0.0, "max": 0.0}
