"""A process plant at any number of triangles: pipes, girders, gratings, tanks, stairs, a stack.

Stands in for the power plant of Lloyd et al., "Subdivided Shadow Maps" (TR05-024), section 5: many
separate bodies, thin ones over one another, looked along for a hundred metres. Four blocks of open
steelwork stand side by side along x, with an alley between the second and the third. More triangles
are more bays, more pipes with rounder sides, and finer gratings. Metres, z up, floor at z = 0.
"""

import math
from dataclasses import dataclass

import numpy as np

from asmjax.scene.mesh_tools import merge
from asmjax.scene.plant_parts import (
    BAR_TRIANGLES,
    BEND,
    Bars,
    bar_mesh,
    bars,
    beams,
    joined,
    pipe_mesh,
    pipe_triangles,
    vessel,
    vessel_triangles,
)
from asmjax.scene.shapes import GREY, quad
from asmjax.scene.sizes import SizeRange
from asmjax.scene.spec import LightSpec, Mesh, SceneSpec, Vector, ViewSpec

DEFAULT_TRIANGLES = 200_000
SIZES = SizeRange("plant", 10_000, 100_000_000)
"""Triangles that may be asked for: fewer make no plant, more no sense of a float32's digits."""

SUMMARY = "pipes, girders, gratings and tanks around an alley; any number of triangles: plant:12m"

BAY, DEPTH, STOREY = 6.0, 9.0, 4.0
"""Length of a bay along x, depth of a block along y, and height of a storey, metres."""

ALLEY = 5.0
"""Width of the alleys between blocks, metres."""

LEGS = 5
"""Straight parts of a pipe run."""

_BLOCKS = (-1.5 * ALLEY - 2.0 * DEPTH, -0.5 * ALLEY - DEPTH, 0.5 * ALLEY, 1.5 * ALLEY + DEPTH)
"""Where each block begins along y."""

_PIPE_SHARE = 0.65
"""Part of the triangles left by the steelwork that pipes take; gratings take the rest."""

_TANK_SHARE = 0.08
"""Part of them that vessels may take if that makes them rounder than a dodecagon."""

_RADII = (0.035, 0.06, 0.1, 0.17, 0.28)
_PIPE_COLOURS: tuple[Vector, ...] = (
    (0.72, 0.58, 0.20), (0.60, 0.26, 0.20), (0.34, 0.46, 0.38), (0.40, 0.48, 0.60),
    (0.74, 0.74, 0.70),
)  # fmt: skip
_STEEL: Vector = (0.42, 0.45, 0.47)
_GRATE: Vector = (0.56, 0.57, 0.58)
_RAIL: Vector = (0.78, 0.66, 0.22)
_TANK: Vector = (0.74, 0.75, 0.76)
_GROUND: Vector = (0.50, 0.49, 0.46)


@dataclass(frozen=True)
class _Layout:
    """What a number of triangles decides before any body is made.

    `storeys` and `tank` are (blocks, bays): floors above ground, and whether a vessel stands there.
    """

    bays: int
    runs: int
    storeys: np.ndarray
    tank: np.ndarray

    @property
    def length(self) -> float:
        return BAY * self.bays


