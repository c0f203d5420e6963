"""Kernels of points that an eye and a light see: projection, footprints, beams, places in maps.

The twins follow a ray: pixel, plane, light image, in mpmath; the Jacobian by central differences
in 50 digits, which share nothing with the closed form.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import mpmath
import numpy as np

from asmjax.buffers import SurfacePoints, anchor, light_offset, project
from asmjax.footprint import (
    log2_mipmap_ratio,
    log2_perspective_error,
    surface_tangents,
    uv_jacobian,
)
from asmjax.geometry import Chart, LightFrame, laid_out
from asmjax.shadow.adaptive.address import address_of, centre_offset, index_at
from asmjax.shadow.comparison import plane_depth
from asmjax.shadow.warped.table import chart_of, place_in, table_of
from helpers.gradients import unit_or_zero
from helpers.kernels import Arrays, Kernel, Part, powers
from helpers.poses import KINDS, Kind, Pose, random_pose

BESIDE = 2.0**-7
"""Image offset at which receiver planes are asked for their depth; one number in every precision.
"""

MARGIN = 1e-4
"""Points nearer to the border of a face than this part of it are left out: on which side of it
they lie is for rounding to decide."""

STRETCH = 4.0
"""Anisotropy that mip-maps filter: both axes of a footprint matter then."""

LEVEL = 12
"""log2 of the resolution at which addresses are asked for offsets."""

_POOL = 24_000


@functools.cache
def pose_of(kind: Kind) -> Pose:
    """Many points under cosines of 0.3 and more, within one frame. Two faces of a cube stand for
    all: each more only costs compilation."""
    pose = random_pose(0, kind, _POOL, least_cosine=0.3)
    frame = pose.frame
    if frame.faces > 1:
        frame = eqx.tree_at(
            lambda f: (f.rotation, f.corner, f.extent), frame, replace_fn=lambda a: a[2:4]
        )
    keep = np.ones(pose.columns.size, bool)
    inside = np.zeros(pose.columns.size, bool)
    for face in range(frame.faces):
        x, y, z = frame.rotation[face] @ (pose.world - frame.origin[:, None])
        plane = np.stack([x, y]) / (np.where(z > 0, z, np.inf) if frame.perspective else 1.0)
        uv = (plane - frame.corner[face][:, None]) / frame.extent[face][:, None]
        ahead = z > frame.near
        keep &= ~ahead | (np.abs(np.stack([uv, uv - 1])).min(axis=(0, 1)) > MARGIN)
        inside |= ahead & ((uv > 0) & (uv < 1)).all(axis=0)
    keep &= inside
    return Pose(
        pose.camera, frame, pose.world[:, keep], pose.normal[:, keep],
        pose.columns[keep], pose.rows[keep],
    )  # fmt: skip


@functools.cache
def flat_frame() -> LightFrame:
    """A frame without extent, and with a near plane of 0."""
    frame = pose_of("point").frame
    return eqx.tree_at(lambda f: (f.extent, f.near), frame, (np.zeros((1, 2)), np.float64(0)))


def points_of(kind: Kind, position, normal) -> SurfacePoints:
    """Points relative to the eye; the last of them is not valid."""
    n = position.shape[1]
    return SurfacePoints(
        position=position,
        normal=normal,
        prim=jnp.arange(n, dtype=jnp.int32),
        valid=jnp.arange(n) != n - 1,
        origin=pose_of(kind).camera.origin,
    )


def receivers_of(points: SurfacePoints, frame: LightFrame):
    return project(points, frame, light_offset(points, frame))


def _sane(kind: Kind, rng, n) -> Arrays:
    """Points and normals of the pool; more than it holds come several times."""
    pose = pose_of(kind)
    chosen = rng.permutation(np.resize(np.arange(pose.columns.size), n))
    position = pose.world[:, chosen] - pose.camera.origin[:, None]
    return position, pose.normal[:, chosen]


def _near(kind: Kind, rng, n) -> Arrays:
    """Edge-on to eye or light within 1e-20 to 1, nearly at them, or behind them."""
    pose = pose_of(kind)
    position, normal = _sane(kind, rng, n)
    eye, light = position, position + (pose.camera.origin - pose.frame.origin)[:, None]
    ray = np.where(rng.random(n) < 0.5, eye, light)
    ray = ray / np.linalg.norm(ray, axis=0)
    tilt = np.where(rng.random(n) < 0.7, 10.0 ** rng.uniform(-20, 0, n), 1e6)
    normal = normal - ray * (ray * normal).sum(axis=0) * (1 - np.minimum(tilt, 1))
    pull = np.where(rng.random(n) < 0.5, 1.0, 10.0 ** rng.uniform(-45, 5, n))
    pull = pull * rng.choice([1.0, 1.0, -1.0], n)
    from_light = pull * light - (light - eye)
    position = np.where(rng.random(n) < 0.5, pull * eye, from_light)
    return position, normal


def _unit_normals(position, normal, *rest) -> Arrays:
    return position, unit_or_zero(normal), *rest


def _ones(*arguments: np.ndarray) -> Arrays:
    return tuple(np.ones_like(a) for a in arguments)


# Twins of one point in mpmath.


class _Twin:
    """A pose with numbers of 50 digits."""

    def __init__(self, kind: Kind):
        pose = pose_of(kind)
        self.camera, self.frame = pose.camera, pose.frame
        eye, light = _exact(pose.camera.origin), _exact(pose.frame.origin)
        self.to_light = [a - b for a, b in zip(eye, light, strict=True)]
        self.axes = _exact(pose.camera.rotation)
        self.focal = _exact(pose.camera.focal)
        self.near = mpmath.mpf(float(pose.frame.near))

    def face_of(self, position):
        """Rotation, corner and extent of the first face that holds a point."""
        world = _add(position, self.to_light)
        for face in range(self.frame.faces):
            tables = (self.frame.rotation, self.frame.corner, self.frame.extent)
            rotation, corner, extent = (_exact(table[face]) for table in tables)
            x, y, z = (_dot(axis, world) for axis in rotation)
            scale = z if self.frame.perspective else 1
            if z > self.near and all(
                0 <= (a / scale - c) / e < 1 for a, c, e in zip((x, y), corner, extent, strict=True)
            ):
                return rotation, corner, extent
        raise AssertionError("the pool's points lie in a face")

    def image(self, position, face) -> list:
        """u, v and depth."""
        rotation, corner, extent = face
        x, y, z = (_dot(axis, _add(position, self.to_light)) for axis in rotation)
        scale = z if self.frame.perspective else 1
        return [*((a / scale - c) / e for a, c, e in zip((x, y), corner, extent, strict=True)), z]

    def seen(self, position, normal, step) -> list:
        """The point of the tangent plane that a pixel `step` away sees."""
        right, down, forward = self.axes
        depth = _dot(forward, position)
        x = _dot(right, position) / depth + step[0] / self.focal[0]
        y = _dot(down, position) / depth + step[1] / self.focal[1]
        ray = [right[k] * x + down[k] * y + forward[k] for k in range(3)]
        t = _dot(normal, position) / _dot(normal, ray)
        return [t * r for r in ray]

    def motion(self, of, position, normal) -> list:
        """Rows d of / d(pixel right, pixel down), by central differences: exact to 1e-28."""
        h = mpmath.mpf(10) ** -14
        columns = []
        for step in ((h, 0), (0, h)):
            ahead, behind = (
                of(self.seen(position, normal, [sign * s for s in step])) for sign in (1, -1)
            )
            columns.append([(a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True)])
        return columns

    def jacobian(self, position, normal) -> list:
        """[u, v][right, down]"""
        face = self.face_of(position)
        right, down = self.motion(lambda p: self.image(p, face)[:2], position, normal)
        return [[right[0], down[0]], [right[1], down[1]]]

    def tangents(self, position, normal) -> list:
        return self.motion(lambda p: p, position, normal)


def _exact(a) -> Any:
    return [_exact(x) for x in a] if np.ndim(a) else mpmath.mpf(float(a))


def _add(a, b):
    return [x + y for x, y in zip(a, b, strict=True)]


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def _norm(a) -> Any:
    return mpmath.sqrt(_dot(a, a))


def _log2(x):
    return mpmath.log(x) / mpmath.log(2)


twin_of = functools.cache(_Twin)


def _projection_digits(kind: Kind, position, normal) -> list:
    twin = twin_of(kind)
    rotation, corner, extent = face = twin.face_of(position)
    u, v, depth = twin.image(position, face)
    n = [_dot(axis, normal) for axis in rotation]
    reach = max(extent)
    if twin.frame.perspective:
        x, y = (c + a * e for a, c, e in zip((u, v), corner, extent, strict=True))
        ray, reach = [x, y, 1], reach * depth
    else:
        ray = [0, 0, 1]
    along = _dot(n, ray)
    sign = 1 if twin.frame.perspective else -1
    slope = [sign * n[k] * extent[k] / along for k in range(2)]
    moved = BESIDE * (slope[0] + slope[1])
    plane = depth / (1 + moved) if twin.frame.perspective else depth + moved
    return [u, v, depth, *slope, _norm(ray) / abs(along), reach, plane]


def _mipmap_digits(kind: Kind, position, normal) -> list:
    """`log2_mipmap_ratio` with a resolution and a tile of 1."""
    twin = twin_of(kind)
    (a, b), (c, d) = twin.jacobian(position, normal)
    right, down = twin.tangents(position, normal)
    det = a * d - b * c
    texel = [
        _norm([(p * x - q * y) / det for x, y in zip(right, down, strict=True)])
        for p, q in ((d, c), (b, a))
    ]
    values = []
    for lengths in ([_norm(right), _norm(down)], texel):
        longest, shortest = max(lengths), min(lengths)
        level = -_log2(max(shortest, longest / STRETCH))
        below = mpmath.floor(level)
        values.append(below + _log2(1 + level - below))
    return [values[0] - values[1]]


def _beam_digits(kind: Kind, position, normal, density) -> list:
    """Widths across the rays of two steps each: singular values by trace and determinant."""
    twin = twin_of(kind)
    rotation, corner, extent = face = twin.face_of(position)
    u, v, depth = twin.image(position, face)

    def widths(steps, ray):
        length = _norm(ray)
        ray = [x / length for x in ray]
        one, other = ([x - _dot(s, ray) * r for x, r in zip(s, ray, strict=True)] for s in steps)
        trace = _dot(one, one) + _dot(other, other)
        det = _dot(one, one) * _dot(other, other) - _dot(one, other) ** 2
        root = mpmath.sqrt(trace**2 - 4 * det)
        return mpmath.sqrt((trace + root) / 2), mpmath.sqrt(2 * det / (trace + root))

    eye = [_dot(axis, position) for axis in twin.axes]
    pixel = [[eye[2] / twin.focal[0], 0, 0], [0, eye[2] / twin.focal[1], 0]]
    (a, b), (c, d) = density
    det = a * d - b * c
    scale, ray = 1, [0, 0, 1]
    if twin.frame.perspective:
        scale = depth
        ray = [corner[0] + u * extent[0], corner[1] + v * extent[1], 1]
    texel = [
        [scale * extent[0] * p / det, scale * extent[1] * q / det, 0] for p, q in ((d, -c), (-b, a))
    ]
    return [_log2(widths(texel, ray)[0] / widths(pixel, eye)[1])]


# The kernels.


def _projection(kind: Kind, frame: LightFrame, position, normal):
    """Image coordinates, depth, slope, secant, reach, and the receiver's plane beside it."""
    receivers = receivers_of(points_of(kind, position, normal), frame)
    beside = jnp.full((2, position.shape[1]), BESIDE, position.dtype)
    return jnp.stack([
        *receivers.uv, receivers.depth, *receivers.slope, receivers.secant, receivers.reach,
        plane_depth(receivers, beside, frame.perspective),
    ])  # fmt: skip


