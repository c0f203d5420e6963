"""Kernels of lights with a size and of filters: what is seen of a light, windows, moments, tests.

They are asked of receivers as `project` may make them, in frames of one face; poses, which make
receivers of points, are a family of their own.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import Receivers, double
from asmjax.buffers.receivers import GRAZING
from asmjax.geometry import AreaLight, LightFrame, rectangle_light, sphere_light, sun_light
from asmjax.shadow.comparison import BIAS, bias_distance, depth_tolerance, lit_by_texel, plane_depth
from asmjax.shadow.filtered.footprint import box_of, stratified_share
from asmjax.shadow.soft.hamburger import ALPHA, mean_blocker, shadow_intensity
from asmjax.shadow.soft.light_taps import (
    Horizon,
    horizon,
    scale_at,
    seen,
    share_above,
    shift_at,
    taps_of,
)
from asmjax.shadow.soft.nearest import least_depths, least_in
from asmjax.shadow.soft.summed import scaled, summed, unscaled, window_moments
from asmjax.shadow.soft.wide_map import WideTexels, search_depth
from helpers.kernels import Arrays, Kernel, Part, powers
from helpers.painted import painted
from helpers.theory import QUICKLY

SIDE = 32
"""Texels a side of the map."""

TEXEL = 1 / 64
"""Of the image: the size of texels that are tested."""

NEAREST, FARTHEST = 1e-12, 1e8
"""Depths of receivers: the least is that of float32 (`least_depth`)."""

ROUNDINGS = 1e-6
"""A few roundings of float32, in parts."""

LIGHTS = {
    "rectangle": rectangle_light((1.0, 2.0, 3.0), (0.3, 0.1, 0.02), (-0.05, 0.2, 0.1)),
    "sphere": sphere_light((1.0, 2.0, 3.0), 0.3),
    "sun": sun_light((0.0, 0.0, 1.0), 0.05),
}


def frame_of(area: AreaLight | None, perspective: bool) -> LightFrame:
    """A face along z, wider than high."""
    return LightFrame(
        origin=np.array([1.0, 2.0, 3.0]),
        rotation=np.eye(3)[None],
        corner=np.array([[-0.7, -0.3]]),
        extent=np.array([[1.3, 0.8]]),
        cone_axis=np.array([0.0, 0.0, 1.0]),
        cos_cutoff=-1.0,
        near=0.0,
        perspective=perspective,
        area=area,
    )


def receivers_at(uv, depth, slope, secant=1.0, reach=1.0) -> Receivers:
    """Of which all but the last face the light."""
    n = depth.shape[0]
    return Receivers(
        face=jnp.zeros(n, jnp.int32),
        uv=uv,
        depth=depth,
        slope=slope,
        secant=secant * jnp.ones_like(depth),
        reach=reach * jnp.ones_like(depth),
        prim=jnp.arange(n, dtype=jnp.int32),
        facing=jnp.arange(n) != n - 1,
    )


def _places(rng, n) -> Arrays:
    """Image coordinates, depths and slopes of receivers several radii away from any light."""
    return rng.uniform(0.02, 0.98, (2, n)), powers(rng, n, 2, 200), 0.3 * rng.normal(size=(2, n))


def _as_projected(uv, depth, slope, *rest) -> Arrays:
    steepest = 1 / GRAZING
    return (
        np.clip(uv, 0, 1 - 2.0**-24),
        np.clip(np.abs(depth), NEAREST, FARTHEST),
        np.clip(slope, -steepest, steepest),
        *rest,
    )


def unsteady(of: Callable, most: float) -> Callable[..., np.ndarray]:
    """Points at which a few roundings of the arguments move a result by more than `most`."""

    @functools.partial(jax.jit, compiler_options=QUICKLY)
    def moved(signs, *arguments):
        def at(sign):
            return of(*(a * (1 + ROUNDINGS * s) for a, s in zip(arguments, sign, strict=True)))

        found = jax.vmap(at)(signs)
        return jnp.ptp(found.reshape(len(signs), -1, found.shape[-1]), axis=0).max(axis=0)

    def jumps(*arguments: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng(0)
        with jax.enable_x64(True):
            signs = [rng.choice([-1.0, 0.0, 1.0], (8, *a.shape)) for a in arguments]
            return np.asarray(moved(signs, *arguments)) > most

    return jumps


# What receivers see of a light, and where in its map.


def _light_seen(shape: str, uv, depth, slope, share):
    """The light, its shift by a blocker at a part `share` of the depth, and its horizon."""
    area = LIGHTS[shape]
    frame, receivers = frame_of(area, shape != "sun"), receivers_at(uv, depth, slope)
    light = seen(frame, area, receivers)
    blocker = share * depth
    shift = shift_at(light, frame, receivers, blocker)
    heights = horizon(light, frame, receivers)
    rows = [
        *light.centre, *light.axis_u, *light.axis_v, scale_at(light, frame, blocker),
        *shift.centre, *shift.axis_u, *shift.axis_v, *shift.half_box(shape == "rectangle"),
        *shift.at(0.25, -0.5), *heights,
    ]  # fmt: skip
    return jnp.stack([row * jnp.ones_like(depth) for row in rows])


def _blocked(rng, n) -> Arrays:
    # Blockers are before the light.
    return *_places(rng, n), rng.uniform(0.3, 0.9, n)


def _light_kernel(shape: str) -> Kernel:
    return Kernel(
        f"light_taps-{shape}",
        functools.partial(_light_seen, shape),
        _blocked,
        # Of a sphere the shift of the centre is nothing beside that of the axes.
        (Part(9), Part(1), Part(6), Part(2), Part(2), Part(3)),
        allowed=_as_projected,
    )


TAPS = taps_of(LIGHTS["sphere"], 16).T
"""(taps, 2) points of a disk."""


def _above(centre, axis_u, axis_v):
    return share_above(Horizon(centre, axis_u, axis_v), jnp.asarray(TAPS, centre.dtype))


def _at_the_horizon(centre, axis_u, axis_v) -> np.ndarray:
    heights = centre + TAPS[:, :1] * axis_u + TAPS[:, 1:] * axis_v
    return (np.abs(heights) < ROUNDINGS * np.hypot(axis_u, axis_v)).any(axis=0)


LIGHT = (
    *map(_light_kernel, LIGHTS),
    Kernel(
        "share_above",
        _above,
        lambda rng, n: tuple(rng.normal(size=(3, n))),
        jumps=_at_the_horizon,
        jumps_at="a tap that is just as high as the plane",
        # A count.
        slopes=False,
    ),
)


# Searches and windows of a map.


@functools.cache
def _map() -> np.ndarray:
    """(1, SIDE, SIDE) float32 depths, a part of them nowhere hit."""
    rng = np.random.default_rng(3)
    depth = rng.uniform(0.8, 2.0, (1, SIDE, SIDE)).astype(np.float32)
    depth[0, 20:, 4:11] = np.inf
    return depth


def _searched(uv, depth, slope, half):
    """The search for blockers, and one look into a window of half sides `half`, in texels."""
    frame = frame_of(LIGHTS["rectangle"], True)
    receivers = receivers_at(uv, depth, slope)
    least = jnp.asarray(least_depths(_map()), depth.dtype)
    texels = WideTexels(frame, None, None, np.array([[0.2, 0.3]]), np.array(0.8), least)
    light = seen(frame, LIGHTS["rectangle"], receivers)
    low, high = uv * SIDE - half, uv * SIDE + half
    nearest = least_in(least, receivers.face, low, high, SIDE, 1)
    # It is infinite where nothing is hit; who asks holds it to the receiver's own.
    return jnp.stack([
        search_depth(texels, light, receivers, SIDE), jnp.minimum(nearest, depth)
    ])  # fmt: skip


def _window(centre, half, depth):
    """Moments and their bias, and a depth as moments have it and back; in float64 within."""
    dtype, sums, face = centre.dtype, summed(_map()), jnp.zeros(depth.shape, jnp.int32)
    with jax.enable_x64(True):
        low, high = double(centre) - double(half), double(centre) + double(half)
        moments, alpha = window_moments(
            sums, face, jnp.maximum(low, 0), jnp.minimum(high, SIDE), SIDE
        )
        at = scaled(sums, depth)
        found = jnp.concatenate([moments, jnp.stack([alpha, at, unscaled(sums, at)])])
        return jax.lax.convert_element_type(found, dtype)


def _windows(rng, n) -> Arrays:
    return rng.uniform(2, SIDE - 2, (2, n)), rng.uniform(0.6, 8, (2, n)), rng.uniform(0.9, 1.9, n)


def _inside(centre, half, depth) -> Arrays:
    """Of a texel at least, about a place that is half a texel away from the border."""
    return np.clip(centre, 0.5, SIDE - 0.5), np.clip(half, 0.5, 1e6), depth


WINDOWS = (
    Kernel(
        "search_depth",
        _searched,
        lambda rng, n: (*_places(rng, n), rng.uniform(0.5, 9, (2, n))),
        (Part(1), Part(1)),
        allowed=lambda uv, depth, slope, half: (*_as_projected(uv, depth, slope), np.abs(half)),
        jumps=unsteady(_searched, 1e-4),
        jumps_at="borders of cells, and between their levels",
        # Steps from cell to cell.
        slopes=False,
    ),
    Kernel(
        "window_moments",
        _window,
        _windows,
        (*[Part(1, least=1.0)] * 4, Part(1), Part(1, least=1.0), Part(1)),
        allowed=_inside,
    ),
)


# Moments.

DEPTHS = 12
"""In each window: with room around their moments."""


def _windows_of_depths(rng, n) -> Arrays:
    depth = rng.uniform(-0.9, 0.9, (DEPTHS, n))
    moments = np.stack([(depth**k).mean(axis=0) for k in range(1, 5)])
    return moments, depth.mean(axis=0) + rng.choice([-1.0, 1.0], n) * rng.uniform(0.1, 0.3, n)


def _moment_kernel(of: Callable) -> Kernel:
    def with_bias(moments, depth):
        return of(moments, depth, ALPHA["float32"])

    return Kernel(
        of.__name__,
        with_bias,
        _windows_of_depths,
        (Part(1, least=1.0),),
        jumps=unsteady(with_bias, 5e-5),
        jumps_at="a blocker of no weight, which may be anywhere",
    )


MOMENTS = tuple(map(_moment_kernel, (shadow_intensity, mean_blocker)))


# Shadow tests, footprints, and how wide a light looks.


def _tested(perspective: bool, uv, depth, slope, offset, secant, reach, held):
    """The plane's depth at a texel, the bias as depth and as distance, and the outcome."""
    frame = frame_of(None, perspective)
    receivers = receivers_at(uv, depth, slope, secant, reach)
    lit = lit_by_texel(
        receivers, offset, TEXEL, held, None, bias=BIAS, perspective=perspective
    )  # fmt: skip
    return jnp.stack([
        plane_depth(receivers, offset, perspective),
        depth_tolerance(receivers, TEXEL, BIAS),
        bias_distance(receivers, frame, TEXEL, BIAS),
        lit.astype(depth.dtype),
    ])  # fmt: skip


