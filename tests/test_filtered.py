"""Filters: identities between them, integrals as oracles, and no acne whatever map is filtered."""

import functools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.counting import CountingRays
from helpers.gradients import assert_finite, assert_gradient, value_and_gradient
from helpers.painted import painted, ref_area, ref_bilinear, ref_dithered, ref_sixteen
from helpers.registry import SIBLINGS
from helpers.soft_cases import soft_case
from hypothesis import given
from hypothesis import strategies as st

from asmjax.buffers import SurfacePoints
from asmjax.errors import UseError
from asmjax.experiment.traces import counted_traces
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, Rectangle, ViewSpec
from asmjax.shadow import (
    MAPS,
    AccumulatedShadowMap,
    FilteredShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
)
from asmjax.shadow.filtered import KERNELS, Kernel
from asmjax.shadow.filtered.footprint import box_of, stratified_share
from asmjax.shadow.filtered.pixels import noise, pixel_of
from asmjax.shadow.filtered.windows import box, dithered

SIDE, POINTS = 20, 300
"""Texels a side of a picture, and places in it."""

WIDTHS = (1 / 64, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 7.3)
PIXELS = jnp.array([[0, 1, 0, 1], [0, 0, 1, 1]], jnp.int32)
"""A block of 2 x 2."""

picture = np.random.default_rng(1).random((SIDE, SIDE)) < 0.5
places = np.random.default_rng(2).uniform(-0.0, SIDE, (2, POINTS))

_box = eqx.filter_jit(lambda held, at, width: box(painted(held, at), width))
_dithered = eqx.filter_jit(lambda held, at, pixel: dithered(painted(held, at), pixel))


def in_dtype(at: np.ndarray, dtype) -> tuple[np.ndarray, np.ndarray]:
    """Places as a kernel is given them, and the same in float64."""
    given_at = at.astype(dtype)
    return given_at, given_at.astype(np.float64)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_window_is_its_integral(width, dtype):
    """Against the picture's integral in float64: windows within a texel, and over many."""
    at, exact = in_dtype(places, dtype)
    digits = 1e-6 if dtype == "float32" else 1e-13
    # Sides are known to a rounding of a texel, areas to one of the whole picture's.
    near = digits * max(1, 1 / width) + 1e-12 / width**2
    np.testing.assert_allclose(
        _box(picture, at, width), ref_area(picture, exact, width / 2), atol=near
    )


def test_sixteen_tests_are_an_area_of_four_texels_and_25_weights(dtype):
    """Three ways to 1e-6: 64 texels, the integral, and weights 1 - f, 1, 1, 1, f."""
    at, exact = in_dtype(places, dtype)
    found = np.asarray(_box(picture, at, 4.0))
    np.testing.assert_allclose(found, ref_sixteen(picture, exact), atol=1e-6)
    np.testing.assert_allclose(found, ref_area(picture, exact, 2.0), atol=1e-6)
    column, row = np.floor(exact).astype(int)
    (f, g), total = exact - np.floor(exact), np.zeros(POINTS)
    weights = [np.stack([1 - x, 1 + 0 * x, 1 + 0 * x, 1 + 0 * x, x]) / 4 for x in (f, g)]
    for i in range(5):
        for j in range(5):
            x, y = (np.clip(k - 2, 0, SIDE - 1) for k in (column + i, row + j))
            total += weights[0][i] * weights[1][j] * picture[y, x]
    np.testing.assert_allclose(found, total, atol=1e-6)


def test_the_hardware_test_is_an_area_of_one_texel(dtype):
    at, exact = in_dtype(places, dtype)
    np.testing.assert_allclose(_box(picture, at, 1.0), ref_bilinear(picture, exact), atol=2e-6)


