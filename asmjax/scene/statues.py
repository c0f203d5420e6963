"""A terrace of statues: one figure of up to 1.6 million triangles, placed as often as wanted.

Stands in for the St. Matthew of Lloyd et al., "Subdivided Shadow Maps" (TR05-024), section 5: more
triangles than memory holds if each were written down. They are counted once for each statue, but
kept once: `statues:370m` is 237 statues. Metres, z up, the terrace at z = 0.
"""

import math

import numpy as np

from asmjax.scene.mesh_tools import rotation
from asmjax.scene.shapes import box, quad
from asmjax.scene.sizes import SizeRange
from asmjax.scene.spec import Instances, LightSpec, Mesh, SceneSpec, Vector, ViewSpec
from asmjax.scene.statue import FINEST, make_statue

DEFAULT_TRIANGLES = 1_000_000
SIZES = SizeRange("statues", 100_000, 2_000_000_000, "100k")
"""Triangles that may be asked for, all statues together: fewer make no figure, and more cannot be
numbered by an int32."""

SUMMARY = "statues on a terrace, one figure placed many times; any number of triangles: statues:82m"

FEWEST_STATUES = 32
SPACING = 3.0
"""Distance between statues, metres."""

_SUN: Vector = (0.30, 0.70, -0.65)
_CLOSE_TURN = -3.1
"""How far the statue of the view `close` is turned, radians: its left side is in the sun."""

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_PAVING: Vector = (0.60, 0.57, 0.52)
_GRASS: Vector = (0.36, 0.42, 0.26)


def make_statues(triangles: int = DEFAULT_TRIANGLES, name: str = "statues") -> SceneSpec:
    """The terrace with that many triangles, to within 2 %.

    The figure is as fine as it can be with `FEWEST_STATUES` of them or more.

    Raises:
        UseError: a number of triangles outside `SIZES`.
    """
    SIZES.check(triangles)
    steps, count = division(triangles)
    placed = _placed(count)
    lights = (
        LightSpec("sun", "directional", direction=_SUN),
        LightSpec("lamp", "point", position=(0.5 * SPACING, 0.5 * SPACING, 5.5)),
    )
    return SceneSpec(
        name,
        SUMMARY,
        tuple(_terrace(count)),
        {view.name: view for view in _views(count, placed)},
        {light.name: light for light in lights},
        instances=(Instances("statue", make_statue(steps), placed),),
    )


def division(triangles: int) -> tuple[int, int]:
    """How finely the figure is made, in steps of `make_statue`, and how many statues there are."""
    plinth, figure = (mesh.faces.shape[1] for mesh in make_statue(0))
    sizes = [4**steps * figure + plinth for steps in range(FINEST + 1)]
    steps = max(k for k, size in enumerate(sizes) if k == 0 or FEWEST_STATUES * size <= triangles)
    return steps, round(triangles / sizes[steps])


def _grid(count: int) -> tuple[int, int]:
    """Columns along x and rows along y; the last row may be short."""
    columns = math.ceil(math.sqrt(count))
    return columns, -(-count // columns)


def _placed(count: int) -> np.ndarray:
    """To-world transforms (count, 3, 4): a square grid about the origin, all turned differently."""
    columns, rows = _grid(count)
    index = np.arange(count)
    x = SPACING * (index % columns - 0.5 * (columns - 1))
    y = SPACING * (index // columns - 0.5 * (rows - 1))
    placed = np.empty((count, 3, 4))
    for k in range(count):
        size = 1.0 + 0.08 * math.sin(1.7 * k)
        placed[k, :, :3] = size * rotation((0.0, 0.0, 1.0), _GOLDEN_ANGLE * k)
    placed[:, :, 3] = np.stack([x, y, np.zeros(count)], axis=1)
    return placed


def _terrace(count: int) -> list[Mesh]:
    """Lawn, the paved terrace a metre above it, two steps down on all sides, and a low wall."""
    half = 0.5 * SPACING * _grid(count)[0] + 1.0
    far = 4.0 * half + 30.0
    lawn = quad(
        "lawn", [(-far, -far, -1.0), (far, -far, -1.0), (far, far, -1.0), (-far, far, -1.0)], _GRASS
    )
    steps = [
        box(f"step_{k}", (-half - out, -half - out, -1.2), (half + out, half + out, top), _PAVING)
        for k, (out, top) in enumerate([(0.0, 0.0), (1.0, -0.33), (2.0, -0.66)])
    ]
    walls = [
        box("wall_left", (-half, half - 0.3, -0.1), (half, half, 0.8), _PAVING),
        box("wall_back", (-half, -half, -0.1), (0.3 - half, half - 0.3, 0.8), _PAVING),
    ]
    return [lawn, *steps, *walls]


def _views(count: int, placed: np.ndarray) -> tuple[ViewSpec, ...]:
    """All 512 x 512: from above, along an aisle, and at the shoulder of a statue in the middle."""
    columns, rows = _grid(count)
    half = 0.5 * SPACING * columns
    # Of the inner half, the statue on whose left side the sun shines.
    turn = (_GOLDEN_ANGLE * np.arange(count) - _CLOSE_TURN) % (2.0 * math.pi)
    inside = np.abs(placed[:, :2, 3]).max(axis=1) < 0.6 * half
    chosen = placed[np.argmin(np.where(inside, np.minimum(turn, 2.0 * math.pi - turn), np.inf))]

    def near(x: float, y: float, z: float) -> Vector:
        px, py, pz = (chosen @ np.array([x, y, z, 1.0])).tolist()
        return px, py, pz

    # Between two rows whether their number is odd or even.
    aisle = 0.5 * SPACING if rows % 2 else 0.0
    return (
        ViewSpec(
            "overview",
            origin=(1.8 * half + 6.0, -1.9 * half - 6.0, 1.3 * half + 5.0),
            target=(0.0, 0.0, 0.3),
            fov_x_deg=42.0,
        ),
        ViewSpec(
            "aisle",
            origin=(half + 1.5, aisle, 1.9),
            target=(-half, aisle, 1.3),
            fov_x_deg=60.0,
        ),
        ViewSpec(
            "close", origin=near(0.75, 0.42, 2.45), target=near(0.05, 0.12, 2.0), fov_x_deg=36.0
        ),
    )
