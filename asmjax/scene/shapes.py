"""Small mesh makers: box, grid, sphere, rounded solid, tube and torus knot.

All take lengths in scene units and return closed meshes with outward normals, except `grid`, an
open sheet. Triangle counts are exact and stated with each maker.
"""

from itertools import product

import numpy as np

from asmjax.scene.mesh_tools import make_mesh
from asmjax.scene.spec import Mesh, Vector

GREY: Vector = (0.7, 0.7, 0.7)


def box(name: str, low: Vector, high: Vector, reflectance: Vector = GREY) -> Mesh:
    """Axis-aligned box from corner `low` to corner `high`: 12 triangles."""
    corners = np.array(list(product(*zip(low, high, strict=True))), dtype=np.float64).T
    # Corner 4x + 2y + z; each quad counter-clockwise from outside.
    quads = np.array(
        [
            [0, 1, 3, 2],
            [4, 6, 7, 5],
            [0, 4, 5, 1],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 5, 7, 3],
        ]
    ).T
    return make_mesh(name, corners, quads_to_triangles(quads), reflectance)


def bevelled_box(
    name: str, low: Vector, high: Vector, bevel: float, reflectance: Vector = GREY
) -> Mesh:
    """Box from `low` to `high` with every edge cut off by `bevel`: 44 triangles."""
    middle = 0.5 * (np.asarray(low, dtype=np.float64) + np.asarray(high))
    half = 0.5 * (np.asarray(high, dtype=np.float64) - np.asarray(low))
    signs = np.array(list(product((-1, 1), repeat=3)))
    # Vertex 3 * corner + axis lies on the face across `axis`, pulled in along the other two.
    reach = half - bevel * (1.0 - np.eye(3))
    vertices = middle[:, None] + (signs[:, None, :] * reach[None, :, :]).reshape(-1, 3).T
    faces = [[3 * c, 3 * c + 1, 3 * c + 2][:: int(np.prod(signs[c]))] for c in range(8)]
    quads = []
    for axis in range(3):
        bit, next_bit, last_bit = (4 >> ((axis + k) % 3) for k in range(3))
        round_trip = (0, next_bit, next_bit | last_bit, last_bit)
        quads.append([3 * (bit | c) + axis for c in round_trip])
        quads.append([3 * c + axis for c in reversed(round_trip)])
        b, c = (axis + 1) % 3, (axis + 2) % 3
        # The four edges along `axis`, between the faces across b and c.
        for corner in (0, next_bit, last_bit, next_bit | last_bit):
            strip = [3 * corner + b, 3 * (corner | bit) + b, 3 * (corner | bit) + c, 3 * corner + c]
            outward = corner in (next_bit, last_bit)
            quads.append(strip if outward else strip[::-1])
    faces = np.concatenate([np.array(faces).T, quads_to_triangles(np.array(quads).T)], axis=1)
    return make_mesh(name, vertices, faces, reflectance)


def quads_to_triangles(quads: np.ndarray) -> np.ndarray:
    """Faces (3, 2n) from quads (4, n), each cut along its first diagonal."""
    a, b, c, d = quads
    return np.stack([[a, a], [b, c], [c, d]]).reshape(3, -1)


def quad(name: str, corners: list[Vector], reflectance: Vector = GREY) -> Mesh:
    """One open quadrilateral, corners counter-clockwise from its front: 2 triangles."""
    faces = np.array([[0, 0], [1, 2], [2, 3]])
    return make_mesh(name, np.asarray(corners, dtype=np.float64).T, faces, reflectance)


def grid(
    name: str, x: np.ndarray, y: np.ndarray, z: np.ndarray, reflectance: Vector = GREY
) -> Mesh:
    """Height field `z[row, column]` over `x` (columns) and `y` (rows), both increasing.

    Normals point up (+z). 2 (rows - 1) (columns - 1) triangles.
    """
    rows, columns = z.shape
    xs, ys = np.meshgrid(x, y)
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    quads = np.stack([c.ravel() for c in corners])
    vertices = np.stack([xs.ravel(), ys.ravel(), z.ravel()])
    return make_mesh(name, vertices, quads_to_triangles(quads), reflectance)


def sphere(
    name: str, centre: Vector, radius: float, frequency: int, reflectance: Vector = GREY
) -> Mesh:
    """Geodesic sphere from an octahedron: 8 frequency^2 nearly equal triangles."""
    return rounded_solid(name, centre, (radius, radius, radius), 2.0, frequency, reflectance)


def rounded_solid(
    name: str,
    centre: Vector,
    half_size: Vector,
    roundness: float,
    frequency: int,
    reflectance: Vector = GREY,
) -> Mesh:
    """Superellipsoid |x/a|^p + |y/b|^p + |z/c|^p = 1 with `p = roundness`: 8 frequency^2 triangles.

    2 is an ellipsoid, 4 to 8 a box with ever tighter round edges.
    """
    points, faces = _octahedron(frequency)
    # Stepping by angle along each axis evens out the triangles of the sphere.
    direction = np.sin(0.5 * np.pi * points)
    norm = np.sum(np.abs(direction) ** roundness, axis=0) ** (1.0 / roundness)
    scale = np.asarray(half_size, dtype=np.float64)[:, None]
    vertices = direction / norm * scale + np.asarray(centre, dtype=np.float64)[:, None]
    return make_mesh(name, vertices, faces, reflectance)


