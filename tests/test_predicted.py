"""Predicted errors of layouts: against built maps, a slow twin, and central differences."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case, case_of
from helpers.gradients import (
    assert_finite,
    assert_gradient,
    hostile_arrays,
    unit_or_zero,
    value_and_gradient,
)
from hypothesis import given
from hypothesis import strategies as st

from asmjax.buffers import SurfacePoints
from asmjax.experiment.aliasing import aliasing_maps
from asmjax.geometry import Camera, look_at
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import LightSpaceShadowMap, PartitionedShadowMap
from asmjax.shadow.warped.body import bodies
from asmjax.shadow.warped.predicted import Layout, log2_errors, log2_p_mean, slab_alpha
from asmjax.shadow.warped.sampled import GRAZING, sampled_receivers, sight_of
from asmjax.shadow.warped.sight import BINS, Seen, bin_of, outline_of, parallel_sight
from asmjax.shadow.warped.strength import half_view, light_space_n
from asmjax.theory import u_from_xi

TEXELS = 1024.0**2
errors_of = jax.jit(log2_errors)
STEEP = (0.2, 0.3, -1.0)


def along_a_plane(side=40, toward=STEEP):
    """An eye a little above a plane, which looks along it; parallel light from above."""
    scene = ANALYTIC_SCENES["a5_half_plane"]()
    view = ViewSpec("along", (0.0, -6.0, 0.5), (0.0, 0.0, -0.2), (0, 0, 1), 60.0, side, side)
    light = LightSpec("sun", "directional", direction=toward)
    return case_of(scene, scene.spec.shapes, view, light)


def hills(n: int = 160, depth=(2.0, 30.0)) -> tuple[SurfacePoints, Camera]:
    """Points on a rough ground under an eye, even in the logarithm of depth, in any precision."""
    camera = look_at((0, 0, 0), (0, 1, -0.2), fov_x_deg=60.0, width=64, height=64)
    rng = np.random.default_rng(0)
    z = np.exp(rng.uniform(*np.log(depth), size=n))
    x, y = rng.uniform(-0.5, 0.5, n), rng.uniform(0.1, 0.4, n)
    right, down, forward = camera.rotation
    position = z * (np.outer(right, x) + np.outer(down, y) + forward[:, None])
    normal = np.stack([rng.normal(0, 0.1, n), rng.normal(0, 0.1, n), np.ones(n)])
    return points_of(position, normal / np.linalg.norm(normal, axis=0)), camera


def points_of(position, normal) -> SurfacePoints:
    n = position.shape[1]
    return SurfacePoints(
        jnp.asarray(position, float),
        jnp.asarray(normal, float),
        jnp.zeros(n, jnp.int32),
        jnp.ones(n, bool),
        np.zeros(3),
    )


def even_layout(k: int, near: float, far: float, u=0.7) -> Layout:
    """Splits a third of a bin from the edges of bins, uneven strengths and shares."""
    bins = np.floor(BINS * np.arange(1, k) / k) + 1 / 3
    some = 1 + 0.2 * np.arange(k)[None]
    splits = near * (far / near) ** (bins / BINS)
    return Layout(*(jnp.asarray(part) for part in (u / some, splits, some / some.sum(), some)))


@functools.cache
def hills_seen(k: int = 3) -> tuple[Seen, Layout]:
    points, camera = hills()
    seen = jax.jit(lambda d, p: parallel_sight(d, p, camera))(jnp.asarray(STEEP), points)
    return seen, even_layout(k, float(seen.near), float(seen.far))


def closed_layout(case, k: int, falloff: str, texels: float) -> Layout:
    """What the siblings choose: logarithmic splits, equal shares, warps in closed form."""
    found = bodies(case.eye, case.frame)
    near = min(body.eye_depth.min() for body in found)
    far = max(body.eye_depth.max() for body in found)
    edges = near * (far / near) ** (np.arange(k + 1) / k)
    u = np.zeros((case.frame.faces, k))
    for body in found:
        for j in range(k):
            which = (body.eye_depth >= edges[j]) & ((body.eye_depth < edges[j + 1]) | (j == k - 1))
            if which.any() and body.pace > 0:
                n = light_space_n(body.part(which), half_view(case.eye), falloff)
                u[body.face, j] = edges[j] / body.pace / n
    ones = np.ones_like(u)
    return Layout(*(jnp.asarray(part) for part in (u, edges[1:-1], ones / ones.size, ones)))


@pytest.mark.parametrize(
    ("name", "measure"),
    [
        ("plane", "m"),
        ("a6_sphere", "perspective"),
        pytest.param("plane", "perspective", marks=pytest.mark.slow),
        pytest.param("a6_sphere", "m", marks=pytest.mark.slow),
    ],
)
def test_prediction_is_the_error_of_the_built_map(name, measure, x64):
    """`density` times the pixel's Jacobian of the map that the sibling makes of the same numbers:
    parallel light and a lamp of three faces, one warp and four partitions. The map measures at the
    centres of its texels: 0.3 % off in the warp."""
    case = along_a_plane() if name == "plane" else analytic_case(name, 40)
    for algorithm, k, falloff in (
        (LightSpaceShadowMap(1024, falloff="sine"), 1, "sine"),
        (PartitionedShadowMap(1024, partitions=4, warp="light-space"), 4, "shaped"),
    ):
        if name != "plane" and k > 1:
            continue  # slabs that a face does not hold leave their texels to the others
        maps = aliasing_maps(
            algorithm, algorithm.build(case.eye, case.frame, case.rays), case.eye, case.frame
        )
        found = bodies(case.eye, case.frame)
        receivers = sampled_receivers(case.eye, case.frame, measure)
        seen = sight_of(receivers, found, case.frame, case.eye.valid.size)
        layout = closed_layout(case, k, falloff, TEXELS)
        log2, weight = errors_of(seen, layout, TEXELS * len(found))
        counts = np.asarray(weight.sum(axis=0)) > 0
        predicted = np.exp2(np.asarray((log2 * weight).sum(axis=0)))[counts]
        expected = (maps.m if measure == "m" else maps.perspective)[receivers.pixel][counts]
        assert counts.sum() > 300
        np.testing.assert_allclose(predicted, expected, rtol=5e-3)


def ref_errors(seen: Seen, layout: Layout, texels: float, splits_in_bins):
    """(n,) m by the paper's own form: z' = z - 1 + n, n in plane units, in line with the eye.
    Loops, and derivatives of the map's coordinates by central differences. For splits at the edges
    of bins."""
    plane, jacobian, depth = (np.asarray(a) for a in (seen.plane, seen.jacobian, seen.depth))
    place = np.asarray(bin_of(seen.depth, seen.near, seen.far))
    edges = [0, *splits_in_bins, BINS]
    starts = [float(seen.near), *np.asarray(layout.splits)]
    m = np.zeros(depth.size)
    for k in range(len(edges) - 1):
        inside = (place >= edges[k]) & (place < edges[k + 1])
        x, y = plane[:, inside]
        n = starts[k] / float(seen.pace[0]) / float(layout.u[0, k])
        low, length = y.min(), np.ptp(y)
        f = n + length

        def image(x, y, n=n, f=f, low=low, length=length):
            ahead = y - low + n
            return x / ahead, f / length * (1 - n / ahead)

        across = image(x, y)[0]
        width = np.ptp(across)
        area = texels * float(layout.shares[0, k])
        aspect = float(layout.aspect[0, k])
        size = np.sqrt(area * aspect) / width, np.sqrt(area / aspect)
        for i, p, q in zip(np.flatnonzero(inside), x, y, strict=True):
            h = 1e-6
            motion = np.empty((2, 2))
            for j, (dx, dy) in enumerate(((h, 0), (0, h))):
                ahead, behind = image(p + dx, q + dy), image(p - dx, q - dy)
                motion[:, j] = [(a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True)]
            texel = np.diag(size) @ motion @ jacobian[:, :, i]
            m[i] = 1 / np.linalg.svd(texel, compute_uv=False)[1]
    return m


def test_prediction_is_that_of_the_slow_twin(x64):
    """All points lie in the outline that the kernel knows; the twin asks every one of them."""
    seen, layout = hills_seen()
    bins = [20, 41]
    splits = float(seen.near) * (float(seen.far) / float(seen.near)) ** (np.array(bins) / BINS)
    layout = layout._replace(splits=jnp.asarray(splits))
    log2, weight = errors_of(seen, layout, TEXELS)
    found = np.exp2(np.asarray((log2 * weight).sum(axis=0)))
    # Eight directions of the outline find the extents along the axes; those of the bent one to 1 %.
    np.testing.assert_allclose(found, ref_errors(seen, layout, TEXELS, bins), rtol=1e-2)
    np.testing.assert_allclose(np.asarray(weight.sum(axis=0)), np.asarray(seen.weight))


def test_gradients_are_central_differences(x64):
    """log m of every receiver, in u, splits, shares and aspect; float64, to 1e-4."""
    seen, layout = hills_seen()

    def errors(u, splits, shares, aspect):
        log2, weight = log2_errors(seen, Layout(u, splits, shares, aspect), TEXELS)
        return log2 * weight

    assert_gradient(errors, *(np.asarray(part) for part in layout))


def test_the_p_mean_s_gradient_is_a_central_difference(x64):
    seen, layout = hills_seen()

    def loss(u, splits, shares):
        log2 = log2_errors(seen, Layout(u, splits, shares, layout.aspect), TEXELS)
        return log2_p_mean(*log2, 8.0)

    assert_gradient(loss, *(np.asarray(part) for part in layout[:3]))
    log2, weight = errors_of(seen, layout, TEXELS)
    m, counts = np.exp2(np.asarray(log2)), np.asarray(weight)
    expected = (np.sum(counts * m**8) / counts.sum()) ** (1 / 8)
    assert float(jnp.exp2(log2_p_mean(log2, weight, 8.0))) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("xi", [-0.4, 0.6])
def test_gradients_in_xi(xi, x64):
    seen, layout = hills_seen()
    alpha = jax.jit(slab_alpha)(seen, layout.splits)
    assert float(alpha.min()) > 1.5

    def errors(xi):
        log2, weight = log2_errors(seen, layout._replace(u=u_from_xi(xi, alpha)), TEXELS)
        return log2 * weight

    assert_gradient(errors, np.full((1, 3), xi))


@pytest.mark.slow
def test_gradients_in_xi_where_its_branches_meet(x64):
    """xi = 0: derivatives from below and from above, which are one: only the second one jumps."""
    seen, layout = hills_seen(1)
    alpha = jax.jit(slab_alpha)(seen, layout.splits)

    @jax.jit
    def mean(xi):
        log2, weight = log2_errors(seen, layout._replace(u=u_from_xi(xi, alpha)), TEXELS)
        return jnp.sum(log2 * weight) / jnp.sum(weight)

    step, slope = 1e-6, jax.jit(jax.grad(mean))
    below = (mean(0.0) - mean(-step)) / step
    above = (mean(step) - mean(0.0)) / step
    assert float(slope(0.0)) == pytest.approx(float(below), rel=1e-4)
    assert float(slope(1e-12)) == pytest.approx(float(above), rel=1e-4)
    assert float(above) == pytest.approx(float(below), rel=1e-4)


@pytest.mark.slow
def test_gradients_in_the_light_s_direction(x64):
    """Through frame, axis, Jacobian and extents, for each receiver."""
    points, camera = hills()
    _, layout = hills_seen()

    def errors(direction):
        seen = parallel_sight(direction, points, camera)
        log2, weight = log2_errors(seen, layout, TEXELS)
        return log2 * weight

    assert_gradient(errors, np.array(STEEP))


@pytest.mark.slow
def test_a_split_moves_extents_and_receivers(x64):
    """Receivers even in log z in a line: moving a split by a bin changes the mean of m^p as the
    closed form of the integrals does; its derivative between is their difference."""
    z = np.exp(np.linspace(0, np.log(64), 4096))
    k, power = BINS // 2, 2.0
    seen = on_a_line(z)
    one = np.ones((1, 2))

    @jax.jit
    def loss(split):
        layout = Layout(*(jnp.asarray(part) for part in (0 * one, split[None], one / 2, one)))
        log2, weight = log2_errors(seen, layout, 1.0)
        return jnp.sum(weight * jnp.exp2(power * log2)) / weight.sum()

    def exact(b):
        """m = L / (z r), r rows of one of two equal charts: the integral of its square."""
        total, width = 0.0, np.log(64)
        for low, high in ((1.0, b), (b, 64.0)):
            total += (high - low) ** 2 * (low**-2 - high**-2) / 2 * 2 / width
        return total

    at = [64 ** (j / BINS) for j in (k, k + 1)]
    for b in at:
        assert float(loss(jnp.asarray(b))) == pytest.approx(exact(b), rel=0.02)
    middle = np.sqrt(at[0] * at[1])
    slope = float(jax.jit(jax.grad(loss))(jnp.asarray(middle)))
    expected = (exact(at[1]) - exact(at[0])) / (at[1] - at[0])
    assert slope == pytest.approx(expected, rel=0.05)


@jax.jit
def on_a_line(z) -> Seen:
    """Receivers on the axis, light across it, pixels in proportion to depth: m is TR05-024's."""
    n = z.size
    depth = jnp.asarray(z)
    near, far = depth.min(), depth.max()
    plane = jnp.stack([jnp.zeros(n), depth])
    wide = jnp.full(n, 1e6)
    jacobian = jnp.stack([jnp.stack([wide, 0 * wide]), jnp.stack([0 * wide, depth])])
    cell = bin_of(depth, near, far)
    outline = outline_of(plane, cell, jnp.ones(n, bool), 1)
    face, weight = jnp.zeros_like(cell), jnp.ones(n)
    return Seen(plane, jacobian, depth, face, weight, outline, near, far, jnp.zeros(1), jnp.ones(1))


