"""The triangles of a Mitsuba scene on the host, and its primitive ids."""

import equinox as eqx
import numpy as np

NOT_A_MESH = -1


class SceneGeometry(eqx.Module):
    """Float64 copies of the float32 triangles that Mitsuba casts against.

    A primitive's global id counts through the shapes in scene order: triangles of meshes, segments
    of curves, and one for most other shapes.

    Attributes:
        vertices: (3, n_vertices) float64, world.
        faces: (3, n_prims) int32 vertex indices; `NOT_A_MESH` for primitives of other shapes.
        flat: (n_prims,) bool, whether a primitive is flat: triangles and disks.
        first_prim: (n_shapes + 1,) int64, the first global primitive id of each shape.
        bounds: (3, 2) float64, the scene's box.
    """

    vertices: np.ndarray
    faces: np.ndarray
    flat: np.ndarray
    first_prim: np.ndarray
    bounds: np.ndarray

    @property
    def triangles(self) -> int:
        return int((self.faces[0] != NOT_A_MESH).sum())

    def corners(self, prim: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The three corners (3, n) of triangles `prim` (n,)."""
        a, b, c = self.faces[:, prim]
        return self.vertices.take(a, 1), self.vertices.take(b, 1), self.vertices.take(c, 1)


def read_geometry(shapes: list, bbox) -> SceneGeometry:
    """Copy the triangles of Mitsuba shapes to the host."""
    vertices, faces, first, offset = [np.zeros((3, 0))], [np.zeros((3, 0), np.int32)], [0], 0
    for shape in shapes:
        if shape.is_mesh():
            points = np.array(shape.vertex_positions_buffer(), np.float64).reshape(-1, 3).T
            triangles = np.array(shape.faces_buffer()).astype(np.int64).reshape(-1, 3).T + offset
            offset += points.shape[1]
            vertices.append(points)
            faces.append(triangles.astype(np.int32))
        else:
            faces.append(np.full((3, shape.primitive_count()), NOT_A_MESH, np.int32))
        first.append(first[-1] + faces[-1].shape[1])
    counts = np.diff(first)
    flat = [shape.is_mesh() or shape.class_name() == "Disk" for shape in shapes]
    return SceneGeometry(
        vertices=np.concatenate(vertices, axis=1),
        faces=np.concatenate(faces, axis=1),
        flat=np.repeat(np.array(flat, bool), counts),
        first_prim=np.array(first, np.int64),
        bounds=np.array([np.array(bbox.min).ravel(), np.array(bbox.max).ravel()], np.float64).T,
    )


def meet_planes(
    geometry: SceneGeometry, prim: np.ndarray, origin: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where float64 rays meet the planes of triangles: parameter t (n,) and unit normals (3, n).

    Mitsuba's float32 hit only says which triangle; this is the exact point of its plane. Normals
    face the ray's origin. t is NaN for a degenerate triangle or a ray in its plane.
    """
    a, b, c = geometry.corners(prim)
    (p, q, r), (u, v, w) = b - a, c - a
    normal = np.stack([q * w - r * v, r * u - p * w, p * v - q * u])
    facing = np.einsum("in,in->n", normal, directions)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("in,in->n", normal, a - origin[:, None]) / facing
        normal *= -np.sign(facing) / np.sqrt(np.einsum("in,in->n", normal, normal))
    return t, normal
