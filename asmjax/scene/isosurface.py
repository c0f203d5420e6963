"""Smooth closed surfaces from implicit fields: smooth unions of ellipsoids, meshed by surface nets.

A field is negative inside, positive outside, and near the surface its value is about the distance
in scene units. Meshing follows Gibson, "Constrained elastic surface nets" (1998): one vertex per
grid cell that the surface passes, one quad per grid edge that it crosses.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from asmjax.scene.mesh_tools import make_mesh
from asmjax.scene.shapes import quads_to_triangles
from asmjax.scene.spec import Mesh, Vector

_FAR = 1e3
"""Field value in scene units where no blob is near."""


@dataclass(frozen=True)
class Blob:
    """An ellipsoid of semi-axes `radii` around `centre`, turned by `turn` (3, 3), local to world.

    `blend` is the width in scene units over which it melts into the blobs listed before it.
    """

    centre: Vector
    radii: Vector
    turn: np.ndarray | None = None
    blend: float = 0.05

    @property
    def reach(self) -> np.ndarray:
        """Half size (3,) of the axis-aligned box beyond which the blob changes no surface."""
        turn = np.eye(3) if self.turn is None else self.turn
        return np.linalg.norm(turn * np.asarray(self.radii), axis=1) + 2.0 * self.blend + 0.02

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Approximate signed distance (n,) at offsets `points` (3, n) from the centre.

        Exact to first order at the surface.
        """
        local = points if self.turn is None else self.turn.T @ points
        scaled = local / np.asarray(self.radii)[:, None]
        k0 = np.sqrt(np.einsum("in,in->n", scaled, scaled))
        scaled /= np.asarray(self.radii)[:, None]
        k1 = np.sqrt(np.einsum("in,in->n", scaled, scaled))
        return k0 * (k0 - 1.0) / np.maximum(k1, 1e-12)


def smooth_union(blobs: Sequence[Blob], points: np.ndarray) -> np.ndarray:
    """Field of the melted blobs at `points` (3, n): a quadratic smooth minimum, in list order.

    Each blob is evaluated only within its reach: most points are far from most blobs.
    """
    field = np.full(points.shape[1], _FAR)
    for blob in blobs:
        offset = points - np.asarray(blob.centre)[:, None]
        near = np.flatnonzero(np.all(np.abs(offset) < blob.reach[:, None], axis=0))
        field[near] = _melted(field[near], blob.distance(offset[:, near]), blob.blend)
    return field


def _grid_field(blobs: Sequence[Blob], axes: Sequence[np.ndarray]) -> np.ndarray:
    """`smooth_union` on the grid over `axes`, each blob on its own window of it."""
    field = np.full([axis.size for axis in axes], _FAR)
    for blob in blobs:
        ends = zip(axes, np.subtract(blob.centre, blob.reach), np.add(blob.centre, blob.reach),
                   strict=True)  # fmt: skip
        window = tuple(slice(*np.searchsorted(axis, (low, high))) for axis, low, high in ends)
        local = [axis[w] - c for axis, w, c in zip(axes, window, blob.centre, strict=True)]
        points = np.stack(np.meshgrid(*local, indexing="ij"))
        here = field[window]
        other = blob.distance(points.reshape(3, -1)).reshape(here.shape)
        field[window] = _melted(here, other, blob.blend)
    return field


def _melted(field: np.ndarray, other: np.ndarray, blend: float) -> np.ndarray:
    """Minimum of two fields, rounded off where they differ by less than `blend`."""
    overlap = np.maximum(blend - np.abs(field - other), 0.0)
    return np.minimum(field, other) - overlap * overlap / (4.0 * blend)


