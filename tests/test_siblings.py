"""What every shadow algorithm must do, on scenes whose visibility is known in closed form.

The algorithms are the entries of `helpers.registry`; the oracles are the closed forms of
`asmjax.scene.analytic_scenes`, the uniform map, and each algorithm itself under another
transformation of JAX or of space.
"""

import functools
import time
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import (
    analytic_case,
    kept_arrays,
    moved,
    random_rotation,
)
from helpers.counting import CountingRays
from helpers.effort import ALIKE
from helpers.made_for import MADE, avenue, made_case
from helpers.made_for import TEXELS as MADE_TEXELS
from helpers.registry import SIBLINGS, VARIANTS

from asmjax.buffers import SurfacePoints
from asmjax.experiment.traces import counted_traces
from asmjax.geometry import in_domain, towards_light
from asmjax.scene.analytic_rays import analytic_eye
from asmjax.shadow import ALGORITHMS, FilteredShadowMap, UniformShadowMap
from asmjax.shadow.comparison import texel_bytes

SIDE = 64
"""Pixels a side where one build is enough: how an algorithm answers, not how well."""

SAME = 1e-3
"""What shares of light may differ by, of answers that are the same: a thousandth of a texel."""

TEXELS = 4**7
BUDGETS = (4**7, 4**9)
"""Texels in all, as against the 16,384 pixels of the images that error is measured in."""


LIGHTS = ("a6_sphere", "a6_sphere_sun")
"""A point light that needs three faces, and parallel rays."""


VARIED = (
    "logarithmic-uniform", "partitioned-warped", "filtered-sixteen", "filtered-original", "moment",
    "filtered", "tuned",
)  # fmt: skip
"""Variants that the quick run leaves to the others, and families that have files of their own."""


def case_of(sibling, *more):
    """A parameter set of the tests below, its name beginning with the algorithm's."""
    marks = [pytest.mark.slow] if sibling.name in (*ALIKE, *VARIED) else []
    return pytest.param(sibling, *more, id="-".join((sibling.name, *more)), marks=marks)


def pairs(*chosen):
    """Parametrises `sibling` and `name` by pairs of an algorithm and a scene."""
    return pytest.mark.parametrize(("sibling", "name"), [case_of(*pair) for pair in chosen])


each = pairs(
    *(
        (sibling, name)
        for k, sibling in enumerate(SIBLINGS)
        for j, name in enumerate(LIGHTS)
        if not sibling.charts or j == k % 2
    )
)
each_setting = pairs(
    *((sibling, LIGHTS[k % 2]) for k, sibling in enumerate(SIBLINGS)),
    *((variant, "a4_disc_light") for variant in VARIANTS),
)
KEEPING = ("uniform", "filtered", "accumulated", "pcss", "moment")
"""Families with the setting `keep`, of their own or of the inner map."""

each_sibling = pytest.mark.parametrize("sibling", [case_of(one) for one in SIBLINGS])


def built(sibling, name, side=SIDE, texels=TEXELS):
    """Case, algorithm, state; built once, as building is most of the time."""
    return _built(sibling, name, side, texels, jnp.zeros(()).dtype.name)


def differing(one, other) -> int:
    """Answers that are not the same."""
    return int(np.sum(np.abs(one - other) > SAME))


@functools.cache
def _built(sibling, name, side, texels, precision):
    del precision
    case = analytic_case(name, side)
    algorithm = sibling.of_budget(texels, case.frame.faces)
    return case, algorithm, algorithm.build(case.eye, case.frame, case.rays)


def test_the_registry_names_every_algorithm():
    tested = {type(sibling.of_budget(TEXELS, 1)) for sibling in SIBLINGS}
    assert tested == set(ALGORITHMS.values())


def test_lights_are_of_the_kinds_that_these_tests_rely_on():
    frames = [analytic_case(name, SIDE).frame for name in LIGHTS]
    assert [frame.faces for frame in frames] == [3, 1]
    assert [frame.perspective for frame in frames] == [True, False]


def check_degenerate(sibling, name, compare):
    """Same texel centres, same test: equal bit for bit."""
    compare = "depth" if sibling.depth_only else compare
    case = analytic_case(name, SIDE)
    flat = UniformShadowMap(128, compare=compare)
    expected = flat.visibility(flat.build(case.eye, case.frame, case.rays), case.eye.points)
    algorithm = sibling.degenerate(128, compare)
    state = algorithm.build(case.eye, case.frame, case.rays)
    np.testing.assert_array_equal(algorithm.visibility(state, case.eye.points), expected)
    assert algorithm.effective_resolution(state) == 128
    assert not algorithm.status(state).is_limit
    assert 0.2 < np.mean(expected) < 0.99


