"""From a light and a view to the light frame that serves them."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import numpy as np

from asmjax.buffers import BLUR, EyeBuffer
from asmjax.errors import UseError, require
from asmjax.geometry import (
    AreaLight,
    LightFrame,
    basis_from_axis,
    disk_light,
    fitted_directional_frame,
    fitted_point_frame,
    fixed_frame,
    in_domain,
    rectangle_light,
    sphere_light,
)
from asmjax.scene.spec import Disk, LightSpec, Rectangle, Sphere

NEAR_FRACTION = 1e-6
"""Receivers nearer to a light than this fraction of the scene's diagonal are not lit by it."""

FARTHEST = 1e5
"""Lamps farther away than so many diagonals of the scene are refused: the last digit of a float32
depth from there is a hundredth of the scene, and the bias half of it."""

KEPT_MARGIN = 0.25
"""A frame that is to be kept grows by this fraction, so that the next views fit into it too."""


Eyes = EyeBuffer | Sequence[EyeBuffer]
"""What a frame is fitted to: one image, or the samples of each pixel."""


def light_frame(light: LightSpec, eye: Eyes, bounds: np.ndarray) -> LightFrame:
    """The frame of `light`: its fixed field of view, or fitted to the receivers the eye sees; of a
    light with a size also to those that only a part of it shines on.

    Args:
        eye: all samples of the pixels where there are several: what lies outside the frame is dark.
        bounds: (3, 2) float64, the scene's box, min and max per axis.

    Raises:
        UseError: no visible surface faces the light.
    """
    if _is_fixed(light):
        assert light.fov_deg is not None
        near = _near(bounds)
        return _with_area(
            fixed_frame(light.position, light.direction, light.fov_deg, near, light.cutoff_deg),
            light,
        )
    return _with_area(_fitted(light, _receivers(light, eye), bounds, _blur(eye)), light)


def kept_light_frame(
    previous: LightFrame | None, light: LightSpec, eye: Eyes, bounds: np.ndarray
) -> LightFrame:
    """`previous` if it still serves: what a map keeps that outlives one view.

    A frame with a fixed field of view changes with its light only. A fitted one is taken along by
    a light that moves, and is replaced where it does not hold all receivers that face the light:
    by one that holds them and all that it held before, grown by `KEPT_MARGIN`.

    Raises:
        UseError: as `light_frame`.
    """
    if _is_fixed(light):
        return light_frame(light, eye, bounds)
    return _with_area(_kept(previous, light, eye, bounds), light)


def _kept(
    previous: LightFrame | None, light: LightSpec, eye: Eyes, bounds: np.ndarray
) -> LightFrame:
    """As `kept_light_frame`, of any area, for a light without a fixed field of view."""
    receivers, blur = _receivers(light, eye), _blur(eye)
    if previous is None:
        return _grown(_fitted(light, receivers, bounds, blur))
    followed = _followed(previous, light, receivers, bounds, blur)
    if _holds(followed, light, receivers, bounds):
        return followed
    held = np.concatenate([receivers, _outline(followed, bounds)], axis=1)
    return _grown(_fitted(light, held, bounds, blur))


def _with_area(frame: LightFrame, light: LightSpec) -> LightFrame:
    """The frame with the area of the light, and itself where it has it already. Of a flat light the
    cone is all that lies before it."""
    if (frame.area is None) == (light.area is None) and eqx.tree_equal(frame.area, light.area):
        return frame
    if light.area is not None and light.area.is_flat:
        return replace(frame, area=light.area, cone_axis=light.area.normal, cos_cutoff=0.0)
    if frame.area is not None and frame.area.is_flat:
        frame = replace(frame, cos_cutoff=-1.0)
    return replace(frame, area=light.area)


def area_of(shape: Rectangle | Disk | Sphere) -> AreaLight:
    """The light that a shape of a scene would be, if it emitted: a rectangle along half_u x half_v,
    a disk along its normal, a sphere on all sides."""
    if isinstance(shape, Rectangle):
        return rectangle_light(shape.centre, shape.half_u, shape.half_v)
    if isinstance(shape, Disk):
        e_u, e_v, _ = basis_from_axis(shape.normal)
        return disk_light(shape.centre, shape.radius * e_u, shape.radius * e_v)
    return sphere_light(shape.centre, shape.radius)


def _is_fixed(light: LightSpec) -> bool:
    return light.kind != "directional" and light.fov_deg is not None


def _diagonal(bounds: np.ndarray) -> float:
    return float(np.linalg.norm(bounds[:, 1] - bounds[:, 0]))


def _near(bounds: np.ndarray) -> np.float64:
    return np.float64(NEAR_FRACTION * _diagonal(bounds))