def surface_net(
    name: str,
    blobs: Sequence[Blob],
    low: Vector,
    high: Vector,
    spacing: float,
    reflectance: Vector = (0.7, 0.7, 0.7),
) -> Mesh:
    """Surface of the melted `blobs` inside the box `low`..`high`, which must enclose it.

    `spacing` is the grid step in scene units. Vertices are relaxed towards even spacing, then
    pulled back on to the surface, so shading is smooth at any step.
    """
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    values = _grid_field(blobs, axes)
    inside = values < 0.0
    cell_of, vertices = _cell_vertices(values, inside)
    quads = np.concatenate([_axis_quads(inside, cell_of, axis) for axis in range(3)], axis=1)
    vertices = vertices * spacing + np.asarray(low)[:, None]
    for _ in range(2):
        vertices = pull_to_surface(blobs, _relaxed(vertices, quads), 0.01 * spacing)
    # The shorter diagonal keeps triangles fat where the surface bends.
    across = [vertices[:, quads[i]] - vertices[:, quads[i + 2]] for i in (0, 1)]
    other = np.sum(across[1] ** 2, axis=0) < np.sum(across[0] ** 2, axis=0)
    quads = np.where(other, np.roll(quads, -1, axis=0), quads)
    return make_mesh(name, vertices, quads_to_triangles(quads), reflectance)


def _cell_vertices(values: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of each cell's vertex (-1 for none) and the vertices (3, n) in grid units.

    A vertex is the mean of the points where the surface crosses the twelve edges of its cell.
    """
    size = tuple(n - 1 for n in values.shape)
    corner = {}
    for offset in np.ndindex(2, 2, 2):
        window = tuple(slice(o, o + n) for o, n in zip(offset, size, strict=True))
        corner[offset] = window
    filled = np.sum([inside[w] for w in corner.values()], axis=0, dtype=np.int8)
    active = np.flatnonzero((filled.ravel() > 0) & (filled.ravel() < 8))
    cells = np.stack(np.unravel_index(active, size)).astype(np.float64)
    at = {o: values[w].ravel()[active] for o, w in corner.items()}
    total, count = np.zeros_like(cells), np.zeros(active.size)
    for axis in range(3):
        for offset in np.ndindex(2, 2, 2):
            if offset[axis]:
                continue
            end = tuple(1 if i == axis else o for i, o in enumerate(offset))
            a, b = at[offset], at[end]
            crossed = (a < 0.0) != (b < 0.0)
            fraction = a / np.where(crossed, a - b, 1.0)
            point = np.repeat(np.asarray(offset, dtype=np.float64)[:, None], active.size, axis=1)
            point[axis] = fraction
            total += np.where(crossed, point, 0.0)
            count += crossed
    cell_of = np.full(size, -1, dtype=np.int64)
    cell_of.ravel()[active] = np.arange(active.size)
    return cell_of, cells + total / count


def _axis_quads(inside: np.ndarray, cell_of: np.ndarray, axis: int) -> np.ndarray:
    """Outward quads (4, n) around the grid edges along `axis` that the surface crosses."""
    order = (axis, (axis + 1) % 3, (axis + 2) % 3)
    solid, cell = np.transpose(inside, order), np.transpose(cell_of, order)
    start, end = solid[:-1, 1:-1, 1:-1], solid[1:, 1:-1, 1:-1]
    ring = np.stack([cell[:, :-1, :-1], cell[:, 1:, :-1], cell[:, 1:, 1:], cell[:, :-1, 1:]])
    leaving = ring[:, start & ~end]
    entering = ring[::-1, ~start & end]
    return np.concatenate([leaving, entering], axis=1)


def _relaxed(vertices: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Every vertex moved half way to the mean of its neighbours."""
    count = vertices.shape[1]
    start, end = quads.ravel(), np.roll(quads, -1, axis=0).ravel()
    # A closed quad mesh lists each edge once in either direction, so one pass sees all neighbours.
    degree = np.bincount(start, minlength=count)
    mean = np.stack([np.bincount(start, row[end], minlength=count) for row in vertices]) / degree
    return 0.5 * (vertices + mean)


def pull_to_surface(blobs: Sequence[Blob], points: np.ndarray, step: float) -> np.ndarray:
    """One Newton step along the field's gradient (forward differences over `step`)."""
    shifts = np.concatenate([np.zeros((3, 1)), step * np.eye(3)], axis=1)
    probes = (points[:, None, :] + shifts[:, :, None]).reshape(3, -1)
    here, *ahead = smooth_union(blobs, probes).reshape(4, -1)
    gradient = (np.stack(ahead) - here) / step
    slope = np.maximum(np.einsum("in,in->n", gradient, gradient), 0.1)
    return points - here * gradient / slope
