"""Kernel cases: where rays meet triangles, and what that is worth in texels."""

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.geometry.reintersect import meet_triangles
from asmjax.hard_cases.addresses import EYE, addressed, exact_uv, floor_seen, lamp
from asmjax.hard_cases.case import Bound, HardCase, Kernel
from asmjax.hard_cases.exact import cross, dot, fifty
from asmjax.shadow.adaptive.address import DEEPEST_LOG2

_CORNERS = np.array([[-40.0, 45.0, -3.0], [-37.0, -35.0, 52.0], [0.0, 0.0, 0.0]]) - EYE[:, None]
"""A triangle of the floor, relative to the eye, a corner in each column."""

FLOAT32_LOG2 = 19
"""log2 of texels a side up to which hits in float32 are right to a sixteenth of a texel."""

_meet = jax.jit(meet_triangles)


def _exact_t(ray, a, b, c):
    """Where the ray from 0 meets the plane of three corners, in decimals."""
    normal = cross(b - a, c - a)
    return dot(normal, a) / dot(normal, ray)


def _hits(severity: float) -> Kernel:
    """Eye rays met with the floor, and addressed in the lamp's image."""
    ray = floor_seen()
    ray = ray / -ray[2]
    corners = [np.repeat(corner[:, None], ray.shape[1], 1) for corner in _CORNERS.T]

    def value(ray, *corners):
        ray, corners = jnp.asarray(ray), [jnp.asarray(corner) for corner in corners]
        met = _meet(jnp.zeros_like(ray), ray, *corners)
        return addressed(ray * met.t, EYE, lamp())[0]

    def truth(ray, *corners):
        return exact_uv(lamp(), EYE, ray * _exact_t(ray, *corners))

    return Kernel(
        inputs=(ray, *corners),
        value=value,
        truth=fifty(truth),
        unit=2.0**-severity,
        marks=lambda ray, *corners: jnp.full(
            ray.shape[1], severity > (FLOAT32_LOG2 if ray.dtype == jnp.float32 else DEEPEST_LOG2)
        ),
        host=True,
    )


def _along(ray, a, b, c):
    """t where there is a meeting."""
    return meet_triangles(jnp.zeros_like(ray), ray, a, b, c).t


def _unmet(ray, a, b, c):
    return ~meet_triangles(jnp.zeros_like(ray), ray, a, b, c).met


def _slivers(severity: float) -> Kernel:
    """Triangles that many times as long as wide, each met in its middle."""
    rng = np.random.default_rng(11)
    a = rng.uniform(-1, 1, (3, 16)) + np.array([[0.0], [0.0], [5.0]])
    along, across = rng.normal(size=(2, 3, 16))
    along, across = along / np.linalg.norm(along, axis=0), across / np.linalg.norm(across, axis=0)
    b, c = a + along, a + 0.4 * along + across / severity
    return Kernel(
        inputs=((a + b + c) / 3 / 5.0, a, b, c),
        value=_along,
        truth=fifty(_exact_t),
        marks=_unmet,
    )


CASES = (
    HardCase(
        "hits met again, then addressed", (10, 12), "addresses",
        "A hit of float32 rays is off by a part of a texel at 2^22, whatever the address does.",
        "the ray met with its triangle again in float64 (asmjax.geometry.reintersect)",
        "50 digits", "log2 of texels a side", (17.0, 19.0, 22.0, 24.0, 27.0, 30.0),
        Bound(0.0625, 1e-3, "texels"), _hits,
        20.0, "hits in float32 are no part of asmjax, which meets triangles in float64; no map is "
        "finer than 2^24 texels a side",
    ),
    HardCase(
        "rays that meet slivers", (20,), "addresses",
        "The area that weights are divided by cancels: they become anything.",
        "Woop, Benthin, Wald 2013, in float64; areas below four roundings meet nothing",
        "50 digits", "length / width of the triangle", (1e1, 1e3, 1e5, 1e7, 1e9, 1e14),
        Bound(0.1, 1e-4, "relative"), _slivers,
        1e6, "marked: `met` is False",
    ),
)  # fmt: skip
"""Of the theme "addresses"."""
