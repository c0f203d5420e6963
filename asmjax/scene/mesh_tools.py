"""Working on triangle meshes: move, merge, measure, and split to an exact triangle count.

Everything is component first: points `(3, n)` float64 in scene units, faces `(3, n)` int32 whose
corners run counter-clockwise when seen from outside (right-hand rule gives the outward normal).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from asmjax.scene.spec import Mesh, SceneSpec, Vector


def make_mesh(
    name: str, vertices: np.ndarray, faces: np.ndarray, reflectance: Vector = (0.7, 0.7, 0.7)
) -> Mesh:
    """A `Mesh` with the dtypes and memory order that the rest of the package expects."""
    return Mesh(
        name,
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int32),
        reflectance,
    )


def face_normals(mesh: Mesh) -> np.ndarray:
    """Unit normals (3, n_faces) by the right-hand rule; zero for a face without area."""
    a, b, c = (mesh.vertices[:, corner] for corner in mesh.faces)
    normal = np.cross(b - a, c - a, axis=0)
    length = np.linalg.norm(normal, axis=0)
    return normal / np.where(length > 0.0, length, 1.0)


def face_areas(mesh: Mesh) -> np.ndarray:
    """Areas (n_faces,) in square scene units."""
    a, b, c = (mesh.vertices[:, corner] for corner in mesh.faces)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0)


def signed_volume(mesh: Mesh) -> float:
    """Enclosed volume in cubic scene units: positive when a closed mesh is oriented outward."""
    a, b, c = (mesh.vertices[:, corner] for corner in mesh.faces)
    return float(np.sum(a * np.cross(b, c, axis=0)) / 6.0)


def is_closed(mesh: Mesh) -> bool:
    """Whether every directed edge meets exactly one partner that runs the other way.

    That is the combinatorial meaning of closed *and* consistently oriented.
    """
    start = mesh.faces.astype(np.int64)
    end = np.roll(start, -1, axis=0)
    count = np.int64(mesh.vertices.shape[1])
    forward = np.sort((start * count + end).ravel())
    backward = np.sort((end * count + start).ravel())
    return bool(np.all(forward[1:] != forward[:-1]) and np.array_equal(forward, backward))


def rotation(axis: Vector, angle: float) -> np.ndarray:
    """Rotation matrix (3, 3) by `angle` radians around `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


def transform(mesh: Mesh, matrix: np.ndarray, offset: Vector = (0.0, 0.0, 0.0)) -> Mesh:
    """`matrix @ vertex + offset`; a mirroring matrix also turns the faces, so outward stays out."""
    vertices = np.asarray(matrix) @ mesh.vertices + np.asarray(offset, dtype=np.float64)[:, None]
    faces = mesh.faces if np.linalg.det(matrix) > 0.0 else mesh.faces[::-1]
    return make_mesh(mesh.name, vertices, faces, mesh.reflectance)


def move(mesh: Mesh, offset: Vector) -> Mesh:
    """The mesh shifted by `offset`."""
    return transform(mesh, np.eye(3), offset)


def merge(name: str, meshes: Sequence[Mesh], reflectance: Vector = (0.7, 0.7, 0.7)) -> Mesh:
    """One mesh out of many, faces in the order given; nothing is welded."""
    starts = np.cumsum([0, *(m.vertices.shape[1] for m in meshes[:-1])])
    vertices = np.concatenate([m.vertices for m in meshes], axis=1)
    faces = np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)], axis=1)
    return make_mesh(name, vertices, faces, reflectance)


def split_to_count(mesh: Mesh, triangles: int) -> Mesh:
    """Split the longest edges of a closed mesh until it has exactly `triangles` faces.

    One split turns the two faces of an edge into four, so the mesh stays closed and its surface
    the same. The edges of one round share no face, which makes the round one array operation.
    """
    while (missing := triangles - mesh.faces.shape[1]) > 0:
        if missing % 2:
            raise ValueError(f"{triangles} triangles need an odd number of splits of '{mesh.name}'")
        mesh = _split_round(mesh, missing // 2)
    if mesh.faces.shape[1] != triangles:
        raise ValueError(
            f"'{mesh.name}' already has {mesh.faces.shape[1]} triangles, wanted {triangles}"
        )
    return mesh


def _split_round(mesh: Mesh, most: int) -> Mesh:
    """Split at most `most` of the longest edges, no two of them on one face."""
    vertices, faces = mesh.vertices, mesh.faces
    n_vertices, n_faces = vertices.shape[1], faces.shape[1]
    start, end = faces, np.roll(faces, -1, axis=0)
    length = np.linalg.norm(vertices[:, start] - vertices[:, end], axis=0)
    key = np.minimum(start, end).astype(np.int64) * n_vertices + np.maximum(start, end)
    # Sorting by edge puts the two faces of each edge side by side.
    order = np.argsort(key.ravel(), kind="stable")
    first, second = order[0::2], order[1::2]
    longest = np.argsort(-length.ravel()[first], kind="stable")
    used = np.zeros(n_faces, dtype=bool)
    pairs = []
    for slot_a, slot_b in zip(first[longest], second[longest], strict=True):
        face_a, face_b = slot_a % n_faces, slot_b % n_faces
        if not (used[face_a] or used[face_b]):
            used[face_a] = used[face_b] = True
            pairs.append((slot_a, slot_b))
            if len(pairs) == most:
                break
    slots = np.asarray(pairs).T
    corner, face = np.divmod(slots, n_faces)
    a, b = faces[corner, face], faces[(corner + 1) % 3, face]
    opposite = faces[(corner + 2) % 3, face]
    middle = np.broadcast_to(n_vertices + np.arange(slots.shape[1]), slots.shape)
    halves = np.stack([[a, middle, opposite], [middle, b, opposite]], axis=1).reshape(3, -1)
    kept = np.ones(n_faces, dtype=bool)
    kept[face.ravel()] = False
    points = 0.5 * (vertices[:, a[0]] + vertices[:, b[0]])
    return make_mesh(
        mesh.name,
        np.concatenate([vertices, points], axis=1),
        np.concatenate([faces[:, kept], halves], axis=1),
        mesh.reflectance,
    )


def written_out(spec: SceneSpec) -> SceneSpec:
    """The same scene with every instance as meshes of its own; primitive ids stay the same."""
    meshes = [
        replace(transform(mesh, placed[:, :3], tuple(placed[:, 3])), name=f"{mesh.name}_{k}")
        for instances in spec.instances
        for k, placed in enumerate(instances.transforms)
        for mesh in instances.meshes
    ]
    return replace(spec, shapes=(*spec.shapes, *meshes), instances=())