@each
def test_degenerate_settings_are_the_uniform_map(sibling, name):
    check_degenerate(sibling, name, "both")


@pytest.mark.parametrize("sibling", VARIANTS, ids=lambda s: s.name)
def test_degenerate_settings_of_variants_are_the_uniform_map(sibling):
    check_degenerate(sibling, "a4_disc_light", "both")


@each_sibling
@pytest.mark.parametrize("compare", ["depth", "id"])
def test_degenerate_settings_with_every_comparison(sibling, compare):
    check_degenerate(sibling, "a4_disc_light", compare)


@each_sibling
def test_degenerate_settings_in_float64(sibling, x64):
    check_degenerate(sibling, "a4_disc_light", "both")


@each_setting
def test_error_falls_with_the_budget(sibling, name):
    """With 16 times the texels at most half as many pixels are wrong (a quarter, while texels are
    wider than pixels)."""
    errors = []
    for texels in BUDGETS:
        case, algorithm, state = built(sibling, name, 128, texels)
        errors.append(case.error(algorithm.visibility(state, case.eye.points)))
    assert errors[1] <= 0.5 * errors[0], errors


@each_setting
def test_no_error_away_from_edges(sibling, name):
    """A pixel is asked of the texel it lies in, so its texel's centre is less than a texel away on
    the receiver's plane: a wrong pixel has a shadow edge within that distance. The casters float
    far above the receiver, where the bias is smaller than the gap.
    """
    found = 0
    for texels in BUDGETS:
        case, algorithm, state = built(sibling, name, 128, texels)
        wrong = case.wrong(algorithm.visibility(state, case.eye.points))
        width = case.texel_width(sibling.log2_resolution(algorithm, state, case.eye.points))
        assert (case.edge_distance[wrong] < width[wrong]).all()
        found += wrong.sum()
    assert found, "nothing was tested"


def wrong_pixels(sibling, light: str) -> float:
    case = made_case(light)
    algorithm = sibling.of_budget(MADE_TEXELS, case.frame.faces)
    state = algorithm.build(case.eye, case.frame, case.rays)
    lit = algorithm.visibility(state, case.eye.points)
    return case.off(lit) if case.frame.area is not None else int(case.wrong(lit).sum())


def test_every_sibling_is_made_for_something():
    made = {type(each.sibling.of_budget(MADE_TEXELS, 1)) for each in MADE}
    assert made | {UniformShadowMap} == set(ALGORITHMS.values())
    assert avenue("lamp").frame.faces == 5


@pytest.mark.parametrize(
    "made",
    [
        pytest.param(
            made, id=made.name, marks=[pytest.mark.slow] if made.name.startswith("tuned") else []
        )
        for made in MADE
    ],
)
def test_each_sibling_beats_the_uniform_map_on_what_it_is_made_for(made):
    """Fewer wrong pixels with as many bytes, where depths run from 1.3 to 100 (`helpers.made_for`);
    truth is a float64 shadow ray for each pixel, or under a light with a size 256 of them."""
    flat = wrong_pixels(SIBLINGS[0], made.light)
    assert flat > 100, "nothing was tested"
    assert wrong_pixels(made.sibling, made.light) <= made.most * flat


@pytest.mark.parametrize("name", ["a1_square", "a5_half_plane", "a8_slabs"])
def test_other_scenes_are_right_away_from_edges(name):
    """As above: a square, one endless edge, casters thinner than a texel."""
    case = analytic_case(name, 128)
    flat = UniformShadowMap(100)
    state = flat.build(case.eye, case.frame, case.rays)
    wrong = case.wrong(flat.visibility(state, case.eye.points))
    assert (case.edge_distance[wrong] < case.texel_width(np.log2(100))[wrong]).all()
    assert wrong.any(), "nothing was tested"


@pytest.mark.parametrize("name", ["a4_disc_light", "a6_sphere_sun"])
def test_uniform_map_converges_to_first_order(name):
    """Misclassification is texel width times edge length: slope -1 in log-log.

    Curved shadows, so that the grid's phase averages out; 0.15 is three standard deviations of
    the fitted slope for the few hundred wrong pixels of the finest map.
    """
    case = analytic_case(name, 512)
    sides = np.array([32, 64, 128, 256])
    errors = []
    for side in sides:
        flat = UniformShadowMap(int(side))
        state = flat.build(case.eye, case.frame, case.rays)
        errors.append(case.error(flat.visibility(state, case.eye.points)))
    slope = np.polyfit(np.log(sides), np.log(errors), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.15), errors


