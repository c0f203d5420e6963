"""Spheres, cylinders and disks in float64: where on them a ray is that a float32 caster found.

A float32 quadratic loses digits with the square of distance / radius: on a rod 0.05 thick, seen
from 4 units away, hits are off by 7e-5, enough for it to shade itself.
"""

from collections.abc import Sequence

import numpy as np

from asmjax.render.working_frame import WorkingFrame

KINDS = ("Sphere", "Cylinder", "Disk")
"""Mitsuba's classes: the unit sphere, the unit cylinder about z from 0 to 1, the unit disk across
z, each under an affine transform."""


class Quadrics:
    """The spheres, cylinders and disks of a scene, by where their one primitive is stored.

    Args:
        mi: the mitsuba module with its variant set.
        parts: Mitsuba shapes: those of the scene in `working` coordinates, then those of shape
            groups in coordinates of the group.
        stored: (n_parts,) int64, ascending, where the primitives of each part begin.
        own: how many of them are the scene's.
    """

    def __init__(self, mi, parts: Sequence, stored: np.ndarray, own: int, working: WorkingFrame):
        mine = [k for k, part in enumerate(parts) if part.class_name() in KINDS]
        places = np.zeros((3, 4, max(len(mine), 1)))
        places[:, :3] = np.eye(3)[:, :, None]
        self._stored = np.full(places.shape[2], -1)
        self._kind = np.full(places.shape[2], -1)
        for i, k in enumerate(mine):
            matrix = np.array(mi.traverse(parts[k])["to_world"].matrix, np.float64)
            places[:, :, i] = matrix.reshape(4, 4)[:3]
            self._stored[i], self._kind[i] = stored[k], KINDS.index(parts[k].class_name())
        of_scene = sum(k < own for k in mine)
        places[:, :, :of_scene] = working.places_outward(places[:, :, :of_scene])
        self._to_local = np.moveaxis(np.linalg.inv(np.moveaxis(places[:, :3], 2, 0)), 0, 2)
        self._place = places[:, 3]

    def known(self, stored: np.ndarray) -> np.ndarray:
        """(n,) bool: which primitives, by where they are stored (n,), are of these kinds."""
        return (stored >= 0) & (self._stored[self._number(stored)] == stored)

    def meet(
        self, stored: np.ndarray, origins: np.ndarray, directions: np.ndarray, near: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where rays (3, n) meet primitives of these kinds: t (n,) and normals (3, n).

        Rays and normals are in the coordinates in which the primitives are stored. Of two meetings
        the one nearer to the parameter `near` (n,). A ray that misses in float64 gets the point
        where it comes nearest. Unit normals have either sign.
        """
        number = self._number(stored)
        kind, rows = self._kind[number], self._to_local[:, :, number]
        start = np.einsum("ikn,kn->in", rows, origins - self._place[:, number])
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

    def _number(self, stored: np.ndarray) -> np.ndarray:
        return np.minimum(np.searchsorted(self._stored, stored), self._stored.size - 1)
