"""Ratios and required resolution: limits known without any kernel, and the erratum of the paper."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.poses import KINDS, Pose, random_pose
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from asmjax.footprint import (
    LOG2_WORST,
    area_ratio,
    linear_ratio,
    log2_linear_ratio,
    log2_m,
    m,
    n_required,
    required_level,
)
from asmjax.geometry import LightFrame, fixed_frame

RESOLUTION = 256


def moved(pose: Pose, rotation: np.ndarray, scale: float, shift: np.ndarray) -> Pose:
    """The whole scene, eye and light turned, scaled and shifted as one rigid body."""

    def place(x):
        return rotation @ x * scale + shift

    camera = eqx.tree_at(
        lambda c: (c.origin, c.rotation),
        pose.camera,
        (place(pose.camera.origin), pose.camera.rotation @ rotation.T),
    )
    frame = pose.frame
    plane = 1.0 if frame.perspective else scale
    frame = LightFrame(
        origin=place(frame.origin),
        rotation=frame.rotation @ rotation.T,
        corner=frame.corner * plane,
        extent=frame.extent * plane,
        cone_axis=rotation @ frame.cone_axis,
        cos_cutoff=frame.cos_cutoff,
        near=frame.near * scale,
        perspective=frame.perspective,
    )
    world = rotation @ pose.world * scale + shift[:, None]
    return Pose(camera, frame, world, rotation @ pose.normal, pose.columns, pose.rows)


@pytest.mark.parametrize("kind", KINDS)
def test_moving_everything_as_one_changes_nothing(x64, kind):
    """Ratios are dimensionless and belong to no world axis: 1e-9 after turn, scale and shift."""
    pose = random_pose(3, kind)
    before = pose.jacobian()
    for seed, scale in enumerate((1e-3, 1.0, 1e4)):
        rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        after = moved(pose, rotation, scale, scale * np.array([3.0, -2.0, 1.0])).jacobian()
        for ratio in (area_ratio, m):
            assert_allclose(ratio(after, RESOLUTION), ratio(before, RESOLUTION), rtol=1e-9)


def test_light_at_the_eye(x64):
    """C_l = C_e: rho = (F_e / F_l)^2, whatever the depth and the normal."""
    pose = random_pose(6)
    camera = pose.camera
    fov, texels = 100.0, 300
    frame = fixed_frame(camera.origin, camera.rotation[2], fov, np.float64(1e-3))
    same = Pose(camera, frame, pose.world, pose.normal, pose.columns, pose.rows)
    focal_light = texels / 2 / np.tan(np.radians(fov / 2))
    assert bool(same.receivers().facing.all())
    wanted = (camera.focal[0] / focal_light) ** 2
    assert_allclose(area_ratio(same.jacobian(), texels), wanted, rtol=1e-10)
    # Both images have one axis and square pixels, so not even the roll stretches.
    assert_allclose(m(same.jacobian(), texels), wanted**0.5, rtol=1e-7)


@pytest.mark.parametrize("kind", ["point", "directional"])
def test_halving_the_focal_length_asks_for_four_times_the_texels(x64, kind):
    """T4: twice the extent is half the focal length; N must rise by 4 and m by 2.

    The formula as printed in 2001, N_current * eye / shadow, falls by 4: kept here to show that
    this test tells them apart.
    """
    pose = random_pose(7, kind)
    frame = pose.frame
    centre = frame.corner + frame.extent / 2
    wide = eqx.tree_at(
        lambda f: (f.corner, f.extent), frame, (centre - frame.extent, 2 * frame.extent)
    )
    near, far = pose.jacobian(), replace(pose, frame=wide).jacobian()
    now = 1024.0**2
    needed = [n_required(now, area_ratio(j, RESOLUTION)) for j in (near, far)]
    assert_allclose(needed[1] / needed[0], 4, rtol=1e-9)
    assert_allclose(m(far, RESOLUTION) / m(near, RESOLUTION), 2, rtol=1e-9)
    printed = [now / area_ratio(j, RESOLUTION) for j in (near, far)]
    assert_allclose(printed[1] / printed[0], 0.25, rtol=1e-9)


def test_n_required_matches_the_eye_when_used(x64):
    """The definition: with N = n_required texels over the face, area ratios are 1."""
    jacobian = random_pose(8).jacobian()
    needed = n_required(float(RESOLUTION) ** 2, area_ratio(jacobian, RESOLUTION))
    side = np.sqrt(np.asarray(needed))
    assert_allclose(area_ratio(jacobian, side), 1, rtol=1e-12)


def random_matrices(n, seed=0):
    return np.random.default_rng(seed).normal(size=(2, 2, n))


def test_area_ratio_is_at_most_m_squared(x64):
    """rho = 1 / (s_max s_min) <= 1 / s_min^2 = m^2, equal iff the footprint is not stretched."""
    jacobian = jnp.asarray(random_matrices(2000))
    area, worst = area_ratio(jacobian, 8), m(jacobian, 8)
    assert bool((area <= worst**2 * (1 + 1e-12)).all())
    values = np.linalg.svd(np.moveaxis(np.asarray(jacobian), -1, 0), compute_uv=False)
    stretch = values[:, 0] / values[:, 1]
    assert_allclose(worst**2 / area, stretch, rtol=1e-9)
    turn, size = np.linspace(0, 6, 50), np.geomspace(1e-3, 1e3, 50)
    conformal = size * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for sign in (1, -1):
        flipped = jnp.asarray(conformal * np.array([1, sign])[:, None, None])
        assert_allclose(m(flipped, 8) ** 2, area_ratio(flipped, 8), rtol=1e-7)


def test_m_is_the_worst_direction(x64):
    """1 / sigma_min of LAPACK's SVD; and no direction of 3,600 is worse, one is nearly as bad."""
    matrices = random_matrices(300, seed=1)
    got = np.asarray(m(jnp.asarray(matrices), 16))
    values = np.linalg.svd(16 * np.moveaxis(matrices, -1, 0), compute_uv=False)
    assert_allclose(got, 1 / values[:, 1], rtol=1e-11)
    turn = np.linspace(0, np.pi, 3601)
    steps = np.stack([np.cos(turn), np.sin(turn)])
    texels = 16 * np.linalg.norm(np.einsum("ijn,jt->int", matrices, steps), axis=0)
    pixels_per_texel = 1 / texels
    assert (pixels_per_texel.max(axis=1) <= got * (1 + 1e-12)).all()
    gentle = values[:, 0] / values[:, 1] < 30
    assert (pixels_per_texel.max(axis=1)[gentle] > 0.99 * got[gentle]).all()


