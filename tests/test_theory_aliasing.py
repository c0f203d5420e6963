"""Aliasing along an axis against traced rays, texel edges against LAPACK, M4 against counting."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.theory import compiled, derivative, in_range
from numpy.testing import assert_allclose
from scipy.stats import qmc

from asmjax import theory
from asmjax.footprint import m as worst_ratio

RESOLUTIONS = 640, 1024
"""Pixels and texels along the axis."""


def turned(angle):
    """Unit vectors along and across an axis at that angle, in the plane."""
    return np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])


def met(origin, direction, point, normal):
    """Where a ray meets the line through `point`."""
    return origin + direction * (normal @ (point - origin)) / (normal @ direction)


class Plane:
    """An eye, a light and a receiver in the plane, and where each sees the receiver."""

    def __init__(self, seed: int, *, parallel: bool, distance: float = 3.0):
        rng = np.random.default_rng(seed)
        self.normal, self.along = turned(rng.uniform(-0.3, 0.3))
        self.point = rng.normal(size=2)
        self.parallel = parallel
        self.eye = self.point + 4 * turned(rng.uniform(-0.5, 0.5))[0]
        self.light = self.point + distance * turned(rng.uniform(-0.5, 0.5))[0]
        # Axes do not point at the receiver: it is seen off axis.
        self.eye_axis, self.eye_side = turned(self._towards(self.eye) + rng.uniform(-0.2, 0.2))
        self.light_axis, self.light_side = turned(
            self._towards(self.light) + rng.uniform(-0.4, 0.4)
        )
        self.eye_width, self.eye_distance = rng.uniform(0.5, 1), rng.uniform(1, 2)
        self.light_width, self.light_distance = rng.uniform(0.5, 1), rng.uniform(1, 2)
        self.strength = rng.uniform(0.2, 3)

    def _towards(self, origin):
        x, y = self.point - origin
        return np.arctan2(y, x)

    def warp(self, s):
        """G, a perspective warp of the light's image line, and its slope."""
        u = self.strength
        return s / (1 + u * (1 - s)), (1 + u) / (1 + u * (1 - s)) ** 2

    def seen_by_eye(self, x):
        """The receiver at image coordinate x in [-1/2, 1/2]."""
        ray = self.eye_axis * self.eye_distance + self.eye_side * self.eye_width * x
        return met(self.eye, ray, self.point, self.normal)

    def seen_by_light(self, s):
        place = self.light_side * self.light_width * (self.warp(s)[0] - 0.5)
        if self.parallel:
            return met(self.light + place, self.light_axis, self.point, self.normal)
        ray = self.light_axis * self.light_distance + place
        return met(self.light, ray, self.point, self.normal)

    def traced(self, x, s, step=1e-6):
        """Length on the receiver of a texel at s / of a pixel at x."""
        lengths = [
            np.linalg.norm(seen(at + step) - seen(at - step)) / (2 * step * count)
            for seen, at, count in (
                (self.seen_by_eye, x, RESOLUTIONS[0]),
                (self.seen_by_light, s, RESOLUTIONS[1]),
            )
        ]
        return lengths[1] / lengths[0]

    def computed(self, x, s) -> theory.AxisAliasing:
        """The same by the formula, for the light's beam where it meets the eye's."""
        point = self.seen_by_eye(x)
        ray = point - self.eye
        depth = self.eye_axis @ ray
        cosine = depth / np.linalg.norm(ray)
        eye = depth, cosine, self.eye_width, self.eye_distance, RESOLUTIONS[0]
        slants = [abs(self.normal @ ray) / np.linalg.norm(ray)]
        image = self.light_width, RESOLUTIONS[1], self.warp(s)[1]
        if self.parallel:
            slants.append(abs(self.normal @ self.light_axis))
            return under_parallel_light(eye, image, slants)
        ray = self.seen_by_light(s) - self.light
        depth = self.light_axis @ ray
        cosine = depth / np.linalg.norm(ray)
        slants.append(abs(self.normal @ ray) / np.linalg.norm(ray))
        light = depth, cosine, image[0], self.light_distance, *image[1:]
        return under_point_light(eye, light, slants)


@jax.jit
def under_parallel_light(eye, image, slants):
    light = theory.log2_parallel_beam(*image)
    return theory.axis_aliasing(theory.log2_point_beam(*eye), light, *slants)


@jax.jit
def under_point_light(eye, light, slants):
    beams = (theory.log2_point_beam(*beam) for beam in (eye, light))
    return theory.axis_aliasing(*beams, *slants)