def _octahedron(frequency: int) -> tuple[np.ndarray, np.ndarray]:
    """Subdivided octahedron |x|+|y|+|z| = 1: points (3, 4f^2+2) and outward faces (3, 8f^2)."""
    f = frequency
    i, j = np.meshgrid(np.arange(f + 1), np.arange(f + 1), indexing="ij")
    up = (i + j) <= f - 1
    down = (i + j) <= f - 2
    lattice = []
    for signs in product((1, -1), repeat=3):
        a, b = i[up], j[up]
        triangles = [[(a + 1, b), (a, b + 1), (a, b)]]
        a, b = i[down], j[down]
        triangles.append([(a, b + 1), (a + 1, b), (a + 1, b + 1)])
        for corners in triangles:
            # (+1, -1, ...) octants are mirror images, so their corners run the other way.
            ordered = corners if np.prod(signs) > 0 else corners[::-1]
            lattice.append(
                np.stack(
                    [
                        np.stack([signs[0] * u, signs[1] * v, signs[2] * (f - u - v)])
                        for u, v in ordered
                    ],
                    axis=1,
                )
            )
    # Integer lattice coordinates weld the octants exactly.
    corners = np.concatenate(lattice, axis=2)
    side = 2 * f + 1
    key = ((corners[0] + f) * side + corners[1] + f) * side + corners[2] + f
    unique, faces = np.unique(key, return_inverse=True)
    points = np.stack([unique // (side * side), unique // side % side, unique % side]) - f
    return points / f, faces.reshape(key.shape)


def tube(
    name: str,
    path: np.ndarray,
    radius: float | np.ndarray,
    sides: int,
    *,
    loop: bool = False,
    reflectance: Vector = GREY,
) -> Mesh:
    """Sweep of a regular polygon of `sides` along `path` (3, n); `radius` is one or n numbers.

    An open path gets flat caps: 2 sides (n - 1) + 2 (sides - 2) triangles; a loop (whose last
    point is not the first again) has 2 sides n. The frame is carried along without twist; a loop
    spreads the closing twist evenly.
    """
    path = np.asarray(path, dtype=np.float64)
    count = path.shape[1]
    tangent, normal = _carried_frames(path, loop)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    if loop:
        angle = angle + _closing_twist(tangent, normal) * np.arange(count)[:, None] / count
    else:
        angle = np.broadcast_to(angle, (count, sides))
    binormal = np.cross(tangent, normal, axis=0)
    spoke = normal[:, :, None] * np.cos(angle) + binormal[:, :, None] * np.sin(angle)
    reach = np.broadcast_to(np.asarray(radius, dtype=np.float64), (count,))[:, None]
    vertices = (path[:, :, None] + reach * spoke).reshape(3, -1)
    ring = np.arange(count * sides).reshape(count, sides)
    near = ring if loop else ring[:-1]
    far = np.roll(ring, -1, axis=0) if loop else ring[1:]
    sheet = (near, np.roll(near, -1, axis=1), np.roll(far, -1, axis=1), far)
    faces = [quads_to_triangles(np.stack([q.ravel() for q in sheet]))]
    if not loop:
        fan = np.arange(1, sides - 1)
        faces.append(np.stack([np.zeros_like(fan), fan + 1, fan]))
        faces.append(ring[-1, 0] + np.stack([np.zeros_like(fan), fan, fan + 1]))
    return make_mesh(name, vertices, np.concatenate(faces, axis=1), reflectance)


def _carried_frames(path: np.ndarray, loop: bool) -> tuple[np.ndarray, np.ndarray]:
    """Unit tangents and parallel-transported unit normals (3, n) along a path."""
    if loop:
        tangent = np.roll(path, -1, axis=1) - np.roll(path, 1, axis=1)
    else:
        tangent = np.gradient(path, axis=1)
    tangent = tangent / np.linalg.norm(tangent, axis=0)
    normal = np.empty_like(tangent)
    carried = np.eye(3)[np.argmin(np.abs(tangent[:, 0]))]
    for i in range(path.shape[1]):
        carried = carried - tangent[:, i] * (tangent[:, i] @ carried)
        carried = carried / np.linalg.norm(carried)
        normal[:, i] = carried
    return tangent, normal


def _closing_twist(tangent: np.ndarray, normal: np.ndarray) -> float:
    """Angle in radians that the carried frame is short of its start after one round."""
    first = tangent[:, 0]
    arrived = normal[:, -1] - first * (first @ normal[:, -1])
    sine = np.cross(arrived, normal[:, 0]) @ first
    return float(np.arctan2(sine, arrived @ normal[:, 0]))


def cylinder(
    name: str,
    start: Vector,
    end: Vector,
    radius: float | tuple[float, float],
    sides: int,
    reflectance: Vector = GREY,
) -> Mesh:
    """Capped cylinder, or frustum when `radius` is (at start, at end): 4 sides - 4 triangles."""
    path = np.asarray([start, end], dtype=np.float64).T
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (2,))
    return tube(name, path, radii, sides, reflectance=reflectance)


def torus_knot(
    name: str,
    turns: tuple[int, int],
    radii: tuple[float, float, float],
    segments: int,
    sides: int,
    reflectance: Vector = GREY,
) -> Mesh:
    """The (p, q) torus knot around the z axis: 2 sides segments triangles.

    It winds `turns[0]` times around the axis and `turns[1]` times around the torus of `radii`
    (major, minor); the third radius is the tube's own. (1, 0) is a plain torus.
    """
    p, q = turns
    major, minor, thickness = radii
    t = 2.0 * np.pi * np.arange(segments) / segments
    reach = major + minor * np.cos(q * t) * (q != 0)
    path = np.stack([reach * np.cos(p * t), reach * np.sin(p * t), minor * np.sin(q * t)])
    return tube(name, path, thickness, sides, loop=True, reflectance=reflectance)
