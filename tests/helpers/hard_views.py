"""Views and lights at the limits of what maps are made for.

Image size and numbers of faces are those of `test_siblings`, so that little is compiled for them.
"""

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from asmjax.scene.spec import Disk, LightSpec, Rectangle, Sphere, ViewSpec
from helpers.analytic_cases import Case
from helpers.traced_cases import traced_case

SIDE = 64
"""Pixels a side."""

GROUND = Rectangle("ground", (0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
DISK = Disk("disk", (0.6, 0.3, 1.0), (0.0, 0.0, 1.0), 0.7)
BALL = Sphere("ball", (-0.9, 1.0, 0.8), 0.5)
SHAPES = (GROUND, DISK, BALL)
"""A ground with two casters above it."""

SHELL = Sphere("shell", (0.0, 0.0, 1.0), 12.0)
"""Around eye, light and all else."""

VIEW = ViewSpec("hard", (0.0, -5.0, 2.0), (0.0, 0.0, 0.0), fov_x_deg=60.0, width=SIDE, height=SIDE)


def sun(*direction: float) -> LightSpec:
    """Parallel light."""
    x, y, z = np.asarray(direction, float).tolist()
    return LightSpec("sun", "directional", direction=(x, y, z))


def lamp(*position: float) -> LightSpec:
    """A point light."""
    x, y, z = np.asarray(position, float).tolist()
    return LightSpec("lamp", "point", position=(x, y, z))


SUN = sun(0.4, 0.2, -1.0)


def _beside(view: ViewSpec, ahead: float, right: float) -> np.ndarray:
    """A point so far in front of the eye and to its right."""
    camera = view.camera()
    return camera.origin + ahead * camera.rotation[2] + right * camera.rotation[0]


def _along() -> Case:
    return traced_case(SHAPES, VIEW, sun(*VIEW.camera().rotation[2]))


def _against() -> Case:
    """Up a little, so that the ground faces a light that comes straight at the eye."""
    view = replace(VIEW, target=(0.0, 0.0, 2.6), fov_x_deg=90.0)
    return traced_case(SHAPES, view, sun(*-view.camera().rotation[2]))


def _at_the_eye() -> Case:
    return traced_case(SHAPES, VIEW, lamp(*VIEW.origin))


def _near_plane() -> Case:
    view = replace(VIEW, near=0.1)
    return traced_case(SHAPES, view, lamp(*_beside(view, 0.1, 0.04)))


def _in_the_image() -> Case:
    """In front of the eye, among what it sees, and so on several faces."""
    return traced_case(SHAPES, VIEW, lamp(*_beside(VIEW, 2.0, 1.5)))


def _inside_dark() -> Case:
    """The shell keeps all parallel light out."""
    return traced_case((*SHAPES, SHELL), VIEW, SUN)


def _inside_lit() -> Case:
    return traced_case((*SHAPES, SHELL), VIEW, lamp(0.5, -7.0, 4.0))


def _one_depth() -> Case:
    """Straight down on the ground alone; the disk is behind the eye and shades it."""
    view = replace(VIEW, origin=(0.0, 0.0, 1.5), up=(0.0, 1.0, 0.0))
    disk = replace(DISK, centre=(-1.0, -0.5, 3.0))
    return traced_case((GROUND, disk), view, SUN)


def _one_pixel() -> Case:
    x, y, z = (VIEW.origin + 4 * VIEW.camera().directions([32.5], [32.5])[:, 0]).tolist()
    return traced_case((Disk("dot", (x, y, z), (0.0, 0.0, 1.0), 0.02),), VIEW, SUN)


NEAREST = 1e-3


def _long_range() -> Case:
    """A leaf at 1e-3 and a wall at 1e5, both upright and seen straight on."""
    view = replace(VIEW, origin=(0.0, 0.0, 0.0), target=(0.0, 1.0, 0.0))
    leaf = Disk("leaf", (0.0, NEAREST, 0.0), (0.0, -1.0, 0.0), 0.3 * NEAREST)
    far = 1e8 * NEAREST
    wall = Rectangle("wall", (0.0, far, 0.0), (far, 0.0, 0.0), (0.0, 0.0, far))
    return traced_case((wall, leaf), view, sun(0.3, 1.0, -0.4))


@functools.cache
def base() -> Case:
    """What all these are extremes of."""
    return traced_case(SHAPES, VIEW, SUN)


def _sky() -> Case:
    view = replace(VIEW, target=(0.0, -4.9, 9.0))
    return traced_case(SHAPES, view, SUN, base().frame)


def _unlit() -> Case:
    """The ground from below, which the light does not reach."""
    view = replace(VIEW, origin=(0.0, 0.0, -3.0), target=(0.0, 0.1, 0.0))
    return traced_case((GROUND,), view, SUN, base().frame)


UNLIT = {"sky": _sky, "only what faces away": _unlit}
"""Views that need the frame of another one: none of their own can be fitted."""

HARD_VIEWS: dict[str, Callable[[], Case]] = {
    "light along the view": _along,
    "light against the view": _against,
    "light at the eye": _at_the_eye,
    "light in the near plane": _near_plane,
    "light in the image": _in_the_image,
    "inside, dark": _inside_dark,
    "inside, lit": _inside_lit,
    "one depth": _one_depth,
    "one pixel": _one_pixel,
    "range of 1e8": _long_range,
    **UNLIT,
}
"""By what is hard about them."""


@functools.cache
def hard_view(name: str) -> Case:
    """One of `HARD_VIEWS`, made once."""
    return HARD_VIEWS[name]()