def _footprint(kind: Kind, position, normal, density):
    """All that is made of receivers: `_projection`, the Jacobian, and log2 of the ratios of texel
    and pixel as beams and as a mip-map tell them. One kernel, as it is compiled as one."""
    pose, points = pose_of(kind), points_of(kind, position, normal)
    frame, camera = pose.frame, pose.camera
    receivers = receivers_of(points, frame)
    return jnp.stack([
        *_projection(kind, frame, position, normal),
        *uv_jacobian(points, camera, frame, receivers).reshape(4, -1),
        log2_perspective_error(points, camera, frame, receivers, density),
        log2_mipmap_ratio(points, camera, frame, receivers, max_anisotropy=STRETCH),
    ])  # fmt: skip


def _footprint_digits(kind: Kind, position, normal, density) -> list:
    twin = twin_of(kind)
    (a, b), (c, d) = twin.jacobian(position, normal)
    return [
        *_projection_digits(kind, position, normal),
        *(a, b, c, d),
        *_beam_digits(kind, position, normal, density),
        *_mipmap_digits(kind, position, normal),
    ]


def _tangents(kind: Kind, position, normal):
    return surface_tangents(points_of(kind, position, normal), pose_of(kind).camera)


def _address(kind: Kind, position, normal):
    """Image coordinates, as whole steps and what is left; the offset to a texel's centre."""
    pose, points = pose_of(kind), points_of(kind, position, normal)
    receivers = receivers_of(points, pose.frame)
    at = address_of(points, anchor(points, pose.frame), receivers, pose.frame.perspective)
    rest = [at.rest_x, at.rest_y]
    whole = [(a.astype(r.dtype) + r) * 2.0**-30 for a, r in zip((at.x, at.y), rest, strict=True)]
    index = index_at(at.x, LEVEL), index_at(at.y, LEVEL)
    return jnp.stack([*whole, *(2.0**LEVEL * centre_offset(at, index, LEVEL))])


