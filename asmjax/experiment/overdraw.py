"""How often a map of several parts draws an object: the price of subdivisions for a rasteriser.

Each part is drawn on its own, so an object whose shadow may fall into several is drawn several
times (TR05-024, section 5.2: overdraw = object renderings / objects). Maps that are cast ray by ray
have no such price: every texel of every part is one ray. Light must be parallel, as in the paper.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import require
from asmjax.geometry import Chart, LightFrame, image_to_plane, plane_to_image
from asmjax.shadow.warped.body import affine, bodies

_BITS = 10
"""Steps per axis, as a power of two, along which triangles are put in order."""


@dataclass(frozen=True, eq=False)
class CasterBoxes:
    """Bounds of k objects as a parallel light sees them.

    Attributes:
        low, high: (2, k) plane coordinates, see `LightFrame`.
        depth: (k,) least light depth, scene units.
    """

    low: np.ndarray
    high: np.ndarray
    depth: np.ndarray

    @property
    def count(self) -> int:
        return self.depth.size


@dataclass(frozen=True, eq=False)
class Part:
    """What one chart of a map stores.

    Attributes:
        corners: (2, c) plane coordinates of a convex polygon.
        deepest: largest light depth of a receiver that it serves; -inf where it serves none.
    """

    corners: np.ndarray
    deepest: float


@dataclass(frozen=True)
class Overdraw:
    """Objects drawn for a map of several parts.

    Attributes:
        parts: of the map.
        renderings: objects, counted for each part that draws them.
        drawn: objects that one part draws at least.
        one_map: objects that a single map of the same view draws.
    """

    parts: int
    renderings: int
    drawn: int
    one_map: int

    @property
    def factor(self) -> float:
        """Renderings / objects drawn at all, as the paper counts; 1 where nothing is drawn."""
        return self.renderings / self.drawn if self.drawn else 1.0

    @property
    def against_one_map(self) -> float:
        """Renderings / objects that a single map draws; 1 where that draws none."""
        return self.renderings / self.one_map if self.one_map else 1.0

    def record(self) -> dict:
        """The numbers as plain values by name."""
        return asdict(self) | {"factor": self.factor, "against_one_map": self.against_one_map}


def overdraw(parts: Sequence[Part], one_map: Sequence[Part], boxes: CasterBoxes) -> Overdraw:
    """Count the objects of `boxes` that `parts` draw, beside those that `one_map` draws."""
    each = drawn_by(parts, boxes)
    return Overdraw(
        parts=len(parts),
        renderings=int(each.sum()),
        drawn=int(each.any(axis=0).sum()),
        one_map=int(drawn_by(one_map, boxes).any(axis=0).sum()),
    )


def drawn_by(parts: Sequence[Part], boxes: CasterBoxes) -> np.ndarray:
    """(parts, k) whether a part draws an object: bounds meet its polygon, not behind all it serves.

    Objects between a part and the light count: their shadows may fall into it.
    """
    return np.stack([meets(part.corners, boxes) & (boxes.depth <= part.deepest) for part in parts])


def meets(corners: np.ndarray, boxes: CasterBoxes) -> np.ndarray:
    """(k,) whether boxes meet a convex polygon (2, c); touching counts.

    Convex sets in a plane are apart only if a line along an edge of one of them is between them.
    """
    lo, hi = corners.min(axis=1)[:, None], corners.max(axis=1)[:, None]
    meet = np.all((boxes.low <= hi) & (boxes.high >= lo), axis=0)
    for start, end in zip(corners.T, np.roll(corners, -1, axis=1).T, strict=True):
        x, y = end - start
        normal = np.array([-y, x])
        along = normal @ corners
        least, most = float(along.min()), float(along.max())
        ends = (
            np.where(normal[:, None] > 0, boxes.low, boxes.high),
            np.where(normal[:, None] > 0, boxes.high, boxes.low),
        )
        near, far = (normal[0] * e[0] + normal[1] * e[1] for e in ends)
        meet &= (near <= most) & (far >= least)
    return meet


def parts_of(charts: Sequence[Chart], view: EyeBuffer, frame: LightFrame) -> list[Part]:
    """What the charts of a view under parallel light store, and how deep their receivers lie.

    Raises:
        UseError: the light is a lamp.
    """
    _check_parallel(frame)
    body = bodies(view, frame)[0]
    onto = plane_to_image(frame, 0)
    image = np.stack([affine(row, body.plane) for row in onto[:2]])
    free, parts = np.ones(body.light_depth.size, bool), []
    for chart in charts:
        least, most = chart.depths
        held = free & (body.eye_depth >= least) & (body.eye_depth < most)
        for line in chart.lines:
            held &= affine(np.asarray(line), image) >= 0
        free &= ~held
        deepest = float(body.light_depth[held].max()) if held.any() else -np.inf
        parts.append(Part(_outline(chart, frame), deepest))
    return parts


def _outline(chart: Chart, frame: LightFrame) -> np.ndarray:
    """(2, c) the chart's square in the plane, cut by its lines."""
    square = np.array([[0.0, 1, 1, 0], [0, 0, 1, 1], [1, 1, 1, 1]])
    u, v, w = np.linalg.inv(chart.to_chart) @ square
    corners = np.stack([u / w, v / w])
    for line in chart.lines:
        corners = _cut(corners, np.asarray(line))
    back = image_to_plane(frame, chart.face)
    return np.stack([affine(row, corners) for row in back[:2]])