def _receivers(light: LightSpec, eye: Eyes) -> np.ndarray:
    """World points (3, n) that the eye sees and that face the light; `UseError` without any."""
    eyes = [eye] if isinstance(eye, EyeBuffer) else eye
    receivers = np.concatenate([_lit_side(light, one) for one in eyes], axis=1)
    if receivers.shape[1] == 0:
        raise UseError(
            f"light '{light.name}' shines on no surface that this view sees; choose another "
            "`light` or `view`."
        )
    return receivers


def _blur(eye: Eyes) -> float:
    """What the receivers' positions may be off by, scene units."""
    eyes = [eye] if isinstance(eye, EyeBuffer) else eye
    return BLUR * max(float(one.depth[one.valid].max(initial=0.0)) for one in eyes)


def _lit_side(light: LightSpec, eye: EyeBuffer) -> np.ndarray:
    if light.kind == "directional":
        to_light = -np.asarray(light.direction, np.float64)[:, None]
    else:
        to_light = np.asarray(light.position, np.float64)[:, None] - eye.world
    height = np.einsum("in,in->n", eye.normal, to_light + 0 * eye.normal)
    if light.area is not None:
        # A sun is as large as its direction is long.
        size = float(np.linalg.norm(to_light)) if light.kind == "directional" else 1.0
        height = height + size * light.area.extent_along(eye.normal)
        height = np.where(light.area.emits_towards(eye.world), height, 0.0)
    return eye.world[:, eye.valid & (height > 0)]


def _fitted(light: LightSpec, receivers: np.ndarray, bounds: np.ndarray, blur: float) -> LightFrame:
    if light.kind == "directional":
        return fitted_directional_frame(light.direction, receivers, bounds, blur=blur)
    away = np.linalg.norm(np.asarray(light.position, np.float64) - bounds.mean(axis=1))
    require(
        bool(away <= FARTHEST * _diagonal(bounds)),
        f"light '{light.name}' is {away / _diagonal(bounds):.3g} times the scene's diagonal away; "
        f"allowed: {FARTHEST:g} times, as depths from there are float32: make it directional.",
    )
    return fitted_point_frame(
        light.position,
        receivers,
        _near(bounds),
        axis=light.direction,
        cutoff_deg=light.cutoff_deg,
        blur=blur,
    )


def _followed(
    previous: LightFrame,
    light: LightSpec,
    receivers: np.ndarray,
    bounds: np.ndarray,
    blur: float,
) -> LightFrame:
    """`previous` itself while the light rests, else its rectangles at the light's new place."""
    if light.kind == "directional":
        now = _fitted(light, receivers, bounds, blur)
        if np.array_equal(now.rotation, previous.rotation):
            return previous
        return replace(now, corner=previous.corner, extent=previous.extent)
    now = _fitted(light, receivers, bounds, blur)
    if light.kind == "spot" and not (
        np.array_equal(now.cone_axis, previous.cone_axis) and now.cos_cutoff == previous.cos_cutoff
    ):
        # Its faces turn with it: nothing of the old ones is in its place.
        return _grown(now)
    return replace(previous, origin=np.asarray(light.position, np.float64))


def _holds(frame: LightFrame, light: LightSpec, receivers: np.ndarray, bounds: np.ndarray) -> bool:
    """Whether every receiver that the light can reach lies in the frame, and casters before it."""
    relative = receivers - frame.origin[:, None]
    reached = np.linalg.norm(relative, axis=0) > frame.near
    if light.kind == "spot":
        reached &= frame.cone_axis @ relative > frame.cos_cutoff * np.linalg.norm(relative, axis=0)
    rectangle = replace(frame, cos_cutoff=-1.0)
    if not in_domain(rectangle, receivers[:, reached]).all():
        return False
    if frame.perspective:
        return True
    # Depth counts from a plane that all casters must lie behind, objects that moved among them.
    corners = np.stack(np.meshgrid(*bounds), axis=0).reshape(3, -1)
    return bool((frame.rotation[0, 2] @ (corners - frame.origin[:, None])).min() > 0)


def _outline(frame: LightFrame, bounds: np.ndarray) -> np.ndarray:
    """World points (3, n) at the corners of the frame's rectangles."""
    u, v = np.array([0.0, 1.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0, 1.0])
    far = _diagonal(bounds) if frame.perspective else 0.0
    points = []
    for face in range(frame.faces):
        origin, direction = frame.ray(face, u, v)
        points.append(origin + far * direction)
    return np.concatenate(points, axis=1)


def _grown(frame: LightFrame) -> LightFrame:
    corner = frame.corner - 0.5 * KEPT_MARGIN * frame.extent
    far = corner + (1 + KEPT_MARGIN) * frame.extent
    if frame.faces > 1:
        # Faces of a cube meet at 1; a fitted one keeps a margin of its own there.
        least = np.minimum(frame.corner, -1.0)
        most = np.maximum(frame.corner + frame.extent, 1.0)
        corner, far = np.maximum(corner, least), np.minimum(far, most)
    return replace(frame, corner=corner, extent=far - corner)