@functools.cache
def _charts():
    turn = np.eye(3) + 0.3 * np.random.default_rng(1).uniform(-1, 1, (3, 3))
    first = Chart(0, turn / turn[2, 2], 5.0, lines=((1.0, 0.0, -0.5),))
    return table_of(laid_out([first, Chart(0, np.eye(3))], 400))


def _places(kind: Kind, position, normal):
    """Offsets to the texel's centre, in parts of the image, and the image's motion per texel."""
    pose, points = pose_of(kind), points_of(kind, position, normal)
    receivers = receivers_of(points, pose.frame)
    chart, _ = chart_of(_charts(), receivers, receivers.depth)
    where = anchor(points, pose.frame)
    place = place_in(_charts(), chart, points, receivers, where, pose.frame.perspective)
    return jnp.concatenate([place.offset, place.per_texel.reshape(4, -1)])


def _with_density(kind: Kind, draw) -> Callable[..., Arrays]:
    def drawn(rng, n) -> Arrays:
        position, normal = draw(kind, rng, n)
        density = rng.normal(size=(2, 2, n))
        # Not flat, so that its determinant has all its digits.
        density[0, 0], density[1, 1] = 3 + np.abs(density[0, 0]), -3 - np.abs(density[1, 1])
        return position, normal, density * powers(rng, n, 1e1, 1e5)

    return drawn


