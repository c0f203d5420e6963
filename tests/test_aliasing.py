"""Texels and pixels of any map: against the flat map's own footprints, and by moving one pixel."""

import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.poses import projected

from asmjax.experiment.aliasing import AliasingMaps, aliasing_maps, aliasing_numbers
from asmjax.experiment.maps import analysis_maps
from asmjax.shadow import SubdividedShadowMap, UniformShadowMap

SIDE = 48


@pytest.mark.parametrize("scene", ["a4_disc_light", "a6_sphere_sun"])
def test_a_flat_maps_m_is_that_of_its_resolution(scene):
    """Through `density` as through the resolution itself."""
    case = analytic_case(scene, SIDE)
    flat = UniformShadowMap(128)
    state = flat.build(case.eye, case.frame, case.rays)
    maps = aliasing_maps(flat, state, case.eye, case.frame)
    direct = analysis_maps(case.eye, case.frame, flat, state)
    np.testing.assert_array_equal(maps.known, ~np.isnan(direct["m"]))
    np.testing.assert_allclose(maps.m, direct["m"], rtol=2e-5)
    np.testing.assert_allclose(1 / maps.texels, direct["area_ratio"], rtol=2e-5)


def test_a_warped_maps_texels_are_those_that_a_step_in_the_image_passes():
    """Neighbouring pixels of one plane: their texel coordinates, summed step by step along a row,
    against the mapping itself; a chart is smooth, so the sum is good to second order."""
    case = analytic_case("a6_sphere_sun", 96)
    algorithm = SubdividedShadowMap(256, parts=1)
    state = algorithm.build(case.eye, case.frame, case.rays)
    maps = aliasing_maps(algorithm, state, case.eye, case.frame)
    points = case.eye.points
    uv = np.asarray(projected(points, case.frame).uv)
    density = np.asarray(algorithm.density(state, points))
    image = (2, *case.eye.size)
    # By differences in the image: the texels between two neighbours.
    step = np.einsum("ikn,kn->in", density, np.roll(uv, -1, axis=1) - np.roll(uv, 1, axis=1)) / 2
    normal = np.asarray(points.normal)
    flat = (normal[2] > 1 - 1e-6) & maps.known
    inner = np.zeros(image[1:], bool)
    inner[:, 1:-1] = True
    same = flat & inner.reshape(-1) & np.roll(flat, 1) & np.roll(flat, -1)
    assert same.sum() > 500
    got = maps.jacobian[:, 0][:, same]
    size = np.linalg.norm(got, axis=0)
    assert np.median(np.linalg.norm(got - step[:, same], axis=0) / size) < 0.01


def test_numbers_are_those_of_the_maps():
    """Quantiles and shares of a small set, and the texels that are asked for."""
    m = np.array([0.5, np.nan, 2.0, 4.0, 1.0])
    texels = np.array([4.0, np.nan, 0.25, 0.0625, 1.0])
    maps = AliasingMaps(m, 2 * m, texels, np.zeros((2, 2, 5)))
    numbers = aliasing_numbers(maps, 100)
    assert numbers.receivers == 4
    assert (numbers.max_m, numbers.max_perspective) == (4.0, 8.0)
    assert numbers.median_m == 1.5
    assert (numbers.above_1, numbers.below_1) == (0.5, 0.25)
    assert numbers.wasted == pytest.approx(1 - (1 + 0.25 + 0.0625 + 1) / 100)
    assert set(numbers.record()) == set(type(numbers).__dataclass_fields__)


def test_without_receivers_everything_is_wasted():
    none = np.full(4, np.nan)
    numbers = aliasing_numbers(AliasingMaps(none, none, none, np.zeros((2, 2, 4))), 16)
    assert (numbers.receivers, numbers.max_m, numbers.wasted) == (0, 0.0, 1.0)
