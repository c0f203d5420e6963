"""The triangles of a Mitsuba scene on the host, and its primitive ids."""

from collections import Counter

import equinox as eqx
import numpy as np

from asmjax.errors import require
from asmjax.geometry.reintersect import meet_triangles_on_host
from asmjax.render.instances import Instancing, placement
from asmjax.render.quadrics import Quadrics
from asmjax.render.working_frame import WorkingFrame

NOT_A_MESH = -1

MOST_PRIMITIVES = 2**31 - 1
"""Primitive ids are int32."""


class SceneGeometry(eqx.Module):
    """Float64 copies of the float32 triangles that Mitsuba casts against.

    A primitive's global id counts through the shapes in scene order: triangles of meshes, segments
    of curves, and one for most other shapes. An instance of a shape group is a shape with all the
    primitives of its group, part after part. A group is stored once, behind all other shapes.

    Attributes:
        vertices: (3, n_vertices) float64, world; those of a group in the coordinates in which it is
            cast.
        faces: (3, n_stored) int32 vertex indices; `NOT_A_MESH` for primitives of other shapes.
        flat: (n_stored,) bool, whether a primitive is flat: triangles and disks.
        first_prim: (n_shapes + 1,) int64, the first global primitive id of each shape.
        bounds: (3, 2) float64, the scene's box; an instance enters with its group's box, turned.
        first_stored: (n_shapes,) int64, where the primitives of each shape are stored.
        first_part: (n_shapes,) int64, where the parts of each shape stand in `part_prim`.
        part_prim: (n_parts,) int64, first primitive of a part, counted from that of its shape.
        to_world: (3, 4, n_shapes) float64, from stored coordinates to the world's; None in a scene
            without instances.
        quadrics: the primitives that are spheres, cylinders or disks.
    """

    vertices: np.ndarray
    faces: np.ndarray
    flat: np.ndarray
    first_prim: np.ndarray
    bounds: np.ndarray
    first_stored: np.ndarray
    first_part: np.ndarray
    part_prim: np.ndarray
    to_world: np.ndarray | None
    quadrics: Quadrics

    @property
    def triangles(self) -> int:
        """Triangles that rays can meet: those of a group count for each of its instances."""
        on_mesh = self.faces[0] != NOT_A_MESH
        runs = zip(self.first_stored.tolist(), np.diff(self.first_prim).tolist(), strict=True)
        return sum(
            times * int(on_mesh[start : start + count].sum())
            for (start, count), times in Counter(runs).items()
        )

    def stored(self, prim: np.ndarray, shape: np.ndarray | None = None) -> np.ndarray:
        """Where primitives `prim` (n,) are stored; some index for -1.

        `shape` (n,), their dense shape ids (any for -1), spares looking for them.
        """
        if self.to_world is None:
            return prim
        shape = self._shape(prim) if shape is None else np.maximum(shape, 0)
        return prim - self.first_prim[shape] + self.first_stored[shape]

    def on_mesh(self, prim: np.ndarray, shape: np.ndarray | None = None) -> np.ndarray:
        """Which of `prim` (n,) are triangles of meshes; says nothing of -1."""
        return self.faces[0][self.stored(prim, shape)] != NOT_A_MESH

    def corners(
        self, prim: np.ndarray, shape: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The three corners (3, n) of triangles `prim` (n,), world."""
        if self.to_world is None:
            return self._corners(prim)
        shape = self._shape(prim) if shape is None else shape
        own = self._corners(self.stored(prim, shape))
        # Row by row: one product of small matrices for each primitive takes three times as long.
        rows = [[column.take(shape) for column in row] for row in self.to_world]
        a, b, c = (
            np.stack([r[0] * x + r[1] * y + r[2] * z + r[3] for r in rows]) for x, y, z in own
        )
        return a, b, c

    def meet_quadrics(
        self,
        prim: np.ndarray,
        shape: np.ndarray,
        origin: np.ndarray,
        directions: np.ndarray,
        near: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where world rays (3, n) from `origin` (3,) meet the spheres, cylinders and disks `prim`
        (n,) of shapes `shape` (n,): t (n,) and unit normals (3, n); see `Quadrics.meet`."""
        stored, origins = self.stored(prim, shape), origin[:, None]
        if self.to_world is None:
            return self.quadrics.meet(stored, origins, directions, near)
        shapes, back = np.unique(shape, return_inverse=True)
        places = self.to_world[:, :, shapes]
        inward = np.moveaxis(np.linalg.inv(np.moveaxis(places[:, :3], 2, 0)), 0, 2)[:, :, back]
        t, normal = self.quadrics.meet(
            stored,
            np.einsum("ikn,kn->in", inward, origins - places[:, 3, back]),
            np.einsum("ikn,kn->in", inward, directions),
            near,
        )
        normal = np.einsum("kin,kn->in", inward, normal)
        return t, normal / np.linalg.norm(normal, axis=0)

    def _shape(self, prim: np.ndarray) -> np.ndarray:
        return np.maximum(np.searchsorted(self.first_prim, prim, side="right") - 1, 0)

    def _corners(self, stored: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, b, c = self.faces[:, stored]
        return self.vertices.take(a, 1), self.vertices.take(b, 1), self.vertices.take(c, 1)


def read_geometry(
    mi, shapes: list, bbox, instancing: Instancing, working: WorkingFrame
) -> SceneGeometry:
    """Copy the triangles of Mitsuba shapes in `working` and their shape groups to the host.

    Raises:
        UseError: more primitives than an int32 can number, or an instance without a size.
    """
    sources, alone = _sources(shapes, instancing)
    own = sum(shape.vertex_count() for (shape,) in sources[:alone] if shape.is_mesh())
    points, faces, flat = _copied([part for source in sources for part in source])
    vertices = np.concatenate(points, axis=1)
    # Groups keep coordinates of their own.
    vertices[:, :own] = working.outward(vertices[:, :own])
    stored = np.concatenate([[0], np.cumsum([f.shape[1] for f in faces])]).astype(np.int64)
    first_part = np.concatenate([[0], np.cumsum([len(s) for s in sources])]).astype(np.int64)
    # A shape of its own is the next of those, an instance one of the groups behind them.
    group = instancing.group
    source = np.where(group < 0, np.cumsum(group < 0) - 1, alone + group)
    owner = np.repeat(np.arange(len(sources)), np.diff(first_part))
    counts = np.diff(stored[first_part])
    return SceneGeometry(
        vertices=vertices,
        faces=np.concatenate(faces, axis=1),
        flat=np.repeat(np.array(flat, bool), np.diff(stored)),
        first_prim=first_ids(counts[source]),
        bounds=box_of(bbox, working),
        first_stored=stored[first_part[source]],
        first_part=first_part[source],
        part_prim=stored[:-1] - stored[first_part[owner]],
        to_world=_places(mi, shapes, instancing, working) if instancing else None,
        quadrics=read_quadrics(mi, shapes, instancing, working),
    )


def read_quadrics(mi, shapes: list, instancing: Instancing, working: WorkingFrame) -> Quadrics:
    """The spheres, cylinders and disks among Mitsuba shapes in `working` and in their groups."""
    sources, alone = _sources(shapes, instancing)
    parts = [part for source in sources for part in source]
    counts = [part.primitive_count() for part in parts]
    stored = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return Quadrics(mi, parts, stored, alone, working)


def _sources(shapes: list, instancing: Instancing) -> tuple[list[tuple], int]:
    """What is stored: each shape of its own, then the parts of each group; how many are own."""
    alone = [(shape,) for shape, k in zip(shapes, instancing.group, strict=True) if k < 0]
    return [*alone, *instancing.parts], len(alone)


def _places(mi, shapes: list, instancing: Instancing, working: WorkingFrame) -> np.ndarray:
    """(3, 4, n_shapes) float64, from the stored coordinates of each shape to the world's.

    Raises:
        UseError: an instance whose transform has no inverse.
    """
    places = np.stack([placement(mi, shape) for shape in shapes], axis=2)
    flat = np.linalg.det(np.moveaxis(places[:, :3], 2, 0)) == 0.0
    require(
        not flat.any(),
        f"the transform of instance '{shapes[int(np.argmax(flat))].id()}' has no inverse; give it "
        "a size along each axis.",
    )
    instances = instancing.group >= 0
    places[:, :, instances] = working.places_outward(places[:, :, instances])
    return places


def box_of(bbox, working: WorkingFrame) -> np.ndarray:
    """(3, 2) float64, world, min and max per axis, of a Mitsuba box in `working`."""
    ends = [np.array(bbox.min).ravel(), np.array(bbox.max).ravel()]
    return working.outward(np.array(ends, np.float64).T)


def first_ids(counts: np.ndarray) -> np.ndarray:
    """First global id of each shape and the total (n_shapes + 1,) int64 from its primitives.

    Raises:
        UseError: more than an int32 can number.
    """
    first = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    require(
        int(first[-1]) <= MOST_PRIMITIVES,
        f"the scene has {first[-1]} primitives, those of instances counted for each; allowed are "
        f"{MOST_PRIMITIVES}, as ids are int32: leave some instances out.",
    )
    return first


def _copied(parts: list) -> tuple[list[np.ndarray], list[np.ndarray], list[bool]]:
    """Vertices and faces of each part, and whether it is flat; an empty array comes first."""
    vertices, faces, offset = [np.zeros((3, 0))], [], 0
    for part in parts:
        if part.is_mesh():
            points = np.array(part.vertex_positions_buffer(), np.float64).reshape(-1, 3).T
            triangles = np.array(part.faces_buffer()).astype(np.int64).reshape(-1, 3).T + offset
            offset += points.shape[1]
            vertices.append(points)
            faces.append(triangles.astype(np.int32))
        else:
            faces.append(np.full((3, part.primitive_count()), NOT_A_MESH, np.int32))
    flat = [part.is_mesh() or part.class_name() == "Disk" for part in parts]
    return vertices, faces, flat


def meet_surfaces(
    geometry: SceneGeometry,
    prim: np.ndarray,
    origin: np.ndarray,
    directions: np.ndarray,
    shape: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where float64 rays meet the triangles that a float32 ray caster names: parameter t (n,),
    place (3, n) and unit normals (3, n).

    One ray in 10^5 passes beyond the edge of its triangle: it gets the nearest place on that by
    barycentric coordinates, which is on the edge that the right triangle shares. Normals face the
    ray's origin. t is NaN for a triangle without an area or a ray in its plane.
    """
    corners = geometry.corners(prim, shape)
    found = meet_triangles_on_host(origin, directions, corners)
    t = np.where(found.met, found.t, np.nan)
    place = origin[:, None] + t * directions
    beyond = np.flatnonzero(found.met & ~found.inside)
    weights = np.maximum(found.weights[:, beyond], 0)
    weights /= weights.sum(axis=0)
    place[:, beyond] = sum(
        w * corner[:, beyond] for w, corner in zip(weights, corners, strict=True)
    )
    return t, place, np.asarray(found.normal)
