"""Hits on instances of shape groups, told apart on the device of a vectorised variant."""

from contextlib import AbstractContextManager

import numpy as np

from asmjax.render.geometry import SceneGeometry
from asmjax.render.instances import Instancing
from asmjax.render.working_frame import WorkingFrame


def shape_number(mi, shape) -> int:
    """The number by which the renderer's hits name a shape; 0 names none."""
    import drjit as dr

    return int(np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)))[0])


class InstancedHits:
    """Tables of a scene with instances, by the numbers of its shapes.

    Args:
        mi: the mitsuba module with its variant set.
        instancing: which shapes are instances, and of what.
        geometry: counts primitives and knows where instances stand.
        numbers: `shape_number` of each shape that is cast against.
        shape_ids: dense shape id of each of them, in `geometry`'s order.
        working: the frame in which the renderer's scene stands.
    """

    def __init__(
        self,
        mi,
        instancing: Instancing,
        geometry: SceneGeometry,
        numbers: list[int],
        shape_ids: list[int],
        working: WorkingFrame,
    ):
        import drjit as dr

        self._mi, self._dr = mi, dr
        first_part = np.zeros(max(numbers) + 1, np.uint32)
        first_part[numbers] = geometry.first_part[shape_ids]
        self._first_part = mi.UInt32(first_part)
        self._part_prim = mi.Int32(geometry.part_prim.astype(np.int32))
        # Groups are stored behind all shapes of their own, whose parts they are themselves.
        alone = geometry.part_prim.size - sum(len(parts) for parts in instancing.parts)
        parts = [shape_number(mi, part) for group in instancing.parts for part in group]
        self._parts = mi.UInt32(np.array([0] * alone + parts, np.uint32))
        assert geometry.to_world is not None
        places, instances = geometry.to_world.copy(), instancing.group >= 0
        places[:, :, instances] = working.places_inward(places[:, :, instances])
        matrix = np.moveaxis(places[:, :, shape_ids], 2, 0)
        inverse = np.linalg.inv(matrix[:, :, :3])
        shift = -np.einsum("nij,nj->ni", inverse, matrix[:, :, 3])
        to_part = np.zeros((first_part.size, 3, 4), np.float32)
        to_part[numbers] = np.concatenate([inverse, shift[:, :, None]], axis=2)
        self._to_part = mi.Float(to_part.ravel())

    def number(self, hit):
        """Number of the shape that was hit, its own or an instance."""
        # Of a hit on an instance `shape` is null.
        return self._raw(hit.shape) | self._raw(hit.instance)

    def first_prim(self, hit):
        """First primitive of the part that was hit, counted from that of its shape."""
        part, inside = self._part(hit)
        return self._dr.gather(self._mi.Int32, self._part_prim, part, inside)

    def in_part(self, hit, ray):
        """The same hit and ray as if the part were a shape of its own, in its coordinates."""
        mi, dr = self._mi, self._dr
        part, inside = self._part(hit)
        number = dr.gather(mi.UInt32, self._parts, part, inside) | self._raw(hit.shape)
        own = type(hit)(hit)
        own.shape = dr.reinterpret_array(mi.ShapePtr, number)
        own.instance = dr.zeros(mi.ShapePtr, dr.width(hit))
        rows = self._rows(hit)
        origin = (row[0] * ray.o.x + row[1] * ray.o.y + row[2] * ray.o.z + row[3] for row in rows)
        along = (row[0] * ray.d.x + row[1] * ray.d.y + row[2] * ray.d.z for row in rows)
        return own, mi.Ray3f(mi.Point3f(*origin), mi.Vector3f(*along))

    def few_calls(self) -> AbstractContextManager:
        """Inside, what is asked of hits' shapes is asked of those only that were hit.

        Otherwise Dr.Jit prepares the answer of every shape that there is, instances among them,
        each time anew: a second for a thousand instances.
        """
        return self._dr.scoped_set_flag(self._dr.JitFlag.SymbolicCalls, False)

    def to_world(self, hit, normal):
        """Unit normals (3, n) of the scene from those of the part that was hit."""
        # The inverse transpose; the rows lead from the world into the part.
        rows = self._rows(hit)
        turned = (sum(rows[i][k] * normal[i] for i in range(3)) for k in range(3))
        return self._dr.normalize(self._mi.Vector3f(*turned))

    def _part(self, hit):
        mi, dr = self._mi, self._dr
        instance = self._raw(hit.instance)
        inside = hit.is_valid() & (instance != 0)
        return dr.gather(mi.UInt32, self._first_part, instance, inside) + hit.shape_index, inside

    def _rows(self, hit):
        mi, dr = self._mi, self._dr
        start, valid = 12 * self.number(hit), hit.is_valid()
        return [
            [dr.gather(mi.Float, self._to_part, start + 4 * i + k, valid) for k in range(4)]
            for i in range(3)
        ]

    def _raw(self, pointer):
        return self._dr.reinterpret_array(self._mi.UInt32, pointer)
