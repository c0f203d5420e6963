"""What must not matter: the unit of length, the order of the pixels, a little more memory.

Rigid motion is asked of every algorithm in `test_siblings`, and of frames that are fitted anew
here; that a view at rest never gets worse, pass by pass and update by update, in
`test_adaptive_refine`.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest
from helpers.analytic_cases import Case, analytic_case, moved, permuted, random_rotation
from helpers.effort import effort
from helpers.metamorphic import refitted, reordered, scaled
from helpers.registry import SIBLINGS, Sibling

from asmjax.geometry import fitted_directional_frame, fitted_point_frame
from asmjax.scene.spec import Disk, LightSpec, Rectangle, ViewSpec

SIDE, TEXELS = 64, 4**7
"""As in `test_siblings`, so that nothing more is compiled."""

LIGHTS = ("a6_sphere", "a6_sphere_sun")
"""A point light that needs three faces, and parallel rays."""

SCALES = effort((2.0**-20, 2.0**20), tuple(2.0**k for k in range(-30, 31, 5)))
"""Powers of two: nothing is rounded, so any difference is an absolute threshold somewhere."""

PAIRS = [
    pytest.param(sibling, name, id=f"{sibling.name}-{name}")
    for k, sibling in enumerate(SIBLINGS)
    for j, name in enumerate(LIGHTS)
    if not sibling.charts or j == k % 2
]
each = pytest.mark.parametrize(("sibling", "name"), PAIRS)


def siblings(chosen):
    return pytest.mark.parametrize("sibling", chosen, ids=lambda s: s.name)


def answer(sibling: Sibling, case: Case, texels: int = TEXELS):
    """Algorithm, state, and visibility of the case's pixels."""
    algorithm = sibling.of_budget(texels, case.frame.faces)
    state = algorithm.build(case.eye, case.frame, case.rays)
    return algorithm, state, np.asarray(algorithm.visibility(state, case.eye.points))


@functools.cache
def plain(sibling: Sibling, name: str):
    case = analytic_case(name, SIDE)
    return case, *answer(sibling, case)


@each
@pytest.mark.parametrize("factor", SCALES)
def test_units_of_length_change_no_bit(sibling, name, factor):
    """A scene of micrometres and one of megametres: equal images, and equal texels."""
    case, algorithm, state, before = plain(sibling, name)
    other = scaled(case, factor)
    _, again, after = answer(sibling, other)
    np.testing.assert_array_equal(before, after)
    assert 0.1 < before.mean() < 1
    here, there = (
        np.asarray(algorithm.density(s, c.eye.points)) for s, c in ((state, case), (again, other))
    )
    np.testing.assert_array_equal(here, there)


@each
def test_the_order_of_the_pixels_changes_nothing_but_theirs(sibling, name):
    """Asked in another order, the same answers in that order. Made for another order, the same map,
    but for sums over pixels that are rounded otherwise: two pixels on borders of texels. The tuned
    map measures at every so many-th pixel, so at others then: 1 %."""
    case, algorithm, state, before = plain(sibling, name)
    order = np.random.default_rng(3).permutation(before.size)
    asked = algorithm.visibility(state, reordered(case.eye.points, order))
    np.testing.assert_array_equal(np.asarray(asked), before[order])
    if not sibling.charts:
        return  # the adaptive map takes pixels in turns: `test_pixel_order_does_not_matter`
    other = algorithm.build(permuted(case.eye, order), case.frame, case.rays)
    again = np.asarray(algorithm.visibility(other, case.eye.points))
    assert np.sum(again != before) <= (0.01 * before.size if sibling.name == "tuned" else 2)


@pytest.mark.slow
@siblings([sibling for k, sibling in enumerate(SIBLINGS) if not sibling.charts or k % 2])
def test_frames_fitted_to_a_turned_scene_are_as_good(sibling):
    """The frame's own roll depends on the light's axis, so its texels lie otherwise: as many pixels
    are wrong, but for the scatter of those at edges."""
    case, _, _, before = plain(sibling, "a6_sphere_sun")
    other = moved(case, random_rotation(7), np.array([300.0, -200.0, 100.0]))
    sun = replace(case.light, direction=tuple((random_rotation(7) @ case.light.direction).tolist()))
    _, _, after = answer(sibling, refitted(other, other.shapes, sun))
    errors = [int(case.wrong(lit).sum()) for lit in (before, after)]
    assert abs(errors[1] - errors[0]) <= 3 * np.sqrt(max(errors)) + 2, errors


@siblings(effort(SIBLINGS[:2], SIBLINGS))
def test_error_falls_with_every_doubling_in_trend(sibling):
    """Wrong pixels are those at edges that chance puts beside a texel's: their number scatters by
    its root, and a doubling of the texels never adds more than three of those."""
    case = analytic_case("a4_disc_light", 128)
    wrong = []
    for k in effort((10, 12, 14), range(10, 19)):
        _, _, lit = answer(sibling, case, 2**k)
        wrong.append(int(case.wrong(lit).sum()))
    for before, after in zip(wrong, wrong[1:], strict=False):
        assert after <= before + 3 * np.sqrt(before) + 2, wrong
    assert wrong[-1] < wrong[0], wrong


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
    case = refitted(replace(analytic_case("a1_square", SIDE), view=view), (leaf, ground), lamp)
    answers = [answer(sibling, scaled(case, f))[2] for f in (2.0**-20, 1.0, 2.0**20)]
    for lit in answers:
        np.testing.assert_array_equal(lit, answers[1])
    assert answers[1][case.eye.shape == 0].all()
