"""Scene cases: lights that have a size. Every soft map is asked, beside 256 shadow rays a pixel to
points all over the light.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from asmjax.geometry import AreaLight, disk_light, rectangle_light, sphere_light, sun_light
from asmjax.hard_cases.case import Bound, HardCase
from asmjax.hard_cases.lights import (
    GROUND,
    SHAPES,
    SHINING,
    SUN,
    TEST,
    VIEW,
    below_pixel,
    lamp,
)
from asmjax.hard_cases.scene import Setup
from asmjax.hard_cases.surfaces import DOWN, FAR, falling, thin_gap
from asmjax.hard_cases.views import scaled
from asmjax.scene.spec import Disk, LightSpec


def _share(most: float) -> Bound:
    return Bound(most, most, "of the light, mean over the pixels")


RAYS = "256 float64 shadow rays to the light"

_ABOVE = (0.2, 0.2, 4.0)
"""Where lamps are, above the ground of `SHAPES`."""


def _facing_down(make: Callable[..., AreaLight], at, half: float) -> AreaLight:
    return make(at, (0.0, half, 0.0), (half, 0.0, 0.0))


def _lamp_of(area: AreaLight) -> LightSpec:
    return replace(lamp(*area.centre), area=area)


def _sun_of(light: LightSpec, degrees: float) -> LightSpec:
    return replace(light, area=sun_light(light.direction, np.radians(degrees)))


def _vanishing(severity: float) -> Setup:
    return Setup(SHAPES, VIEW, _lamp_of(_facing_down(rectangle_light, _ABOVE, 1 / severity)))


def _as_large(severity: float) -> Setup:
    """A disk as large as that, beside its distance to the ground."""
    return Setup(SHAPES, VIEW, _lamp_of(_facing_down(disk_light, _ABOVE, 4 * severity)))


def _at_the_light(severity: float) -> Setup:
    """A leaf that comes up to the lamp, of half its size."""
    x, y, z = _ABOVE
    leaf = Disk("leaf", (x + 0.05, y, z - 1 / severity), (0.0, 0.0, 1.0), 0.1)
    return Setup((GROUND, leaf), VIEW, _lamp_of(_facing_down(disk_light, _ABOVE, 0.2)))


def _on_the_receiver(severity: float) -> Setup:
    """A cover over half of the ground, `1 / severity` above it, cut open for the eye."""
    return replace(thin_gap(severity), light=_sun_of(SUN, 3.0))


def _horizon(severity: float) -> Setup:
    """A sun ten degrees across that sets: half of it is below the ground at 90 degrees."""
    return Setup((GROUND,), VIEW, _sun_of(falling(severity), 10.0))


def _tilted(severity: float) -> Setup:
    return Setup((GROUND, FAR), DOWN, _sun_of(falling(severity), 0.1))


def _long_range(severity: float) -> Setup:
    """A speck so high above a corner of what is seen: depths of the map range that far."""
    ray = VIEW.camera().directions([3.5], [29.5])[:, 0]
    corner = np.asarray(VIEW.origin) - ray * VIEW.origin[2] / ray[2]
    towards = -SHINING / np.linalg.norm(SHINING)
    x, y, z = (corner + severity * towards).tolist()
    return Setup(
        (*SHAPES, Disk("speck", (x, y, z), (0.0, 0.0, 1.0), 0.05)), VIEW, _sun_of(SUN, 1e-3)
    )


def _wide(severity: float) -> Setup:
    """A ball of light that sees the whole ground of the image, ever lower."""
    height = 6.6 / np.tan(np.radians(severity) / 2)
    view = replace(DOWN, fov_x_deg=60.0)
    leaf = Disk("leaf", (1.4, 0.9, 0.45 * height), (0.0, 0.0, 1.0), 1.5)
    x, y = below_pixel(view)[:2].tolist()
    return Setup((GROUND, leaf), view, _lamp_of(sphere_light((x, y, height), 0.1 * height)))


_BASE = Setup(SHAPES, VIEW, _sun_of(SUN, 3.0))

AREA = 'docs/theory.md, "Lights with a size"'
ACCUMULATION = 'docs/theory.md, "Accumulation"'
PCSS = 'docs/theory.md, "Percentage-closer soft shadows"'
MOMENTS = 'docs/theory.md, "Moment shadow maps"'

CASES = (
    HardCase(
        "light whose size vanishes", (31,), "soft",
        "Penumbrae without width, and moments without variance, are 0/0.",
        f"{PCSS}: widths along rays, in texels, 0 among them", RAYS,
        "1 / half side of the light, scene units",
        (2.0, 10.0, 1e3, 1e6, 1e12), _share(0.02), _vanishing,
    ),
    HardCase(
        "light as large as its distance", (32, 34), "soft",
        "No umbra is left, and cones reach 90 degrees: rays leave maps, and samples their faces.",
        f"{ACCUMULATION}: faces of its own for each sample", RAYS,
        "radius / distance of the light", (0.01, 0.1, 0.3, 1.0, 3.0), _share(0.035), _as_large,
        3.0, "`Status.MARGIN_LIMIT`: rays to the light leave the map",
    ),
    HardCase(
        "caster at the light", (33,), "soft",
        "The penumbra's width is the light's times (d_r - d_b) / d_b: d_b goes to 0.",
        f"{PCSS}: least depths of windows, held behind the light", RAYS,
        "1 / distance of caster and light, scene units", (3.0, 10.0, 1e2, 1e4), _share(0.05),
        _at_the_light,
        10.0, "`Status.MARGIN_LIMIT`; accumulated shadows hold",
    ),
    HardCase(
        "soft shadow of a caster on its receiver", (19, 31), "soft",
        "d_r - d_b cancels, and a bias lets light through.",
        f"{TEST}; {MOMENTS}", RAYS,
        "1 / gap between caster and receiver, scene units", (2.0, 10.0, 1e2, 1e4, 1e6),
        _share(0.02), _on_the_receiver,
        1e2, "the stated bias: `bias_distance`, and of moments a texel on the receiver's slope",
    ),
    HardCase(
        "light that crosses the receiver's horizon", (2, 35), "soft",
        "A part of the light is behind the receiver: taps there meet its plane behind the light.",
        f"{PCSS}: points below the receiver's plane light nothing", RAYS,
        "incidence of the light's middle, degrees", (60.0, 85.0, 88.0, 89.9, 92.0),
        _share(0.05), _horizon,
        91.0, "dark where `Receivers.facing` is False: less than half of the light is seen",
    ),
    HardCase(
        "acne below a light with a size", (19, 35), "soft",
        "A search or a filter is wider than a texel: a plane shades itself over all of it.",
        f"{TEST}, for every tap at its own texel's centre", RAYS,
        "incidence of the light, degrees", (0.0, 45.0, 80.0, 89.9, 89.99), _share(0.01), _tilted,
    ),
    HardCase(
        "moments of a long range of depths", (18, 36), "soft",
        "Four moments of depths in [0, 1] leave a float32 no digits for casters near by.",
        f"{MOMENTS}: depths in [-1, 1] of what is seen, sums in pairs", RAYS,
        "range of depths, scene units", (10.0, 1e2, 1e3, 1e4), _share(0.01), _long_range,
    ),
    HardCase(
        "light with a size and a wide field of view", (9, 34), "soft",
        "Rays to the light cross the seams of a cube's faces.",
        f"{ACCUMULATION}: faces of its own for each sample; maps go on beyond their borders", RAYS,
        "angle that the lamp lights, degrees", (90.0, 122.0, 150.0, 170.0, 175.0), _share(0.02),
        _wide,
    ),
    HardCase(
        "soft shadows in tiny scenes", (14,), "soft",
        "Absolute epsilons: a least penumbra of 1e-4 is the whole scene.",
        AREA, RAYS, "1 / scale", (1.0, 1e2, 1e4, 1e6, 1e9), _share(0.01),
        lambda severity: scaled(_BASE, 1 / severity),
    ),
    HardCase(
        "soft shadows far from the origin", (11,), "soft",
        "World coordinates in float32 have a step of 0.06 units at 1e6.",
        f"{AREA}: offsets of the light from its centre", RAYS,
        "offset in x, y and z, scene units", (1.0, 1e3, 1e6, 1e9), _share(0.01),
        lambda severity: scaled(_BASE, 1.0, (severity, severity, severity)),
    ),
)  # fmt: skip
"""Of the theme "soft"."""
