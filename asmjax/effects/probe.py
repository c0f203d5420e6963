"""What a few thousand rays tell of a light: what it shines on, what it shades, and what stands
between.

The probe is an image of the view with about 64 x 64 pixels. From a light one ray goes to each of
them that faces it, and ends at the first surface: that is the hard shadow, and of what is in it the
caster that is nearest to the light, whose penumbra is the widest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.geometry import AreaLight, LightFrame, bases_along, concentric, in_domain, stratified
from asmjax.scene.materials import Materials, Surroundings
from asmjax.scene.spec import LightSpec

PIXELS = 4096
"""Of the probe: 64 x 64 of a square view."""

NEARLY = 1e-4
"""A ray that ends so near before its receiver ends there, in parts of its length or of the extent
of what is seen, whichever is less: nothing in the scene is near, measured by a lamp's distance."""

ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""What a renderer's float32 may put a hit off by, in parts of the ray's length."""

MOST_LAYERS = 16
"""Surfaces that a ray through transmissive ones passes; it is dark behind more."""

SKY_STRATA = 4
"""So many squared rays go to the surroundings from each pixel of the probe."""


def probe_size(width: int, height: int) -> tuple[int, int]:
    """Width and height in pixels of the probe of an image: `PIXELS` in all, of the image's shape,
    and no more than the image has."""
    side = math.sqrt(PIXELS)
    shape = math.sqrt(width / height)
    return (
        max(1, min(width, round(side * shape))),
        max(1, min(height, round(side / shape))),
    )


@dataclass(frozen=True, eq=False)
class Paths:
    """The ways from a light to the pixels (n,) of a probe.

    Attributes:
        origin: (3, n) where they begin, world: at the light, or in front of all casters.
        along: (3, n) from there to the receiver, scene units; 0 where nothing is seen.
        distance: (n,) its length.
        margin: (n,) what stands no farther before the receiver than this is the receiver itself,
            scene units.
        facing: (n,) bool, whether the light's centre shines on the seen side.
        reached: (n,) bool, whether any part of it does, as soft truth has it.
        straddled: (n,) bool, whether a part of it does and a part is behind the receiver's plane.
        cosine: (n,) between the normal and the way back; at most 0 where not facing.
    """

    origin: np.ndarray
    along: np.ndarray
    distance: np.ndarray
    margin: np.ndarray
    facing: np.ndarray
    reached: np.ndarray
    straddled: np.ndarray
    cosine: np.ndarray

    @property
    def unit(self) -> np.ndarray:
        """(3, n) directions of the light at the receivers."""
        return self.along / np.where(self.distance > 0, self.distance, 1.0)

    @property
    def nearly(self) -> np.ndarray:
        """(n,) the margin in parts of the way."""
        return self.margin / np.where(self.distance > 0, self.distance, 1.0)


def light_paths(eye: EyeBuffer, frame: LightFrame) -> Paths:
    """The ways from the light of `frame` to all pixels."""
    world = np.where(eye.valid, eye.world, 0.0)
    if frame.perspective:
        origin = np.broadcast_to(frame.origin[:, None], world.shape)
        along = world - origin
    else:
        axis = frame.rotation[0, 2]
        along = axis[:, None] * (axis @ (world - frame.origin[:, None]))
        origin = world - along
    along = np.where(eye.valid, along, 0.0)
    distance = np.linalg.norm(along, axis=0)
    extent = np.linalg.norm(np.ptp(world[:, eye.valid], axis=1)) if eye.valid.any() else 0.0
    margin = NEARLY * np.minimum(distance, extent) + ROUNDING * distance
    way = origin, along, distance, margin
    cosine = -np.einsum("in,in->n", eye.normal, along) / np.where(distance > 0, distance, 1.0)
    shone_on = eye.valid & in_domain(frame, world)
    if frame.area is not None and frame.perspective:
        shone_on &= np.asarray(frame.area.emits_towards(world))
    facing = shone_on & (cosine > 0)
    if frame.area is None:
        return Paths(*way, facing, facing, np.zeros_like(facing), cosine)
    # Of a sun the light's place is a unit direction.
    height = cosine * (distance if frame.perspective else 1.0)
    across = frame.area.extent_along(eye.normal)
    reached = shone_on & (height + across > 0)
    return Paths(*way, facing, reached, reached & (height < across), cosine)


def irradiance(
    light: LightSpec, frame: LightFrame, paths: Paths, stand_in: AreaLight | None = None
) -> np.ndarray:
    """What the light brings to each pixel (n,) where nothing shades it, as luminance; with the area
    of `stand_in` where it is a point for something else.

    Of a flat light and a sphere the solid angle is A cos / d^2 (section 12.2 of the reference:
    exact far away).
    """
    cosine = np.where(paths.facing, paths.cosine, 0.0)
    if light.kind == "directional":
        return light.intensity * cosine
    squared = np.where(paths.facing, paths.distance, 1.0) ** 2
    return light.intensity * cosine * seen_area(stand_in or frame.area, frame, paths) / squared


def seen_area(area: AreaLight | None, frame: LightFrame, paths: Paths) -> np.ndarray:
    """Area (n,) of the light as each receiver sees it, scene units squared; 1 of a point."""
    if area is None or not frame.perspective:
        return np.ones_like(paths.distance)
    return np.pi / 4 * np.asarray(area.effective_width(paths.along)) ** 2


def solid_angle(frame: LightFrame, paths: Paths) -> float:
    """Median over what the light shines on, steradians, at most a hemisphere's; 0 of a point."""
    if frame.area is None or not paths.facing.any():
        return 0.0
    if not frame.perspective:
        return float(frame.area.area)
    facing = paths.facing
    angles = seen_area(frame.area, frame, paths)[facing] / paths.distance[facing] ** 2
    return float(min(np.median(angles), 2 * np.pi))