@pytest.mark.parametrize("parallel", [False, True], ids=["point", "directional"])
def test_axis_formula_against_traced_rays(x64, parallel):
    """Footprints of a texel and of a pixel from two rays each; off axis, slanted, warped; 1e-8."""
    rng = np.random.default_rng(5)
    for seed in range(20):
        plane = Plane(seed, parallel=parallel)
        x, s = rng.uniform(-0.4, 0.4), rng.uniform(0.1, 0.9)
        found = plane.computed(x, s)
        assert_allclose(found.m, plane.traced(x, s), rtol=1e-8)
        assert_allclose(found.m, found.perspective * found.projective, rtol=1e-12)
        assert not found.grazing


def test_far_point_light_is_directional(x64):
    """At 1e4 to 1e7 units the point light's beam comes to the parallel one's, as 1 / distance."""
    for distance in (1e4, 1e5, 1e7):
        width = 2.0 / distance
        point = theory.log2_point_beam(distance + 0.7, 1.0, width, 1.0, 512)
        parallel = theory.log2_parallel_beam(2.0, 512)
        assert abs(float(point - parallel)) < 2 / distance


def test_overhead_warp_is_equation_2(x64):
    """On the axis, with the normal halfway between eye and light: m_z of the parameterization and
    no projective aliasing. Off axis the paper's beam is too wide by 1 / cos (erratum l)."""
    alpha, u, theta = 50.0, 0.2, 0.5
    z = in_range(np.linspace(0, 1, 7), 1, alpha)
    to_s, error, spacing = (
        compiled(theory.s_of_z), compiled(theory.m_z), derivative(theory.z_of_s)
    )  # fmt: skip
    slope = spacing(to_s(z, alpha, u), alpha, u) / (alpha - 1)
    wanted = error(z, alpha, u, theta, RESOLUTIONS[0] / RESOLUTIONS[1])
    for off_axis in (0.0, 0.4):
        cosine = np.cos(off_axis)
        eye = z, cosine, 2 * np.tan(theta), 1.0, RESOLUTIONS[0]
        slants = [np.sqrt(0.5)] * 2
        found = under_parallel_light(eye, (alpha - 1, RESOLUTIONS[1], slope), slants)
        assert_allclose(found.perspective, wanted / cosine, rtol=1e-12)
        assert_allclose(found.projective, 1, rtol=1e-12)


def test_grazing_is_marked_and_stays_apart(dtype):
    """A light edge-on makes the projective factor 1e4 at most, an eye edge-on 1e-4 at least; both
    at once do not hide behind a quotient of 1."""
    cosines = jnp.asarray([[0.5, 0.5, 1e-9, 0.0], [0.5, 0.0, 0.5, 0.0]], dtype)
    found = theory.axis_aliasing(0.0, 0.0, *cosines)
    assert found.log2_projective.dtype == dtype
    assert_allclose(found.projective, [1, 5e3, 2e-4, 1], rtol=1e-5)
    assert found.grazing.tolist() == [False, True, True, True]


@jax.jit
def edges_and_lengths(jacobian, resolution):
    edges = theory.texel_edges(jacobian, resolution)
    return edges, theory.edge_lengths(edges), worst_ratio(jacobian, resolution)


@jax.jit
def displacements(edges, normal):
    return theory.mean_displacement(edges, normal), theory.rms_displacement(edges, normal)


def test_texel_edges_are_columns_of_the_inverse(x64):
    """LAPACK's inverse of skewed matrices; m is at least both lengths."""
    jacobian = 1e-3 * np.moveaxis(matrices(200, 4), 0, -1)
    edges, lengths, m = (np.asarray(x) for x in edges_and_lengths(jacobian, 256))
    wanted = np.linalg.inv(np.moveaxis(jacobian, -1, 0)) / 256
    assert_allclose(np.moveaxis(edges, -1, 0), wanted, rtol=1e-9)
    assert_allclose(lengths, np.linalg.norm(edges, axis=0), rtol=1e-12)
    assert (lengths <= m * (1 + 1e-9)).all()


def test_flat_footprints(dtype):
    """Rank one: edges along the direction that the light does not tell apart, as long as m says.
    Nothing there: 0."""
    flat = np.array([[[0, 1, 1e-30], [0, 2, 0]], [[0, 2, 0], [0, 4, 1e-30]]], dtype)
    edges, lengths, m = (np.asarray(x) for x in edges_and_lengths(flat, 4))
    assert edges.dtype == dtype and np.isfinite(edges).all()
    assert_allclose(edges[:, :, 0], 0)
    assert_allclose(np.hypot(*lengths[:, 1]), m[1], rtol=1e-5)
    # J (2, -1) = 0.
    assert_allclose(edges[0, :, 1] + 2 * edges[1, :, 1], 0, atol=1e-5 * lengths[0, 1])


