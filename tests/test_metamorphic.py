"""What must not matter: the unit of length, the place, the pixels' order, a little more memory.

Lights are drawn for each example, those that have a size for the maps that answer with their
penumbras. Rigid motion of one scene is asked of every algorithm in `test_siblings` too; that a
view at rest never gets worse, update by update, in `test_adaptive_refine`.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.analytic_cases import Case, permuted, random_rotation
from helpers.effort import effort, examples
from helpers.metamorphic import SIZED, SIZELESS, drawn, refitted, reordered, scaled, turned
from helpers.registry import SIBLINGS, Sibling
from helpers.traced_cases import traced_case
from hypothesis import given, settings
from hypothesis import strategies as st

from asmjax.geometry import fitted_directional_frame, fitted_point_frame
from asmjax.scene.spec import Disk, LightSpec, Rectangle, ViewSpec
from asmjax.shadow import SOFT, AdaptiveShadowMap

SIDE, TEXELS = 64, 4**7
"""As in `test_siblings`, so that nothing more is compiled."""

EACH = 60
"""Examples of a pair of algorithm and light in the longer profiles: over all pairs more than 1,000
of each property, in some minutes."""

ADAPTIVE = next(sibling for sibling in SIBLINGS if sibling.name == "adaptive")

seeds = st.integers(0, 2**32 - 1)


def is_soft(sibling: Sibling) -> bool:
    return type(sibling.of_budget(TEXELS, 1)) in SOFT.values()


def lights_of(sibling: Sibling, k: int):
    """Those with a size for what knows sizes, one of the others for maps of charts, else both."""
    if is_soft(sibling):
        return SIZED
    return (SIZELESS[k % 2],) if sibling.charts else SIZELESS


PAIRS = [(sibling, kind) for k, sibling in enumerate(SIBLINGS) for kind in lights_of(sibling, k)]


def pairs(chosen):
    return pytest.mark.parametrize(
        ("sibling", "kind"), chosen, ids=[f"{sibling.name}-{kind}" for sibling, kind in chosen]
    )


each = pairs(PAIRS)


def siblings(chosen):
    return pytest.mark.parametrize("sibling", chosen, ids=lambda s: s.name)


def answer(sibling: Sibling, case: Case, texels: int = TEXELS):
    """Algorithm, state, and visibility of the case's pixels."""
    algorithm = sibling.of_budget(texels, case.frame.faces)
    state = algorithm.build(case.eye, case.frame, case.rays)
    return algorithm, state, np.asarray(algorithm.visibility(state, case.eye.points))


def rounded(sibling: Sibling) -> float:
    """What of 4,096 pixels may change, in all: two that lie within a rounding of a texel's border;
    of soft shadows some taps, of which it takes 16 and more to make a pixel."""
    return 0.25 if is_soft(sibling) else 2.0


@each
@given(seed=seeds, power=st.sampled_from((20, -20, *range(-30, 31))))
@settings(max_examples=examples(2, EACH))
def test_units_of_length_change_no_bit(sibling, kind, seed, power):
    """A scene of micrometres and one of megametres: equal images, and equal texels. By a power of
    two nothing is rounded, so any difference is an absolute threshold somewhere."""
    case = drawn(kind, seed, SIDE)
    algorithm, state, before = answer(sibling, case)
    other = scaled(case, 2.0**power)
    _, again, after = answer(sibling, other)
    np.testing.assert_array_equal(before, after)
    assert 0.1 < before.mean() < 1
    here, there = (
        np.asarray(algorithm.density(s, c.eye.points)) for s, c in ((state, case), (again, other))
    )
    np.testing.assert_array_equal(here, there)