def test_the_four_dithered_patterns_are_the_listing_and_their_mean_is_sixteen(dtype):
    """Pixel centres are at +0.5 in a listing, or not: the same pattern."""
    at, exact = in_dtype(places, dtype)
    found = []
    for pixel in PIXELS.T[:, :, None]:
        here = jnp.repeat(pixel + jnp.array([[6], [40]], jnp.int32), POINTS, axis=1)
        found.append(np.asarray(_dithered(picture, at, here)))
        for centre in (0.0, 0.5):
            expected = ref_dithered(picture, exact, np.asarray(here) + centre)
            np.testing.assert_allclose(found[-1], expected, atol=1e-6)
    np.testing.assert_allclose(np.mean(found, axis=0), _box(picture, at, 4.0), atol=1e-6)
    assert all(np.abs(found[i] - found[j]).max() > 0.1 for i in range(4) for j in range(i))
    # As printed, the parities are cast to one number: half of the patterns, half a texel off.
    block = np.asarray(PIXELS).T[:, :, None] + 0 * exact
    printed = np.mean([ref_dithered(picture, exact, pixel, cast=1) for pixel in block], axis=0)
    shifted = ref_sixteen(picture, exact - [[0], [0.5]])
    assert np.abs(printed - ref_sixteen(picture, exact)).max() > 0.05
    assert np.abs(printed - shifted).mean() < np.abs(printed - ref_sixteen(picture, exact)).mean()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_straight_edge_is_a_ramp_of_four_texels(axis):
    """Linear, from dark to lit, two texels to either side of where the texels change."""
    held = np.zeros((SIDE, SIDE), bool)
    held[:, 8:] = True
    at = np.stack([np.linspace(4, 12, POINTS), np.full(POINTS, 9.3)])
    lit = np.asarray(_box(held if axis == 0 else held.T, at if axis == 0 else at[::-1], 4.0))
    np.testing.assert_allclose(lit, np.clip(0.5 + (at[0] - 8) / 4, 0, 1), atol=2e-6)
    assert (np.diff(lit) >= 0).all() and lit[0] == 0 and lit[-1] == 1


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.02, 0.5, 0.98, 1.0]))
def test_shares_lie_between_none_and_all(seed, share):
    """Exactly 0 and 1 where all tests agree, so that nothing lit is nearly so."""
    rng = np.random.default_rng(seed)
    held = rng.random((SIDE, SIDE)) < share
    at = (rng.random((2, POINTS)) * SIDE).astype(np.float32)
    pixel = jnp.zeros((2, POINTS), jnp.int32)
    for lit in (_box(held, at, 4.0), _box(held, at, 1.0), _dithered(held, at, pixel)):
        assert lit.min() >= 0 and lit.max() <= 1
        if share in (0.0, 1.0):
            assert (lit == share).all()


def by_place(at):
    """The hardware's test, a window of no whole texels, and a dithered pattern."""
    around, pixel = painted(picture, at), jnp.zeros(at.shape, jnp.int32)
    return jnp.stack([box(around, 1.0), box(around, 2.5), dithered(around, pixel)])


_by_place, _gradient = jax.jit(by_place), value_and_gradient(by_place)


@given(st.lists(st.floats(0, SIDE) | st.integers(0, 2 * SIDE).map(lambda k: k / 2),
                min_size=16, max_size=16))  # fmt: skip
def test_gradients_are_finite(at):
    """On borders and centres of texels too, where a ramp begins."""
    assert_finite(_gradient(np.reshape(np.asarray(at, np.float32), (2, 8))))


def test_gradients_are_those_of_a_piecewise_linear_function(x64):
    """Central differences agree, and along an axis nothing is curved between the kinks, which are
    where a window's side crosses a texel's border."""
    at = np.random.default_rng(3).integers(2, 17, (2, 40)) + np.random.default_rng(4).uniform(
        0.3, 0.45, (2, 40)
    )
    assert_gradient(by_place, at)
    steps = 0.03 * np.array([-1.0, 0.0, 1.0])
    for axis in np.eye(2):
        before, here, after = (np.asarray(_by_place(at + step * axis[:, None])) for step in steps)
        np.testing.assert_allclose(after - here, here - before, atol=1e-12)


def test_noise_belongs_to_a_pixel_and_fills_the_square(dtype):
    pixel = jnp.stack(jnp.meshgrid(jnp.arange(64), jnp.arange(64))).reshape(2, -1)
    pixel = pixel.astype(jnp.int32)
    found = np.asarray(noise(pixel, 3, jnp.dtype(dtype)), np.float64)
    assert 0 <= found.min() and found.max() < 1
    counts, *_ = np.histogram2d(*found, bins=8, range=[[0, 1]] * 2)
    # Chi-square of 63 degrees of freedom: mean 63, standard deviation 11.
    assert ((counts - 64) ** 2 / 64).sum() < 63 + 5 * 11.3
    assert np.abs(np.corrcoef(*found)[0, 1]) < 0.08
    order = np.random.default_rng(0).permutation(4096)
    np.testing.assert_array_equal(noise(pixel[:, order], 3, jnp.dtype(dtype)), found[:, order])
    assert (np.asarray(noise(pixel, 4, jnp.dtype(dtype))) != found).mean() > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("half", [(0.5, 0.5), (2.0, 0.7), (0.3, 3.6)])
def test_many_samples_are_the_area_of_the_box(half):
    """Of 64 x 64 samples only those in cells that an edge crosses are by chance: of the at most 8
    edges along an axis a cell's width each, 1 / 64 of the box, half of it wrong at the worst."""
    at = places.astype(np.float32)
    halves = jnp.repeat(jnp.asarray(half, jnp.float32)[:, None], POINTS, axis=1)
    pixel = jnp.stack([jnp.arange(POINTS), jnp.arange(POINTS) % 7]).astype(jnp.int32)
    sampled = eqx.filter_jit(
        lambda strata: stratified_share(painted(picture, at), halves, pixel, strata)
    )
    expected = ref_area(picture, at.astype(np.float64), np.asarray(half)[:, None])
    errors = [np.abs(np.asarray(sampled(strata)) - expected) for strata in (4, 64)]
    assert errors[1].max() < 0.02 and errors[0].mean() > 4 * errors[1].mean()