@dataclass(frozen=True, eq=False)
class HardLook:
    """The hard shadow in a probe.

    Attributes:
        lit: (n,) bool, of the pixels that face the light.
        stop: (n,) where the ray ended, in parts of its way: 1 where it arrived.
        prim: (n,) primitive that stopped it, -1 for none.
        rays: how many were cast.
    """

    lit: np.ndarray
    stop: np.ndarray
    prim: np.ndarray
    rays: int


def hard_look(paths: Paths, rays: LightRays) -> HardLook:
    """One ray from the light to each pixel that faces it."""
    count = paths.facing.size
    stop, prim = np.ones(count), np.full(count, -1, np.int64)
    chosen = np.flatnonzero(paths.facing)
    t, hit = rays.closest(paths.origin[:, chosen], paths.along[:, chosen])
    blocked = np.asarray(t) < 1 - paths.nearly[chosen]
    stop[chosen[blocked]] = np.asarray(t)[blocked]
    prim[chosen[blocked]] = np.asarray(hit)[blocked]
    return HardLook(paths.facing & (prim < 0), stop, prim, int(chosen.size))


@dataclass(frozen=True, eq=False)
class Transmission:
    """What passes through the casters of a hard shadow.

    Attributes:
        part: (n,) of the light that arrives without a turn; 0 where the pixel is not in shadow.
        refracted: (n,) bool, whether a refractive surface stopped it.
        rays: how many were cast.
    """

    part: np.ndarray
    refracted: np.ndarray
    rays: int


def transmission(
    paths: Paths, look: HardLook, rays: LightRays, materials: Materials, first_prim: np.ndarray
) -> Transmission:
    """Follow the ways in the hard shadow through all that lets light pass, up to `MOST_LAYERS`.

    The product of what each surface passes, and exp(-extinction x length) inside of media; a second
    boundary of a medium ends it.

    Args:
        first_prim: (n_shapes + 1,) first primitive of each shape, and their number.
    """
    count = paths.facing.size
    part, refracted = np.zeros(count), np.zeros(count, bool)
    # The first surface is known already.
    active = np.flatnonzero(paths.facing & ~look.lit)
    at, prim = look.stop[active], look.prim[active]
    passed, dense, cast = np.ones(active.size), np.zeros(active.size), 0
    entered = np.zeros(active.size)
    for _ in range(MOST_LAYERS):
        shape = np.searchsorted(first_prim, prim, side="right") - 1
        through = dense * (at - entered) * paths.distance[active]
        passed = passed * np.exp(-through) * materials.straight[shape]
        inside = materials.extinction[shape]
        dense = np.where(inside > 0, np.where(dense > 0, 0.0, inside), dense)
        entered = at
        refracted[active[materials.refracts[shape]]] = True
        on = passed > 0
        active, at, passed = active[on], at[on], passed[on]
        dense, entered = dense[on], entered[on]
        if not active.size:
            break
        start = at + NEARLY * (1 - at)
        t, prim = rays.closest(
            paths.origin[:, active] + start * paths.along[:, active], paths.along[:, active]
        )
        cast += int(active.size)
        at, prim = start + np.asarray(t), np.asarray(prim)
        arrived = at >= 1 - paths.nearly[active]
        rest = np.exp(-dense * (1 - entered) * paths.distance[active])
        part[active[arrived]] = (passed * rest)[arrived]
        on = ~arrived
        active, at, prim = active[on], at[on], prim[on]
        passed, dense, entered = passed[on], dense[on], entered[on]
    return Transmission(part, refracted, cast)


def sky_visibility(
    eye: EyeBuffer, rays: LightRays, surroundings: Sequence[Surroundings], seed: int = 0
) -> tuple[np.ndarray, int]:
    """Part (n,) of what the surroundings bring that reaches each pixel, from `SKY_STRATA`^2 rays
    each, and how many were cast; 0 where nothing is seen, 1 where they bring nothing."""
    pixels = np.flatnonzero(eye.valid)
    start = np.random.default_rng(seed).random((2, 1))
    disk = concentric((stratified(SKY_STRATA) + start) % 1.0)
    normal = eye.normal[:, pixels]
    tangent, bitangent, _ = bases_along(normal)
    away = NEARLY * eye.depth[pixels]
    origins = eye.world[:, pixels] + away * normal
    seen, brought = np.zeros(pixels.size), np.zeros(pixels.size)
    for a, b in disk.T.tolist():
        # Malley's method: even on the disk is cosine-weighted on the hemisphere.
        up = math.sqrt(max(1 - a * a - b * b, 0.0))
        directions = a * tangent + b * bitangent + up * normal
        bright = np.sum([item.towards(directions) for item in surroundings], axis=0)
        seen += bright * ~np.asarray(rays.occluded(origins, directions, np.inf))
        brought += bright
    result = np.zeros(eye.valid.size)
    result[pixels] = np.where(brought > 0, seen / np.where(brought > 0, brought, 1.0), 1.0)
    return result, SKY_STRATA**2 * int(pixels.size)
