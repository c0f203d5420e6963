"""Closed-form ray casting in float64: what a renderer is tested against.

Rectangle, disk and sphere are hit in closed form; meshes by brute force over all their triangles
(Moller and Trumbore 1997), which is slow and meant for tests. All arrays are component first.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from asmjax.scene.mesh_tools import face_normals
from asmjax.scene.spec import Disk, Mesh, Rectangle, Shape, Sphere

NO_HIT = -1
_PAIRS_AT_ONCE = 2_000_000
"""Ray-triangle pairs tested together: about 200 MB of temporaries."""


def primitive_count(shape: Shape) -> int:
    """Primitives of a shape: its triangles, or 1 for anything that is not a mesh."""
    return shape.faces.shape[1] if isinstance(shape, Mesh) else 1


def primitive_offsets(shapes: Sequence[Shape]) -> np.ndarray:
    """First global primitive id of each shape, and their total at the end: (n_shapes + 1,)."""
    counts = [primitive_count(s) for s in shapes]
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def closest(
    shapes: Sequence[Shape],
    origins: np.ndarray,
    directions: np.ndarray,
    t_min: np.ndarray | float = 0.0,
    t_max: np.ndarray | float = np.inf,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First hit along `origins + t * directions` with t_min <= t <= t_max, for (3, n) rays.

    Returns `t` (n,) in units of the direction's own length (inf for a miss), the global primitive
    id (n,) int32 counted through the shapes in order (-1 for a miss), and the geometric unit
    normal (3, n), as the shape defines it and not turned to the ray (0 for a miss).
    """
    origins, directions = np.broadcast_arrays(
        np.asarray(origins, dtype=np.float64), np.asarray(directions, dtype=np.float64)
    )
    count = origins.shape[1]
    low = np.broadcast_to(np.asarray(t_min, dtype=np.float64), (count,))
    high = np.broadcast_to(np.asarray(t_max, dtype=np.float64), (count,))
    best = np.full(count, np.inf)
    primitive = np.full(count, NO_HIT, dtype=np.int32)
    normal = np.zeros((3, count))
    offsets = primitive_offsets(shapes)
    for shape, offset in zip(shapes, offsets[:-1], strict=True):
        hit = _intersect(shape, origins, directions, low, np.minimum(high, best))
        # At equal distance the earlier shape keeps the hit.
        nearer = hit.t < best
        best = np.where(nearer, hit.t, best)
        primitive = np.where(nearer, hit.primitive + np.int32(offset), primitive)
        normal = np.where(nearer, hit.normal, normal)
    return best, primitive.astype(np.int32), normal


def occluded(
    shapes: Sequence[Shape], points: np.ndarray, target: np.ndarray, margin: float = 1e-9
) -> np.ndarray:
    """Whether anything stands strictly between `points` (3, n) and `target` (3,): bool (n,).

    `margin` is the share of the segment left out at either end.
    """
    directions = np.asarray(target, dtype=np.float64)[:, None] - points
    return closest(shapes, points, directions, margin, 1.0 - margin)[1] != NO_HIT


@dataclass(frozen=True)
class _Hits:
    """Nearest hits with one shape: `t` inf where it is missed."""

    t: np.ndarray
    primitive: np.ndarray
    normal: np.ndarray