def _pose_kernel(name: str, kind: Kind, of, parts: Sequence[Part], digits=None, **more) -> Kernel:
    return Kernel(
        f"{name}-{kind}",
        functools.partial(of, kind),
        functools.partial(_sane, kind),
        tuple(parts),
        allowed=_unit_normals,
        near=functools.partial(_near, kind),
        digits=None if digits is None else functools.partial(digits, kind),
        pushes=_ones,
        **more,
    )


PROJECTION = (Part(2, least=1.0), Part(1), Part(2, least=1.0), Part(1), Part(1), Part(1))
"""Image coordinates are parts of the image, and slopes of the depth over all of it."""

PLACE = Part(2, least=1.0)


def _tangent_digits(kind: Kind, position, normal) -> list:
    right, down = twin_of(kind).tangents(position, normal)
    return [*right, *down]


def _footprint_kernel(kind: Kind) -> Kernel:
    return Kernel(
        f"footprint-{kind}",
        functools.partial(_footprint, kind),
        _with_density(kind, _sane),
        (*PROJECTION, Part(4), Part(1, octaves=True), Part(1, octaves=True)),
        allowed=_unit_normals,
        near=_with_density(kind, _near),
        digits=functools.partial(_footprint_digits, kind),
        pushes=lambda position, normal, density: (*_ones(position, normal), np.abs(density)),
        # Of several faces one is chosen, whose slopes are those of a single one.
        slopes=kind != "cube",
    )


KERNELS = (
    *map(_footprint_kernel, KINDS),
    _pose_kernel("surface_tangents", "point", _tangents, [Part(3)] * 2, _tangent_digits),
    _pose_kernel("address", "point", _address, [PLACE] * 2, slopes=False),
    _pose_kernel("address", "directional", _address, [PLACE] * 2, slopes=False),
    _pose_kernel("place_in", "point", _places, [PLACE, Part(4)], slopes=False),
    _pose_kernel("place_in", "directional", _places, [PLACE, Part(4)], slopes=False),
    _pose_kernel(
        "project_without_extent",
        "point",
        lambda kind, *args: _projection(kind, flat_frame(), *args),
        PROJECTION,
        precise=False,
        slopes=False,
    ),
)