def matrices(count, seed):
    """Random skewed texel-to-pixel matrices, m from about 1 to 8."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 2, 2)) * rng.uniform(0.5, 3, (count, 1, 1))


@pytest.mark.parametrize("seed", range(4))
def test_predicted_displacement_is_what_a_map_misclassifies(x64, seed):
    """M4 against counting, 0.3 %: a straight shadow edge, answered from texel centres.

    Rationale: a pixel is answered by the centre of its texel, so it is wrong if the edge runs
    between the two. Setup: a texel lattice of random skew, phase and turn; points on a segment
    across the edge. Expected: wrong points / length of edge is the mean displacement, and the same
    weighted by twice the distance is the mean square. Points: 2^17 of a Sobol sequence, which
    misses such areas by about 1e-4.
    """
    inverse = matrices(1, seed)[0]
    jacobian = np.linalg.inv(inverse)
    angle = np.random.default_rng(seed + 50).uniform(0, 2 * np.pi)
    normal = np.array([np.cos(angle), np.sin(angle)])
    reach = np.abs(normal @ inverse).sum() / 2
    phases = qmc.Sobol(3, rng=seed).random_base2(17).T
    distance = (2 * phases[0] - 1) * reach
    texel = jacobian @ (normal[:, None] * distance) + phases[1:]
    centre = inverse @ (np.floor(texel) + 0.5 - phases[1:])
    wrong = (normal @ centre > 0) != (distance > 0)
    mean, square = 2 * reach * wrong.mean(), 2 * reach * (2 * np.abs(distance) * wrong).mean()
    edges, *_ = edges_and_lengths(jacobian[:, :, None], 1)
    found_mean, rms = displacements(edges, normal[:, None])
    assert_allclose(found_mean, mean, rtol=3e-3)
    assert_allclose(np.asarray(rms) ** 2, square, rtol=3e-3)


def test_square_texels(x64):
    """tau = 1: 0.25 along the axes, 0.2357 diagonally, 0.2436 on average; RMS 0.2887 always."""
    angles = np.linspace(0, 2 * np.pi, 3600, endpoint=False)
    edges = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, 3600))
    mean, rms = map(np.asarray, displacements(edges, np.array([np.cos(angles), np.sin(angles)])))
    assert_allclose(mean[[0, 450, 900]], [0.25, 0.2357, 0.25], atol=5e-5)
    assert_allclose(mean.mean(), 0.2436, atol=5e-5)
    assert_allclose(rms, 12**-0.5, rtol=1e-12)


def test_bounds_hold_for_any_jacobian(x64):
    """Mean <= m / 4 and RMS <= m / sqrt(12), for the worst of 90 directions; the second is met."""
    inverse = np.moveaxis(matrices(400, 9), 0, -1)
    jacobian = np.moveaxis(np.linalg.inv(np.moveaxis(inverse, -1, 0)), 0, -1)
    edges, _, m = (np.asarray(x) for x in edges_and_lengths(jacobian, 1))
    bound, rms_bound = (np.asarray(b) for b in theory.displacement_bounds(m))
    assert_allclose(bound, m / 4)
    angles = np.linspace(0, np.pi, 180, endpoint=False)
    normal = np.array([np.cos(angles), np.sin(angles)])[:, :, None]
    pairs = np.broadcast_to(edges[:, :, None], (2, 2, 180, 400)).reshape(2, 2, -1)
    normal = np.broadcast_to(normal, (2, 180, 400)).reshape(2, -1)
    worst, worst_rms = (
        np.asarray(x).reshape(180, 400).max(axis=0) for x in displacements(pairs, normal)
    )
    assert (worst <= bound * (1 + 1e-9)).all()
    assert (worst_rms <= rms_bound * (1 + 1e-9)).all()
    assert (worst_rms > 0.999 * rms_bound).all()
    assert worst.min() > 0 and (worst / bound).max() > 0.99


def test_jit_changes_nothing(x64):
    edges, normal = jnp.asarray(np.moveaxis(matrices(200, 4), 0, -1)), jnp.full((2, 200), 0.6)
    mean, rms = displacements(edges, normal)
    assert_allclose(theory.mean_displacement(edges, normal), mean, rtol=1e-13)
    assert_allclose(theory.rms_displacement(edges, normal), rms, rtol=1e-13)
