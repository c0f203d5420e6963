"""Kernel cases: projections near the planes and directions in which they degenerate, and depths."""

import jax
import jax.numpy as jnp
import numpy as np

from asmjax import theory
from asmjax.buffers import SurfacePoints, light_offset, project
from asmjax.buffers.receivers import GRAZING
from asmjax.footprint import perspective_area
from asmjax.geometry import LightFrame, basis_from_axis, fixed_frame, look_at
from asmjax.hard_cases.case import Bound, HardCase, Kernel
from asmjax.hard_cases.exact import cross, digits, dot, fifty, floats, slope
from asmjax.shadow.comparison import BIAS, plane_depth, plane_is_trusted
from asmjax.theory.aliasing import LEAST_COSINE

_TURN = basis_from_axis((0.3, -0.5, 0.8))
"""A rotation in which no coordinate of a plane is round."""

_COUNT = 16


def points_of(position, normal, origin=(0.0, 0.0, 0.0)) -> SurfacePoints:
    """Valid flat surface points (3, n) relative to `origin`, in the precision of `position`."""
    n = position.shape[1]
    return SurfacePoints(
        position=position,
        normal=normal,
        prim=jnp.zeros(n, jnp.int32),
        valid=jnp.ones(n, bool),
        origin=np.asarray(origin, np.float64),
    )


# Incidence of eye and light.


def _slant(cos_eye, cos_light):
    return theory.axis_aliasing(0.0, 0.0, cos_eye, cos_light).projective


def _slant_exact(cos_eye, cos_light):
    return cos_eye / cos_light


_slant_gradient = jax.grad(lambda *cosines: _slant(*cosines).sum(), argnums=1)


def _slant_marks(cos_eye, cos_light):
    return theory.axis_aliasing(0.0, 0.0, cos_eye, cos_light).grazing


def _slants(cos_eye, cos_light) -> Kernel:
    return Kernel(
        inputs=(cos_eye, cos_light),
        value=_slant,
        truth=fifty(_slant_exact),
        gradient=_slant_gradient,
        gradient_truth=slope(_slant_exact, 1),
        marks=_slant_marks,
    )


def _light_grazes(severity: float) -> Kernel:
    cosine = np.cos(np.radians(severity)) * np.linspace(1, 1.5, 8)
    return _slants(np.linspace(0.3, 1, 8), cosine)


def _both_graze(severity: float) -> Kernel:
    cosine = np.cos(np.radians(severity)) * np.linspace(1, 1.5, 8)
    return _slants(cosine[::-1].copy(), cosine)


AXIS, FOCAL = _TURN[1], np.array([700.0, 700.0])


def _area(position, normal):
    axis, focal = (jnp.asarray(a, position.dtype) for a in (AXIS, FOCAL))
    return perspective_area(position, normal, axis, focal)


def _area_marks(position, normal):
    return ~jnp.isfinite(_area(position, normal))


def _area_exact(position, normal):
    """A = z^3 / (F_x F_y |n . X|)."""
    depth, along = dot(digits(AXIS), position), dot(normal, position)
    fx, fy = digits(FOCAL)
    return depth**3 / (fx * fy * np.abs(along))


def _eye_grazes(severity: float) -> Kernel:
    """Points of a plane that rays meet at `severity` degrees from its normal."""
    angle = np.radians(90 - severity) * np.linspace(1, 1.6, _COUNT)
    distance = np.geomspace(1, 50, _COUNT)
    local = np.stack([0.2 * np.cos(angle), np.cos(angle), -np.sin(angle)]) * distance
    normal = np.repeat(_TURN[2][:, None], _COUNT, 1)
    return Kernel(
        inputs=(_TURN.T @ local, normal),
        value=_area,
        truth=fifty(_area_exact),
        marks=_area_marks,
    )


# The light's own plane.

_NEAREST = 1e-9


def _near_frame() -> LightFrame:
    return LightFrame(
        origin=np.zeros(3),
        rotation=np.eye(3)[None],
        corner=np.zeros((1, 2)),
        extent=np.ones((1, 2)),
        cone_axis=np.array([0.0, 0.0, 1.0]),
        cos_cutoff=-1.0,
        near=_NEAREST,
        perspective=True,
    )


def _about_plane(position, normal):
    """u where a point faces the light, and -1 where it does not."""
    points, frame = points_of(position, normal), _near_frame()
    receivers = project(points, frame, light_offset(points, frame))
    return jnp.where(receivers.facing, receivers.uv[0], -1)


def _about_plane_exact(position, normal):
    ahead = position[2] > digits(_NEAREST)
    return np.where(ahead, position[0] / np.where(ahead, position[2], 1), -1)


_about_plane_gradient = jax.grad(lambda *inputs: _about_plane(*inputs).sum())


