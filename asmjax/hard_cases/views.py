"""Scene cases: eyes, depth ranges, scales and offsets that are hard on maps."""

from dataclasses import replace

import numpy as np

from asmjax.hard_cases.case import HardCase
from asmjax.hard_cases.lights import (
    CHARTS,
    DISK,
    GROUND,
    RAYS,
    SHAPES,
    SHINING,
    STONES,
    SUN,
    VIEW,
    WRONG,
    sun,
)
from asmjax.hard_cases.scene import Setup
from asmjax.scene.spec import Disk, Rectangle, Shape, Sphere, Vector, ViewSpec

NEAREST = 1e-3


def _eye_grazes(severity: float) -> Setup:
    return Setup(SHAPES, _low_eye(severity), SUN)


def _both_graze(severity: float) -> Setup:
    angle = np.radians(severity)
    light = sun(np.sin(angle), 0.3 * np.sin(angle), -np.cos(angle))
    return Setup(STONES, _low_eye(severity), light)


def _low_eye(degrees: float) -> ViewSpec:
    """An eye whose view meets the ground at that angle from its normal, three units along the
    ground."""
    height = 3 / np.tan(np.radians(degrees))
    return replace(VIEW, origin=(0.0, -3.0, float(height)), target=(0.0, 0.0, 0.0))