def _intersect(
    shape: Shape, origins: np.ndarray, directions: np.ndarray, low: np.ndarray, high: np.ndarray
) -> _Hits:
    if isinstance(shape, Mesh):
        return _hit_mesh(shape, origins, directions, low, high)
    if isinstance(shape, Sphere):
        t, normal = _hit_sphere(shape, origins, directions, low, high)
    elif isinstance(shape, Disk):
        t, normal = _hit_disk(shape, origins, directions, low, high)
    else:
        t, normal = _hit_rectangle(shape, origins, directions, low, high)
    return _Hits(t, np.zeros(t.shape, dtype=np.int32), normal)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products (n,) of a vector (3,) with others (3, n). BLAS would round them by how many there
    are, so that a ray met another place alone than among others."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _hit_plane(
    centre: np.ndarray, normal: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ray parameter (inf when parallel) and hit point relative to `centre`."""
    slope = _dot(normal, directions)
    offset = centre[:, None] - origins
    parallel = slope == 0.0
    t = np.where(parallel, np.inf, _dot(normal, offset) / np.where(parallel, 1.0, slope))
    # A parallel ray has no hit point; any finite one keeps the arithmetic quiet.
    return t, np.where(parallel, 0.0, t) * directions - offset


def _hit_rectangle(
    shape: Rectangle, origins: np.ndarray, directions: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.asarray(shape.half_u, dtype=np.float64), np.asarray(shape.half_v, dtype=np.float64)
    normal = np.cross(u, v)
    normal = normal / np.linalg.norm(normal)
    t, local = _hit_plane(np.asarray(shape.centre, dtype=np.float64), normal, origins, directions)
    inside = (np.abs(_dot(u, local)) <= u @ u) & (np.abs(_dot(v, local)) <= v @ v)
    return np.where(inside & (t >= low) & (t <= high), t, np.inf), normal[:, None]


def _hit_disk(
    shape: Disk, origins: np.ndarray, directions: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    normal = np.asarray(shape.normal, dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    t, local = _hit_plane(np.asarray(shape.centre, dtype=np.float64), normal, origins, directions)
    inside = np.sum(local * local, axis=0) <= shape.radius**2
    return np.where(inside & (t >= low) & (t <= high), t, np.inf), normal[:, None]


def _hit_sphere(
    shape: Sphere, origins: np.ndarray, directions: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Both roots count, so a ray from inside hits the far wall."""
    speed = np.linalg.norm(directions, axis=0)
    unit = directions / speed
    offset = origins - np.asarray(shape.centre, dtype=np.float64)[:, None]
    along = -np.sum(unit * offset, axis=0)
    # The distance of centre and ray first: b^2 - 4ac would cancel for far or grazing rays.
    miss = offset + along * unit
    under = shape.radius**2 - np.sum(miss * miss, axis=0)
    half = np.sqrt(np.maximum(under, 0.0))
    near, far = (along - half) / speed, (along + half) / speed
    t = np.where((near >= low) & (near <= high), near, far)
    t = np.where((under >= 0.0) & (t >= low) & (t <= high), t, np.inf)
    at = offset + np.where(np.isfinite(t), t, 0.0) * directions
    return t, at / np.maximum(np.linalg.norm(at, axis=0), 1e-300)


def _hit_mesh(
    mesh: Mesh, origins: np.ndarray, directions: np.ndarray, low: np.ndarray, high: np.ndarray
) -> _Hits:
    """Every ray against every triangle, a block of rays at a time; edges and corners count."""
    a, b, c = (mesh.vertices[:, corner][:, None, :] for corner in mesh.faces)
    edge_1, edge_2 = b - a, c - a
    count = origins.shape[1]
    t_all, face_all = np.full(count, np.inf), np.zeros(count, dtype=np.int32)
    block = max(1, _PAIRS_AT_ONCE // max(1, mesh.faces.shape[1]))
    for start in range(0, count, block):
        rays = slice(start, start + block)
        direction = directions[:, rays, None]
        p = np.cross(direction, edge_2, axis=0)
        det = np.sum(edge_1 * p, axis=0)
        parallel = det == 0.0
        inverse = 1.0 / np.where(parallel, 1.0, det)
        s = origins[:, rays, None] - a
        u = np.sum(s * p, axis=0) * inverse
        q = np.cross(s, edge_1, axis=0)
        v = np.sum(direction * q, axis=0) * inverse
        t = np.sum(edge_2 * q, axis=0) * inverse
        inside = ~parallel & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        inside &= (t >= low[rays, None]) & (t <= high[rays, None])
        t = np.where(inside, t, np.inf)
        face = np.argmin(t, axis=1)
        face_all[rays] = face
        t_all[rays] = t[np.arange(face.size), face]
    return _Hits(t_all, face_all, face_normals(mesh)[:, face_all])