@each
def test_cost_is_what_exists_and_stays_below_the_limit(sibling, name):
    case, algorithm, _ = built(sibling, name)
    rays = CountingRays(case.rays)
    state = algorithm.build(case.eye, case.frame, rays)
    cost = algorithm.cost(state)
    assert cost.bytes == sum(array.nbytes for array in kept_arrays(state))
    assert cost.bytes <= TEXELS * texel_bytes("both")
    assert 0 < cost.texels <= TEXELS
    assert (cost.rays, cost.passes) == (rays.texels, rays.launches)
    assert set(cost.seconds) == {"build", "analysis"} and min(cost.seconds.values()) >= 0


@pytest.mark.parametrize(
    ("sibling", "how"),
    [case_of(one, "anew") for one in SIBLINGS]
    + [case_of(one, "kept") for one in SIBLINGS if one.name in KEEPING],
)
def test_cost_is_that_of_the_last_build_or_update_alone(sibling, how):
    """Two frames, of a light and casters that rest: from another place, and at rest there."""
    case, algorithm, _ = built(sibling, LIGHTS[SIBLINGS.index(sibling) % 2])
    algorithm, rays = kept_by(algorithm) if how == "kept" else algorithm, CountingRays(case.rays)
    state = algorithm.build(case.eye, case.frame, rays)
    there = analytic_eye(case.shapes, replace(case.view, fov_x_deg=case.view.fov_x_deg / 2))
    for eye in (there, there):
        before, start = (rays.texels, rays.launches), time.perf_counter()
        state = algorithm.update(state, eye, case.frame, rays)
        wall, cost = time.perf_counter() - start, algorithm.cost(state)
        assert (before[0] + cost.rays, before[1] + cost.passes) == (rays.texels, rays.launches)
        assert 0 <= sum(cost.seconds.values()) <= wall
        if how == "kept":
            assert (cost.rays, cost.passes, cost.seconds["build"]) == (0, 0, 0.0)


def inner_of(algorithm):
    return algorithm.inner if isinstance(algorithm, FilteredShadowMap) else algorithm


def kept_by(algorithm):
    """The same settings, of a map that updates keep."""
    kept = replace(inner_of(algorithm), keep=True)
    return kept if inner_of(algorithm) is algorithm else replace(algorithm, inner=kept)


@each
def test_jit_is_no_jit(sibling, name):
    """Fused arithmetic may round a receiver on a texel's border to the other side: 2 of 4,096."""
    case, algorithm, state = built(sibling, name)
    points = case.eye.points
    compiled = np.asarray(algorithm.visibility(state, points))
    with jax.disable_jit():
        plain = np.asarray(algorithm.visibility(state, points))
    assert differing(compiled, plain) <= 2
    assert 0 < compiled.mean() < 1


@each
def test_vmap_over_batches_is_the_whole(sibling, name):
    case, algorithm, state = built(sibling, name)
    points = case.eye.points
    whole = np.asarray(algorithm.visibility(state, points))

    def batch(a):
        return jnp.moveaxis(a.reshape(*a.shape[:-1], 8, -1), -2, 0)

    def visibility(position, normal, prim, valid):
        chosen = SurfacePoints(position, normal, prim, valid, points.origin)
        return algorithm.visibility(state, chosen)

    parts = eqx.filter_vmap(visibility)(
        batch(points.position), batch(points.normal), batch(points.prim), batch(points.valid)
    )
    np.testing.assert_array_equal(np.asarray(parts).ravel(), whole)


@each
def test_one_trace_per_shape(sibling, name):
    """New values of the same shapes - points, light, texels - compile nothing again."""
    case, algorithm, state = built(sibling, name)
    other = moved(case, random_rotation(5), np.array([0.3, -0.2, 0.1]))
    algorithm.visibility(state, case.eye.points)
    with counted_traces() as traces:
        again = algorithm.build(other.eye, other.frame, other.rays)
        algorithm.visibility(again, other.eye.points).block_until_ready()
    assert traces == []


