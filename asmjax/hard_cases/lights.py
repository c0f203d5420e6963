"""Scene cases: where lights are hard on maps. Every algorithm is asked, beside shadow rays.

The scene is a ground with a disk and a ball above it, seen by an eye that looks down at it.
"""

from dataclasses import replace

import numpy as np

from asmjax.hard_cases.case import Bound, HardCase
from asmjax.hard_cases.scene import Setup
from asmjax.scene.spec import Disk, LightSpec, Rectangle, Sphere, ViewSpec

GROUND = Rectangle("ground", (0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
DISK = Disk("disk", (0.6, 0.3, 1.0), (0.0, 0.0, 1.0), 0.7)
TILE = Rectangle("tile", (0.0, 0.5, 0.0), (2.5, 0.0, 0.0), (0.0, 2.5, 0.0))
BALL = Sphere("ball", (-0.9, 1.0, 0.8), 0.5)
SHAPES = (GROUND, DISK, BALL)
"""A ground with two casters above it."""

STONES = (GROUND, Sphere("stone", (-0.6, -0.2, 0.25), 0.25), Sphere("pebble", (0.2, 0.9, 0.1), 0.1))
"""A ground with two casters on it, for light that comes along it."""

VIEW = ViewSpec("hard", (0.2, -2.8, 2.4), (0.3, 0.5, 0.2), fov_x_deg=50.0, width=32, height=32)

WRONG = Bound(0.002, 0.002, "share of pixels wrong beyond a texel of an edge")
"""Of every scene case: two pixels of 32 x 32."""

RAYS = "float64 shadow rays"

TEST = 'docs/theory.md, "The shadow test"'
CHARTS = 'docs/theory.md, "Warped, partitioned and subdivided maps"'


def sun(*direction: float) -> LightSpec:
    """Parallel light."""
    x, y, z = np.asarray(direction, float).tolist()
    return LightSpec("sun", "directional", direction=(x, y, z))


def lamp(*position: float) -> LightSpec:
    """A point light."""
    x, y, z = np.asarray(position, float).tolist()
    return LightSpec("lamp", "point", position=(x, y, z))


SHINING = np.array([0.4, 0.2, -1.0])
"""Where the sun's light goes to."""

SUN = sun(*SHINING)


def _turned(view: ViewSpec, degrees: float) -> LightSpec:
    """Parallel light at that angle to the view's direction, in its upright plane, from above."""
    forward = view.camera().rotation[2]
    below = -np.array([0.0, 0.0, 1.0]) + forward[2] * forward
    below /= np.linalg.norm(below)
    angle = np.radians(degrees)
    return sun(*(np.cos(angle) * forward + np.sin(angle) * below))


def _along(severity: float) -> Setup:
    return Setup(SHAPES, VIEW, _turned(VIEW, 90 - severity))


def _against(severity: float) -> Setup:
    """Up a little, so that the ground faces a light that comes straight at the eye."""
    view = replace(VIEW, origin=(0.0, -3.0, 1.6), target=(0.0, 0.0, 1.8), fov_x_deg=90.0)
    return Setup(SHAPES, view, _turned(view, 90 + severity))


def _parallel(severity: float) -> Setup:
    angle = np.radians(severity)
    return Setup(STONES, VIEW, sun(np.sin(angle), 0.3 * np.sin(angle), -np.cos(angle)))


def beside(view: ViewSpec, ahead: float, right: float) -> np.ndarray:
    """A point so far in front of the eye and to its right."""
    camera = view.camera()
    return camera.origin + ahead * camera.rotation[2] + right * camera.rotation[0]


def _at_the_eye(severity: float) -> Setup:
    return Setup(SHAPES, VIEW, lamp(*beside(VIEW, 0.0, 1 / severity)))


def _camera_plane(severity: float) -> Setup:
    above = 3 * VIEW.camera().rotation[1]
    return Setup((TILE, DISK, BALL), VIEW, lamp(*(beside(VIEW, 1 / severity, 0.5) - above)))


def below_pixel(view: ViewSpec) -> np.ndarray:
    """Where the ray through a pixel beside the image's middle meets the ground: a lamp above it
    lights a pixel straight below."""
    ray = view.camera().directions([16.5], [16.5])[:, 0]
    return np.asarray(view.origin) - ray * view.origin[2] / ray[2]


def _among(severity: float) -> Setup:
    """Ever nearer to the ground, so that ever more of what is seen lies beside and behind it."""
    height = 1 / severity
    x, y = below_pixel(VIEW)[:2].tolist()
    walls = (
        Rectangle("left", (x - 0.6, y + 0.1, 0.1), (0.0, 0.25, 0.0), (0.0, 0.0, 0.1)),
        Rectangle("back", (x + 0.3, y + 0.5, 0.1), (0.2, 0.0, 0.0), (0.0, 0.0, 0.1)),
    )
    return Setup((GROUND, *walls), VIEW, lamp(x, y, height))


def _through_plane(severity: float) -> Setup:
    """A wall beside the lamp, from below it to that far above: behind it, as it sees the ground."""
    top, low = 3.0 + severity, 0.5
    wall = Rectangle(
        "wall", (1.0, 0.5, (top + low) / 2), (0.0, 1.0, 0.0), (0.0, 0.0, (top - low) / 2)
    )
    return Setup((TILE, wall), VIEW, lamp(-0.5, 0.4, 3.0))


def _wide(severity: float) -> Setup:
    """A lamp that sees the whole ground of the image, ever lower."""
    height = 6.6 / np.tan(np.radians(severity) / 2)
    view = replace(VIEW, origin=(0.0, 0.0, 8.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0),
                   fov_x_deg=60.0)  # fmt: skip
    leaf = Disk("leaf", (1.4, 0.9, 0.45 * height), (0.0, 0.0, 1.0), 0.9)
    x, y = below_pixel(view)[:2].tolist()
    return Setup((GROUND, leaf), view, lamp(x, y, height))


def _far_lamp(severity: float) -> Setup:
    return Setup(SHAPES, VIEW, lamp(*(-severity * SHINING / np.linalg.norm(SHINING))))


CASES = (
    HardCase(
        "light along the view", (1,), "lights",
        "Nothing is left of a warp: its axis shrinks to a point.",
        f"{CHARTS}; TR05-024, section 5: warps fade, splits remain",
        RAYS, "light off the perpendicular to the view, degrees",
        (0.0, 45.0, 75.0, 85.0, 90.0), WRONG, _along,
    ),
    HardCase(
        "light against the view: duelling frusta", (1,), "lights",
        "The light's near texels fall on the eye's far pixels: alpha^2 texels a pixel.",
        f"{CHARTS}; TR05-024, section 5: splits, faces, or an adaptive map",
        RAYS, "light off the perpendicular to the view, degrees",
        (0.0, 45.0, 75.0, 85.0, 90.0), WRONG, _against,
    ),
    HardCase(
        "light parallel to the receiver", (2,), "lights",
        "A depth on the receiver changes by any amount within a texel.",
        f"{TEST}: a bias along the normal", RAYS, "incidence of the light on the ground, degrees",
        (60.0, 85.0, 89.0, 89.9, 89.99, 89.999), WRONG, _parallel,
    ),
    HardCase(
        "light at the eye", (4,), "lights",
        "z_l / z_e is constant: no shadow is seen, and acne would be all there is.",
        TEST, RAYS, "1 / distance of light and eye, scene units",
        (1.0, 10.0, 1e3, 1e6, 1e12), WRONG, _at_the_eye,
    ),
    HardCase(
        "light near the camera's plane", (5,), "lights",
        "After the eye's projection the light is at infinity, and behind it on the other side.",
        f"{CHARTS}: warps act in the light's own image", RAYS,
        "1 / distance from the camera's plane, scene units",
        (0.5, 10.0, 1e3, 1e6, 1e12), WRONG, _camera_plane,
    ),
    HardCase(
        "points beside and behind the light", (6,), "lights",
        "w <= 0 mirrors points into the map.",
        "asmjax.buffers.receivers: masked first; faces of a cube", RAYS,
        "1 / height of the lamp, scene units",
        (2.0, 8.0, 32.0, 128.0, 512.0), WRONG, _among,
        8.0, "the stated bias: `bias_distance`, in scene units",
    ),
    HardCase(
        "caster through the light's plane", (7,), "lights",
        "A triangle that crosses w = 0 has to be clipped before it is rasterised.",
        "nothing is rasterised here: light rays meet the triangle itself", RAYS,
        "reach of the caster behind the light, scene units",
        (0.1, 1.0, 10.0, 1e3, 1e6), WRONG, _through_plane,
    ),
    HardCase(
        "lamp with a wide field of view", (9,), "lights",
        "The centre's texels are 1e4 times as wide as the edge's at 179 degrees; seams of a cube.",
        "faces of a cube beyond 125 degrees (asmjax.geometry.light_frame)", RAYS,
        "angle that the lamp lights, degrees",
        (90.0, 122.0, 150.0, 170.0, 179.0), WRONG, _wide,
        179.0, "the stated bias: `bias_distance`, in scene units",
    ),
    HardCase(
        "lamp far away, as a sun", (30,), "lights",
        "Depths from the lamp are huge: their last digit is larger than the scene.",
        f"{TEST}: the bias is a part of the depth; use a directional light", RAYS,
        "distance of the lamp, scene units",
        (10.0, 1e3, 1e5, 1e6, 1e7), WRONG, _far_lamp,
        1e6, "the stated bias: 5e-6 of the distance; UseError beyond 1e5 diagonals",
    ),
)  # fmt: skip
"""Of the theme "lights"."""