def _tests(perspective: bool, rng, n) -> Arrays:
    """Texels beside receivers, whose depths are a hundredth and more nearer or farther."""
    uv, depth, slope = _places(rng, n)
    offset = TEXEL * rng.uniform(-1, 1, (2, n))
    secant, reach = powers(rng, n, 1, 5), depth * rng.uniform(0.5, 1.5, n)
    along = (slope * offset).sum(axis=0)
    plane = depth / (1 + along) if perspective else depth + along
    tolerance = secant * (BIAS * depth + 0.2 * TEXEL * reach)
    held = plane - tolerance + depth * rng.choice([-1.0, 1.0], n) * rng.uniform(0.01, 0.4, n)
    return uv, depth, slope, offset, secant, reach, held


def _testable(uv, depth, slope, offset, secant, reach, held) -> Arrays:
    uv, depth, slope = _as_projected(uv, depth, slope)
    return uv, depth, slope, offset, np.clip(secant, 1, 1 / GRAZING), np.abs(reach), held


def _test_kernel(kind: str) -> Kernel:
    perspective = kind == "point"
    return Kernel(
        f"shadow_test-{kind}",
        functools.partial(_tested, perspective),
        functools.partial(_tests, perspective),
        (Part(1), Part(1), Part(1), Part(1, least=1.0)),
        allowed=_testable,
    )