@each
@given(seed=seeds, rotation=seeds, far=st.sampled_from((1e4, 1.0, 0.0)))
@settings(max_examples=examples(1, EACH))
def test_rigid_motion_changes_nothing(sibling, kind, seed, rotation, far):
    """Scene, eye and light as one body, up to 10,000 units away: positions are relative to the eye,
    so only receivers within a rounding of a texel's border may change."""
    case = drawn(kind, seed, SIDE)
    other = turned(case, random_rotation(rotation), far * np.array([1.0, -2.0, 0.5]))
    (_, _, before), (_, _, after) = answer(sibling, case), answer(sibling, other)
    np.testing.assert_array_equal(case.eye.valid, other.eye.valid)
    assert np.abs(after - before).sum() <= rounded(sibling)


@each
@given(seed=seeds, order=seeds)
@settings(max_examples=examples(1, EACH))
def test_the_order_of_the_pixels_changes_nothing_but_theirs(sibling, kind, seed, order):
    """Asked in another order, the same answers in that order. Made for another order, the same map,
    but for sums over pixels that are rounded otherwise. The tuned map measures at every so many-th
    pixel, so at others then: 1 %."""
    case = drawn(kind, seed, SIDE)
    algorithm, state, before = answer(sibling, case)
    order = np.random.default_rng(order).permutation(before.size)
    asked = algorithm.visibility(state, reordered(case.eye.points, order))
    np.testing.assert_array_equal(np.asarray(asked), before[order])
    if sibling.name == "adaptive":
        return  # it takes pixels in turns: `test_pixel_order_does_not_matter`
    other = algorithm.build(permuted(case.eye, order), case.frame, case.rays)
    again = np.asarray(algorithm.visibility(other, case.eye.points))
    most = 0.01 * before.size if sibling.name == "tuned" else rounded(sibling)
    assert np.abs(again - before).sum() <= most


@pytest.mark.slow
@siblings([sibling for k, sibling in enumerate(SIBLINGS) if not sibling.charts or k % 2])
@given(seed=seeds, rotation=seeds)
@settings(max_examples=examples(1, EACH))
def test_frames_fitted_to_a_turned_scene_are_as_good(sibling, seed, rotation):
    """The frame's own roll depends on the light's axis, so its texels lie otherwise: as many pixels
    are wrong, but for the scatter of those at edges: by three standard deviations of the difference
    of two counts."""
    case, turn = drawn("sun", seed, SIDE), random_rotation(rotation)
    other = turned(case, turn, np.array([300.0, -200.0, 100.0]))
    sun = replace(case.light, direction=tuple((turn @ case.light.direction).tolist()))
    (_, _, before), (_, _, after) = (
        answer(sibling, one) for one in (case, refitted(other, other.shapes, sun))
    )
    errors = [int(case.wrong(lit).sum()) for lit in (before, after)]
    assert abs(errors[1] - errors[0]) <= 4 * np.sqrt(max(errors)) + 2, errors


def check_falling(off):
    """Errors lie at edges that chance puts beside a texel's: their sum scatters by its root, and
    never grows by more than three of those."""
    for before, after in zip(off, off[1:], strict=False):
        assert after <= before + 3 * np.sqrt(before) + 2, off


FEW = 16
"""Wrong pixels of 4,096 that need not become fewer."""

TRENDS = (("uniform", "lamp"), ("adaptive", "sun"), ("pcss", "bulb"))
"""Of these in the quick run; all others have more sizes to compile."""


@pairs(effort([pair for pair in PAIRS if (pair[0].name, pair[1]) in TRENDS], PAIRS))
@given(seed=seeds)
@settings(max_examples=examples(1, EACH))
def test_error_falls_with_more_texels_in_trend(sibling, kind, seed):
    """By what pixels are wrong, in all: three maps, each with 8 times the texels."""
    case = drawn(kind, seed, SIDE, 4)
    off = [case.off(answer(sibling, case, 2**k)[2]) for k in (12, 15, 18)]
    check_falling(off)
    # Below that it is chance, or what a soft map takes several depths of blockers for.
    assert off[-1] < off[0] or off[0] < FEW, off