def _about_plane_slope(position, normal):
    """By all three coordinates."""
    ahead = position[2] > digits(_NEAREST)
    z = np.where(ahead, position[2], 1)
    none = 0 * z
    return np.stack([
        np.where(ahead, 1 / z, 0), none, np.where(ahead, -position[0] / z**2, 0)
    ])  # fmt: skip


def _light_plane(severity: float) -> Kernel:
    """Half of the points `1 / severity` in front of the light, the others behind."""
    depth = np.linspace(1, 2, _COUNT) / severity * np.where(np.arange(_COUNT) % 2, -1, 1)
    across = np.linspace(0.1, 0.9, _COUNT)
    normal = np.tile([[0.0], [0.0], [-1.0]], _COUNT)
    return Kernel(
        inputs=(np.stack([across * depth, 0.4 * depth, depth]), normal),
        value=_about_plane,
        truth=fifty(_about_plane_exact),
        gradient=_about_plane_gradient,
        gradient_truth=fifty(_about_plane_slope),
        unit=1.0,
    )


# Depths, and the receiver plane of the shadow test.

_OFFSET = np.array([3e-3, -2e-3])
"""From a receiver to the centre of a texel, image coordinates."""


def _plane_frame() -> LightFrame:
    return fixed_frame((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 60.0, 1e-9)


def _seen_at(position, normal):
    """Receivers of the plane, and the image offset to the texel's centre."""
    points, frame = points_of(position, normal), _plane_frame()
    receivers = project(points, frame, light_offset(points, frame))
    return receivers, jnp.tile(jnp.asarray(_OFFSET, position.dtype)[:, None], receivers.uv.shape[1])


def _rounding(position, normal, stored):
    """By how much a plane shades itself: distance along the normal / distance to the light."""
    receivers, offset = _seen_at(position, normal)
    off = plane_depth(receivers, offset, True) - stored
    return off / (receivers.depth * receivers.secant)


def _plane_marks(position, normal, stored):
    receivers, offset = _seen_at(position, normal)
    return (receivers.secant >= 0.999 / GRAZING) | ~plane_is_trusted(receivers, offset, True)


def _plane_at(tilt_deg: float, depth: float) -> Kernel:
    tilt = np.radians(tilt_deg)
    frame = _plane_frame()
    normal = np.array([np.sin(tilt) * 0.8, np.sin(tilt) * 0.6, -np.cos(tilt)])
    u, v = np.meshgrid(np.linspace(0.05, 0.95, 4), np.linspace(0.05, 0.95, 4))
    _, ray = frame.ray(0, u.ravel(), v.ravel())
    # The plane passes through the axis at that depth; rays that miss it are turned to the axis.
    level = -np.cos(tilt) * depth
    slope_ = normal @ ray
    ray = np.where(slope_ < 0.05 * normal[2], ray, np.array([[0.0], [0.0], [1.0]]))
    t = level / (normal @ ray)
    ray = np.where((t > 0) & (t < 40 * depth), ray, np.array([[0.0], [0.0], [1.0]]))
    position = ray * (level / (normal @ ray))
    return Kernel(
        inputs=(position, np.repeat(normal[:, None], 16, 1), _stored(position, normal)),
        value=_rounding,
        truth=lambda position, normal, stored: np.zeros(16),
        unit=1.0,
        marks=_plane_marks,
    )


def _stored(position, normal) -> np.ndarray:
    """What the map holds at the offset: the plane's exact depth, rounded to float32."""
    frame = _plane_frame()
    x, y = (position[k] / position[2] + _OFFSET[k] * frame.extent[0, k] for k in range(2))
    rays = frame.rotation[0, 0][:, None] * x + frame.rotation[0, 1][:, None] * y
    rays = rays + frame.rotation[0, 2][:, None]
    exact = dot(digits(normal), digits(position)) / dot(digits(normal), digits(rays))
    return floats(exact).astype(np.float32).astype(np.float64)


# Host: bases and views.


def _up_rotation(up):
    camera = look_at((0, 0, 0), _TURN[2], up, fov_x_deg=60, width=8, height=8)
    return camera.rotation


def _up_exact(up):
    forward = digits(_TURN[2])
    forward = forward / np.sqrt(dot(forward, forward))
    right = cross(forward, up)
    right = right / np.sqrt(dot(right, right))
    return np.stack([right, cross(forward, right), forward])


def _up_along(severity: float) -> Kernel:
    up = _TURN[2] + _TURN[0] / severity
    return Kernel(
        inputs=(up,),
        value=_up_rotation,
        truth=fifty(_up_exact),
        unit=1.0,
        refusal=lambda: _up_rotation(up),
        host=True,
    )


def _poles(severity: float) -> Kernel:
    """Directions about both poles of the basis."""
    turn = np.linspace(0, 2 * np.pi, 8)
    around = np.stack([np.cos(turn), np.sin(turn), 0 * turn]) / severity
    axes = np.concatenate([around + [[0.0], [0], [1]], around - [[0.0], [0], [1]]], axis=1)
    return Kernel(
        inputs=(axes,),
        value=lambda axes: np.stack([b @ b.T for b in map(basis_from_axis, axes.T)]),
        truth=lambda axes: np.tile(np.eye(3), (16, 1, 1)),
        unit=1.0,
        host=True,
    )


_GG = "clamped cosines, told apart in logarithms, and marked"

CASES = (
    HardCase(
        "light parallel to the receiver, aliasing", (2,), "projections",
        "Texels stretch by 1 / cos psi, without end: 573 at 89.9 degrees.",
        f"{_GG} (docs/theory.md, \"Any light\")",
        "50 digits", "incidence of the light, degrees",
        (60.0, 85.0, 89.0, 89.9, 89.99, 89.999),
        Bound(1e-5, 1e-12, "relative", 1e-4), _light_grazes,
        89.993, f"marked: `grazing` below a cosine of {LEAST_COSINE:g}",
    ),
    HardCase(
        "light and eye both parallel to the receiver", (2, 3), "projections",
        "infinity / infinity: two degenerate factors cancel, or become NaN.",
        f"{_GG} (docs/theory.md, \"Any light\")",
        "50 digits", "incidence of both, degrees",
        (60.0, 85.0, 89.0, 89.9, 89.99, 89.999),
        Bound(1e-5, 1e-12, "relative", 1e-4), _both_graze,
        89.993, f"marked: `grazing` below a cosine of {LEAST_COSINE:g}",
    ),
    HardCase(
        "area of a pixel on a surface seen edge-on", (3,), "projections",
        "n . X cancels: the area of a pixel is the inverse of what is left.",
        "z / (n . X) first, and infinite where n . X is rounding (docs/theory.md, \"Footprints\")",
        "50 digits", "incidence of the eye, degrees",
        (60.0, 89.0, 89.9, 89.99, 89.999, 89.9999),
        Bound(4e-3, 1e-9, "relative"), _eye_grazes,
        89.9995, "marked: the area is infinite",
    ),
    HardCase(
        "points about the light's plane", (5, 6), "projections",
        "z = 0 divides by 0, and z < 0 mirrors points into the map.",
        "masked first, then divided by a safe depth (asmjax.buffers.receivers)",
        "50 digits", "1 / distance from the plane, scene units",
        (1e0, 1e3, 1e6, 1e8, 1e10),
        Bound(1e-6, 1e-14, "widths of the map", 1e-4), _light_plane,
    ),
    HardCase(
        "depth in the map", (18,), "projections",
        "A depth of 0 to 1 in perspective has 6e-3 units left at 100, of near 0.1 and far 1000.",
        "linear axial depth in float32, compared in the same metric "
        "(docs/theory.md, \"The shadow test\")",
        "50 digits", "depth, scene units", (1e-6, 1e-3, 1e0, 1e3, 1e6, 1e9),
        Bound(BIAS / 4, BIAS / 4, "of the depth, along the normal"),
        lambda severity: _plane_at(60.0, severity),
    ),
    HardCase(
        "receiver plane at a texel's centre", (19,), "projections",
        "The pixel's own depth is off by half a texel times tan psi: acne.",
        "the receiver's plane met by the texel's own ray (docs/theory.md, \"The shadow test\")",
        "50 digits", "tilt of the plane to the light's, degrees",
        (0.0, 45.0, 80.0, 89.9, 89.99, 89.999),
        Bound(BIAS / 2, BIAS / 2, "of the depth, along the normal"),
        lambda severity: _plane_at(severity, 10.0),
        89.95, f"marked: `plane_is_trusted`, and `secant` at its most, 1 / {GRAZING:g}",
    ),
    HardCase(
        "up vector along the view", (29,), "projections",
        "The cross product of view and up vanishes: the camera rolls at random.",
        "refused (asmjax.geometry.look_at); lights use a basis that needs no up vector",
        "50 digits", "1 / angle between up and view, radians", (1e0, 1e3, 1e6, 1e8, 1e10),
        Bound(1e-6, 1e-6, "of the axes' length"), _up_along,
        1e9, "refused: UseError below 1e-9 radians",
    ),
    HardCase(
        "light's basis about its poles", (29,), "projections",
        "A basis made with a fixed up vector degenerates where the light is parallel to it.",
        "Duff et al. 2017, branchless (asmjax.geometry.basis)",
        "closed form", "1 / angle from the pole, radians", (1e0, 1e4, 1e8, 1e12, 1e16),
        Bound(1e-14, 1e-14, "of the axes' length"), _poles,
    ),
)  # fmt: skip
"""Of the theme "projections"."""
