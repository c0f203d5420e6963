"""The pixel-to-texel Jacobian against three oracles that share none of its code.

Forward differentiation of "pixel, ray, tangent plane, light image"; the homography that a plane
induces between two images; and NumPy's SVD. All in float64 to 1e-10.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.poses import KINDS, Kind, Pose, random_pose, ref_homographies, ref_jacobian

from asmjax.buffers import light_offset, project
from asmjax.footprint import determinant, singular_values, surface_tangents, uv_jacobian

EXACT = 1e-10
"""Relative to the size of the Jacobian: closed form and automatic differentiation both lose about
100 roundings of float64 at cosines down to 0.05."""


def relative_error(got, wanted):
    """Per point: norm of the difference over the norm of the right matrix."""
    axes = tuple(range(np.ndim(wanted) - 1))
    return np.linalg.norm(got - wanted, axis=axes) / np.linalg.norm(wanted, axis=axes)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_matches_forward_differentiation(x64, kind, seed):
    pose = random_pose(seed, kind)
    receivers = pose.receivers()
    assert bool(receivers.facing.all()) and pose.columns.size > 150
    assert pose.frame.faces == (6 if kind == "cube" else 1)
    wanted = ref_jacobian(pose, np.asarray(receivers.face))
    assert relative_error(np.asarray(pose.jacobian()), wanted).max() < EXACT


@pytest.mark.parametrize("seed", range(4))
def test_matches_the_plane_induced_homography(x64, seed):
    """J_ij = (H_ij w - h_i H_3j) / w^2 and det J = det H / w^3."""
    pose = random_pose(seed)
    jacobian = pose.jacobian()
    h = ref_homographies(pose)
    pixel = np.stack([pose.columns, pose.rows, np.ones_like(pose.rows)], axis=1)
    image = np.einsum("nij,nj->ni", h, pixel)
    w = image[:, 2][:, None, None]
    wanted = (h[:, :2, :2] * w - image[:, :2, None] * h[:, 2:, :2]) / w**2
    assert relative_error(np.asarray(jacobian), np.moveaxis(wanted, 0, -1)).max() < EXACT
    det = np.linalg.det(h) / image[:, 2] ** 3
    np.testing.assert_allclose(determinant(jacobian), det, rtol=EXACT)


@pytest.mark.parametrize("seed", range(3))
def test_tangents_lie_in_the_plane_and_move_one_pixel(x64, seed):
    """Project X + h dX/du back into the eye: it must land one step h further, in the plane."""
    pose = random_pose(seed)
    camera = pose.camera
    tangents = np.asarray(surface_tangents(pose.points(), camera))
    assert np.abs(np.einsum("ijn,jn->in", tangents, pose.normal)).max() < 1e-13
    step = 1e-6
    for axis in range(2):
        x, y, z = camera.rotation @ (pose.world + step * tangents[axis] - camera.origin[:, None])
        pixel = np.stack([x / z, y / z]) * camera.focal[:, None] + camera.principal[:, None]
        moved = (pixel - np.stack([pose.columns, pose.rows])) / step
        # A central difference would be exact to 1e-9; one-sided leaves the curvature, about `step`.
        assert np.abs(moved - np.eye(2)[axis][:, None]).max() < 1e-4


def random_matrices(count: int) -> np.ndarray:
    """(2, 2, count): entries over many decades, some of the matrices nearly singular."""
    rng = np.random.default_rng(3)
    matrices = rng.normal(size=(2, 2, count)) * 10 ** rng.uniform(-4, 4, (2, 1, count))
    stretched = slice(0, count // 4)
    matrices[1, :, stretched] = matrices[0, :, stretched] * 2 + 1e-6 * matrices[1, :, stretched]
    return matrices


def test_singular_values_match_svd(x64):
    """LAPACK's smallest value is exact to a rounding of the largest, hence that tolerance."""
    matrices = random_matrices(2000)
    largest, smallest = singular_values(jnp.asarray(matrices))
    wanted = np.linalg.svd(np.moveaxis(matrices, -1, 0), compute_uv=False)
    np.testing.assert_allclose(largest, wanted[:, 0], rtol=1e-14)
    assert (np.abs(smallest - wanted[:, 1]) / wanted[:, 0]).max() < 4e-16 * 4


@pytest.mark.parametrize("kind", KINDS)
def test_zero_where_not_facing(x64, kind):
    """Turned normals face neither light nor map: no footprint, no NaN."""
    pose = random_pose(5, kind)
    turned = Pose(
        pose.camera, pose.frame, pose.world, -pose.normal, pose.columns, pose.rows
    ).jacobian()
    assert not np.asarray(turned).any()


def test_a_grazing_eye_stretches_the_footprint_but_keeps_it_finite(dtype):
    """Towards edge-on the pixel's footprint grows without bound along the view only.

    sigma_max then exceeds any number while sigma_min, set by the other direction, must not fall
    to 0: an eye that grazes a floor does not need an infinite resolution.
    """
    pose = random_pose(2)
    to_eye = pose.camera.origin[:, None] - pose.world
    to_eye = to_eye / np.linalg.norm(to_eye, axis=0)
    across = pose.normal - to_eye * (pose.normal * to_eye).sum(axis=0)
    across = across / np.linalg.norm(across, axis=0)
    before = None
    for cosine in (1e-2, 1e-12, 0.0):
        grazing = across + cosine * to_eye
        tilted = Pose(pose.camera, pose.frame, pose.world, grazing, pose.columns, pose.rows)
        facing = np.asarray(tilted.receivers(dtype).facing)
        largest, smallest = (np.asarray(s) for s in singular_values(tilted.jacobian(dtype)))
        assert np.isfinite(largest).all()
        if before is not None:
            both = facing & before[2]
            assert both.sum() > 20
            assert (largest[both] > before[0][both]).all()
            assert (smallest[both] > 0.3 * before[1][both]).all()
            break
        before = largest, smallest, facing


def test_batches_over_cameras_equal_a_loop(x64):
    """One jitted `vmap` over eyes gives what one call per eye gives, bit for bit but for fusion."""
    poses = [random_pose(seed, "directional", 64) for seed in (0, 1, 2)]
    frame = poses[0].frame
    smallest = min(p.columns.size for p in poses)

    def one(points, camera):
        receivers = project(points, frame, light_offset(points, frame))
        return uv_jacobian(points, camera, frame, receivers)

    cut = [
        Pose(p.camera, frame, p.world[:, :smallest], p.normal[:, :smallest], p.columns, p.rows)
        for p in poses
    ]
    points = [p.points() for p in cut]
    loop = [one(p, c.camera) for p, c in zip(points, cut, strict=True)]

    def stack(trees):
        return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(x) for x in leaves]), *trees)

    batch = jax.jit(jax.vmap(one))(stack(points), stack([c.camera for c in cut]))
    np.testing.assert_allclose(batch, jnp.stack(loop), rtol=1e-12, atol=1e-15)
    assert light_offset(points[0], frame).shape == (1, 3)


def test_kinds_are_all_tested():
    assert set(KINDS) == set(Kind.__args__)
