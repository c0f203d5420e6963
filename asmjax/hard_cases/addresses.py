"""Kernel cases: where in the map a point lies, to parts of a texel, at resolutions beyond float32.

A lamp ten units above a floor sees 122 degrees of it; an eye stands on the floor. Positions are
those that the precision at hand holds, relative to the eye: what the kernels add to their rounding
is the error.
"""

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import SurfacePoints, anchor, light_offset, project
from asmjax.footprint import cell_index
from asmjax.geometry import LightFrame, fixed_frame
from asmjax.hard_cases.case import Bound, HardCase, Kernel
from asmjax.hard_cases.exact import digits, dot, fifty
from asmjax.hard_cases.projections import points_of
from asmjax.shadow import UniformShadowMap
from asmjax.shadow.adaptive.address import (
    BITS,
    address_of,
    centre_offset,
    index_at,
)

_COUNT = 32
EYE = np.array([0.3, -3.0, 1.7])
_PLACE = np.array([0.0, 0.0, 10.0])
_WIDE_DEG = 122.0
_FINE = 22
"""log2 of the texels a side at which offsets and borders are asked for."""


def floor_seen(seed: int = 3) -> np.ndarray:
    """Points (3, n) of the floor relative to the eye, with digits in all places."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-15, 15, (2, _COUNT))
    return np.stack([x, y, np.zeros(_COUNT)]) - EYE[:, None]


def _up(position) -> jax.Array:
    normal = np.tile([[0.0], [0.0], [1.0]], position.shape[1])
    return jnp.asarray(normal, position.dtype)


def lamp(shift: float = 0.0, width_deg: float = _WIDE_DEG) -> LightFrame:
    """A light that shines straight down, its place moved by `shift` along all axes."""
    return fixed_frame(_PLACE + shift, (0.0, 0.0, -1.0), width_deg, 1e-6)


def exact_uv(frame: LightFrame, origin: np.ndarray, position):
    """Image coordinates (2, n) in decimals of points relative to `origin`; perspective light."""
    offset = digits(origin) - digits(frame.origin)
    world = position + offset[:, None]
    x, y, z = (dot(digits(axis), world) for axis in frame.rotation[0])
    plane = np.stack([x / z, y / z])
    return (plane - digits(frame.corner[0])[:, None]) / digits(frame.extent[0])[:, None]


# float32 image coordinates of the flat map.


@jax.jit
def _projected(points: SurfacePoints, offset, frame: LightFrame):
    return project(points, frame, offset).uv


def _flat_uv(position, frame: LightFrame) -> np.ndarray:
    position = jnp.asarray(position)
    points = points_of(position, _up(position), EYE)
    return np.asarray(_projected(points, light_offset(points, frame), frame))


def _flat(severity: float, width_deg: float = _WIDE_DEG, log2: float | None = None) -> Kernel:
    log2 = severity if log2 is None else log2
    return Kernel(
        inputs=(floor_seen() if width_deg == _WIDE_DEG else _narrow(width_deg),),
        value=lambda position: _flat_uv(position, lamp(0.0, width_deg)),
        truth=fifty(lambda position: exact_uv(lamp(0.0, width_deg), EYE, position)),
        unit=2.0**-log2,
        host=True,
        refusal=lambda: UniformShadowMap(resolution=round(2**log2)),
        goes_on=True,
    )


def _narrow(width_deg: float) -> np.ndarray:
    """Points all over the floor that the lamp sees, closer together the wider it is."""
    rng = np.random.default_rng(5)
    u, v = rng.uniform(0.02, 0.98, (2, _COUNT))
    origin, ray = lamp(0.0, width_deg).ray(0, u, v)
    return origin + ray * (-origin[2] / ray[2]) - EYE[:, None]


def _wide(severity: float) -> Kernel:
    if severity >= 179.9:
        return Kernel(
            inputs=(np.zeros(1),),
            value=lambda x: x,
            truth=lambda x: x,
            refusal=lambda: lamp(0.0, severity),
        )
    return _flat(severity, severity, 12)


# Addresses in tiles.


@jax.jit
def _addresses(points: SurfacePoints, offset, rows, frame: LightFrame):
    receivers = project(points, frame, offset)
    address = address_of(points, rows, receivers, frame.perspective)
    index = index_at(address.at, _FINE)
    return address.at, address.rest, index, centre_offset(address, index, _FINE)


def addressed(position, origin, frame: LightFrame) -> tuple[np.ndarray, np.ndarray]:
    """Image coordinates (2, n) from a point's address, and from its texel and the offset in it;
    float64."""
    position = jnp.asarray(position)
    points = points_of(position, _up(position), origin)
    offset, rows = light_offset(points, frame), anchor(points, frame)
    at, rest, index, to_centre = (
        np.asarray(part, np.float64) for part in _addresses(points, offset, rows, frame)
    )
    return np.ldexp(at + rest, -BITS), np.ldexp(index + 0.5, -_FINE) - to_centre


def _tiles(severity: float) -> Kernel:
    return Kernel(
        inputs=(floor_seen(),),
        value=lambda position: addressed(position, EYE, lamp())[0],
        truth=fifty(lambda position: exact_uv(lamp(), EYE, position)),
        unit=2.0**-severity,
        host=True,
    )


def _offsets(severity: float) -> Kernel:
    eye, frame = EYE + severity, lamp(severity)
    return Kernel(
        inputs=(floor_seen(),),
        value=lambda position: addressed(position, eye, frame)[0],
        truth=fifty(lambda position: exact_uv(frame, eye, position)),
        unit=2.0**-_FINE,
        host=True,
    )


def _borders(severity: float) -> Kernel:
    """Points that far, `1 / severity` of a texel, from borders of pages of 16 texels."""
    frame = lamp()
    near = np.round(np.linspace(0.1, 0.9, _COUNT) * 2**_FINE / 16) * 16
    u = np.ldexp(near + np.where(np.arange(_COUNT) % 2, 1, -1) / severity, -_FINE)
    origin, ray = frame.ray(0, u, u[::-1])
    return Kernel(
        inputs=(origin + ray * (-origin[2] / ray[2]) - EYE[:, None],),
        value=lambda position: addressed(position, EYE, frame)[1],
        truth=fifty(lambda position: exact_uv(frame, EYE, position)),
        unit=2.0**-_FINE,
        host=True,
    )


# Numbers of texels and cells.


def _numbers(severity: float) -> Kernel:
    """The last cell of six faces with 2^severity cells in all, or nearly."""
    side = round(2 ** (severity / 2))

    def last(uv):
        return np.asarray(cell_index(jnp.asarray(uv), jnp.full(1, 5), side), np.float64)

    return Kernel(
        inputs=(np.full((2, 1), 1 - 2.0**-20),),
        value=last,
        truth=lambda uv: np.floor(uv[0] * side) + side * (np.floor(uv[1] * side) + 5 * side),
        unit=1.0,
        refusal=lambda: last(np.full((2, 1), 0.5)),
        host=True,
    )


def _directional(severity: float) -> Kernel:
    """A lamp so far away, over the middle of what is seen, beside the same in decimals."""
    position = floor_seen()
    half = 20.0 / severity
    frame = LightFrame(
        origin=np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0]) * severity,
        rotation=fixed_frame((0, 0, 0), (-0.2, -0.1, -1.0), 90.0, 1e-6).rotation,
        corner=np.full((1, 2), -half),
        extent=np.full((1, 2), 2 * half),
        cone_axis=np.array([0.0, 0.0, -1.0]),
        cos_cutoff=-1.0,
        near=1e-6,
        perspective=True,
    )
    return Kernel(
        inputs=(position,),
        value=lambda position: _flat_uv(position, frame),
        truth=fifty(lambda p: exact_uv(frame, EYE, p)),
        unit=2.0**-12,
        host=True,
    )


_ANCHORED = 'docs/theory.md, "Addresses": an anchor in float64, fixed-point addresses'

CASES = (
    HardCase(
        "image coordinates in float32", (10,), "addresses",
        "Coordinates in [0.5, 1) have 24 bits: 2 bits below a texel are left at 2^22.",
        "flat maps end at 2^15; charts and pages form places in float64",
        "50 digits", "log2 of texels a side", (12.0, 15.0, 17.0, 19.0, 22.0, 24.0),
        Bound(1 / 16, 1e-6, "texels"), _flat,
        16.0, "refused: UseError above 2^15 texels a side of a flat map",
    ),
    HardCase(
        "addresses in tiles", (12,), "addresses",
        "u * 2^L - i cancels: what is left is the rounding of u, 2^L times larger.",
        _ANCHORED, "50 digits", "log2 of texels a side", (17.0, 19.0, 22.0, 24.0, 27.0, 30.0),
        Bound(1e-3, 1e-3, "texels"), _tiles,
    ),
    HardCase(
        "addresses far from the origin", (11,), "addresses",
        "World coordinates of float32 at 1000 units are 3.6 texels off at 2^19.",
        _ANCHORED, "50 digits", "offset of the scene in x, y and z, scene units",
        (1e0, 1e3, 1e6, 1e9, 1e12),
        Bound(1e-3, 1e-3, "texels at 2²² a side"), _offsets,
    ),
    HardCase(
        "points beside borders of pages", (13,), "addresses",
        "Floors of coordinates that were rounded differently name two pages, or none.",
        "shifts of one integer (docs/theory.md, \"Addresses\")",
        "50 digits", "1 / distance from a border, texels at 2²² a side",
        (1e1, 1e3, 1e6, 1e9, 1e12),
        Bound(1e-3, 1e-3, "texels at 2²² a side"), _borders,
    ),
    HardCase(
        "numbers of texels in 32 bits", (26,), "addresses",
        "2^19 texels a side are 2^38 in all: int32 wraps to negative numbers.",
        "(page, local) pairs in pages, at most 2^31 texels in flat maps",
        "closed form", "log2 of cells of a face", (20.0, 24.0, 28.0, 32.0, 38.0),
        Bound(0.0, 0.0, "cells"), _numbers,
        29.0, "refused: UseError above 2^28 cells a face",
    ),
    HardCase(
        "one plane for a wide field of view", (9,), "addresses",
        "tan of half the angle grows to 115 at 179 degrees: the centre gets few texels.",
        "a plane of its own up to 125 degrees, faces of a cube beyond (asmjax.geometry)",
        "50 digits", "field of view, degrees", (60.0, 122.0, 150.0, 170.0, 179.0, 179.95),
        Bound(1 / 16, 1e-6, "texels at 2¹² a side"), _wide,
        179.9, "refused: UseError from 179.9 degrees",
    ),
    HardCase(
        "image coordinates from a lamp far away", (30,), "addresses",
        "Position + offset rounds to the light's distance: all points move by its last digit.",
        "rotated offsets, formed in float64 on the host (asmjax.buffers.receivers)",
        "50 digits", "distance of the lamp, scene units", (1e1, 1e3, 1e5, 1e7, 1e9),
        Bound(1 / 16, 1e-4, "texels at 2¹² a side"), _directional,
    ),
)  # fmt: skip
"""Of the theme "addresses"."""