def _cut(corners: np.ndarray, line: np.ndarray) -> np.ndarray:
    """The part of a convex polygon (2, c) where line @ (x, y, 1) >= 0; all of it if none is."""
    value = affine(line, corners)
    if (value >= 0).all() or (value < 0).all():
        return corners
    kept = []
    for k in range(value.size):
        j = (k + 1) % value.size
        if value[k] >= 0:
            kept.append(corners[:, k])
        if (value[k] >= 0) != (value[j] >= 0):
            way = value[k] / (value[k] - value[j])
            kept.append(corners[:, k] + way * (corners[:, j] - corners[:, k]))
    return np.stack(kept, axis=1)


def caster_boxes(
    corners: Sequence[np.ndarray], owner: np.ndarray, frame: LightFrame
) -> CasterBoxes:
    """Bounds of the objects that own triangles.

    Args:
        corners: three arrays (3, m) of world corners.
        owner: (m,) number of the object that a triangle belongs to, any numbers.

    Raises:
        UseError: the light is a lamp.
    """
    _check_parallel(frame)
    order = np.argsort(owner, kind="stable")
    first = np.flatnonzero(np.diff(owner[order], prepend=-1))
    low, high = [], []
    for axis in frame.rotation[0]:
        along = np.stack([axis @ (corner - frame.origin[:, None]) for corner in corners])
        low.append(np.minimum.reduceat(along.min(axis=0)[order], first))
        high.append(np.maximum.reduceat(along.max(axis=0)[order], first))
    return CasterBoxes(np.stack(low[:2]), np.stack(high[:2]), low[2])


def chunks(middle: np.ndarray, shape: np.ndarray, size: int) -> np.ndarray:
    """(m,) number of the chunk of each triangle: `size` neighbours of one shape, the last fewer.

    Args:
        middle: (3, m) centres of the triangles, put in order along a curve that fills their box.
        shape: (m,) what they belong to.

    Raises:
        UseError: chunks of no triangle.
    """
    require(size >= 1, f"chunks of {size} triangles are not possible; allowed: 1 or more.")
    lo, extent = middle.min(axis=1, keepdims=True), np.ptp(middle, axis=1, keepdims=True)
    steps = ((middle - lo) / np.where(extent > 0, extent, 1) * (2**_BITS - 1)).astype(np.int64)
    code = np.zeros(middle.shape[1], np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((steps[axis] >> bit) & 1) << (3 * bit + axis)
    order = np.lexsort((code, shape))
    sorted_shape = shape[order]
    begins = np.flatnonzero(np.diff(sorted_shape, prepend=sorted_shape[:1] - 1))
    place = np.arange(shape.size) - np.repeat(begins, np.diff(begins, append=shape.size))
    number = np.cumsum(place % size == 0) - 1
    result = np.empty(shape.size, np.int64)
    result[order] = number
    return result


def _check_parallel(frame: LightFrame) -> None:
    require(
        not frame.perspective,
        "overdraw is counted for parallel light only; choose a directional light.",
    )
