"""Slopes of visibility in where points lie, of every algorithm, in both precisions.

Texels do not move with the points: what counts tests of them has steps and no slope, and its
gradient is exactly 0. Two average with weights that follow the point: filters, linear between the
borders of texels, and moments, whose windows do.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import each_of
from helpers.registry import SIBLINGS
from helpers.soft_cases import FLOOR, square_light

from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, Rectangle, ViewSpec
from asmjax.shadow import ALGORITHMS, SOFT, ShadowAlgorithm

BY_NAME = {sibling.name: sibling for sibling in SIBLINGS}

SLOPED = ("filtered", "moment")
"""Of which visibility has a slope where it is a share."""

PLATE = Rectangle("plate", (0.2, 0.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0))
PLACE = (1.0, 0.5, 4.0)
VIEW = ViewSpec("v", (0.3, -2.0, 3.0), (0.0, 0.0, 0.0), fov_x_deg=45.0, width=32, height=32)

STEP = 1e-6
"""Of central differences, scene units."""


def built(name: str):
    """The algorithm, its state, and what the view sees, in JAX's current precision: a plate above a
    floor, under a square light of half side 0.3 or the point in its middle."""
    return _cached(name, jnp.zeros(()).dtype.name)


@functools.cache
def _cached(name: str, precision: str):
    del precision  # only tells cached states apart
    area = square_light(0.3).at(PLACE) if name in SOFT else None
    light = LightSpec("lamp", "point", position=PLACE, area=area)
    eye = analytic_eye((FLOOR, PLATE), VIEW)
    frame = light_frame(light, eye, scene_bounds((FLOOR, PLATE)))
    algorithm = BY_NAME[name].of_budget(4**7, frame.faces)
    return algorithm, algorithm.build(eye, frame, AnalyticRays((FLOOR, PLATE))), eye.points


def lit_at(algorithm: ShadowAlgorithm, state, points, position):
    """Visibility of the same points elsewhere."""
    return algorithm.visibility(state, eqx.tree_at(lambda p: p.position, points, position))


def slopes(name: str, dtype) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (3, n) of the mean to all places, times their number, and visibility (n,)."""
    algorithm, state, points = built(name)
    assert points.position.dtype == points.normal.dtype == dtype, "of this precision itself"

    def total(position):
        lit = lit_at(algorithm, state, points, position)
        return lit.mean(), lit

    gradient, lit = jax.grad(total, has_aux=True)(points.position)
    assert gradient.dtype == lit.dtype == dtype
    return np.asarray(gradient, np.float64) * points.count, np.asarray(lit)


def test_every_algorithm_is_asked():
    assert set(BY_NAME) == set(ALGORITHMS)


@pytest.mark.parametrize("sibling", each_of(SIBLINGS))
def test_visibility_has_a_finite_gradient(sibling, dtype):
    """Exactly 0 of all that counts tests, and of the others where no light is partly seen."""
    found, lit = slopes(sibling.name, dtype)
    assert np.isfinite(found).all()
    assert 0.05 < np.mean(lit < 0.5) < 0.95, "shadow and light are seen"
    steep = (found != 0).any(axis=0)
    share = (lit > 0) & (lit < 1)
    if sibling.name in SLOPED:
        assert steep[share].mean() > 0.9 and share.sum() > 10
        assert not steep[~share].any()
    else:
        assert not steep.any()


def ref_slopes(name: str, axis: int, step: float) -> np.ndarray:
    """Central differences (n,) of each point's own visibility, along an axis of the world."""
    algorithm, state, points = built(name)
    position = np.asarray(points.position, np.float64)
    push = step * np.eye(3)[axis][:, None]
    after, before = (
        np.asarray(lit_at(algorithm, state, points, jnp.asarray(position + sign * push)))
        for sign in (1, -1)
    )
    return (after - before) / (2 * step)


@pytest.mark.parametrize("name", SLOPED)
def test_gradients_are_central_differences(name, x64):
    """To 1e-4 of the largest slope, at nine in ten of the points that see a part of the light:
    those where differences over two widths say the same, so that no step or kink lies between."""
    found, lit = slopes(name, np.float64)
    share = (lit > 0) & (lit < 1)
    for axis in range(3):
        near, far = (ref_slopes(name, axis, step) for step in (STEP, 4 * STEP))
        size = np.abs(near[share]).max()
        smooth = share & (np.abs(near - far) < 1e-5 * size)
        assert smooth.sum() > 0.9 * share.sum() and size > 0.1
        assert np.abs(found[axis] - near)[smooth].max() < 1e-4 * size


def test_float32_has_the_slopes_of_float64():
    """Of moments, which are of float64 in either, to a hundredth of the largest slope."""
    single, _ = slopes("moment", np.float32)
    with jax.enable_x64(True):
        double, lit = slopes("moment", np.float64)
    off = np.abs(single - double).max(axis=0)
    share = (lit > 0) & (lit < 1)
    assert np.quantile(off[share], 0.9) < 0.01 * np.abs(double).max()
