"""One shape at any number of triangles: rippled sand with rings in it, alike at every scale.

Sand and rings are closed forms around a focus at the origin: twice as far from it, everything is
twice as large, from a few centimetres up to the rim, 10 metres away. Every vertex lies on the
shape, so more triangles follow it more closely and change nothing else. Metres, z up.
"""

import math

import numpy as np

from asmjax.scene.mesh_tools import make_mesh, merge
from asmjax.scene.shapes import grid, quads_to_triangles
from asmjax.scene.sizes import SizeRange
from asmjax.scene.spec import LightSpec, Mesh, SceneSpec, Vector, ViewSpec

DEFAULT_TRIANGLES = 250_000
SIZES = SizeRange("surface", 4_000, 100_000_000)
"""Triangles that may be asked for: with fewer a ring is no ring, with more a float32 is too short
to tell neighbouring vertices apart."""

HALF = 10.0
"""Half the side of the sand, metres."""

SUMMARY = "rippled sand and rings, alike at every scale; any number of triangles: surface:12m"

_RINGS = 48
_RING_SHARE = 0.5
"""Part of all triangles that the rings take."""

_LARGEST_RING, _SMALLEST_RING = 2.3, 0.015
"""Radii of the circles along which the first and the last ring run, metres."""

_ORBIT = 3.3
"""Distance of a ring from the focus, in radii of the ring."""

_THICKNESS = 0.16
"""Mean radius of a ring's body, in radii of the ring."""

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_CORE = 0.04
"""Within this distance of the focus the ripples fade out, metres."""

_STRETCH = 5.0
"""How much closer the sand's grid lines are at the focus: cells are as wide as their distance from
it times a constant, down to sinh(5) = 74 times narrower than a fifth of the mean."""

_SAND: Vector = (0.68, 0.58, 0.44)
_RING_COLOURS: tuple[Vector, ...] = ((0.35, 0.48, 0.60), (0.66, 0.36, 0.28), (0.72, 0.70, 0.64))


def make_surface(triangles: int = DEFAULT_TRIANGLES, name: str = "surface") -> SceneSpec:
    """The scene with that many triangles, to within 2 %; 12 million take seconds.

    Raises:
        UseError: a number of triangles outside `SIZES`.
    """
    SIZES.check(triangles)
    rings = [_ring(k, _RING_SHARE * triangles / _RINGS) for k in range(_RINGS)]
    left = triangles - sum(ring.faces.shape[1] for ring in rings)
    colours = range(len(_RING_COLOURS))
    bodies = [merge(f"rings_{c}", rings[c :: len(colours)], _RING_COLOURS[c]) for c in colours]
    light = LightSpec(
        "lamp", "point", position=(-6.0, -4.5, 5.5), direction=(0.32, 0.24, -1.0), fov_deg=127.0
    )
    return SceneSpec(
        name,
        SUMMARY,
        (_sand(left), *bodies),
        {view.name: view for view in _views()},
        {light.name: light},
    )


def height(x, y) -> np.ndarray:
    """Height of the sand in metres at `x`, `y` (arrays of one shape, or that broadcast)."""
    squared = x * x + y * y
    distance = np.sqrt(squared + _CORE**2)
    octave = np.log(distance)
    arms = np.sin(6.0 * octave + 5.0 * np.arctan2(y, x)) * squared / (squared + _CORE**2)
    return distance * (0.045 * np.sin(9.0 * octave) + 0.03 * arms)


def _views() -> tuple[ViewSpec, ...]:
    """All 512 x 512: at the focus one pixel is about 3 cm, 4 mm and 0.4 mm wide."""
    return (
        ViewSpec("overview", origin=(9.2, -9.2, 10.0), target=(0.0, 0.0, 0.2), fov_x_deg=50.0),
        ViewSpec("rings", origin=(2.2, 0.0, 1.9), target=(0.0, 0.0, 0.04), fov_x_deg=40.0),
        ViewSpec("focus", origin=(0.0, -0.24, 0.2), target=(0.0, 0.0, 0.0), fov_x_deg=38.0),
    )


def _sand(triangles: int) -> Mesh:
    rows = max(int(math.sqrt(triangles / 2)), 2)
    columns = max(round(triangles / 2 / rows), 2)
    x, y = (
        HALF * np.sinh(_STRETCH * np.linspace(-1.0, 1.0, n + 1)) / math.sinh(_STRETCH)
        for n in (columns, rows)
    )
    return grid("sand", x, y, height(x[None, :], y[:, None]), _SAND)


def _ring(k: int, triangles: float) -> Mesh:
    """Ring `k`, the largest first: a lumpy torus, every third one afloat, the others in the sand.

    A grid that is closed both ways: around the hole, and around the body.
    """
    radius = _LARGEST_RING * (_SMALLEST_RING / _LARGEST_RING) ** (k / (_RINGS - 1))
    angle = _GOLDEN_ANGLE * k
    at = _ORBIT * radius * np.array([[math.cos(angle)], [math.sin(angle)]])
    lift = 1.5 if k % 3 == 2 else 0.55
    centre = np.stack([*at, height(*at) + lift * radius])
    along, around = _cells(triangles)
    t = 2.0 * np.pi * np.arange(along)[:, None] / along
    s = 2.0 * np.pi * np.arange(around)[None, :] / around
    body = _THICKNESS * (1.0 + 0.22 * np.sin(5.0 * t + k) + 0.12 * np.sin(2.0 * s + 3.0 * t))
    reach = 1.0 + body * np.cos(s)
    local = np.stack([reach * np.cos(t), reach * np.sin(t), body * np.sin(s)]).reshape(3, -1)
    vertices = radius * (_tilt(k) @ local) + centre
    index = np.arange(along * around, dtype=np.int32).reshape(along, around)
    ahead = np.roll(index, -1, axis=0)
    sheet = (index, ahead, np.roll(ahead, -1, axis=1), np.roll(index, -1, axis=1))
    faces = quads_to_triangles(np.stack([q.ravel() for q in sheet]))
    return make_mesh(f"ring_{k}", vertices, faces)


def _cells(triangles: float) -> tuple[int, int]:
    """Cells along and around a ring whose triangles are about as long as wide."""
    around = max(round(math.sqrt(0.5 * triangles * _THICKNESS)), 5)
    return max(round(0.5 * triangles / around), 6), around


def _tilt(k: int) -> np.ndarray:
    """Rotation (3, 3) that raises ring `k` from lying flat, and turns it about the vertical."""
    lean = math.radians(25.0 if k % 3 == 2 else 68.0 + 8.0 * math.sin(2.0 * k))
    turn = 1.3 * k
    c, s = math.cos(lean), math.sin(lean)
    raised = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ raised
