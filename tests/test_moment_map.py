"""Moment shadow maps: their sums, filters without a light's size, and soft shadows."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case, case_of
from helpers.poses import projected
from helpers.soft_cases import (
    ABOVE,
    FLOOR,
    SIDE,
    asked,
    built_and_kept,
    lone_floor,
    mean_error,
    penumbra,
    ramp_width,
    soft_case,
    square_light,
    texel_on_receiver,
    traced_soft_case,
)

from asmjax.errors import UseError
from asmjax.experiment.traces import counted_traces
from asmjax.scene.analytic_scenes import a8_slabs
from asmjax.scene.spec import LightSpec, Rectangle
from asmjax.shadow import MomentShadowMap, UniformShadowMap, algorithm_of
from asmjax.shadow.soft.summed import summed, window_moments


def ref_window(depth: np.ndarray, low, high) -> np.ndarray:
    """Moments (4,) of the texels in a window, each by the part of it that is inside."""
    at = np.arange(depth.shape[0])
    columns, rows = (np.clip(np.minimum(high[k], at + 1) - np.maximum(low[k], at), 0, 1) for k in
                     range(2))  # fmt: skip
    weight = rows[:, None] * columns
    return np.array([(weight * depth**k).sum() for k in range(1, 5)]) / weight.sum()


def test_windows_are_the_means_of_their_texels():
    """Of any width from one texel on, at the borders too, on every face; what is nowhere hit is
    the farthest depth there is."""
    rng = np.random.default_rng(1)
    depth = rng.uniform(3, 9, (2, 40, 40)).astype(np.float32)
    depth[1, 5:9, 30:] = np.inf
    sums = summed(depth)
    middle, half = sums.scale
    scaled = np.where(np.isfinite(depth), (depth.astype(float) - middle) / half, 1.0)
    low = rng.uniform(0, 39, (2, 64))
    high = np.minimum(low + rng.uniform(1, 20, (2, 64)), 40.0)
    low[:, :2], high[:, :2] = [[0.0, 38.5], [0.0, 39.0]], [[40.0, 40.0], [40.0, 40.0]]
    face = rng.integers(0, 2, 64).astype(np.int32)
    with jax.enable_x64(True):
        found, alpha = window_moments(
            sums, jnp.asarray(face), jnp.asarray(low), jnp.asarray(high), 40
        )
    expected = [ref_window(scaled[face[k]], low[:, k], high[:, k]) for k in range(64)]
    np.testing.assert_allclose(found, np.stack(expected, axis=1), atol=1e-9)
    assert (np.asarray(alpha) >= 1e-8).all() and np.abs(scaled).max() <= 1


def test_sums_of_large_maps_keep_their_digits():
    """A million texels of one depth: any window has the moments of that depth, to a tenth of the
    bias that it asks for."""
    sums = summed((7 + 1e-3 * (np.arange(1024) % 2) + np.zeros((1, 1024, 1))).astype(np.float32))
    low = jnp.asarray(np.random.default_rng(0).uniform(900, 1000, (2, 256)), jnp.float32)
    with jax.enable_x64(True):
        low = low.astype(jnp.float64)
        width = jnp.asarray(np.geomspace(2, 20, 256)).round()
        found, alpha = window_moments(
            sums, jnp.zeros(256, jnp.int32), low.round(), low.round() + width, 1024
        )
        even = np.asarray(width) % 2 == 0
        values = (np.array([7.0, 7.001], np.float32).astype(float) - sums.scale[0]) / sums.scale[1]
        expected = np.array([(values**k).mean() for k in range(1, 5)])
        off = np.abs(np.asarray(found) - expected[:, None]).max(axis=0)
    assert even.sum() > 100 and (off[even] < 0.1 * np.asarray(alpha)[even]).all()


def test_a_filter_is_a_lower_bound_of_shadow():
    """Beside the share of texels in the window that shade the receiver: exact, as a disk above a
    plane is two depths, and none is darker."""
    case = analytic_case("a4_disc_light", SIDE)
    state, lit = asked(MomentShadowMap(128, kernel=5.0), case)
    _, hard = asked(UniformShadowMap(512), case)
    distance, texel = case.edge_distance, texel_on_receiver(case, 128)
    beyond = case.judged & (distance > 4.3 * texel)
    np.testing.assert_allclose(lit[beyond], hard[beyond], atol=1e-3)
    inside = case.judged & (distance < texel)
    assert 0.2 < lit[inside].mean() < 0.8 and len(np.unique(lit[inside].round(3))) > 50
    assert case.error(lit) < 0.01 and state.flat.depth is None
    assert MomentShadowMap(128, kernel=5.0).effective_resolution(state) == 26


@pytest.mark.parametrize(("half", "height"), [(0.2, 1.0), (0.6, 2.0), (1.2, 1.0)])
def test_ramp_of_a_half_plane(half, height):
    """As wide as in truth but for two texels: the box is of whole and parts of texels, and edges
    are where texels say."""
    case = soft_case("a5_square", SIDE, half, height)
    state, lit = asked(MomentShadowMap(256), case)
    texel = texel_on_receiver(case, 256, state.margin)
    assert ramp_width(case, lit) == pytest.approx(penumbra(half, height), abs=2 * texel)
    assert np.abs(lit - case.expected)[case.judged].mean() < 0.01


@pytest.mark.parametrize("name", ["a2", "a4", "a5"])
def test_squares_and_disks_are_near_their_closed_form(name):
    """A disk is taken for a square that is spread as widely."""
    case = soft_case(name, SIDE)
    _, lit = asked(MomentShadowMap(256), case)
    assert (lit >= 0).all() and (lit <= 1).all()
    assert mean_error(case, lit) < (0.008 if name == "a2" else 0.012)
    assert mean_error(case, lit) < 0.4 * mean_error(case, asked(UniformShadowMap(256), case)[1])


@pytest.mark.parametrize("sized", [True, False], ids=["sized", "point"])
@pytest.mark.parametrize("tilt_deg", [0.0, 60.0, 85.0])
def test_a_plane_alone_is_lit_all_over(tilt_deg, sized):
    """At any tilt, in windows of any width."""
    case = lone_floor(tilt_deg)
    if not sized:
        case = without_area(case)
    _, lit = asked(MomentShadowMap(128, kernel=5.0), case)
    assert (lit[case.eye.valid] == 1).all()


def without_area(case):
    return replace(case, frame=replace(case.frame, area=None))


@pytest.mark.slow
def test_light_leaks_onto_narrow_receivers():
    """Known wrong: a bar that fills little of its window, below others and above the floor, is lit
    by more than passes. Nothing is lit by less, beside the share of the window's texels that lie
    higher; and the floor by as much, as its own depth is one that the moments know."""
    scene = a8_slabs(heights=(4.0, 1.0))
    view = next(iter(scene.spec.views.values())).resized(SIDE, SIDE)
    light = next(iter(scene.spec.lights.values()))
    between = [
        Rectangle(f"bar{k}", (0.0, y, 2.5), (1.2, 0.0, 0.0), (0.0, 0.04, 0.0))
        for k, y in enumerate((-0.6, -0.35, -0.1, 0.15, 0.4, 0.65))
    ]
    case = case_of(scene, (*scene.spec.shapes, *between), view, light)
    kernel, side = 9.0, 128
    _, lit = asked(MomentShadowMap(side, kernel=kernel), case)
    flat = UniformShadowMap(side)
    depth = np.asarray(flat.build(case.eye, case.frame, case.rays).depth)
    depth = depth.reshape(-1, side, side)
    points = case.eye.points
    seen = projected(points, case.frame)
    uv, face, own = np.asarray(seen.uv) * side, np.asarray(seen.face), np.asarray(seen.depth)
    chosen = np.flatnonzero(seen.facing)[::7]
    floor = case.judged[chosen]
    truth = []
    for k in chosen:
        place = np.clip(uv[:, k], 0.5, side - 0.5)
        higher = (depth[face[k]] < own[k] - 0.5).astype(float)
        truth.append(1 - ref_window(higher, place - kernel / 2, place + kernel / 2)[0])
    leak = lit[chosen] - truth
    assert len(leak) > 300 and leak.min() > -1e-4
    assert leak[floor].max() < 0.06
    assert 0.1 < leak[~floor].max() < 0.3


@pytest.mark.slow
def test_contact_is_lit_on_a_slope():
    """Known wrong: a receiver counts as near as its plane gets within the window, so that on a
    slope the foot of a caster is lit."""
    wall = Rectangle("wall", (0.0, 0.0, 0.25), (0.0, 1.0, 0.0), (0.0, 0.0, 0.25))
    place = (-4.0, 0.0, 3.0)
    light = LightSpec("lamp", "point", position=place, area=square_light(0.01).at(place))
    case = without_area(traced_soft_case((FLOOR, wall), ABOVE, light, 1))
    _, lit = asked(MomentShadowMap(512, kernel=9.0), case)
    _, hard = asked(UniformShadowMap(512), case)
    x, y, _ = case.eye.world
    foot = case.judged & (x > 0.01) & (x < 0.03) & (np.abs(y) < 0.8)
    tail = case.judged & (x > 0.25) & (x < 0.4) & (np.abs(y) < 0.6)
    assert hard[tail].max() == 0 and lit[tail].mean() < 0.05
    assert lit[foot].mean() > 0.5


def test_verbs_under_a_light_with_a_size():
    case = soft_case("a4", SIDE)
    algorithm = MomentShadowMap(256, keep=True)
    rays, state, lit, kept = built_and_kept(algorithm, case)
    np.testing.assert_array_equal(algorithm.visibility(kept, case.eye.points), lit)
    with counted_traces() as traces:
        again = algorithm.update(state, case.eye, case.frame, case.rays, moved=np.zeros((1, 3, 2)))
        after = np.asarray(algorithm.visibility(again, case.eye.points))
    assert traces == []
    np.testing.assert_array_equal(after, lit)
    jitted = jax.jit(algorithm.visibility)(state, case.eye.points)
    np.testing.assert_allclose(jitted, lit, atol=1e-3)
    with jax.enable_x64(True):
        double = soft_case("a4", SIDE)
        _, exact = asked(algorithm, double)
    assert (exact.dtype, lit.dtype) == (np.float64, np.float32)
    assert np.abs(exact - lit).mean() < 1e-3


def test_wrong_use_is_refused():
    wrong: list[dict[str, Any]] = [{"resolution": 0}, {"kernel": 0.5}, {"kernel": np.nan}]
    for settings in wrong:
        with pytest.raises(UseError, match="allowed"):
            MomentShadowMap(**settings)
    with pytest.raises(UseError, match="known: depth"):
        algorithm_of({"algorithm": "moment", "settings": {"compare": "id"}})
