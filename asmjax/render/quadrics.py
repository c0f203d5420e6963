"""Spheres, cylinders and disks in float64: where on them a ray is that a float32 caster found.

A float32 quadratic loses digits with the square of distance / radius: on a rod 0.05 thick, seen
from 4 units away, hits are off by 7e-5, enough for it to shade itself.
"""

import numpy as np

from asmjax.render.working_frame import WorkingFrame

KINDS = ("Sphere", "Cylinder", "Disk")
"""Mitsuba's classes: the unit sphere, the unit cylinder about z from 0 to 1, the unit disk across
z, each under an affine transform."""


class Quadrics:
    """The spheres, cylinders and disks of a scene.

    Args:
        mi: the mitsuba module with its variant set.
        shapes: Mitsuba shapes in the scene's order, in `working` coordinates.
    """

    def __init__(self, mi, shapes: list, working: WorkingFrame):
        self._kind = np.full(max(len(shapes), 1), -1)
        to_world = np.zeros((3, 4, self._kind.size))
        to_world[:, :3] = np.eye(3)[:, :, None]
        for k, shape in enumerate(shapes):
            if shape.class_name() in KINDS:
                self._kind[k] = KINDS.index(shape.class_name())
                matrix = np.array(mi.traverse(shape)["to_world"].matrix, np.float64)
                to_world[:, :, k] = matrix.reshape(4, 4)[:3]
        mine = self._kind >= 0
        to_world[:, :, mine] = working.places_outward(to_world[:, :, mine])
        linear = np.moveaxis(to_world[:, :3], 2, 0)
        self._to_local = np.moveaxis(np.linalg.inv(linear), 0, 2)
        self._place = to_world[:, 3]

    def known(self, shape: np.ndarray) -> np.ndarray:
        """(n,) bool: which dense shape ids (n,), any for none, are of these kinds."""
        return self._kind[np.maximum(shape, 0)] >= 0

    def meet(
        self, shape: np.ndarray, origin: np.ndarray, directions: np.ndarray, near: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where world rays (3, n) from `origin` (3,) meet their shapes: t (n,) and normals (3, n).

        Of two meetings the one nearer to the parameter `near` (n,). A ray that misses in float64
        gets the point where it comes nearest. Unit normals have either sign.
        """
        kind, rows = self._kind[shape], self._to_local[:, :, shape]
        start = np.einsum("ikn,kn->in", rows, origin[:, None] - self._place[:, shape])
        along = np.einsum("ikn,kn->in", rows, directions)
        # Of a cylinder only x and y count, of a disk z alone.
        counts = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[kind].T
        o, d = counts * start, counts * along
        speed = np.einsum("in,in->n", d, d)
        speed = np.where(speed > 0, speed, 1.0)
        closest = -np.einsum("in,in->n", o, d) / speed
        # The distance to the axis or centre first: b^2 - 4ac would cancel.
        miss = o + closest * d
        below = np.where(kind == 2, 0.0, 1.0) - np.einsum("in,in->n", miss, miss)
        half = np.sqrt(np.maximum(below, 0.0) / speed) * (kind != 2)
        t = np.where(np.abs(closest - half - near) <= np.abs(closest + half - near),
                     closest - half, closest + half)  # fmt: skip
        local = np.where(kind == 2, counts, o + t * d)
        normal = np.einsum("kin,kn->in", rows, local)
        return t, normal / np.linalg.norm(normal, axis=0)
