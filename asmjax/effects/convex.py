"""Whether a mesh is convex: it shades itself only where it turns away from the light."""

import numpy as np

MOST_FACES = 4096
"""Meshes with more are not looked at: few that are convex have so many."""

BULGE = 1e-6
"""Vertices may stand out of a face's plane by this part of the mesh's size: float32 corners."""


def is_convex(vertices: np.ndarray, faces: np.ndarray, outside: np.ndarray) -> bool:
    """Whether no vertex (3, n) stands on the outer side of any face (3, k), all of whose planes
    have the middle of the vertices on one side, and the point `outside` (3,) is not inside.

    Faces without an area count for nothing.
    """
    if not 0 < faces.shape[1] <= MOST_FACES:
        return False
    used = vertices[:, np.unique(faces)]
    a, b, c = (vertices[:, corner] for corner in faces)
    normal = np.cross(b - a, c - a, axis=0)
    length = np.linalg.norm(normal, axis=0)
    size = float(np.ptp(used, axis=1).max())
    some = length > 1e-12 * size**2
    if not some.any():
        return False
    normal, a = normal[:, some] / length[some], a[:, some]
    own = np.einsum("if,if->f", normal, a)
    middle = normal.T @ used.mean(axis=1) - own
    # A flat mesh has its middle in its planes, and no inside.
    out = np.where(middle > 0, -1.0, 1.0)
    height = out[:, None] * (normal.T @ used - own[:, None])
    if (height > BULGE * size).any():
        return False
    flat = np.abs(middle).max() <= BULGE * size
    return bool(flat or (out * (normal.T @ outside - own) > 0).any())
