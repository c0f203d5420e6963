"""Re-intersection: against mpmath, watertight along shared edges, differentiable, and never NaN."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers.gradients import (
    assert_finite,
    assert_gradient,
    hostile_arrays,
    unit_or_zero,
    value_and_gradient,
)
from hypothesis import example, given
from hypothesis import strategies as st

from asmjax.geometry.reintersect import LANES, meet_triangles, meet_triangles_on_host

N = 64

MEET = jax.jit(meet_triangles)


def case(seed=0, size=1.0, distance=5.0):
    """Rays from around the origin through random places of random triangles, and their weights."""
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=(3, N))
    centre *= distance / np.linalg.norm(centre, axis=0)
    a, b, c = (centre + size * rng.normal(size=(3, N)) for _ in range(3))
    weights = rng.dirichlet(np.ones(3), N).T
    origin = 0.1 * rng.normal(size=(3, N))
    place = weights[0] * a + weights[1] * b + weights[2] * c
    return origin, place - origin, a, b, c, weights


def test_where_it_was_aimed(dtype):
    """t is 1 and the weights are those that the ray was aimed by."""
    *arrays, weights = case()
    found = MEET(*(jnp.asarray(x, dtype) for x in arrays))
    tolerance = 2e-4 if dtype == np.float32 else 1e-11
    assert np.asarray(found.inside).all() and np.asarray(found.met).all()
    np.testing.assert_allclose(found.t, 1.0, rtol=tolerance)
    np.testing.assert_allclose(found.weights, weights, atol=tolerance)
    normal = np.asarray(found.normal)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=0), 1, rtol=1e-5)
    assert (np.sum(normal * arrays[1], axis=0) <= 0).all()


def ref_t(origin, direction, a, b, c):
    """The ray parameter to 50 digits, by the plane of the triangle."""
    with mpmath.workdps(50):
        o, d, a, b, c = (mpmath.matrix(list(map(float, v))) for v in (origin, direction, a, b, c))
        p, q = b - a, c - a
        n = mpmath.matrix([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2],
                           p[0] * q[1] - p[1] * q[0]])  # fmt: skip

        def dot(u, v):
            return sum(u[k] * v[k] for k in range(3))

        return float(dot(n, a - o) / dot(n, d))


@pytest.mark.parametrize(("size", "distance"), [(1.0, 5.0), (1e-3, 100.0), (50.0, 10.0)])
def test_against_mpmath(size, distance, x64):
    """Float64 is right to the rounding of what it is given: corners at `distance`, sides `size`."""
    *arrays, _ = case(1, size, distance)
    found = MEET(*(jnp.asarray(x) for x in arrays))
    truth = np.array([ref_t(*(x[:, k] for x in arrays)) for k in range(N)])
    origin, direction, a, b, c = arrays
    normal = np.cross(b - a, c - a, axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    # How far t moves for a plane that moves by one rounding of its corners.
    slope = np.abs(np.sum(normal * direction, axis=0))
    thin = size / np.abs(np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0) / size)
    allowed = 64 * np.finfo(float).eps * distance / slope * np.maximum(thin, 1)
    assert (np.abs(np.asarray(found.t) - truth) <= allowed).all()


def fan(rng, count=7):
    """A closed fan of triangles around a corner, none of which the origin sees from behind."""
    angle = 2 * np.pi * (np.arange(count) + 0.6 * rng.random(count)) / count
    rim = np.stack([np.cos(angle), np.sin(angle), 0.1 * rng.normal(size=count)])
    shift = rng.normal(size=(3, 1)) * [[0.5], [0.5], [1.0]] + [[0.0], [0.0], [7.0]]
    a = np.repeat(shift + rng.normal(size=(3, 1)) * 0.1, count, 1)
    return a, rim + shift, np.roll(rim + shift, -1, axis=1)


@pytest.mark.parametrize("dtype", ["float32", "float64"], indirect=True)
def test_rays_at_shared_edges_are_inside_of_a_triangle_at_least(dtype):
    """Of all triangles of a fan, for rays that pass within roundings of its edges and corner."""
    rng = np.random.default_rng(4)
    leaks = 0
    for _ in range(8):
        a, b, c = fan(rng)
        count = a.shape[1]
        share = np.r_[0.0, 1e-7, rng.random(30)]
        for k in range(count):
            on_edge = a[:, :1] + share * (b[:, k : k + 1] - a[:, :1])
            inside = np.zeros(share.size, bool)
            for j in range(count):
                wide = [np.repeat(v[:, j : j + 1], share.size, 1) for v in (a, b, c)]
                args = (np.zeros_like(on_edge), on_edge, *wide)
                inside |= np.asarray(MEET(*(jnp.asarray(v, dtype) for v in args)).inside)
            leaks += int((~inside).sum())
    assert leaks == 0


def test_a_side_is_the_other_sides_negative_bit_for_bit(dtype):
    """The weights' signs at a shared edge, seen from both of its triangles."""
    rng = np.random.default_rng(2)
    p, q, left, right = (rng.normal(size=(3, 512)) + [[0], [0], [4]] for _ in range(4))
    share = rng.random(512)
    direction = p + share * (q - p) * (1 + 1e-8 * rng.normal(size=512))
    zero = np.zeros_like(p)
    cast = [jnp.asarray(v, dtype) for v in (zero, direction, left, p, q, right)]
    one = MEET(cast[0], cast[1], cast[2], cast[3], cast[4])
    other = MEET(cast[0], cast[1], cast[5], cast[4], cast[3])
    outside_one = np.asarray(one.weights[0] < 0)
    outside_other = np.asarray(other.weights[0] < 0)
    across = np.sum(np.cross(q - p, left - p, axis=0) * np.cross(q - p, right - p, axis=0), axis=0)
    # Where the two lie on either side of the edge as the ray sees it.
    side = np.sum(np.cross(p, q, axis=0) * left, axis=0), np.sum(np.cross(p, q, axis=0) * right, 0)
    apart = (side[0] * side[1] < -1e-3) & np.isfinite(across)
    assert apart.sum() > 100
    assert not (outside_one & outside_other)[apart].any()