@each_sibling
def test_another_number_of_points_is_another_trace(sibling):
    """So that what is counted above is what could have been traced."""
    name = LIGHTS[SIBLINGS.index(sibling) % 2]
    _, algorithm, state = built(sibling, name)
    # Sizes of their own: siblings share what they compile.
    points = analytic_case(name, 13 + SIBLINGS.index(sibling)).eye.points
    with counted_traces() as traces:
        jax.eval_shape(lambda: algorithm.visibility(state, points))
    assert traces


@each
def test_visibility_is_a_share_and_dark_where_no_light_can_be(sibling, name, dtype):
    """All of it or nothing, but for filters. Flipped normals, points outside the frame and invalid
    pixels are dark; nothing is NaN."""
    case, algorithm, state = built(sibling, name)
    points, n = case.eye.points, case.eye.points.count
    flipped = np.arange(n) % 5 == 0
    away = np.arange(n) % 7 == 0
    changed = SurfacePoints(
        position=points.position + jnp.where(away, 1e3, 0.0).astype(points.position.dtype),
        normal=jnp.where(flipped, -points.normal, points.normal),
        prim=points.prim,
        valid=points.valid & (np.arange(n) % 11 != 0),
        origin=points.origin,
    )
    lit = algorithm.visibility(state, changed)
    assert lit.shape == (n,) and lit.dtype == dtype
    assert lit.min() == 0 and lit.max() == 1
    assert sibling.soft or set(np.unique(np.asarray(lit))) == {0.0, 1.0}
    world = np.where(case.eye.valid, case.eye.world, 0.0) + np.where(away, 1e3, 0.0)
    normal = np.where(flipped, -1, 1) * case.eye.normal
    facing = np.einsum("in,in->n", normal, towards_light(case.frame, world)) > 0
    possible = np.asarray(changed.valid) & facing & in_domain(case.frame, world)
    assert not np.asarray(lit)[~possible].any()
    assert np.asarray(lit)[possible].mean() > 0.5


@each
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_rigid_motion_changes_nothing(sibling, name, shift):
    """Scene, eye and light move as one body, 10,000 units away too: positions are relative to the
    eye, so only receivers within a rounding of a texel's border may change (2 of 4,096)."""
    case, algorithm, state = built(sibling, name)
    other = moved(case, random_rotation(11), shift * np.array([1.0, -2.0, 0.5]))
    before = np.asarray(algorithm.visibility(state, case.eye.points))
    state = algorithm.build(other.eye, other.frame, other.rays)
    after = np.asarray(algorithm.visibility(state, other.eye.points))
    np.testing.assert_array_equal(case.eye.valid, other.eye.valid)
    assert differing(before, after) <= 2


@each
def test_float32_equals_float64(sibling, name):
    """Precision decides only receivers within a rounding of a texel's border (2 of 4,096)."""
    lit = []
    for double in (False, True):
        with jax.enable_x64(double):
            case, algorithm, state = built(sibling, name)
            lit.append(np.asarray(algorithm.visibility(state, case.eye.points)))
    assert lit[0].dtype == np.float32 and lit[1].dtype == np.float64
    assert differing(*lit) <= 2


@each_sibling
def test_points_that_several_faces_hold(sibling):
    """One face over a part of the image, and two others, turned, over all of it. Every receiver is
    served, and wrong only within a texel of an edge, on either side of the seam."""
    case = analytic_case("a4_disc_light", SIDE)
    frame, first = case.frame, case.frame.rotation[0]
    half = float(np.abs(frame.corner).max()) * 1.5
    faces = eqx.tree_at(
        lambda f: (f.rotation, f.corner, f.extent),
        frame,
        (
            np.stack([first, turned(0.5) @ first, turned(-0.3) @ first]),
            np.stack([frame.corner[0], [-half, -half], [-half, -half]]),
            np.stack([frame.extent[0] * [0.5, 1.0], *[[2 * half, 2 * half]] * 2]),
        ),
    )
    algorithm = sibling.of_budget(TEXELS, 3)
    state = algorithm.build(case.eye, faces, case.rays)
    lit = algorithm.visibility(state, case.eye.points)
    wrong = case.wrong(lit)
    log2 = sibling.log2_resolution(algorithm, state, case.eye.points)
    # The second face is at most 1.5 * sqrt(2) times as wide as the one that `texel_width` knows.
    assert (case.edge_distance[wrong] < 2.2 * case.texel_width(log2)[wrong]).all()
    assert case.error(lit) < 0.025


def turned(angle: float) -> np.ndarray:
    """(3, 3) rotation about the third axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
