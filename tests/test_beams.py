"""Beams of pixels and texels against vectors, cross-sections and NumPy's SVD; and what m is made
of: m is at most the perspective factor times the ratio of the slants."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.poses import KINDS, Kind, Pose, random_pose

from asmjax.footprint import LOG2_WORST, log2_perspective_error, m


def random_density(count: int) -> np.ndarray:
    """(2, 2, count) texels per image size: stretched, sheared and mirrored."""
    rng = np.random.default_rng(7)
    return rng.normal(size=(2, 2, count)) * 10 ** rng.uniform(1, 4, (1, 1, count))


def across(vector: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """The part of a vector across a ray."""
    ray = ray / np.linalg.norm(ray)
    return vector - ray * (ray @ vector)


def widths(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Singular values of two vectors of space, largest first."""
    return np.linalg.svd(np.stack([first, second], axis=1), compute_uv=False)


def slow_error(pose: Pose, density: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Point by point: one pixel's steps at the point's depth, one texel's steps at the light's."""
    camera, frame, result = pose.camera, pose.frame, []
    for k, world in enumerate(pose.world.T):
        ray = world - camera.origin
        depth = camera.rotation[2] @ ray
        pixel = [across(camera.rotation[i] * depth / camera.focal[i], ray) for i in range(2)]
        rotation, extent = frame.rotation[face[k]], frame.extent[face[k]]
        ray, scale = rotation[2], 1.0
        if frame.perspective:
            ray = world - frame.origin
            scale = rotation[2] @ ray
        texels = np.linalg.inv(density[:, :, k])
        texel = [across(scale * (rotation[:2].T @ (extent * texels[:, i])), ray) for i in range(2)]
        result.append(widths(*texel)[0] / widths(*pixel)[1])
    return np.array(result)


_error = eqx.filter_jit(log2_perspective_error)


def error_of(pose: Pose, density, dtype: type[np.floating] = np.float64) -> np.ndarray:
    points = pose.points(dtype)
    density = jnp.asarray(density, dtype)
    return np.asarray(_error(points, pose.camera, pose.frame, pose.receivers(dtype), density))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(2))
def test_beams_match_cross_sections(x64, kind: Kind, seed):
    pose = random_pose(seed, kind)
    density = random_density(pose.columns.size)
    face = np.asarray(pose.receivers().face)
    wanted = np.log2(slow_error(pose, density, face))
    np.testing.assert_allclose(error_of(pose, density), wanted, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_m_is_within_the_slants_of_the_perspective_factor(x64, kind: Kind):
    """m <= m~ / (cosine at the light): the receiver stretches a texel's beam by that at most, and
    a pixel's footprint is nowhere narrower than its beam."""
    pose = random_pose(4, kind)
    density = random_density(pose.columns.size)
    texels = np.einsum("ikn,kjn->ijn", density, np.asarray(pose.jacobian()))
    most = 2.0 ** error_of(pose, density) * np.asarray(pose.receivers().secant)
    assert (np.asarray(m(jnp.asarray(texels), 1)) <= most * (1 + 1e-9)).all()


def test_turning_a_receiver_changes_nothing(x64):
    """Beams do not know the surface."""
    pose = random_pose(5)
    turned = Pose(
        pose.camera, pose.frame, pose.world, random_pose(5, least_cosine=0.2).normal,
        pose.columns, pose.rows,
    )  # fmt: skip
    assert not np.array_equal(turned.normal, pose.normal)
    density = random_density(pose.columns.size)
    np.testing.assert_array_equal(error_of(turned, density), error_of(pose, density))


def test_where_nothing_is_known_the_error_is_the_worst(dtype):
    """No texel, turned away from the light, not valid."""
    pose = random_pose(6)
    none = np.zeros((2, 2, pose.columns.size))
    assert (error_of(pose, none, dtype) == LOG2_WORST).all()
    away = Pose(pose.camera, pose.frame, pose.world, -pose.normal, pose.columns, pose.rows)
    assert (error_of(away, random_density(none.shape[-1]), dtype) == LOG2_WORST).all()


@pytest.mark.parametrize("kind", ["point", "directional"])
@pytest.mark.parametrize("factor", [2.0**-30, 2.0**30])
def test_the_unit_of_length_does_not_count(kind: Kind, factor):
    """In float32, bit for bit: fourth powers of widths left its range below 1e-10 units, and
    logarithms of widths ended at 2^-30 units."""
    pose = random_pose(8, kind)
    camera = eqx.tree_at(lambda c: c.origin, pose.camera, pose.camera.origin * factor)
    plane = 1.0 if pose.frame.perspective else factor
    frame = pose.frame
    frame = eqx.tree_at(
        lambda f: (f.origin, f.corner, f.extent, f.near),
        frame,
        (
            frame.origin * factor,
            frame.corner * plane,
            frame.extent * plane,
            frame.near * factor,
        ),
    )
    other = Pose(camera, frame, pose.world * factor, pose.normal, pose.columns, pose.rows)
    density = random_density(pose.columns.size)
    here, there = (error_of(p, density, np.float32) for p in (pose, other))
    assert np.ptp(here) > 1
    np.testing.assert_array_equal(here, there)
