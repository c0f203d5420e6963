"""World areas of pixels and texels against ray-cast corners, 50 digits, and limits."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.poses import KINDS, random_pose
from numpy.testing import assert_allclose

from asmjax.footprint import (
    area_ratio,
    determinant,
    orthographic_area,
    perspective_area,
    surface_tangents,
)

RESOLUTION = 512


def eye_area(pose, dtype: type[np.floating] = np.float64):
    points = pose.points(dtype)
    focal = jnp.asarray(pose.camera.focal, dtype)
    return perspective_area(
        points.position, points.normal, jnp.asarray(pose.camera.rotation[2], dtype), focal
    )


def texel_area(pose, face=0, dtype: type[np.floating] = np.float64):
    frame = pose.frame
    normal = jnp.asarray(pose.normal, dtype)
    axis = jnp.asarray(frame.rotation[face, 2], dtype)
    texel = jnp.asarray(frame.extent[face] / RESOLUTION, dtype)
    if not frame.perspective:
        return orthographic_area(normal, axis, texel)
    relative = jnp.asarray(pose.world - frame.origin[:, None], dtype)
    return perspective_area(relative, normal, axis, 1 / texel)


@pytest.mark.parametrize("seed", range(3))
def test_area_of_a_pixel_cast_onto_the_plane(x64, seed):
    """Corners of a pixel shrunk 1,000 times are cast onto the tangent plane; area by cross product.

    The plane's image is projective, so a small enough pixel is a parallelogram: the centred
    differences leave 1e-6 of relative curvature at cosines above 0.05.
    """
    pose = random_pose(seed)
    camera, half = pose.camera, 0.5e-3
    relative = pose.world - camera.origin[:, None]

    def cast(dx, dy):
        ray = camera.directions(pose.columns + dx, pose.rows + dy)
        return ray * (pose.normal * relative).sum(axis=0) / (pose.normal * ray).sum(axis=0)

    wide = (cast(half, 0) - cast(-half, 0)) / (2 * half)
    tall = (cast(0, half) - cast(0, -half)) / (2 * half)
    wanted = np.linalg.norm(np.cross(wide, tall, axis=0), axis=0)
    assert_allclose(eye_area(pose), wanted, rtol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_area_is_the_cross_product_of_the_tangents(x64, seed):
    pose = random_pose(seed)
    right, down = np.asarray(surface_tangents(pose.points(), pose.camera))
    wanted = np.linalg.norm(np.cross(right, down, axis=0), axis=0)
    assert_allclose(eye_area(pose), wanted, rtol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_determinant_is_the_ratio_of_areas(x64, kind, seed):
    """|det J| = A_eye / A_texel, and `area_ratio` its inverse: two derivations, 1e-10."""
    pose = random_pose(seed, kind)
    jacobian = pose.jacobian()
    face = np.asarray(pose.receivers().face)
    for k in np.unique(face):
        mine = face == k
        ratio = np.asarray(texel_area(pose, k) / eye_area(pose))[mine]
        det = np.abs(np.asarray(determinant(jacobian)))[mine] * RESOLUTION**2
        assert_allclose(det * ratio, 1, rtol=1e-10)
        assert_allclose(np.asarray(area_ratio(jacobian, RESOLUTION))[mine], ratio, rtol=1e-10)


def test_a_far_point_light_is_a_parallel_one(x64):
    """At distance d both areas agree to 1 / d."""
    rng = np.random.default_rng(0)
    point, normal = rng.uniform(-1, 1, (3, 50)), rng.normal(size=(3, 50))
    axis, texel = np.array([0.0, 0.0, 1.0]), np.array([0.01, 0.02])
    flat = orthographic_area(jnp.asarray(normal), jnp.asarray(axis), jnp.asarray(texel))
    for distance in (1e4, 1e7):
        far = perspective_area(
            jnp.asarray(point + axis[:, None] * distance),
            jnp.asarray(normal), jnp.asarray(axis), jnp.asarray(distance / texel),
        )  # fmt: skip
        cosine = np.abs(normal[2]) / np.linalg.norm(normal, axis=0)
        # The ray's direction differs by up to 2 / d, which counts 1 / cosine times.
        assert (np.abs(far / flat - 1) * cosine).max() < 10 / distance


def test_edge_on_and_behind_are_infinite(dtype):
    """An edge-on plane fills no pixel: area +inf, as documented; so has one behind the eye."""
    axis, focal = jnp.asarray([0, 0, 1], dtype), jnp.asarray([100, 100], dtype)
    position = jnp.asarray([[0, 0, 0, 1], [0, 0, 0, 0], [2, -2, 0, 1]], dtype)
    normal = jnp.asarray([[1, 0, 0, 2**-0.5], [0, 0, 0, 0], [0, -1, -1, -(2**-0.5)]], dtype)
    assert np.isinf(perspective_area(position, normal, axis, focal)).all()
    edge_on = orthographic_area(normal[:, :1], axis, focal)
    assert np.isinf(edge_on).all()