def _caster_behind(severity: float) -> Setup:
    """The disk stands that far behind the eye and shades what it sees."""
    view = replace(VIEW, origin=(0.0, 0.0, 1.5), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    height = 1.5 + severity
    towards = SHINING / SHINING[2] * height
    x, y = (towards[:2] + (-0.3, 0.2)).tolist()
    return Setup((GROUND, replace(DISK, centre=(x, y, height), radius=0.4)), view, SUN)


def _long_range(severity: float) -> Setup:
    """A leaf at 1e-3 and a wall at a depth that many times larger, both seen straight on."""
    view = replace(VIEW, origin=(0.0, 0.0, 0.0), target=(0.0, 1.0, 0.0))
    leaf = Disk("leaf", (0.0, NEAREST, 0.0), (0.0, -1.0, 0.0), 0.3 * NEAREST)
    far = severity * NEAREST
    wall = Rectangle("wall", (0.0, far, 0.0), (far, 0.0, 0.0), (0.0, 0.0, far))
    sail = Disk("sail", (0.29 * far, 0.7 * far, 0.12 * far), (0.0, -1.0, 0.0), 0.12 * far)
    return Setup((wall, sail, leaf), view, sun(0.3, 1.0, -0.4))


def _one_depth(severity: float) -> Setup:
    """Ever more straight down on the ground alone: all depths become one."""
    tilt = 1 / severity
    view = replace(
        VIEW, origin=(0.0, 0.0, 1.5), target=(0.0, float(1.5 * tilt), 0.0), up=(0.0, 1.0, 0.0)
    )
    disk = replace(DISK, centre=(-1.0, -0.5, 3.0))
    return Setup((GROUND, disk), view, SUN)


def _few_pixels(severity: float) -> Setup:
    """A dot so small; from 1e9 on no pixel sees it, and the light is fitted to another view."""
    x, y, z = (VIEW.origin + 4 * VIEW.camera().directions([16.5], [16.5])[:, 0]).tolist()
    radius = 1 / severity
    dot = Disk("dot", (x, y, z), (0.0, 0.0, 1.0), radius)
    if severity < 1e6:
        towards = np.array([x, y, z]) - 0.7 * radius * SHINING
        x, y, z = towards.tolist()
        return Setup((dot, Disk("cover", (x, y, z), (0.0, 0.0, 1.0), 0.6 * radius)), VIEW, SUN)
    away = replace(VIEW, target=(0.2, -2.7, 9.0))
    return Setup((*SHAPES, dot), away, SUN, frame_of=VIEW)


def _below(severity: float) -> Setup:
    """The ground from ever lower, and at last from below, where no light reaches."""
    view = replace(VIEW, origin=(0.0, -1.0, -severity), target=(0.0, 0.1, 0.0))
    return Setup((GROUND, DISK), view, SUN, frame_of=VIEW)


def scaled(setup: Setup, scale: float, shift: Vector = (0.0, 0.0, 0.0)) -> Setup:
    """The setup made larger, then moved; its pixels see the same."""

    def point(p) -> Vector:
        x, y, z = (scale * np.asarray(p) + shift).tolist()
        return x, y, z

    def vector(v) -> Vector:
        x, y, z = (scale * np.asarray(v)).tolist()
        return x, y, z

    def shape(s: Shape) -> Shape:
        if isinstance(s, Rectangle):
            return replace(s, centre=point(s.centre), half_u=vector(s.half_u),
                           half_v=vector(s.half_v))  # fmt: skip
        assert isinstance(s, Disk | Sphere)
        return replace(s, centre=point(s.centre), radius=scale * s.radius)

    view = replace(
        setup.view,
        origin=point(setup.view.origin),
        target=point(setup.view.target),
        near=scale * setup.view.near,
    )
    return Setup(tuple(shape(s) for s in setup.shapes), view, setup.light, same_as=setup)


_BASE = Setup(SHAPES, VIEW, SUN)


def _far_away(severity: float) -> Setup:
    return scaled(_BASE, 1.0, (severity, severity, severity))


_NORMALISED = "lengths relative to depth, nothing absolute (asmjax.numerics)"

CASES = (
    HardCase(
        "eye grazing the receiver", (3,), "views",
        "Pixels cover ever more of the ground, without end.",
        "docs/theory.md, \"Footprints\": per pixel, in logarithms", RAYS,
        "incidence of the view on the ground, degrees",
        (60.0, 85.0, 89.0, 89.9, 89.99, 89.999), WRONG, _eye_grazes,
    ),
    HardCase(
        "eye and light grazing the receiver", (2, 3), "views",
        "Two factors without end, which a quotient of areas cancels in silence.",
        "docs/theory.md, \"Any light\": two logarithms", RAYS,
        "incidence of both on the ground, degrees",
        (60.0, 85.0, 89.0, 89.9, 89.99, 89.999), WRONG, _both_graze,
    ),
    HardCase(
        "caster behind the eye", (8,), "views",
        "A perspective map cannot hold what is behind its centre: it slides back, or loses it.",
        f"{CHARTS}: cast through the inverse warp", RAYS,
        "how far behind the eye, scene units", (0.1, 1.0, 10.0, 100.0, 1e4), WRONG,
        _caster_behind,
    ),
    HardCase(
        "large range of depths", (17, 18), "views",
        "far / near of 1e6 and more leaves a warp one row of texels, or float32 no digits.",
        f"{CHARTS}: places in float64 from the eye", RAYS, "far / near",
        (1e2, 1e4, 1e6, 1e8, 1e10), WRONG, _long_range,
    ),
    HardCase(
        "one depth only", (15, 27), "views",
        "All slabs but one are empty, and ln z / ln alpha is 0/0.",
        f"{CHARTS}, \"Limits\": slabs without receivers get no chart", RAYS,
        "1 / tilt of the view, radians", (1.0, 1e2, 1e4, 1e8, 1e16), WRONG, _one_depth,
    ),
    HardCase(
        "few pixels, one, and none", (27,), "views",
        "Means and fits over no pixel are 0/0.",
        "docs/theory.md: nothing seen leaves a flat map", RAYS,
        "1 / radius of what is seen; none from 10⁹",
        (1.0, 10.0, 50.0, 1e9), WRONG, _few_pixels,
    ),
    HardCase(
        "nothing that the light reaches", (24, 27), "views",
        "A map is fitted to receivers, of which there is none.",
        "docs/theory.md: a light that reaches nothing leaves a flat map", RAYS,
        "depth of the eye below the ground, scene units",
        (-2.0, -0.1, 0.1, 3.0), WRONG, _below,
    ),
    HardCase(
        "tiny scenes", (14,), "views",
        "Absolute epsilons: a bias or a near distance of 1e-4 is the whole scene.",
        _NORMALISED, RAYS, "1 / scale", (1.0, 1e2, 1e4, 1e6, 1e9), WRONG,
        lambda severity: scaled(_BASE, 1 / severity),
    ),
    HardCase(
        "huge scenes", (14,), "views",
        "Absolute epsilons vanish beside rounding; squares and cubes overflow float32.",
        _NORMALISED, RAYS, "scale", (1.0, 1e2, 1e4, 1e6, 1e9), WRONG,
        lambda severity: scaled(_BASE, severity),
    ),
    HardCase(
        "scene far from the origin", (11,), "views",
        "World coordinates in float32 have a step of 0.06 units at 1e6.",
        "positions relative to the eye, offsets in float64 (docs/theory.md, \"Addresses\")", RAYS,
        "offset in x, y and z, scene units", (1.0, 1e3, 1e6, 1e9, 1e12, 1e14), WRONG, _far_away,
        1e11, "refused: UseError where float64 has lost the scene's digits",
    ),
)  # fmt: skip
"""Of the theme "views"."""
