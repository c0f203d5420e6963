"""A robed figure with a raised lamp on a plinth, at any fineness: four times the triangles a step.

A coarse surface net of melted ellipsoids is split and pulled on to the smooth surface step by step;
at last folds of the robe and chisel marks are raised from it. Metres, z up, looking along +x.
"""

from dataclasses import replace

import numpy as np

from asmjax.scene.isosurface import Blob, pull_to_surface, surface_net
from asmjax.scene.mesh_tools import make_mesh
from asmjax.scene.shapes import bevelled_box
from asmjax.scene.spec import Mesh, Vector

FINEST = 5
"""Steps of `make_statue` after which edges are 2 to 3 mm long."""

PLINTH_HEIGHT = 0.7
_SPACING = 0.094
_MARBLE: Vector = (0.80, 0.78, 0.74)
_STONE: Vector = (0.52, 0.50, 0.46)


def make_statue(steps: int) -> tuple[Mesh, Mesh]:
    """Plinth and figure, 2.8 metres tall, standing on z = 0; `steps` of 0 to `FINEST`.

    The figure reaches a little into the plinth. Both are closed.
    """
    blobs = _blobs()
    figure = surface_net(
        "figure", blobs, (-0.7, -0.8, -0.4), (0.7, 0.8, 2.4), _SPACING, _MARBLE
    )  # fmt: skip
    for _ in range(steps):
        figure = split_all(figure)
        edge = 0.5 * _SPACING * 0.5**steps
        points = pull_to_surface(blobs, figure.vertices, 0.1 * edge)
        figure = make_mesh(figure.name, points, figure.faces, _MARBLE)
    normals = _vertex_normals(figure)
    raised = figure.vertices + _relief(figure.vertices, 0.5**steps * _SPACING) * normals
    raised[2] += PLINTH_HEIGHT
    half = 0.46
    plinth = bevelled_box(
        "plinth", (-half, -half, 0.0), (half, half, PLINTH_HEIGHT), 0.03, _STONE
    )  # fmt: skip
    return plinth, replace(figure, vertices=np.ascontiguousarray(raised))


def split_all(mesh: Mesh) -> Mesh:
    """Every face of a closed mesh cut into four at the middles of its edges."""
    count = mesh.vertices.shape[1]
    start = mesh.faces.astype(np.int64)
    end = np.roll(start, -1, axis=0)
    key = np.minimum(start, end) * count + np.maximum(start, end)
    edges, middle = np.unique(key, return_inverse=True)
    low, high = np.divmod(edges, count)
    points = 0.5 * (mesh.vertices[:, low] + mesh.vertices[:, high])
    (a, b, c), (ab, bc, ca) = mesh.faces, count + middle.reshape(key.shape)
    faces = np.concatenate(
        [np.stack([a, ab, ca]), np.stack([ab, b, bc]), np.stack([ca, bc, c]),
         np.stack([ab, bc, ca])], axis=1,
    )  # fmt: skip
    vertices = np.concatenate([mesh.vertices, points], axis=1)
    return make_mesh(mesh.name, vertices, faces, mesh.reflectance)


def _vertex_normals(mesh: Mesh) -> np.ndarray:
    """Unit normals (3, n_vertices): means of the faces around, weighted by their areas."""
    a, b, c = (mesh.vertices[:, corner] for corner in mesh.faces)
    normal = np.tile(np.cross(b - a, c - a, axis=0), 3)
    count = mesh.vertices.shape[1]
    total = np.stack([np.bincount(mesh.faces.ravel(), row, count) for row in normal])
    return total / np.linalg.norm(total, axis=0)


def _relief(points: np.ndarray, edge: float) -> np.ndarray:
    """Height (n,) above the smooth surface at `points` (3, n), in metres.

    Waves shorter than four edges are left out: the triangles could not follow them.
    """
    x, y, z = points
    around = np.arctan2(y, x)
    robe = np.clip((1.45 - z) / 0.5, 0.0, 1.0)
    folds = np.sin(13.0 * around + 2.0 * np.sin(2.5 * z) + 0.8 * np.sin(3.0 * around))
    pleats = np.sin(29.0 * around + 6.0 * z)
    chisel = np.sin(390.0 * z + 2.0 * np.sin(40.0 * y)) * np.sin(330.0 * y + 90.0 * x)
    waves = (
        (0.016 * robe, 0.11, folds),
        (0.005 * robe, 0.05, pleats),
        (0.0008, 0.016, chisel),
    )
    height = np.zeros_like(x)
    for size, length, wave in waves:
        if length > 4.0 * edge:
            height += size * wave
    return height


def _blobs() -> list[Blob]:
    """The figure without its plinth, feet at z = 0; nothing mirrors."""
    upright = [
        Blob((0.00, 0.00, 0.20), (0.36, 0.33, 0.52), None, 0.05),
        Blob((0.01, 0.01, 0.75), (0.26, 0.24, 0.50), None, 0.15),
        Blob((0.00, 0.00, 1.18), (0.19, 0.23, 0.34), None, 0.12),
        Blob((0.00, 0.00, 1.42), (0.14, 0.27, 0.13), None, 0.10),
        Blob((0.02, 0.00, 1.60), (0.085, 0.085, 0.14), None, 0.06),
        Blob((0.04, 0.01, 1.77), (0.125, 0.11, 0.15), None, 0.04),
        Blob((-0.06, 0.0, 1.74), (0.12, 0.13, 0.17), None, 0.05),
    ]
    right = [
        _limb((0.00, -0.25, 1.44), (0.10, -0.50, 1.52), 0.10),
        _limb((0.10, -0.50, 1.52), (0.18, -0.52, 1.92), 0.085),
        Blob((0.19, -0.52, 2.08), (0.15, 0.15, 0.13), None, 0.05),
    ]
    left = [
        _limb((0.00, 0.27, 1.42), (0.04, 0.42, 1.08), 0.10),
        _limb((0.04, 0.42, 1.08), (0.36, 0.40, 1.12), 0.085),
        Blob((0.42, 0.36, 1.20), (0.09, 0.15, 0.16), None, 0.04),
        # The cloak that hangs from that arm.
        Blob((0.00, 0.36, 0.74), (0.13, 0.12, 0.46), None, 0.08),
    ]
    return [*upright, *right, *left]


def _limb(start: Vector, end: Vector, radius: float) -> Blob:
    """An ellipsoid along the way from `start` to `end`, a radius longer at either end."""
    a, b = np.asarray(start), np.asarray(end)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    side = np.cross((0.0, 0.0, 1.0), along)
    side = side / np.linalg.norm(side)
    turn = np.stack([along, side, np.cross(along, side)], axis=1)
    x, y, z = (0.5 * (a + b)).tolist()
    return Blob((x, y, z), (0.5 * length + radius, radius, radius), turn, 0.05)