@pytest.mark.parametrize("kind", SIZELESS)
@given(seed=seeds)
@settings(max_examples=examples(2, 1_000))
def test_a_pass_more_never_makes_an_adaptive_map_worse(kind, seed):
    """One, two, four, and as many as it takes: but for two pixels that chance had right."""
    case = drawn(kind, seed, SIDE)
    known = ADAPTIVE.of_budget(TEXELS, case.frame.faces)
    assert isinstance(known, AdaptiveShadowMap)
    off = []
    for passes in (1, 2, 4, known.max_passes):
        algorithm = replace(known, max_passes=passes)
        state = algorithm.build(case.eye, case.frame, case.rays)
        off.append(case.off(algorithm.visibility(state, case.eye.points)))
    assert all(after <= before + 2 for before, after in zip(off, off[1:], strict=False)), off


# Thresholds that were lengths once, each with what it broke.


def test_light_straight_down_on_a_flat_scene_starts_above_it():
    """The scene has no extent along the light: the plane that depth counts from was 1e-12 units
    above it, whatever the scene's size, and below the rounding of large coordinates."""
    for size in (1e-6, 1.0, 1e6):
        bounds = np.array([[-size, size], [-size, size], [3 * size, 3 * size]])
        receivers = np.array([[-0.5, 0.5], [0.2, 0.1], [3.0, 3.0]]) * size
        frame = fitted_directional_frame((0.0, 0.0, -1.0), receivers, bounds)
        above = float(frame.origin[2] - 3 * size)
        assert 1e-9 * size < above < 1e-6 * size


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_frame_is_as_wide_as_its_receivers_in_any_unit(size):
    """It was 1e-5 units wide at least: a scene of micrometres filled a hundredth of it."""
    rng = np.random.default_rng(0)
    receivers = rng.uniform(-1, 1, (3, 100)) * size
    bounds = np.array([[-2.0, 2.0]] * 3) * size
    frame = fitted_directional_frame((0.3, 0.2, -1.0), receivers, bounds)
    x, y, _ = frame.rotation[0] @ receivers
    np.testing.assert_allclose(frame.extent[0], [np.ptp(x), np.ptp(y)], rtol=1e-3)


def test_a_single_receiver_lies_within_its_frame_in_float32():
    """Its rectangle is as wide as what float32 makes of its place, seen from the eye: for a light
    close to it, which sees that as a wide angle, too."""
    point = np.array([[0.0], [0.0], [0.0]])
    sun = fitted_directional_frame((0.0, 0.0, -1.0), point, np.zeros((3, 2)), blur=1e-3)
    lamp = fitted_point_frame((0.0, 0.0, 1e-3), point, 1e-9, blur=1e-5)
    assert sun.extent.min() >= 2e-3 and lamp.extent.min() >= 0.02


@siblings(effort(SIBLINGS[:3], SIBLINGS))
def test_a_leaf_beside_a_near_lamp_is_lit_in_any_unit(sibling):
    """One pixel sees a leaf, a lamp stands a thousandth of the distance before it."""
    view = ViewSpec("leaf", (0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, SIDE, SIDE)
    leaf = Disk("leaf", (0.02, 0.01, 0.0), (0.0, 0.0, 1.0), 0.02)
    ground = Rectangle("ground", (0.0, 0.0, -1.0), (9.0, 0.0, 0.0), (0.0, 9.0, 0.0))
    lamp = LightSpec("lamp", "point", position=(0.021, 0.012, 0.004))
    case = traced_case((leaf, ground), view, lamp)
    on_leaf = case.eye.shape == 0
    assert on_leaf.sum() == 1 and (case.expected[on_leaf] == 1).all()
    answers = [answer(sibling, scaled(case, f))[2] for f in (2.0**-20, 1.0, 2.0**20)]
    for lit in answers:
        np.testing.assert_array_equal(lit, answers[1])
    assert answers[1][on_leaf].all()