def test_the_box_of_a_footprint_holds_its_corners_and_no_more():
    """Half of what the two sides of the pixel span, and never less than asked for."""
    texels = np.random.default_rng(0).normal(size=(2, 2, 50)) * 3
    corners = np.einsum("ijn,jk->ikn", texels, [[-0.5, 0.5, -0.5, 0.5], [-0.5, -0.5, 0.5, 0.5]])
    widest = np.abs(corners).max(axis=1)
    for least in (0.0, 4.0):
        found = box_of(jnp.asarray(texels), least)
        np.testing.assert_allclose(found, np.maximum(widest, least / 2), rtol=1e-6)


# Scenes.

INNER = {sibling.name: sibling for sibling in SIBLINGS}


def kernels_of(inner: ShadowAlgorithm) -> list[FilteredShadowMap]:
    return [FilteredShadowMap(kernel, 4.0, strata=3, inner=inner) for kernel in KERNELS]


@functools.cache
def tilted(tilt_deg: float, kind: str):
    """A floor alone under a light that many degrees off its normal: eye, frame, rays."""
    floor = Rectangle("floor", (0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    view = ViewSpec("v", (0.4, -2.5, 2.2), (0.1, 0.2, 0.0), fov_x_deg=40.0, width=64, height=64)
    tilt = np.radians(tilt_deg)
    x, y, z = np.array([np.sin(tilt) * 0.8, np.sin(tilt) * 0.6, np.cos(tilt)]).tolist()
    light = LightSpec("sun", "directional", direction=(-x, -y, -z))
    if kind == "point":
        light = LightSpec("lamp", "point", position=(9 * x, 9 * y, 9 * z))
    eye = analytic_eye([floor], view)
    return eye, light_frame(light, eye, scene_bounds([floor])), AnalyticRays([floor])


OTHERS = [
    pytest.param(name, "directional" if k % 2 else "point", 89.0, marks=pytest.mark.slow)
    for k, name in enumerate(MAPS) if name not in ("uniform", "adaptive", "logarithmic")
]  # fmt: skip


@pytest.mark.parametrize(
    ("inner", "kind", "tilt_deg"),
    [
        ("uniform", "point", 89.0),
        ("uniform", "directional", 89.0),
        ("adaptive", "point", 89.0),
        ("logarithmic", "directional", 89.0),
        *OTHERS,
    ],
)
def test_a_plane_does_not_shade_itself_under_any_filter(inner, kind, tilt_deg):
    """Each test is of the plane at its own texel's centre: all of the light, exactly, to 89 degrees
    and with windows of several texels."""
    eye, frame, rays = tilted(tilt_deg, kind)
    algorithm = replace(INNER[inner].of_budget(4**7, frame.faces), compare="depth")
    # What tells kernels apart does not depend on the map; the uniform one is asked by all.
    filters = kernels_of(algorithm)[:: 1 if inner == "uniform" else 4]
    state = filters[0].build(eye, frame, rays)
    for each in filters:
        lit = np.asarray(each.visibility(state, eye.points))
        assert np.array_equal(lit, eye.valid), each.name


@pytest.mark.parametrize("inner", [pytest.param("adaptive", marks=pytest.mark.slow), "logarithmic"])
def test_flat_maps_of_all_families_are_filtered_alike(inner):
    """Degenerate settings leave every map the uniform one's texels: of their pages and charts a
    filter makes what it makes of those, but for pixels within a rounding of a border."""
    case = analytic_case("a4_disc_light", 64)
    answers = []
    for algorithm in (UniformShadowMap(128, compare="both"), INNER[inner].degenerate(128, "both")):
        filtered = FilteredShadowMap("sixteen", inner=algorithm)
        state = filtered.build(case.eye, case.frame, case.rays)
        answers.append(np.asarray(filtered.visibility(state, case.eye.points)))
    one, other = answers
    assert np.sum(np.abs(one - other) > 1e-3) <= 2
    assert 0.02 < np.mean((one > 0) & (one < 1))


@functools.cache
def filtered_case(kernel: Kernel):
    case = analytic_case("a6_sphere_sun", 64)
    algorithm = FilteredShadowMap(kernel, 2.0, strata=4, inner=UniformShadowMap(48))
    return case, algorithm, algorithm.build(case.eye, case.frame, case.rays)


def chosen(points: SurfacePoints, index) -> SurfacePoints:
    return SurfacePoints(
        points.position[:, index], points.normal[:, index], points.prim[index],
        points.valid[index], points.origin,
    )  # fmt: skip


@pytest.mark.parametrize("kernel", [pytest.param("dithered", marks=pytest.mark.slow), "original"])
def test_what_a_pixel_gets_does_not_depend_on_its_company(kernel):
    """A part of the image in another order, and another origin of the coordinates."""
    case, algorithm, state = filtered_case(kernel)
    points, n = case.eye.points, case.eye.points.count
    whole = np.asarray(algorithm.visibility(state, points))
    assert 0 < np.mean((whole > 0) & (whole < 1))
    part = np.random.default_rng(0).permutation(n)[: n // 4]
    lit = algorithm.visibility(state, chosen(points, part))
    np.testing.assert_array_equal(lit, whole[part])
    shift = np.array([0.25, -0.5, 0.125])
    moved = SurfacePoints(
        points.position - shift[:, None].astype(points.position.dtype),
        points.normal, points.prim, points.valid, points.origin + shift,
    )  # fmt: skip
    # Rounding moves shares a little, and samples that lie on borders of texels.
    off = np.abs(np.asarray(algorithm.visibility(state, moved)) - whole)
    assert np.sum(off > 1e-4) <= 0.005 * n


@pytest.mark.slow
def test_light_has_a_slope_in_position_where_it_is_a_share():
    """Through the whole query: none where all tests agree, and finite everywhere."""
    case, algorithm, state = filtered_case("sixteen")

    def total(position):
        points = eqx.tree_at(lambda points: points.position, case.eye.points, position)
        lit = algorithm.visibility(state, points)
        return lit.sum(), lit

    slope, lit = jax.grad(total, has_aux=True)(case.eye.points.position)
    steep = np.abs(np.asarray(slope)).max(axis=0)
    assert np.isfinite(steep).all()
    np.testing.assert_array_equal(steep > 0, (np.asarray(lit) > 0) & (np.asarray(lit) < 1))


def test_pixels_are_those_that_see_the_points():
    """Every pixel's own point, and none behind the camera."""
    eye = analytic_case("a6_sphere_sun", 64).eye
    column, row = np.asarray(pixel_of(eye.points, eye.camera))
    expected = np.arange(eye.points.count)
    at = row * eye.camera.width + column
    assert (at[eye.valid] == expected[eye.valid]).all() and not at[~eye.valid].any()
    behind = replace(eye.points, position=-eye.points.position)
    assert not np.asarray(pixel_of(behind, eye.camera)).any()


@pytest.mark.parametrize("kernel", ["dithered", "original"])
def test_each_filter_is_traced_once_and_may_be_jitted_with_its_state(kernel):
    case, algorithm, state = filtered_case(kernel)
    lit = algorithm.visibility(state, case.eye.points)
    again = algorithm.build(case.eye, case.frame, case.rays)
    with counted_traces() as traces:
        algorithm.visibility(again, case.eye.points).block_until_ready()
    assert traces == []
    jitted = eqx.filter_jit(lambda held, points: algorithm.visibility(held, points))
    assert np.sum(np.abs(jitted(state, case.eye.points) - lit) > 1e-3) <= 2


def test_all_but_the_answers_is_the_inner_maps():
    case, algorithm, state = filtered_case("sixteen")
    inner, held = algorithm.inner, state.inner
    assert algorithm.name == "filtered-sixteen-uniform-48"
    assert FilteredShadowMap("area", 2.5).name == "filtered-area2.5-uniform-2048"
    cost, own = algorithm.cost(state), inner.cost(held)
    assert (cost.rays, cost.texels, cost.passes) == (own.rays, own.texels, own.passes)
    assert 0 < cost.bytes - own.bytes < 200
    assert algorithm.memory(3) == inner.memory(3)
    np.testing.assert_array_equal(
        algorithm.density(state, case.eye.points), inner.density(held, case.eye.points)
    )
    kept = FilteredShadowMap(inner=UniformShadowMap(48, keep=True))
    seen = case.eye, case.frame, case.rays
    state = kept.update(kept.build(*seen), *seen)
    assert kept.cost(state).rays == 0 and kept.copied(state).inner is state.inner


@pytest.mark.parametrize(
    "inner", [PCSSShadowMap(16), MomentShadowMap(16), AccumulatedShadowMap(16)]
)
def test_what_is_soft_already_is_refused_before_anything_is_cast(inner):
    """Under a light with a size; without one all of them are the uniform map."""
    case = soft_case("a5_square", 16)
    rays = CountingRays(case.rays)
    with pytest.raises(UseError, match="filter"):
        FilteredShadowMap(inner=inner).build(case.eye, case.frame, rays)
    assert rays.launches == 0
    hard = replace(case.frame, area=None)
    FilteredShadowMap(inner=inner).build(case.eye, hard, rays)
    assert rays.launches == 1
