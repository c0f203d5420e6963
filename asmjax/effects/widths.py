"""How wide penumbrae are in the eye's image, from what a probe saw.

A light's point l away from its centre moves the shadow edge of a blocker at distance d_b on a
receiver at distance d_r by k l, k = (d_r - d_b) / d_b, along the light's ray onto the receiver's
plane (A2 of docs/theory.md); of a sun l is a tangent and k the gap d_r - d_b. The camera takes
that to pixels. All of the light together moves the edge about an ellipse, that of the light's half
axes: the outline of a disk, and of a rectangle what counts at edges along its sides. A penumbra is
as wide as that ellipse is across its edge.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, LightRays, whole_image
from asmjax.effects.probe import HardLook, Paths
from asmjax.geometry import AreaLight, LightFrame, bases_along
from asmjax.metrics import boundary_edges, boundary_length, surface_pairs
from asmjax.numerics import dot

TEXELS = 64
"""Texels a side of the probe of a light, for each face."""

RAYS = 4
"""Rays along each side of a texel, which holds the nearest of their hits."""

GRAZING = 0.02
"""Receivers that the light grazes at a smaller cosine count as if at this one: any penumbra there
is endless."""

NEAREST = 1e-6
"""Blockers count as no nearer to the light than this part of the receiver's distance."""

Ellipse = tuple[np.ndarray, np.ndarray]
"""Two conjugate half axes (2, n), pixels of the picture, right and down."""


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a hard shadow in a probe.

    Attributes:
        dark, light: (m,), (l,) indices of the pixels on either side.
        across: (2, m) of the dark ones, unit vectors (right, down) across the edge in the image; 0
            where the probe does not tell.
        length: of all edges, pixels of the picture.
    """

    dark: np.ndarray
    light: np.ndarray
    across: np.ndarray
    length: float


def shadow_edges(eye: EyeBuffer, paths: Paths, look: HardLook, scale: float) -> Edges:
    """Where neighbouring pixels of one surface, both facing the light, are lit and dark.

    Args:
        scale: pixels of the picture per pixel of the probe.
    """
    size = eye.size
    facing = paths.facing.reshape(size)
    depth = np.where(eye.valid, eye.depth, 1.0).reshape(size)
    lit = np.where(look.lit, 1.0, 0.0).reshape(size)
    edges = boundary_edges(lit, surface_pairs(facing, depth))
    beside = np.zeros(size, bool)
    beside[:, :-1] |= edges.right
    beside[:, 1:] |= edges.right
    beside[:-1] |= edges.down
    beside[1:] |= edges.down
    dark = np.flatnonzero((beside & (lit == 0)).ravel())
    light = np.flatnonzero((beside & (lit > 0)).ravel())
    return Edges(dark, light, _across(lit, facing)[:, dark], scale * boundary_length(edges))


def _across(lit: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """(2, n) unit vectors (right, down) from dark to light in the smoothed image."""
    # Imported late, as it takes long.
    from scipy.ndimage import gaussian_filter

    weight = gaussian_filter(facing.astype(float), 1.5, mode="nearest")
    smooth = gaussian_filter(np.where(facing, lit, 0.0), 1.5, mode="nearest")
    smooth = smooth / np.maximum(weight, 1e-6)
    slope = np.stack([_slope(smooth, 1).ravel(), _slope(smooth, 0).ravel()])
    steepness = np.linalg.norm(slope, axis=0)
    told = steepness > 1e-3
    return np.where(told, slope / np.where(told, steepness, 1.0), 0.0)


def _slope(image: np.ndarray, axis: int) -> np.ndarray:
    return np.gradient(image, axis=axis) if image.shape[axis] > 1 else np.zeros_like(image)


def on_screen(eye: EyeBuffer, vectors: np.ndarray, scale: float) -> np.ndarray:
    """Pixels (2, n) of the picture, right and down, that world vectors (3, n) at the seen points
    make, to first order."""
    camera = eye.camera
    right, down, forward = camera.rotation @ vectors
    depth = np.where(eye.valid, eye.depth, 1.0)
    x, y, _ = camera.rotation @ (np.where(eye.valid, eye.world, 0.0) - camera.origin[:, None])
    moved = np.stack([right - x / depth * forward, down - y / depth * forward]) / depth
    return scale * camera.focal[:, None] * moved


def light_ellipse(eye: EyeBuffer, area: AreaLight, paths: Paths, scale: float) -> Ellipse:
    """What the light's half axes become in the picture at each pixel, for k = 1."""
    unit = paths.unit
    if area.shape == "sphere":
        radius = float(np.linalg.norm(area.half_u))
        # A sphere shows the same disk to everybody.
        axes = [radius * axis for axis in bases_along(unit)[:2]]
    else:
        axes = [np.broadcast_to(half[:, None], unit.shape) for half in (area.half_u, area.half_v)]
    steep = np.maximum(paths.cosine, GRAZING)
    u, v = (
        on_screen(eye, axis + unit * (np.einsum("in,in->n", eye.normal, axis) / steep), scale)
        for axis in axes
    )
    return u, v


