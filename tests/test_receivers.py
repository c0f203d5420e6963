"""Receivers, light frames and cameras against slow float64 twins and exact geometry."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import examples
from helpers.gradients import (
    hostile_arrays,
    unit_or_zero,
)
from helpers.poses import KINDS, Pose, random_pose, ref_project, surface_points
from hypothesis import given, settings
from numpy.testing import assert_allclose

from asmjax.buffers import light_offset, project
from asmjax.buffers.receivers import GRAZING
from asmjax.errors import UseError
from asmjax.geometry import (
    basis_from_axis,
    fitted_directional_frame,
    fitted_point_frame,
    fixed_frame,
    in_domain,
    look_at,
    towards_light,
    unit,
)
from asmjax.shadow.comparison import plane_depth

projected = eqx.filter_jit(project)


def any_normals(pose: Pose, seed=0) -> Pose:
    """The same points with normals that face any way."""
    normal = np.random.default_rng(seed).normal(size=pose.normal.shape)
    normal /= np.linalg.norm(normal, axis=0)
    return Pose(pose.camera, pose.frame, pose.world, normal, pose.columns, pose.rows)


def spot_pose(seed: int) -> Pose:
    """A spot whose cone of 12 degrees cuts through the points of its wider square face."""
    pose = random_pose(seed)
    frame = eqx.tree_at(lambda f: f.cos_cutoff, pose.frame, np.cos(np.radians(12.0)))
    return Pose(pose.camera, frame, pose.world, pose.normal, pose.columns, pose.rows)


def assert_same_receivers(got, wanted, rtol):
    assert np.asarray(got.facing).tolist() == wanted["facing"].tolist()
    assert np.asarray(got.face).tolist() == wanted["face"].tolist()
    assert_allclose(got.uv, wanted["uv"], rtol=0, atol=rtol)
    assert_allclose(got.depth, wanted["depth"], rtol=rtol)
    assert_allclose(got.secant, wanted["secant"], rtol=rtol * 100)


@pytest.mark.parametrize("kind", KINDS)
def test_project_matches_a_loop(x64, kind):
    pose = any_normals(random_pose(1, kind))
    wanted = ref_project(pose.frame, pose.world, pose.normal)
    assert 20 < wanted["facing"].sum() < 180
    assert_same_receivers(pose.receivers(), wanted, 1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_jit_changes_nothing(x64, kind):
    pose = any_normals(random_pose(1, kind))
    points = pose.points()
    plain = project(points, pose.frame, light_offset(points, pose.frame))
    for a, b in zip(jax.tree.leaves(plain), jax.tree.leaves(pose.receivers()), strict=True):
        assert_allclose(a, b, rtol=1e-13, atol=1e-15)  # a rounding of coordinates of about 1


def test_spot_cone(x64):
    """Inside 12 degrees of the axis is lit, outside is not; both occur."""
    pose = spot_pose(2)
    wanted = ref_project(pose.frame, pose.world, pose.normal)
    assert 10 < wanted["facing"].sum() < 190
    assert_same_receivers(pose.receivers(), wanted, 1e-12)
    ray = pose.world - pose.frame.origin[:, None]
    angle = np.degrees(np.arccos(unit(pose.frame.cone_axis) @ ray / np.linalg.norm(ray, axis=0)))
    assert wanted["facing"].tolist() == (angle < 12).tolist()


@pytest.mark.parametrize("make", [*KINDS, "spot"])
def test_domain_is_where_receivers_face(x64, make):
    """For normals turned to the light, `facing` on the device is `in_domain` on the host.

    Points reach beyond the image on every side, and behind the light.
    """
    pose = spot_pose(3) if make == "spot" else random_pose(3, make)
    rng = np.random.default_rng(1)
    world = pose.frame.origin[:, None] + rng.normal(size=(3, 2000)) * 8
    normal = towards_light(pose.frame, world)
    normal = normal / np.linalg.norm(normal, axis=0)
    points = surface_points(world, normal, pose.camera.origin)
    facing = np.asarray(projected(points, pose.frame, light_offset(points, pose.frame)).facing)
    inside = in_domain(pose.frame, world)
    assert facing.tolist() == inside.tolist()
    assert 0 < inside.sum() and (~inside).sum() > 0


@pytest.mark.parametrize("kind", KINDS)
def test_plane_depth_is_an_exact_intersection(x64, kind):
    """Depth of the receiver's plane at a neighbouring texel = ray of that texel against the plane.

    Rays come from `LightFrame.ray` and are met with the plane in world space; 1e-9 because the
    plane is reached under cosines down to 0.3. Offsets of a hundredth of the image.
    """
    pose = random_pose(4, kind, least_cosine=0.3)
    frame, receivers = pose.frame, pose.receivers()
    offset = np.random.default_rng(0).uniform(-0.01, 0.01, (2, pose.columns.size))
    got = np.asarray(plane_depth(receivers, jnp.asarray(offset), frame.perspective))
    uv = np.asarray(receivers.uv) + offset
    for i, face in enumerate(np.asarray(receivers.face)):
        origin, ray = (a[:, 0] for a in frame.ray(int(face), uv[0, i : i + 1], uv[1, i : i + 1]))
        normal, point = pose.normal[:, i], pose.world[:, i]
        assert got[i] == pytest.approx(normal @ (point - origin) / (normal @ ray), rel=1e-9)


def test_ray_hits_the_point_it_was_projected_from(x64):
    """`LightFrame.ray` is the inverse of `project`: origin + depth * direction = the point."""
    for kind in KINDS:
        pose = random_pose(5, kind)
        receivers = pose.receivers()
        uv, depth, face = (np.asarray(a) for a in (receivers.uv, receivers.depth, receivers.face))
        for k in range(pose.frame.faces):
            mine = face == k
            origin, ray = pose.frame.ray(k, *uv[:, mine])
            assert_allclose(origin + depth[mine] * ray, pose.world[:, mine], atol=1e-12)


def test_secant_is_bounded_and_slope_vanishes_at_grazing(dtype):
    """An edge-on plane says nothing about depth: slope 0, secant at most 1 / GRAZING."""
    frame = fixed_frame([0, 0, 5], [0, 0, -1], 90.0, np.float64(1e-3))
    tilt = np.array([1e-2, 1e-3, 1e-5, 1e-8, 0.0])
    world = np.zeros((3, 5))
    normal = np.stack([np.sqrt(1 - tilt**2), 0 * tilt, tilt])
    points = surface_points(world, normal, np.zeros(3), dtype)
    got = projected(points, frame, light_offset(points, frame))
    assert np.asarray(got.facing).tolist() == [True, True, True, True, False]
    assert_allclose(got.secant, [1e2, 1e3, 1 / GRAZING, 1 / GRAZING, 1], rtol=1e-5)
    assert (np.asarray(got.slope)[:, 2:] == 0).all() and np.abs(got.slope[:, :2]).max() > 90


@settings(max_examples=examples(25))
@given(hostile_arrays((3, 64)))
def test_every_direction_belongs_to_exactly_one_cube_face(world):
    """Directions of a dense sphere, and hostile ones: one face each, the one of its longest axis.

    Directions on a seam may go to either side, hence the margin of 1e-3.
    """
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(3, 4000))
    frame = fitted_point_frame(np.zeros(3), sphere, 1e-9)
    assert frame.faces == 6
    world = np.where(np.abs(world) < 1e-6, 0, world)
    world = world[:, np.abs(world).max(axis=0) > 0]
    directions = np.concatenate([sphere[:, : 128 - world.shape[1]], world], axis=1)
    with jax.enable_x64(True):
        points = surface_points(directions, -unit_or_zero(directions), np.zeros(3))
        got = projected(points, frame, np.zeros((6, 3)))
    axes = frame.rotation[:, 2] @ directions / np.abs(directions).max(axis=0)
    uncovered = ~np.asarray(got.facing)
    # Fitted to 4,000 directions, so the outermost corners and seams may stay uncovered.
    assert not uncovered[: 128 - world.shape[1]].any()
    chosen = axes[np.asarray(got.face), np.arange(directions.shape[1])]
    assert (chosen[~uncovered] > 1 - 1e-3).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("far", [1e4, 1e6])
def test_far_from_the_origin_nothing_changes(kind, far):
    """Float32 kernels, scene moved by up to 1e6 units: uv the same to 1e-5.

    Positions are relative to the eye, and eye minus light is formed in float64: only float64's
    own rounding at 1e6 (1e-10) is left, and the fit of the frame to moved points.
    """
    pose = random_pose(6, kind)
    shift = far * np.array([1.0, -2.0, 0.5])
    frame = eqx.tree_at(lambda f: f.origin, pose.frame, pose.frame.origin + shift)
    camera = eqx.tree_at(lambda c: c.origin, pose.camera, pose.camera.origin + shift)
    moved = Pose(camera, frame, pose.world + shift[:, None], pose.normal, pose.columns, pose.rows)
    here, there = pose.receivers(np.float32), moved.receivers(np.float32)
    assert here.uv.dtype == jnp.float32
    same = np.asarray(here.face == there.face) & np.asarray(here.facing & there.facing)
    assert same.mean() > 0.99
    assert np.abs(here.uv - there.uv)[:, same].max() < 1e-5
    assert_allclose(here.depth[same], there.depth[same], rtol=1e-5)


@pytest.mark.parametrize("kind", ["point", "directional"])
def test_batches_over_lights_equal_a_loop(x64, kind):
    """`vmap` over frames: four lights at once give what four calls give."""
    poses = [random_pose(seed, kind, 64) for seed in range(4)]
    points = poses[0].points()

    def leaf(f):
        return (f.near, f.cos_cutoff)

    frames = [
        eqx.tree_at(leaf, p.frame, tuple(np.float64(x) for x in leaf(p.frame))) for p in poses
    ]
    loop = [projected(points, f, light_offset(points, f)) for f in frames]
    batch = jax.tree.map(lambda *a: np.stack(a), *frames)
    offsets = np.stack([light_offset(points, f) for f in frames])
    got = jax.jit(jax.vmap(project, (None, 0, 0)))(points, batch, offsets)
    for i, wanted in enumerate(loop):
        for a, b in zip(jax.tree.leaves(got), jax.tree.leaves(wanted), strict=True):
            assert_allclose(np.asarray(a)[i], b, rtol=1e-12, atol=1e-14)


axes = hostile_arrays(3)


@given(axes)
def test_basis_is_orthonormal_and_right_handed(axis):
    """Any direction, also along the poles; a vector without direction is refused."""
    if not axis.any():
        with pytest.raises(UseError, match="no direction"):
            basis_from_axis(axis)
        return
    basis = basis_from_axis(axis)
    assert np.abs(basis @ basis.T - np.eye(3)).max() < 1e-14
    assert np.linalg.det(basis) == pytest.approx(1.0)
    scaled = axis / np.abs(axis).max()
    assert_allclose(basis[2], scaled / np.linalg.norm(scaled), atol=1e-15)


def test_basis_is_continuous_but_where_z_changes_sign():
    """On random arcs within a hemisphere, small steps turn the basis by steps as small."""
    rng = np.random.default_rng(0)
    for sign in (1, -1):
        for _ in range(20):
            ends = rng.normal(size=(2, 3))
            ends[:, 2] = sign * np.abs(ends[:, 2])
            ends /= np.linalg.norm(ends, axis=1)[:, None]
            t = np.linspace(0, 1, 2001)[:, None]
            arc = ends[0] * (1 - t) + ends[1] * t
            bases = np.array([basis_from_axis(a) for a in arc])
            steps = np.abs(np.diff(arc / np.linalg.norm(arc, axis=1)[:, None], axis=0)).max()
            assert np.abs(np.diff(bases, axis=0)).max() < 10 * steps


def test_camera_sees_its_target_in_the_middle_and_up_at_the_top():
    """Pixel (w/2, h/2) looks along the axis; row 0 is towards `up`, column 0 to the left."""
    camera = look_at([1, 2, 3], [4, 6, 3], fov_x_deg=90, width=64, height=32)
    middle, top, left, corner = camera.directions([32, 32, 0, 0], [16, 0, 16, 0]).T
    assert_allclose(middle, [0.6, 0.8, 0])
    assert_allclose(top - middle, [0, 0, 0.5], atol=1e-15)
    # Left of a view along (0.6, 0.8, 0) with z up is (-0.8, 0.6, 0); tan(45 degrees) = 1.
    assert_allclose(left - middle, [-0.8, 0.6, 0], atol=1e-15)
    assert_allclose(corner - middle, (top - middle) + (left - middle), atol=1e-15)
    columns, rows = camera.centres()
    assert columns[:2].tolist() == [0.5, 1.5] and rows[[0, 64]].tolist() == [0.5, 1.5]
    flipped = look_at([1, 2, 3], [4, 6, 3], fov_x_deg=90, width=64, height=32, mirrored=True)
    assert_allclose(flipped.directions([64], [16])[:, 0], left, atol=1e-15)
    shifted = look_at(
        [1, 2, 3], [4, 6, 3], fov_x_deg=90, width=64, height=32, principal_point=(0.25, -0.5)
    )
    assert_allclose(shifted.directions([48], [0])[:, 0], middle, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_fitted_frames_hold_all_receivers(kind):
    """And tightly: the receivers reach to within a thousandth of each border of one face."""
    rng = np.random.default_rng(3)
    world = rng.uniform(-1, 1, (3, 500))
    if kind == "directional":
        frame = fitted_directional_frame([1, 2, -3], world, np.array([[-2.0, 2.0]] * 3))
    else:
        frame = fitted_point_frame([0, 0, 0] if kind == "cube" else [3, 2, 4], world, 1e-6)
    assert frame.faces == (6 if kind == "cube" else 1)
    assert in_domain(frame, world).all()
    if kind != "cube":
        uv = ref_project(frame, world, -towards_light(frame, world) * -1)["uv"]
        assert uv.min(axis=1).max() < 1e-3 and uv.max(axis=1).min() > 1 - 1e-3


def test_wrong_use_says_what_to_do():
    good: dict[str, Any] = {"fov_x_deg": 60, "width": 4, "height": 4}
    with pytest.raises(UseError, match="parallel"):
        look_at([0, 0, 0], [0, 0, -5], **good)
    with pytest.raises(UseError, match="no direction"):
        look_at([1, 2, 3], [1, 2, 3], **good)
    with pytest.raises(UseError, match="no direction"):
        look_at([0, np.nan, 0], [0, 0, -5], **good)
    for fov in (0.0, -20.0, 179.9, 360.0):
        with pytest.raises(UseError, match="field of view"):
            fixed_frame([0, 0, 0], [0, 0, 1], fov, 1e-3)
    nothing = np.zeros((3, 0))
    with pytest.raises(UseError, match="no visible surface"):
        fitted_point_frame([0, 0, 0], nothing, 1e-3)
    with pytest.raises(UseError, match="no visible surface"):
        fitted_directional_frame([0, 0, 1], nothing, np.zeros((3, 2)))
    behind = np.array([[0.0], [0.0], [-1.0]])
    with pytest.raises(UseError, match="spot light"):
        fitted_point_frame([0, 0, 0], behind, 1e-3, axis=[0, 0, 1], cutoff_deg=20)