def hostile(case: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, normals and the direction of light."""
    points, camera = hills(64, (1e-2, 1e6) if case == "far" else (2.0, 30.0))
    position, normal = np.asarray(points.position), np.asarray(points.normal)
    direction = np.array(STEEP)
    if case == "flat":
        position = position / (camera.rotation[2] @ position)
    elif case == "along the view":
        direction = camera.rotation[2]
    elif case == "nearly along the view":
        direction = camera.rotation[2] + [0.0, 0.0, -0.021]
    elif case == "edge-on":
        normal = np.tile(np.cross(STEEP, [0.0, 0.0, 1.0])[:, None], 64)
        normal = normal / np.linalg.norm(normal[:, 0])
    elif case in ("one", "none"):
        normal = normal * np.where(np.arange(64) < (case == "one"), 1, -1)
    return position, normal, direction


@functools.cache
def predicted(beams: bool):
    """p-mean and sum of log m of 64 points, and their gradients: traced once a precision."""
    _, camera = hills()

    def loss(direction, position, normal, u, splits, shares):
        seen = parallel_sight(direction, points_of(position, normal), camera, beams)
        log2, weight = log2_errors(seen, Layout(u, splits, shares, jnp.ones_like(u)), TEXELS)
        return jnp.stack([log2_p_mean(log2, weight, 8.0), jnp.sum(log2 * weight)])

    return value_and_gradient(loss)


HOSTILE = (
    "flat", "far", "along the view", "nearly along the view", "edge-on", "one", "none",
)  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_everything_is_finite(case, dtype):
    """Receivers all at one depth or from 1 to 1e8, light along the view, edge-on light, one
    receiver and none: values and gradients in layout, direction and points; of m in float32 and of
    its perspective factor in float64."""
    layout = even_layout(3, 2.0, 30.0)
    position, normal, direction = hostile(case)
    arguments = (direction, position, normal, *layout[:3])
    found = predicted(dtype == np.float64)(*(jnp.asarray(a, dtype) for a in arguments))
    assert_finite(found)
    assert found[0].dtype == dtype
    if case == "none":
        np.testing.assert_array_equal(found[0], 0.0)
    elif case == "one":
        assert float(found[0][0]) < 0, "one receiver has all texels"


@given(hostile_arrays((2, 3, 8)), st.integers(0, 2**32 - 1))
def test_everything_is_finite_for_any_points(numbers, seed):
    """R1: eight of the 64 points and normals are anything, and so are direction and layout, within
    what is allowed."""
    position, normal, _ = hostile("")
    position, normal = position.copy(), normal.copy()
    position[:, :8], normal[:, :8] = numbers[0], unit_or_zero(numbers[1])
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3) * 10.0 ** rng.uniform(-9, 0, 3)
    splits = np.sort(10.0 ** rng.uniform(-3, 6, 2))
    u, shares = 10.0 ** rng.uniform(-6, 6, (2, 1, 3))
    for dtype in (np.float32, np.float64):
        with jax.enable_x64(dtype == np.float64):
            arguments = (direction, position, normal, u, splits, shares)
            found = predicted(dtype == np.float64)(*(jnp.asarray(a, dtype) for a in arguments))
            assert_finite(found)


def test_receivers_lit_edge_on_do_not_count(x64):
    """What faces the light by a cosine of less than `GRAZING` is not among the samples."""
    for sine, counts in ((0.9 * GRAZING, False), (1.1 * GRAZING, True)):
        case = along_a_plane(toward=(0.0, np.sqrt(1 - sine**2), -sine))
        receivers = sampled_receivers(case.eye, case.frame, "m")
        ground = np.abs(case.eye.normal[2, receivers.pixel]) > 0.99
        assert (receivers.counts & ground).any() == counts