def gap_ratio(area: AreaLight, paths: Paths, stop: np.ndarray) -> np.ndarray:
    """k (n,) of a blocker at `stop`, in parts of the way from the light."""
    if area.shape == "sun":
        return (1 - stop) * paths.distance
    return (1 - stop) / np.maximum(stop, NEAREST)


def width_in_map(frame: LightFrame, area: AreaLight, paths: Paths, k: np.ndarray) -> np.ndarray:
    """Widths (n,) of the same penumbrae in the light's own image, parts of its side, whatever the
    eye sees: of a straight blocker above a plane the same all along its shadow's edge.

    Of a light as wide as it looks from there; square sides where the image has two.
    """
    side = np.asarray(area.effective_width(paths.along))
    if area.shape == "rectangle":
        # Of a square as large as the disk.
        side = side * np.sqrt(np.pi) / 2
    extent = np.sqrt(np.prod(frame.extent, axis=1))
    if not frame.perspective:
        return k * side / extent[0]
    depth = np.einsum("fi,in->fn", frame.rotation[:, 2], paths.along)
    face = depth.argmax(axis=0)
    return k * side / (np.maximum(depth.max(axis=0), frame.near) * extent[face])


def width_across(ellipse: Ellipse, k: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Widths (n,) in pixels of penumbrae across edges, `across` (2, n) as of `Edges`; where that is
    0 the widest of any edge there."""
    u, v = ellipse
    told = np.hypot(np.sum(u * across, axis=0), np.sum(v * across, axis=0))
    return 2 * k * np.where(np.any(across != 0, axis=0), told, widest(ellipse))


def at_edges(ellipse: Ellipse, k: np.ndarray, edges: Edges) -> np.ndarray:
    """Widths (m,) in pixels of the penumbrae at the dark pixels beside `edges`."""
    u, v = ellipse
    some = edges.dark
    return width_across((u[:, some], v[:, some]), k[some], edges.across)


def widest(ellipse: Ellipse) -> np.ndarray:
    """The longest half axis (n,): the larger singular value of the two vectors."""
    u, v = ellipse
    uu, vv, uv = (np.sum(a * b, axis=0) for a, b in ((u, u), (v, v), (u, v)))
    half = 0.5 * (uu + vv)
    return np.sqrt(half + np.hypot(0.5 * (uu - vv), uv))


def umbra_share(
    eye: EyeBuffer, dark: np.ndarray, edges: Edges, ellipse: Ellipse, k: np.ndarray, scale: float
) -> float:
    """Part of the hard shadow's pixels, `dark` (n,) bool, that all of the light leaves dark: those
    farther from any edge than half their penumbra is wide towards it (A2: umbra half side > 0)."""
    from scipy.ndimage import distance_transform_edt

    if not dark.any():
        return 0.0
    if not edges.light.size:
        return 1.0
    lit = np.zeros(eye.valid.size, bool)
    lit[edges.light] = True
    found: Any = distance_transform_edt(~lit.reshape(eye.size), return_indices=True)
    distance, nearest = found
    rows, columns = np.indices(eye.size)
    towards = np.stack([nearest[1] - columns, nearest[0] - rows]).reshape(2, -1).astype(float)
    length = distance.ravel()
    width = width_across(ellipse, k, towards / np.where(length > 0, length, 1.0))
    # The edge itself is half a pixel before the lit one.
    return float(np.mean((scale * (length - 0.5) > 0.5 * width)[dark]))


@dataclass(frozen=True, eq=False)
class Blockers:
    """What a light's probe met: of each texel the hit that is nearest to the light.

    Attributes:
        points: (3, m) world.
        radius: (m,) half the diagonal of the texel there, scene units; 0 where nothing was hit.
        rays: how many were cast.
    """

    points: np.ndarray
    radius: np.ndarray
    rays: int


def find_blockers(frame: LightFrame, rays: LightRays) -> Blockers:
    """`TEXELS` x `TEXELS` minima of depth for each face, of `RAYS` x `RAYS` rays each."""
    side = TEXELS * RAYS
    depth = rays.light_buffer(frame, whole_image(frame, side)).depth.astype(np.float64)
    blocks = depth.reshape(frame.faces, TEXELS, RAYS, TEXELS, RAYS).swapaxes(2, 3)
    blocks = blocks.reshape(frame.faces, TEXELS, TEXELS, RAYS * RAYS)
    nearest, least = blocks.argmin(axis=3), blocks.min(axis=3)
    row, column = (index.ravel() for index in np.indices((TEXELS, TEXELS)))
    points, radii = [], []
    for face in range(frame.faces):
        down, right = divmod(nearest[face].ravel(), RAYS)
        met = np.isfinite(least[face].ravel())
        at = np.where(met, least[face].ravel(), 1.0)
        origin, direction = frame.ray(
            face, (column * RAYS + right + 0.5) / side, (row * RAYS + down + 0.5) / side
        )
        points.append(origin + at * direction)
        half = 0.5 * float(np.linalg.norm(frame.extent[face])) / TEXELS
        radii.append(np.where(met, half * (at if frame.perspective else 1.0), 0.0))
    return Blockers(np.concatenate(points, axis=1), np.concatenate(radii), depth.size)


def widest_gaps(
    eye: EyeBuffer, frame: LightFrame, area: AreaLight, paths: Paths, blockers: Blockers
) -> np.ndarray:
    """The largest k (n,) of any blocker in the cone between a receiver and the light, 0 for none.

    A blocker counts where it stands above the receiver's tangent plane, before it, on the side to
    which the light emits, and so near to the ray from the centre that a ray from some point of the
    light may meet its texel.
    """
    start = frame.origin[:, None]
    facing = paths.facing
    receiver = np.where(facing, eye.world - start, 1.0)
    before = np.asarray(area.emits_towards(blockers.points))
    found = _largest_gap(
        *(
            jnp.asarray(array, jnp.float32)
            for array in (
                receiver,
                np.where(facing, eye.normal, 0.0),
                np.where(facing, paths.distance, 1.0),
                np.where(facing, paths.unit, 0.0),
                np.where(facing, paths.margin, 1.0),
                blockers.points - start,
                np.where(before, blockers.radius, 0.0),
                area.radius,
            )
        ),
        frame.perspective,
    )
    return np.where(facing, np.asarray(found, np.float64), 0.0)


@partial(jax.jit, static_argnums=8)
def _largest_gap(
    receiver: Float[Array, "3 n"],
    normal: Float[Array, "3 n"],
    distance: Float[Array, " n"],
    unit: Float[Array, "3 n"],
    clear: Float[Array, " n"],
    blocker: Float[Array, "3 m"],
    radius: Float[Array, " m"],
    light_radius: Float[Array, ""],
    perspective: bool,
) -> Float[Array, " n"]:
    """Every receiver against every blocker, places relative to the light; one loop and no array of
    pairs after compilation. Blockers of radius 0 are none, nor are those that stand no higher above
    the receiver's plane than `clear`."""
    receiver, normal, unit = receiver[:, :, None], normal[:, :, None], unit[:, :, None]
    blocker, reach = blocker[:, None, :], distance[:, None]
    along = dot(unit, blocker)
    gap, away = reach - along, blocker - receiver
    if perspective:
        # The difference of two squares would be off by D^2 1e-7, more than a texel of a far lamp.
        off = blocker - along * unit
        apart = dot(off, off)
        limit = light_radius * gap / reach + radius
        k = gap / jnp.maximum(along, NEAREST * reach)
    else:
        # Across parallel rays only the difference of the two places counts.
        apart = dot(away, away) - dot(unit, away) ** 2
        limit = light_radius * gap + radius
        k = gap
    above = dot(normal, away) > clear[:, None]
    counts = above & (gap > 0) & (along > 0) & (radius > 0) & (apart <= jnp.maximum(limit, 0) ** 2)
    return jnp.where(counts, k, 0).max(axis=1, initial=0)