PICTURE = np.random.default_rng(5).random((SIDE, SIDE)) < 0.5


def _footprint(at, texels):
    """The box around a footprint, and the share of light by 2 x 2 samples in it."""
    half = box_of(texels, 1.0)
    pixel = jnp.stack([jnp.arange(at.shape[1], dtype=jnp.int32)] * 2)
    return jnp.concatenate([half, stratified_share(painted(PICTURE, at), half, pixel, 2)[None]])


def _width_seen(directions):
    return jnp.stack([LIGHTS[shape].effective_width(directions) for shape in LIGHTS])


def _from_the_front(rng, n) -> Arrays:
    """Directions of any length within 70 degrees of the rectangle's normal."""
    normal = LIGHTS["rectangle"].normal[:, None]
    across = np.cross(normal, rng.normal(size=(3, n)), axis=0)
    across /= np.linalg.norm(across, axis=0)
    angle = rng.uniform(0, np.radians(70), n)
    return ((np.cos(angle) * normal + np.sin(angle) * across) * powers(rng, n, 1e-3, 1e3),)


OTHERS = (
    *map(_test_kernel, ("point", "directional")),
    Kernel(
        "stratified_share",
        _footprint,
        lambda rng, n: (rng.uniform(0, SIDE, (2, n)), 3 * rng.normal(size=(2, 2, n))),
        (Part(2), Part(1, least=1.0)),
        allowed=lambda at, texels: (at % SIDE, texels),
        jumps=unsteady(_footprint, 1e-3),
        jumps_at="samples on borders of texels",
    ),
    Kernel(
        "effective_width",
        _width_seen,
        _from_the_front,
        (Part(1),) * len(LIGHTS),
    ),
)

KERNELS = (*LIGHT, *WINDOWS, *MOMENTS, *OTHERS)
