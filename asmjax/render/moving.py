"""Shapes of a scene that move: new vertices, new boxes, and the renderer told of both."""

from dataclasses import replace

import numpy as np

from asmjax.errors import UseError, require, unknown_name
from asmjax.render.caster import MitsubaRays
from asmjax.render.geometry import SceneGeometry, box_of, read_quadrics
from asmjax.render.instances import is_instance
from asmjax.render.load import Scene
from asmjax.render.working_frame import WorkingFrame

LARGEST_OBJECT = 0.5
"""A shape whose diagonal is more than this part of the scene's is its surroundings, no object."""

_VERTICES = "vertex_positions"
"""Parameter of meshes; rectangles are meshes too, but know a transform instead."""


class MovingShapes:
    """One object of a scene, made of one or several shapes, and its way to other places.

    Args:
        scene: the scene at rest.
        wanted: a name of `scene.shape_names`, or what several of them have before a "_"
            (`robot` for `robot_shell` and `robot_joints`), or an index; None chooses the finest
            mesh that is no larger than half the scene.

    Attributes:
        name: of the shapes that move.
        diagonal: of the object's box, scene units.

    Raises:
        UseError: no such shape, none that could move, or an instance of a shape group.
    """

    def __init__(self, scene: Scene, wanted: str | None = None):
        self._scene = scene
        self.shapes = _chosen(scene, wanted)
        self.name = ", ".join(scene.shape_names[k] for k in self.shapes)
        shapes = scene._scene.shapes()
        self._movable = [shapes[k] for k in self.shapes]
        lamps = {light.shape for light in scene.lights.values()}
        for k in self.shapes:
            require(
                k not in lamps,
                f"'{scene.shape_names[k]}' is a lamp, whose light would stay behind; choose "
                "another `object`, or `motion` light.",
            )
            require(
                not is_instance(shapes[k]),
                f"'{scene.shape_names[k]}' is an instance of a shape group, and those cannot be "
                "moved; choose another `object`, or write it out as a shape of its own.",
            )
        self._rest = [_place(scene._mi, shape) for shape in self._movable]
        self._offset = np.zeros(3)
        boxes = self._boxes()
        low, high = boxes[:, :, 0].min(axis=0), boxes[:, :, 1].max(axis=0)
        self.diagonal = float(np.linalg.norm(high - low))

    def at(self, offset: np.ndarray) -> tuple[Scene, np.ndarray | None]:
        """The scene with the object `offset` (3,) away from its rest, in scene units.

        Also the boxes (k, 3, 2) float64 that the object left and that it is in now, min and max
        per axis; None if it did not move. The renderer's scene is changed in place: scenes and
        light rays that were made before are to be used no more.
        """
        mi, renderer = self._scene._mi, self._scene._scene
        if np.array_equal(offset, self._offset):
            return self._scene, None
        before, scale = self._boxes(), self._scene.working.scale
        for shape, rest in zip(self._movable, self._rest, strict=True):
            _move(mi, shape, rest, scale * np.asarray(offset))
        self._offset = np.array(offset, np.float64)
        # Shapes that changed are dirty; this rebuilds what rays are cast against.
        renderer.parameters_changed([])
        boxes = np.concatenate([before, self._boxes()])
        shapes, working = renderer.shapes(), self._scene.working
        instancing = self._scene._instancing
        geometry = replace(
            _with_vertices(self._scene.geometry, shapes, self.shapes, renderer, working),
            quadrics=read_quadrics(mi, shapes, instancing, working),
        )
        rays = MitsubaRays(mi, renderer, list(range(len(shapes))), geometry, instancing, working)
        self._scene = replace(self._scene, geometry=geometry, _rays=rays, _without={})
        return self._scene, boxes

    def _boxes(self) -> np.ndarray:
        """(k, 3, 2) float64, world, of the shapes that move."""
        working = self._scene.working
        return np.stack([box_of(shape.bbox(), working) for shape in self._movable])


def _chosen(scene: Scene, wanted: str | None) -> list[int]:
    names = scene.shape_names
    if wanted is None:
        shapes = scene._scene.shapes()
        low, high = scene.geometry.bounds.T
        most = LARGEST_OBJECT * np.linalg.norm(high - low)
        boxes = [box_of(shape.bbox(), scene.working) for shape in shapes]
        sizes = [np.linalg.norm(np.diff(box, axis=1)) for box in boxes]
        still = {light.shape for light in scene.lights.values()}
        still |= {k for k, shape in enumerate(shapes) if is_instance(shape)}
        objects = [k for k, size in enumerate(sizes) if 0 < size <= most and k not in still]
        if not objects:
            raise UseError(
                f"scene '{scene.name}' has no shape of its own that could move: every one is "
                "larger than half the scene; name one with `object`."
            )
        return [max(objects, key=lambda k: shapes[k].primitive_count())]
    if wanted in names:
        return [names.index(wanted)]
    parts = [k for k, name in enumerate(names) if name.startswith(f"{wanted}_")]
    if parts:
        return parts
    if wanted.isdecimal() and int(wanted) < len(names):
        return [int(wanted)]
    raise unknown_name("object", wanted, names, f"Indices 0 to {len(names) - 1} work too.")


def _with_vertices(
    geometry: SceneGeometry, shapes, moved: list[int], renderer, working: WorkingFrame
) -> SceneGeometry:
    """`geometry` with the vertices of the moved shapes and the scene's box as they are now."""
    counts = [shape.vertex_count() if shape.is_mesh() else 0 for shape in shapes]
    first = np.concatenate([[0], np.cumsum(counts)])
    vertices = geometry.vertices.copy()
    for k in moved:
        if counts[k]:
            flat = np.array(shapes[k].vertex_positions_buffer(), np.float64)
            vertices[:, first[k] : first[k + 1]] = working.outward(flat.reshape(-1, 3).T)
    return replace(geometry, vertices=vertices, bounds=box_of(renderer.bbox(), working))


def _place(mi, shape) -> np.ndarray:
    """Vertices (n, 3) of a mesh, the (4, 4) transform of any other shape; float64, in the frame in
    which the shape stands."""
    params = mi.traverse(shape)
    if _VERTICES in params:
        return np.array(params[_VERTICES], np.float64).reshape(-1, 3)
    if "to_world" not in params:
        raise UseError(
            f"a shape of type {shape.class_name()} cannot be moved; choose another `object`."
        )
    return np.array(params["to_world"].matrix, np.float64).reshape(4, 4)


def _move(mi, shape, rest: np.ndarray, offset: np.ndarray) -> None:
    params = mi.traverse(shape)
    if _VERTICES in params:
        params[_VERTICES] = (rest + offset).astype(np.float32).ravel()
    else:
        moved = rest.copy()
        moved[:3, 3] += offset
        params["to_world"] = type(params["to_world"])(moved)
    params.update()