def test_logarithms_and_powers_agree(dtype):
    jacobian = jnp.asarray(random_matrices(200), dtype)
    tolerance = 2e-5 if dtype == jnp.float32 else 1e-13
    log_area, log_axis = log2_linear_ratio(jacobian, 64), log2_m(jacobian, 64)
    assert log_area.dtype == log_axis.dtype == dtype
    assert_allclose(area_ratio(jacobian, 64), 4.0**log_area, rtol=tolerance)
    assert_allclose(linear_ratio(jacobian, 64), 2.0**log_area, rtol=tolerance)
    assert_allclose(m(jacobian, 64), 2.0**log_axis, rtol=tolerance)
    # A texel of twice the side is twice as coarse, in both measures.
    assert_allclose(log2_linear_ratio(jacobian, 32) - log_area, 1, rtol=tolerance)
    assert_allclose(log2_m(jacobian, 32) - log_axis, 1, rtol=tolerance)


def test_flat_footprints_are_the_worst(dtype):
    """Zero and rank-one Jacobians: a light edge-on. No resolution is enough, and nothing is NaN."""
    flat = jnp.asarray([[[0, 1, 1e-30], [0, 2, 0]], [[0, 2, 0], [0, 4, 1e-30]]], dtype)
    worst = LOG2_WORST - np.log2(4)
    assert_allclose(log2_linear_ratio(flat, 4), worst)
    assert_allclose(log2_m(flat, 4), worst)
    assert np.isfinite(area_ratio(flat, 4)).all()


def test_required_level_matches_brute_force(x64):
    """Refine one level at a time, by 2^log2_cells in resolution, until the ratio is matched."""
    rng = np.random.default_rng(2)
    log2_ratios = rng.uniform(-3, 20, 60)
    for log2_cells in (1, 2, 3):
        for log2_target in (0.0, -2.0, 1.0):
            got = np.ceil(required_level(jnp.asarray(log2_ratios), log2_cells, log2_target))
            for ratio, found in zip(log2_ratios, got, strict=True):
                level = 0
                while ratio > log2_target:
                    level, ratio = level + 1, ratio - log2_cells
                assert int(found) == level


def test_required_level_of_area_and_axis(x64):
    """l = max(0, ceil(log2 m)) or ceil(0.5 log2 rho) below a root map of one texel pair."""
    jacobian = random_pose(9).jacobian()
    by_axis = required_level(log2_m(jacobian, 16), 1)
    by_area = required_level(log2_linear_ratio(jacobian, 16), 1)
    assert_allclose(by_axis, np.maximum(np.log2(m(jacobian, 16)), 0), atol=1e-12)
    assert_allclose(by_area, np.maximum(0.5 * np.log2(area_ratio(jacobian, 16)), 0), atol=1e-12)
    assert bool((by_area <= by_axis).all())
