"""Predicted displacement against what closed-form scenes and made-up images give."""

import numpy as np
import pytest
from helpers.analytic_cases import analytic_case

from asmjax.experiment.aliasing import AliasingMaps, aliasing_maps
from asmjax.experiment.displacement import displacement, truth_edges
from asmjax.shadow import LightSpaceShadowMap, UniformShadowMap


@pytest.fixture(scope="module")
def case():
    return analytic_case("a4_disc_light", 256)


@pytest.mark.parametrize("algorithm", [UniformShadowMap, LightSpaceShadowMap])
@pytest.mark.parametrize("resolution", [48, 64, 128])
def test_prediction_meets_measurement(case, algorithm, resolution):
    """A disc's shadow: a long smooth edge in all directions; within an eighth, from two to seven
    pixels a texel."""
    chosen = algorithm(resolution)
    state = chosen.build(case.eye, case.frame, case.rays)
    maps = aliasing_maps(chosen, state, case.eye, case.frame)
    truth = np.where(case.judged, case.expected, case.eye.valid)
    found = displacement(truth, chosen.visibility(state, case.eye.points), case.eye, maps)
    assert found.length > 200
    assert found.measured == pytest.approx(found.predicted, rel=0.125)


def test_edges_have_the_length_and_direction_of_the_circle(case):
    """The shadow of a disc is an ellipse: its length from the pixels' own positions, and normals
    that turn once around."""
    truth = np.where(case.judged, case.expected, case.eye.valid)
    edges = truth_edges(truth, case.eye, np.asarray(case.eye.valid))
    height, width = case.eye.size
    lit = truth.reshape(height, width) >= 0.5
    rows, columns = np.nonzero(~lit & case.eye.valid.reshape(height, width))
    span = np.array([np.ptp(columns) + 1, np.ptp(rows) + 1]) / 2
    angle = np.linspace(0, 2 * np.pi, 10_001)
    around = np.hypot(*np.diff(span[:, None] * np.stack([np.cos(angle), np.sin(angle)]))).sum()
    assert edges.length.sum() == pytest.approx(around, rel=0.03)
    np.testing.assert_allclose(np.hypot(*edges.normal), 1, atol=1e-9)
    # Normals point into the light, away from the middle of the shadow.
    row, column = np.divmod(edges.pixel[0], width)
    outwards = np.stack([column - columns.mean(), row - rows.mean()])
    assert ((edges.normal * outwards).sum(axis=0) > 0).mean() > 0.98


def test_no_edges_no_displacement(case):
    n = case.eye.valid.size
    maps = AliasingMaps(np.ones(n), np.ones(n), np.ones(n), np.ones((2, 2, n)))
    found = displacement(np.ones(n), np.ones(n), case.eye, maps)
    assert (found.predicted, found.measured, found.length, found.share) == (0.0, 0.0, 0.0, 0.0)