def make_plant(triangles: int = DEFAULT_TRIANGLES, name: str = "plant") -> SceneSpec:
    """The plant with that many triangles, to within 1 %; 12 million take seconds.

    Raises:
        UseError: a number of triangles outside `SIZES`.
    """
    SIZES.check(triangles)
    layout = _layout(triangles)
    fixed = [*_ground(layout), *_steelwork(layout), *_stairs(layout)]
    left = triangles - sum(mesh.faces.shape[1] for mesh in fixed)
    sides = _sides(layout, _PIPE_SHARE * left)
    curved = [*_pipes(layout, sides), *_tanks(layout, _TANK_SHARE * left)]
    left -= sum(mesh.faces.shape[1] for mesh in curved)
    grates = _gratings(layout, max(left // BAR_TRIANGLES, 0))
    lights = (
        LightSpec("sun", "directional", direction=(0.78, 0.16, -0.60)),
        LightSpec("lamp", "point", position=(0.5 * layout.length - 0.7, 0.3, 7.2)),
    )
    return SceneSpec(
        name,
        SUMMARY,
        (*fixed, *curved, *grates),
        {view.name: view for view in _views(layout)},
        {light.name: light for light in lights},
    )


def _layout(triangles: int) -> _Layout:
    bays = max(round(1.3 * (triangles / 10_000) ** (1 / 3)), 1)
    rng = np.random.default_rng(5)
    # Drawn for more bays than there are, so that a plant begins alike at every size.
    storeys = rng.integers(3, 6, (64, len(_BLOCKS))).T[:, :bays]
    tank = rng.random((64, len(_BLOCKS))).T[:, :bays] < 0.2
    # The view `close` looks at the shadow of this bay's floor.
    tank[1, 0] = False
    each = triangles / (len(_BLOCKS) * bays)
    least = pipe_triangles(LEGS, 5, 1)
    runs = round(min(10.0 * bays * math.sqrt(each / 2_500), 0.15 * bays * each / least))
    return _Layout(bays, max(runs, 2), storeys, tank)


def _views(layout: _Layout) -> tuple[ViewSpec, ...]:
    """All 512 x 512: from outside, along the alley past a column, and at a floor's shadow in it."""
    far = 2.45 * math.hypot(0.5 * layout.length + 12.0, 27.0)
    middle = np.array([0.5 * layout.length + 4.0, 0.0, 11.0])
    outside = middle + far * np.array([-0.42, -0.76, 0.5])
    return (
        ViewSpec("overview", origin=_vector(outside), target=_vector(middle), fov_x_deg=44.0),
        ViewSpec("alley", origin=(-0.7, -1.9, 1.2), target=(20.0, -0.1, 2.6), fov_x_deg=66.0),
        ViewSpec("close", origin=(7.9, -1.3, 0.9), target=(8.8, -2.2, 0.0), fov_x_deg=36.0),
    )


def _vector(a: np.ndarray) -> Vector:
    x, y, z = a.tolist()
    return x, y, z


def _ground(layout: _Layout) -> list[Mesh]:
    """A plane far beyond the plant, and the stack behind it."""
    low, high = -120.0, layout.length + 120.0
    plane = quad(
        "ground",
        [(low, -140.0, 0.0), (high, -140.0, 0.0), (high, 140.0, 0.0), (low, 140.0, 0.0)],
        _GROUND,
    )
    x, y = layout.length + 14.0, 14.0
    stack = [
        vessel("stack", (x, y, -3.0), (x, y, 36.0), 1.9, 24, GREY),
        vessel("collar", (x, y, 31.0), (x, y, 34.0), 2.3, 24, GREY),
        vessel("foot", (x, y, -1.0), (x, y, 4.0), 3.0, 24, GREY),
    ]
    return [plane, merge("stack", stack, GREY)]


def _steelwork(layout: _Layout) -> list[Mesh]:
    """Columns, girders, braces and railings of each block, and bridges over the alley."""
    meshes = []
    for block, y in enumerate(_BLOCKS):
        storeys = layout.storeys[block]
        parts, rails = [], []
        tops = np.maximum(np.append(storeys, 0), np.insert(storeys, 0, 0))
        for k, top in enumerate(tops):
            x, z = BAY * k, STOREY * np.arange(1, top + 1) - 0.2
            for side in (y, y + DEPTH):
                parts.append(beams([[x], [side], [0.0]], [[x], [side], [STOREY * top]], 0.3, 0.32))
            parts.append(beams(*_between(x, y, z, x, y + DEPTH, z), 0.18, 0.4))
        for k, count in enumerate(storeys):
            x, z = BAY * k, STOREY * np.arange(1, count + 1)
            for side in (y, y + DEPTH):
                parts.append(beams(*_between(x, side, z - 0.2, x + BAY, side, z - 0.2), 0.18, 0.4))
            edge = y if block > 1 else y + DEPTH
            rails.append(_railing(x, edge, z))
            if k % 3 == 0:
                ends = _between(x, y + 0.05, z - STOREY, x + BAY, y + 0.05, z - 0.3)
                parts.append(bars(*ends, 0.1, 0.1))
        meshes.append(bar_mesh(f"steel_{block}", joined(parts), _STEEL))
        meshes.append(bar_mesh(f"rails_{block}", joined(rails), _RAIL))
    bridges = [
        beams(*_between(x, -0.5 * ALLEY, 7.8, x, 0.5 * ALLEY, 7.8), 0.2, 0.5)
        for middle in BAY * np.arange(0.5, layout.bays, 3.0)
        for x in (middle - 0.6, middle + 0.6)
    ]
    return [*meshes, bar_mesh("bridges", joined(bridges), _STEEL)]


def _points(x, y, z) -> np.ndarray:
    """Points (3, n) from coordinates that broadcast."""
    return np.stack(np.broadcast_arrays(x, y, np.atleast_1d(z)))


def _between(x0, y0, z0, x1, y1, z1) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends (3, n) from coordinates that broadcast."""
    return _points(x0, y0, z0), _points(x1, y1, z1)


def _railing(x: float, y: float, z: np.ndarray) -> Bars:
    """Posts every 1.5 metres and two rails along one bay, on all floors `z` (n,)."""
    posts = [bars(*_between(x + 1.5 * k + 0.4, y, z, x + 1.5 * k + 0.4, y, z + 1.1), 0.045, 0.045)
             for k in range(4)]  # fmt: skip
    rails = [bars(*_between(x, y, z + h, x + BAY, y, z + h), 0.04, 0.05) for h in (0.55, 1.1)]
    return joined([*posts, *rails])


def _stairs(layout: _Layout) -> list[Mesh]:
    """A stair tower before the second block: flights of 16 treads, to and fro, up to its roof."""
    y, step = _BLOCKS[1] + DEPTH - 1.6, np.arange(16)
    parts = []
    for floor in range(int(layout.storeys[1, 0])):
        out = floor % 2
        x = -1.2 - 0.27 * (step if out else step[::-1])
        z = STOREY * floor + 0.25 * (step + 1.0)
        across = y + 1.3 * out
        parts.append(bars(*_between(x, across - 0.5, z, x, across + 0.5, z), 0.26, 0.03))
        for side in (-0.5, 0.5):
            # The stringer and a metre above it the rail.
            foot, head = (_points(x[k], across + side, z[k] + [0.0, 1.0]) for k in (0, -1))
            parts.append(bars(foot, head, 0.05, [0.22, 0.05]))
        landing = -0.6 if out == 0 else -5.9
        level = STOREY * (floor + 1.0) - 0.02
        parts.append(bars(*_between(landing, y - 0.6, level, landing, y + 1.9, level), 1.2, 0.04))
    posts = [(x, y + dy) for x in (-6.4, -0.15) for dy in (-0.6, 1.9)]
    top = STOREY * float(layout.storeys[1, 0])
    parts += [beams([[x], [w], [0.0]], [[x], [w], [top + 1.0]], 0.16, 0.16) for x, w in posts]
    return [bar_mesh("stairs", joined(parts), _STEEL)]


def _sides(layout: _Layout, budget: float) -> tuple[int, ...]:
    """Sides of the pipes of each radius: the most that all runs together can have."""
    runs = np.bincount(np.arange(layout.runs) % len(_RADII), minlength=len(_RADII))

    def cost(scale: float) -> int:
        sides = _sides_at(scale)
        return len(_BLOCKS) * int(
            sum(n * pipe_triangles(LEGS, s, _arc(s)) for n, s in zip(runs, sides, strict=True))
        )

    low, high = 1.0, 256.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if cost(middle) <= budget else (low, middle)
    return _sides_at(low)


def _sides_at(scale: float) -> tuple[int, ...]:
    return tuple(max(round(scale * math.sqrt(r / _RADII[2])), 5) for r in _RADII)


def _arc(sides: int) -> int:
    """Segments of an elbow, as long as a pipe of so many sides is wide between two of them."""
    return max(sides // 4, 1)


def _pipes(layout: _Layout, sides: tuple[int, ...]) -> list[Mesh]:
    meshes = []
    for block, y in enumerate(_BLOCKS):
        corners = _routes(layout, block, y)
        for k, radius in enumerate(_RADII):
            mine = corners[:, k :: len(_RADII)]
            if mine.shape[1]:
                meshes.append(
                    pipe_mesh(f"pipes_{block}_{k}", mine, np.full(mine.shape[1], radius),
                              sides[k], _arc(sides[k]), _PIPE_COLOURS[k])
                )  # fmt: skip
    return meshes


def _routes(layout: _Layout, block: int, y: float) -> np.ndarray:
    """Corners (3, runs, LEGS + 1) of the pipe runs of one block.

    Runs go along the block below a floor, turn across it or up to another floor, and on. Five run
    side by side, one of each radius.
    """
    rng = np.random.default_rng([7, block])
    count = -(-layout.runs // len(_RADII))
    low = np.array([0.4, y + 0.8, 0.5])
    high = np.array([layout.length - 1.6, y + DEPTH - 2.2, STOREY * 4.0 + 0.8])
    at = low[:, None] + (high - low)[:, None] * rng.random((3, count))
    levels = STOREY * rng.integers(1, 6, count) - rng.choice([0.75, 1.25], count)
    at[2] = np.clip(levels, low[2], high[2])
    shortest = 2.0 * BEND * _RADII[-1] + 0.1
    corners = [at]
    for leg in range(LEGS):
        axis = np.zeros(count, int) if leg % 2 == 0 else rng.integers(1, 3, count)
        room = (high - low)[axis]
        most = np.where(axis == 0, np.minimum(0.5 * room, 14.0), 0.5 * room)
        length = shortest + np.maximum(most - shortest, 0.0) * rng.random(count)
        length = np.where(axis == 2, STOREY * np.clip(np.round(length / STOREY), 1, 2), length)
        sign = np.where(rng.random(count) < 0.5, -1.0, 1.0)
        here = at[axis, np.arange(count)]
        beyond = (here + sign * length > high[axis]) | (here + sign * length < low[axis])
        at = at.copy()
        at[axis, np.arange(count)] += np.where(beyond, -sign, sign) * length
        corners.append(at)
    bundle = np.stack(corners, axis=2)
    # Shifted by the same in x and y, parallel runs stay apart in legs along any axis.
    gap = np.cumsum([0.0, 0.14, 0.22, 0.36, 0.58])
    gap = np.stack([gap, gap, np.zeros(5)])
    runs = bundle[:, :, None, :] + gap[:, None, :, None]
    return runs.reshape(3, -1, LEGS + 1)[:, : layout.runs]


def _tanks(layout: _Layout, budget: float) -> list[Mesh]:
    """An upright vessel in every bay that has one, and lying drums on some roofs."""
    ends: list[tuple[Vector, Vector, float]] = []
    for block, y in enumerate(_BLOCKS):
        for k, upright in enumerate(layout.tank[block]):
            x, top = BAY * (k + 0.5), STOREY * float(layout.storeys[block, k])
            middle = y + 0.5 * DEPTH
            if upright:
                ends.append(((x, middle, 0.4), (x, middle, top + 1.5), 2.1))
            elif (k + block) % 3 == 0:
                ends.append(((x - 2.2, middle, top + 1.12), (x + 2.2, middle, top + 1.12), 1.1))
    sides = max(s for s in (12, 18, 24, 36, 48, 72, 96)
                if s == 12 or len(ends) * vessel_triangles(s) <= budget)  # fmt: skip
    bodies = [vessel("tank", start, end, radius, sides, _TANK) for start, end, radius in ends]
    return [merge("tanks", bodies, _TANK)]


def _gratings(layout: _Layout, count: int) -> list[Mesh]:
    """Exactly `count` bars in the floors of all bays without a vessel.

    Floors are panels of some 20 bars along x, a fifth as wide as the distance between them.
    """
    floors = [
        (block, BAY * k, _BLOCKS[block], STOREY * (s + 1))
        for block in range(len(_BLOCKS))
        for k in range(layout.bays)
        for s in range(int(layout.storeys[block, k]))
        if not layout.tank[block, k]
    ]
    if not floors or not count:
        return []
    owner, x, y, z = np.array(floors, float).T
    each = np.full(x.size, count // x.size) + (np.arange(x.size) < count % x.size)
    across = max(round(math.sqrt(each[0] / 20 * DEPTH / BAY)), 1)
    along = max(round(each[0] / 20 / across), 1)
    floor = np.repeat(np.arange(x.size), each)
    order = np.arange(count) - np.repeat(np.cumsum(each) - each, each)
    panels = along * across
    panel, place = order % panels, order // panels
    bars_there = -(-(each[floor] - panel) // panels)
    length, width = BAY / along, DEPTH / across
    pitch = width / bars_there
    at_x = x[floor] + (panel % along) * length
    at_y = y[floor] + (panel // along) * width + (place + 0.5) * pitch
    ends = _between(at_x + 0.03 * length, at_y, z[floor] + 0.016,
                    at_x + 0.97 * length, at_y, z[floor] + 0.016)  # fmt: skip
    every = bars(*ends, np.clip(0.2 * pitch, 0.003, 0.05), 0.032)
    parts = [Bars(*(a[..., owner[floor] == b] for a in every)) for b in range(len(_BLOCKS))]
    return [bar_mesh(f"grates_{b}", part, _GRATE) for b, part in enumerate(parts) if part.count]
