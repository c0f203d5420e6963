"""Areas read from a mip-map: closed forms of their errors, and a twin that differentiates rays."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.planes import square_light
from helpers.poses import KINDS, Pose, random_pose, surface_points
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from asmjax.buffers import light_offset, project
from asmjax.errors import UseError
from asmjax.footprint import (
    LOG2_WORST,
    log2_linear_ratio,
    log2_mip_value,
    log2_mipmap_ratio,
    log2_sampled_length,
)
from asmjax.geometry import fixed_frame, look_at

RESOLUTION = 64
MOST_TOO_LARGE = np.log2(1.0615)
"""Trilinear reading, at f = 1/ln 2 - 1 = 0.4427: (1 + f) / 2^f = 1.0615."""

read = eqx.filter_jit(log2_mipmap_ratio)
projected = eqx.filter_jit(project)


def read_ratio(
    pose: Pose,
    dtype: type[np.floating] = np.float64,
    resolution=RESOLUTION,
    most=1.0,
    tile=1.0,
    eight_bit=False,
) -> np.ndarray:
    """`log2_mipmap_ratio`; settings as arrays, so that each does not compile for itself."""
    points, receivers = pose.points(dtype), pose.receivers(dtype)
    resolution, most, tile = (jnp.asarray(x, dtype) for x in (resolution, most, tile))
    found = read(
        points, pose.camera, pose.frame, receivers, resolution,
        max_anisotropy=most, tile=tile, eight_bit=eight_bit,
    )  # fmt: skip
    return np.asarray(found)


def exact_ratio(pose: Pose) -> np.ndarray:
    return np.asarray(log2_linear_ratio(pose.jacobian(), RESOLUTION))


def test_trilinear_reading_is_too_large_by_known_amounts(x64):
    """Reference 1.4: (1 + f) / 2^f, at most +6.15 % at f = 0.4427, +4.07 % in the mean, and
    squared, as an area, +12.7 %; exact where a level is hit."""
    part = np.arange(100_000) / 100_000
    level = part + np.arange(-20, 20)[:, None]
    excess = np.exp2(np.asarray(log2_mip_value(jnp.asarray(level))) - level)
    assert_allclose(excess, np.broadcast_to((1 + part) / 2**part, level.shape), rtol=1e-12)
    assert excess.max() - 1 == pytest.approx(0.0615, abs=5e-5)
    assert part[excess[20].argmax()] == pytest.approx(0.4427, abs=1e-4)
    assert excess.mean() - 1 == pytest.approx(0.0407, abs=5e-5)
    assert excess.max() ** 2 - 1 == pytest.approx(0.127, abs=5e-4)
    assert (excess[:, 0] == 1).all()


def test_eight_bits_hold_one_to_255(x64):
    level = jnp.linspace(-5, 12, 2001)
    value = np.exp2(np.asarray(log2_mip_value(level, eight_bit=True)))
    free = np.exp2(np.asarray(log2_mip_value(level)))
    assert_allclose(value, np.round(value), rtol=1e-12)
    assert value.min() == 1 and value.max() == pytest.approx(255)
    inside = (free >= 1) & (free <= 255)
    assert np.abs(value - free)[inside].max() <= 0.5
    assert (value[free < 1] == 1).all() and (value[free > 255.5] > 254.9).all()


@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(1, 64))
def test_the_sampled_length_is_the_longest_over_the_bounded_stretch(one, other, most):
    """Slow twin in plain numbers: P_max / min(P_max / P_min, most)."""
    lengths = np.exp2([one, other])
    longest, shortest = lengths.max(), lengths.min()
    wanted = longest / min(longest / shortest, most)
    with jax.enable_x64(True):
        got = log2_sampled_length(jnp.asarray([one, other]), jnp.log2(jnp.asarray(most)))
    assert float(got) == pytest.approx(np.log2(wanted), abs=1e-12)


def ref_ratio(pose: Pose, resolution, most, tile=1.0, eight_bit=False) -> np.ndarray:
    """Slow twin: one point at a time; axes by the complex step, which has no rounding to speak of.

    The point under pixel (u + i h) of the eye, and under (u + i h) of the light, on the tangent
    plane; no tangent formula and no inverse of a Jacobian.
    """
    camera, frame = pose.camera, pose.frame
    face = np.asarray(pose.receivers().face)
    step = 1e-30
    result = []
    for i in range(pose.columns.size):
        point, normal = pose.world[:, i], pose.normal[:, i]
        rotation, corner, extent = (
            a[face[i]] for a in (frame.rotation, frame.corner, frame.extent)
        )

        def on_plane(origin, ray, point=point, normal=normal):
            return origin + ray * ((normal @ (point - origin)) / (normal @ ray))

        def seen(pixel, on_plane=on_plane):
            x, y = (pixel - camera.principal) / camera.focal
            return on_plane(camera.origin, camera.rotation.T @ np.array([x, y, 1.0]))

        def shone_on(uv, on_plane=on_plane, corner=corner, extent=extent, rotation=rotation):
            x, y = corner + uv * extent
            if frame.perspective:
                return on_plane(frame.origin, rotation.T @ np.array([x, y, 1.0]))
            return on_plane(frame.origin + rotation.T @ np.array([x, y, 0.0]), rotation[2])

        x, y, z = rotation @ (point - frame.origin)
        plane = np.array([x, y]) / z if frame.perspective else np.array([x, y])
        values = []
        for image, at, scale in (
            (seen, np.array([pose.columns[i], pose.rows[i]]), 1.0),
            (shone_on, (plane - corner) / extent, resolution),
        ):
            lengths = [
                np.linalg.norm(image(at + 1j * step * axis).imag / step) / scale
                for axis in np.eye(2)
            ]
            length = max(lengths) / min(max(lengths) / min(lengths), most)
            level = np.log2(tile / length)
            value = 2.0 ** np.floor(level) * (1 + level - np.floor(level))
            values.append(min(max(round(value), 1), 255) if eight_bit else value)
        result.append(np.log2(values[0] / values[1]))
    return np.array(result)


@pytest.mark.parametrize("kind", KINDS)
def test_matches_the_twin(x64, kind):
    pose = random_pose(4, kind)
    for most, tile, eight_bit in (
        (1.0, 1.0, False),
        (2.0, 0.3, False),
        (16.0, 1.0, False),
        (1.0, 2.0, True),
        (2.0, 2.0, True),
    ):
        got = read_ratio(pose, most=most, tile=tile, eight_bit=eight_bit)
        assert_allclose(got, ref_ratio(pose, RESOLUTION, most, tile, eight_bit), atol=1e-9)


def slanted(stretch: float) -> Pose:
    """A plane below a parallel light of texels 2^-5 wide at resolution 32, looked at from 2 units
    away under a cosine of 1 / stretch: the pixel in the middle is 2^-8 wide and stretch / 2^8 long.
    """
    cosine = 1 / stretch
    away = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    camera = look_at(2 * away, (0, 0, 0), (0, 1, 0), fov_x_deg=60, width=64, height=64)
    camera = eqx.tree_at(lambda c: c.focal, camera, np.array([512.0, 512.0]))
    frame = square_light((0, 0, -1), 1.0, 1.0, perspective=False)
    world = np.zeros((3, 1))
    normal = np.array([[0.0], [0.0], [1.0]])
    return Pose(camera, frame, world, normal, np.array([32.0]), np.array([32.0]))


@pytest.mark.parametrize("stretch", [4.0, 16.0])
def test_isotropic_filtering_takes_a_grazing_pixel_for_its_longer_axis(x64, stretch):
    """Its area is overestimated by the anisotropy, so the ratio of sides is too small by the root.

    All lengths are powers of two, so trilinear reading is exact. The area is right when the root
    of the stretch is filtered; with all of it, it is as wrong as before in the other direction.
    """
    pose = slanted(stretch)
    octaves = np.log2(stretch)
    exact = float(log2_linear_ratio(pose.jacobian(), 32)[0])
    assert exact == pytest.approx(3 - octaves / 2, abs=1e-12)
    for most, error in ((1.0, -octaves / 2), (stretch**0.5, 0), (stretch, octaves / 2)):
        got = read_ratio(pose, resolution=32, most=most)
        assert got[0] - exact == pytest.approx(error, abs=1e-9)


def test_anisotropic_filtering_improves_on_isotropic(x64):
    """Random slants: the mean error in octaves falls when a stretch of 2 is filtered, for all
    kinds of light; limits of 16 gain little more or lose again."""
    for kind in KINDS:
        pose = random_pose(12, kind)
        exact = exact_ratio(pose)
        isotropic, twofold, most = (
            np.abs(read_ratio(pose, most=most) - exact).mean() for most in (1.0, 2.0, 16.0)
        )
        assert twofold < 0.85 * isotropic
        assert twofold < 1.1 * most


def test_light_at_the_eye_leaves_the_error_of_reading_alone(x64):
    """Pixel and texel have one shape and slant: its axes cancel, whatever the filtering does."""
    pose = random_pose(6)
    frame = fixed_frame(pose.camera.origin, pose.camera.rotation[2], 100.0, np.float64(1e-3))
    # Not turned against the eye's image, or the longer axis of the two would differ.
    frame = eqx.tree_at(lambda f: f.rotation, frame, pose.camera.rotation[None])
    same = dataclasses.replace(pose, frame=frame)
    for most in (1.0, 2.0):
        wrong = np.abs(read_ratio(same, most=most) - exact_ratio(same))
        assert wrong.max() <= MOST_TOO_LARGE + 1e-9


def test_a_finer_map_by_a_power_of_two_takes_off_whole_octaves(x64):
    """What lets a ratio for one texel per side stand for every level of a tree."""
    pose = random_pose(8)
    one = read_ratio(pose, resolution=1, most=2.0)
    for level in (1, 7, 19):
        assert_allclose(read_ratio(pose, resolution=2**level, most=2.0), one - level, atol=1e-9)


def test_worst_where_nothing_faces_the_light_or_is_flat(dtype):
    pose = random_pose(5)
    away = dataclasses.replace(pose, normal=-pose.normal)
    assert_allclose(read_ratio(away, dtype), LOG2_WORST - np.log2(RESOLUTION))
    flat = eqx.tree_at(lambda f: f.extent, pose.frame, np.zeros((1, 2)))
    got = read_ratio(dataclasses.replace(pose, frame=flat), dtype, resolution=1)
    assert_allclose(got, LOG2_WORST)


def test_scale_moves_the_phase_but_not_the_ratio(x64):
    """Everything a thousand times larger, a tile too: the same; a tile left as it was: within the
    error of reading."""
    pose = random_pose(9)
    camera = eqx.tree_at(lambda c: c.origin, pose.camera, pose.camera.origin * 1000)
    frame = eqx.tree_at(lambda f: f.origin, pose.frame, pose.frame.origin * 1000)
    large = dataclasses.replace(pose, camera=camera, frame=frame, world=pose.world * 1000)
    before = read_ratio(pose)
    assert_allclose(read_ratio(large, tile=1000.0), before, atol=1e-9)
    assert np.abs(read_ratio(large) - before).max() <= MOST_TOO_LARGE * 2


def test_settings_that_mean_nothing_are_refused():
    pose = random_pose(1, count=10)
    arguments = pose.points(np.float32), pose.camera, pose.frame, pose.receivers(np.float32)
    with pytest.raises(UseError, match="max_anisotropy is 0.5; allowed: 1"):
        log2_mipmap_ratio(*arguments, max_anisotropy=0.5)
    with pytest.raises(UseError, match="tile is 0.0; allowed: a width above 0"):
        log2_mipmap_ratio(*arguments, tile=0.0)


@given(st.floats(1e-6, 1.0), st.floats(0, 6.28), st.floats(1e-3, 1e3))
def test_matches_the_twin_however_grazing(cosine, turn, scale):
    """One point under any slant to the eye, scenes of millimetres and of kilometres; float64."""
    towards = np.array([0.0, 0.0, 1.0])
    across = np.array([np.cos(turn), np.sin(turn), 0.0])
    normal = cosine * towards + np.sqrt(1 - cosine**2) * across
    camera = look_at(
        np.array([0, 0, 4.0]) * scale, (0, 0, 0), (0, 1, 0), fov_x_deg=50, width=64, height=48
    )
    frame = fixed_frame((2 * normal + towards) * scale, -normal, 100.0, np.float64(1e-3))
    pose = Pose(
        camera, frame, np.zeros((3, 1)), normal[:, None], np.array([32.0]), np.array([24.0])
    )
    with jax.enable_x64(True):
        points = surface_points(pose.world, pose.normal, camera.origin)
        receivers = projected(points, frame, light_offset(points, frame))
        assert bool(receivers.facing[0])
        tile = jnp.asarray(scale)
        got = read(points, camera, frame, receivers, 16, max_anisotropy=2.0, tile=tile)
        assert_allclose(np.asarray(got), ref_ratio(pose, 16, 2.0, scale), atol=1e-6)


def test_it_stands_in_for_the_exact_ratio(x64):
    """Shape, dtype and masks of `log2_linear_ratio` for one texel per side, so that an adaptive map
    may measure with it; within an octave on three quarters of random slants."""
    pose = random_pose(13)
    exact = log2_linear_ratio(pose.jacobian(), 1)
    got = read_ratio(pose, resolution=1)
    assert got.shape == exact.shape and got.dtype == exact.dtype
    assert np.mean(np.abs(got - exact) < 1) > 0.75
