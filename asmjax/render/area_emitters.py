"""The sizes of Mitsuba's area emitters, and how bright emitters are."""

import numpy as np

from asmjax.geometry import AreaLight, disk_light, rectangle_light, sphere_light
from asmjax.render.working_frame import WorkingFrame

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear red, green and blue with the primaries of ITU-R BT.709."""

FLAT = 1e-5
"""Two triangles are a parallelogram if their corners fit to this part of its size: float32."""


def area_of_shape(mi, shape, working: WorkingFrame) -> AreaLight | None:
    """The light, world, that emits from a Mitsuba shape in `working`: a rectangle, a disk, a
    sphere that emits outwards, or a mesh of two triangles that are a parallelogram; None for the
    others."""
    kind = shape.class_name()
    if kind in ("Rectangle", "Disk", "Sphere"):
        matrix = np.array(mi.traverse(shape)["to_world"].matrix, np.float64).reshape(4, 4)
        half_u, half_v, _, centre = matrix[:3].T
    elif shape.is_mesh():
        found = _parallelogram(shape)
        if found is None:
            return None
        centre, half_u, half_v = found
    else:
        return None
    centre = working.outward(centre[:, None])[:, 0]
    half_u, half_v = half_u / working.scale, half_v / working.scale
    if not _has_area(kind, half_u, half_v):
        return None
    # Flipped normals and mirroring transforms turn the side that emits.
    sample = shape.sample_position(0.0, mi.Point2f(0.5, 0.5))
    front, at = (np.array(vector, np.float64).reshape(3, 1) for vector in (sample.n, sample.p))
    front = front[:, 0]
    if kind == "Sphere":
        outwards = front @ (working.outward(at)[:, 0] - centre) > 0
        return sphere_light(centre, float(np.linalg.norm(half_u))) if outwards else None
    if front @ np.cross(half_u, half_v) < 0:
        half_v = -half_v
    return (disk_light if kind == "Disk" else rectangle_light)(centre, half_u, half_v)


def _has_area(kind: str, half_u: np.ndarray, half_v: np.ndarray) -> bool:
    """What is squeezed flat, or not finite, is a point like any other shape."""
    size = np.linalg.norm(half_u) * np.linalg.norm(half_v)
    if kind == "Sphere":
        return bool(0 < size < np.inf)
    return bool(FLAT * size < np.linalg.norm(np.cross(half_u, half_v)) < np.inf)


def _parallelogram(mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Centre and half axes (3,) of a mesh, in its coordinates."""
    points = np.array(mesh.vertex_positions_buffer(), np.float64).reshape(-1, 3)
    corners = points[np.array(mesh.faces_buffer()).astype(np.int64)]
    if corners.shape[0] != 6:
        return None
    first, second = ({tuple(corner) for corner in half} for half in (corners[:3], corners[3:]))
    if len(first) != 3 or len(second) != 3 or len(first & second) != 2:
        return None
    b, d = (np.array(corner) for corner in sorted(first & second))
    (a,), (c,) = first - second, second - first
    size = np.linalg.norm(b - d) + np.linalg.norm(np.subtract(a, c))
    if np.linalg.norm(np.add(a, c) - b - d) > FLAT * size:
        return None
    return np.add(a, c) / 2, (b - a) / 2, (d - a) / 2


def brightness(params, name: str) -> tuple[float, float | None]:
    """Luminance of the colour or texture `name` (its mean) among an emitter's parameters, and how
    much that varies from place to place: the standard deviation of a bitmap's texels in parts of
    their mean. 1 and None where it is of a kind that tells neither."""
    if f"{name}.value" in params:
        value = np.array(params[f"{name}.value"], np.float64).reshape(1, -1)
    elif f"{name}.data" in params:
        data = np.array(params[f"{name}.data"], np.float64)
        value = data.reshape(-1, data.shape[-1] if data.ndim == 3 else 1)
    else:
        return 1.0, None
    texels = value @ LUMINANCE if value.shape[1] == 3 else value.mean(axis=1)
    mean = max(float(texels.mean()), 0.0)
    return mean, float(texels.std() / mean) if mean > 0 else 0.0