def test_degenerate_triangles_and_rays_along_planes_meet_nothing(dtype):
    a = np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 2.0]])
    b = np.array([[1.0, 0.0], [0.0, 1.0], [2.0, 3.0]])
    c = np.array([[2.0, 0.0], [0.0, 2.0], [2.0, 5.0]])
    direction = np.array([[0.1, 0.0], [0.2, 0.0], [1.0, 1.0]])
    args = (np.zeros((3, 2)), direction, a, b, c)
    found = MEET(*(jnp.asarray(v, dtype) for v in args))
    assert not np.asarray(found.met).any() and not np.asarray(found.inside).any()
    assert np.asarray(found.t).tolist() == [0.0, 0.0]


def places(origin, direction, a, b, c):
    """What is differentiated: places and normals."""
    found = meet_triangles(origin, direction, a, b, c)
    return jnp.concatenate([origin + found.t * direction, found.normal])


def test_gradients_against_differences(x64):
    *arrays, _ = case(3)
    assert_gradient(places, *arrays)


BOTH = value_and_gradient(places)

FEW = 8
"""Rays in an example of anything: numbers take long to draw."""


def beside_the_axis() -> tuple[np.ndarray, np.ndarray]:
    """Triangles of which one side is 1e12 times or more as long as another, as the ray sees them:
    two corners within 1e-12 of its line, the third a thousand beside it."""
    a, b, c, origin = (
        np.array([-1e-12, 1.0, 1e6]), np.array([1e-20, 1.0, -5e-10]),
        np.array([1e-20, 0.0, 1.0]), np.array([0.0, -663149.0, -1e6]),
    )  # fmt: skip
    other = np.array([[2.0, -1.0, 0.0], [1e-20, 0.0, 0.0], [1e6, 605911.0, -1e-12], [0, -1e6, 0]])
    points = np.stack([np.stack([a, b, c, origin]), other], axis=-1)
    direction = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]])
    return np.tile(points, FEW // 2), np.tile(direction, FEW // 2)


@given(hostile_arrays((4, 3, FEW)), hostile_arrays((3, FEW)).map(unit_or_zero), st.booleans())
@example(*beside_the_axis(), False)
def test_no_nan_for_anything_finite(points, direction, flat):
    """Corners anywhere, in one point, on a line, behind the origin; directions of any kind or 0."""
    a, b, c, origin = points / 1e3
    if flat:
        c = 2 * b - a
    assert_finite(BOTH(*(jnp.asarray(v, jnp.float32) for v in (origin, direction, a, b, c))))


def test_on_the_host_any_number_of_rays():
    """Blocks are filled up and cut again; values are those of the kernel, in float64."""
    rng = np.random.default_rng(5)
    for count in (0, 1, LANES - 1, LANES + 3):
        place = rng.normal(size=(3, count)) + [[0.0], [0.0], [9.0]]
        a, b = (place + rng.normal(size=(3, count)) for _ in range(2))
        origin = np.array([0.1, 0.2, 0.3])
        found = meet_triangles_on_host(origin, place - origin[:, None], (a, b, 3 * place - a - b))
        assert found.t.shape == (count,) and found.weights.shape == (3, count)
        np.testing.assert_allclose(found.t[found.met], 1.0, rtol=1e-9)
        assert found.met.sum() >= 0.99 * count and found.t.dtype == np.float64
