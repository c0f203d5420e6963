"""Scenes from a built-in name, a Mitsuba file or a dictionary, ready to cast rays against."""

import logging
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from asmjax.buffers import EXACT_IDS, EyeBuffer
from asmjax.errors import UseError, file_errors, unknown_name
from asmjax.geometry import NO_LAMP, LightFrame
from asmjax.memory import Limit, Memory, Stage, check, limit_of
from asmjax.render.caster import MitsubaRays
from asmjax.render.emitters import SceneLight, read_emitters
from asmjax.render.eye import cast_eye
from asmjax.render.frames import Frames
from asmjax.render.geometry import SceneGeometry, box_of, read_geometry
from asmjax.render.instances import Instancing, find_instances, known_instances
from asmjax.render.parsed import ParsedScene
from asmjax.render.sensors import plugin_names, read_sensors
from asmjax.render.soft_truth import SoftShadowRays
from asmjax.render.spec_shapes import mitsuba_shape, spec_bounds
from asmjax.render.truth import ShadowRays
from asmjax.render.untrusted import admit
from asmjax.render.variant import activate
from asmjax.render.working_frame import WORLD, WorkingFrame, working_frame
from asmjax.scene.analytic_rays import scene_bounds
from asmjax.scene.builtin import BUILTIN, asked_triangles, is_builtin, load_builtin
from asmjax.scene.file_names import shown
from asmjax.scene.lights import Eyes, kept_light_frame, light_frame
from asmjax.scene.soft_visibility import REPEATS, STRATA
from asmjax.scene.spec import LightSpec, Mesh, SceneSpec, ViewSpec, pick

_log = logging.getLogger("asmjax")

TRIANGLE = Memory(host=20, renderer=150)
"""Of a triangle that is loaded: its mesh, and the tree in which rays find it. 108 to 163 bytes were
measured (surface of 2.5 million, terrain)."""

MOST_MOVES = 3
"""Times that a scene file is moved before its frame is taken as it is."""


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """A scene that rays can be cast against.

    Attributes:
        name: built-in name or file stem.
        views, lights: by name, the first of each is the default.
        notices: what of the scene is simulated differently from what it says.
        geometry: triangles on the host.
        variant: the Mitsuba variant that casts.
        shape_names: a name for each shape, in scene order.
        path: key views of the scene's own walkthrough; empty where it has none.
        working: the frame in which the renderer casts rays; everything else is in the world's.
    """

    name: str
    views: dict[str, ViewSpec]
    lights: dict[str, SceneLight]
    notices: tuple[str, ...]
    geometry: SceneGeometry
    variant: str
    shape_names: tuple[str, ...]
    path: tuple[ViewSpec, ...]
    working: WorkingFrame
    _mi: Any
    _scene: Any
    _rays: MitsubaRays
    _instancing: Instancing
    _without: dict[int, MitsubaRays] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"Scene('{self.name}', {self.geometry.triangles} triangles, "
            f"views: {', '.join(self.views)}; lights: {', '.join(self.lights)})"
        )

    def view(self, wanted: str | int | None = None) -> ViewSpec:
        """The view of that name or index. Raises `UseError` where there is none."""
        return pick("view (sensor)", self.views, wanted, self.name)

    def light(self, wanted: str | int | None = None) -> LightSpec:
        """The light of that name or index. Raises `UseError` where there is none."""
        return self._light(wanted).spec

    def _light(self, wanted: str | int | None) -> SceneLight:
        return pick("light (emitter)", self.lights, wanted, self.name)

    def eye(
        self,
        view: ViewSpec | str | int | None = None,
        offset: tuple[float, float] = (0.0, 0.0),
    ) -> EyeBuffer:
        """The eye's image of a view, or of that of a name or index, sampled `offset` pixels away
        from the pixel centres.

        Raises `UseError` where there is no such view, or it sees nothing.
        """
        view = view if isinstance(view, ViewSpec) else self.view(view)
        buffer = cast_eye(self._rays, self.geometry, view.camera(), offset)
        if not buffer.valid.any():
            raise UseError(
                f"view '{view.name}' of scene '{self.name}' sees no surface; choose another "
                "`view` or `sensor`."
            )
        return buffer

    def light_rays(self, light: str | int | None = None) -> MitsubaRays:
        """What casts the rays of a light: everything but the lamp that carries it."""
        lamp = self._light(light).shape
        if lamp is None:
            return self._rays
        if lamp not in self._without:
            self._without[lamp] = self._rays_without(lamp)
        return self._without[lamp]

    def light_rays_memory(self, light: str | int | None = None) -> Memory:
        """What `light_rays` of a light will take: without its lamp the scene is another one, with
        a tree of its own in which rays find triangles."""
        lamp = self._light(light).shape
        if lamp is None or lamp in self._without:
            return Memory()
        return self.geometry.faces.shape[1] * Memory(renderer=TRIANGLE.renderer)

    def _rays_without(self, lamp: int) -> MitsubaRays:
        shapes = self._scene.shapes()
        casters = {f"shape{i}": s for i, s in enumerate(shapes) if i != lamp}
        groups = {f"group{k}": group for k, group in enumerate(self._instancing.groups)}
        scene = self._mi.load_dict({"type": "scene", **groups, **casters}, optimize=False)
        others = [i for i in range(len(shapes)) if i != lamp]
        return MitsubaRays(
            self._mi, scene, others, self.geometry, self._instancing, self.working, lamp
        )

    def light_frame(self, eye: Eyes, light: str | int | None = None) -> LightFrame:
        """The light frame that serves the receivers of the eye, or of all samples of its pixels."""
        return self._of_lamp(light_frame(self.light(light), eye, self.geometry.bounds), light)

    def kept_light_frame(
        self, previous: LightFrame | None, eye: Eyes, light: str | int | None = None
    ) -> LightFrame:
        """`previous` while it serves the eye's receivers; see `asmjax.scene.lights`."""
        frame = kept_light_frame(previous, self.light(light), eye, self.geometry.bounds)
        return self._of_lamp(frame, light)

    def _of_lamp(self, frame: LightFrame, light: str | int | None) -> LightFrame:
        """The frame, which knows the lamp of its light; itself where it does."""
        shape = self._light(light).shape
        lamp = NO_LAMP if shape is None else shape
        return frame if frame.lamp == lamp else replace(frame, lamp=lamp)

    def with_light(self, moved: LightSpec, light: str | int | None = None) -> "Scene":
        """The same scene with that light in another place."""
        old = self._light(light)
        lights = {
            name: replace(item, spec=moved) if item is old else item
            for name, item in self.lights.items()
        }
        return replace(self, lights=lights)

    def shadow_rays(self, eye: EyeBuffer, frame: LightFrame, rays: MitsubaRays) -> ShadowRays:
        """One shadow ray per eye pixel: truth, and the yardstick of time. Raises `UseError` where
        frame and rays are of different lights."""
        return ShadowRays(self.geometry, eye, frame, rays)

    def soft_rays(
        self,
        eye: EyeBuffer,
        frame: LightFrame,
        rays: MitsubaRays,
        strata: int = STRATA,
        repeats: int = REPEATS,
        seed: int | tuple[int, ...] = 0,
    ) -> SoftShadowRays:
        """`repeats` shadow rays per eye pixel to each of `strata` x `strata` cells of the light:
        soft truth, with its own error. Raises `UseError` for a light without a size, and where
        frame and rays are of different lights."""
        return SoftShadowRays(self.geometry, eye, frame, rays, strata, repeats, seed)


def load_scene(
    source: str | os.PathLike | dict | SceneSpec,
    variant: str | None = None,
    trust: bool = False,
    limit: Limit | None = None,
) -> Scene:
    """A scene by built-in name, path of a Mitsuba XML file, Mitsuba dictionary or `SceneSpec`.

    Shapes are kept apart (`optimize=False`). A scene far from the origin, very small or very large
    is cast in a frame of its own (`asmjax.render.working_frame`). The Mitsuba variant is chosen on
    the first call of the process (see `asmjax.render.variant`).

    Args:
        trust: take a scene file as it is, unchecked: it may then crash the process, read any file,
            or run code of its own (docs/scene_files.md).
        limit: of main memory; `asmjax.memory.limit_of()` if None. Dictionaries and scene files that
            are taken as they are may pass it: nobody knows their size before.

    Raises:
        UseError: unknown name, missing, malformed or hostile file, a scene without shapes, or one
            that takes more memory than the limit leaves.
    """
    limit = limit_of() if limit is None else limit
    if isinstance(source, SceneSpec):
        return _from_spec(activate(variant), source, limit)
    if isinstance(source, dict):
        mi = activate(variant)
        return _from_mitsuba("dict", ParsedScene(mi, source, "the scene dictionary"), mi)
    name = os.fspath(source)
    if is_builtin(name):
        check([Stage(f"scene '{name}'", asked_triangles(name) * TRIANGLE)], limit)
        return _from_spec(activate(variant), load_builtin(name), limit)
    path = scene_file(name)
    mi = activate(variant)
    admitted = None if trust else admit(path, variant, limit.room)
    if admitted is not None:
        check([Stage(f"scene {shown(path.name)}", Memory(renderer=admitted.bytes))], limit)
    parsed = ParsedScene(mi, path, f"scene file '{name}'")
    if admitted is not None:
        parsed.check_documents(admitted.files.documents)
    return _from_mitsuba(path.stem, parsed, mi)


def scene_file(name: str) -> Path:
    """The scene file of that name. Raises `UseError` where there is none; of a mere word
    with the nearest built-in name."""
    path = Path(name)
    remedy = "give a built-in name or the path of a Mitsuba .xml file"
    with file_errors(f"the scene '{name[:80]}' cannot be read", remedy):
        exists, folder, file = path.exists(), path.is_dir(), path.is_file()
    if path.suffix == "" and not exists and "/" not in name:
        raise unknown_name(
            "scene", name, BUILTIN, "A path of a Mitsuba scene file (.xml) works too."
        )
    if name and folder:
        raise UseError(f"'{name}' is a folder; give the path of a Mitsuba .xml file.")
    if not file:
        raise UseError(f"there is no scene file '{name}'; give the path of a Mitsuba .xml file.")
    return path


def _from_mitsuba(name: str, parsed: ParsedScene, mi) -> Scene:
    said, groups = parsed.properties(), parsed.shown_groups()
    can_move, can_scale = parsed.can_move, parsed.can_scale
    scene, frames, notices = parsed.made(WORLD), Frames(), []
    if not hasattr(scene, "shapes") or not scene.shapes():
        raise UseError(f"scene '{name}' has no shapes; asmjax needs surfaces to cast shadows on.")
    better = frames.better(mi, scene, groups)
    odd = (
        f"scene '{name}' or a shape group of it is far from the origin, very small or very large, "
        "or has spheres that its instances shrink"
    )
    if better != frames and not can_scale:
        notices.append(
            f"{odd}, and there are curves, whose radii cannot be scaled: it is moved to the "
            "origin, and rays may lose digits"
        )
    if better != frames and not can_move:
        notices.append(
            f"{odd}, and there are shapes that were made before or stand in several places: rays "
            "are cast where it is, and lose digits there"
        )
        better = frames
    # Far away a box is known roughly only, and better once the scene was moved.
    for _ in range(MOST_MOVES):
        better = better if can_scale else better.unscaled()
        if better == frames:
            break
        scene, frames = parsed.made(better.working, better.groups), better
        better = frames.better(mi, scene, groups)
    working = frames.working
    instancing = find_instances(mi, scene, name, groups)
    low, high = _finite(name, box_of(scene.bbox(), working)).T
    views = read_sensors(mi, scene.sensors(), notices, said, float(np.linalg.norm(high - low)))
    lights = read_emitters(mi, scene, notices, said, working)
    names = plugin_names(scene.shapes(), "shape")
    return _scene(mi, name, scene, instancing, views, lights, notices, names, working=working)


def _finite(name: str, bounds: np.ndarray) -> np.ndarray:
    if not np.isfinite(bounds).all():
        raise UseError(
            f"scene '{name}' has no finite bounding box; mend its vertices and transforms."
        )
    return bounds


def _from_spec(mi, spec: SceneSpec, limit: Limit) -> Scene:
    kept = sum(shape.faces.shape[1] for shape in spec.shapes if isinstance(shape, Mesh))
    kept += sum(mesh.faces.shape[1] for part in spec.instances for mesh in part.meshes)
    check([Stage(f"scene '{spec.name}'", kept * TRIANGLE)], limit)
    working = working_frame(spec_bounds(spec))
    parts = {f"shape{i}": mitsuba_shape(mi, s, working) for i, s in enumerate(spec.shapes)}
    names = [shape.name for shape in spec.shapes]
    groups, group = [], [-1] * len(names)
    for k, instances in enumerate(spec.instances):
        own = working_frame(scene_bounds(instances.meshes))
        meshes = {f"mesh{i}": mitsuba_shape(mi, m, own) for i, m in enumerate(instances.meshes)}
        groups.append(mi.load_dict({"type": "shapegroup", **meshes}))
        parts[f"group{k}"] = groups[-1]
        transforms = own.places_from(np.moveaxis(instances.transforms, 0, 2))
        placed = working.places_inward(transforms)
        for i, matrix in enumerate(np.moveaxis(placed, 2, 0)):
            to_world = mi.ScalarTransform4f(np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]]))
            parts[f"instance{k}_{i}"] = {
                "type": "instance", "shapegroup": groups[-1], "to_world": to_world
            }  # fmt: skip
            names.append(f"{instances.name}_{i}")
            group.append(k)
    scene = mi.load_dict({"type": "scene", **parts}, optimize=False)
    instancing = known_instances(mi, groups, group)
    lights = {name: SceneLight(light) for name, light in spec.lights.items()}
    return _scene(
        mi, spec.name, scene, instancing, dict(spec.views), lights, [], names, spec.path, working
    )  # fmt: skip


def _scene(
    mi, name, scene, instancing, views, lights, notices, shape_names, path=(), working=WORLD
) -> Scene:
    geometry = read_geometry(mi, scene.shapes(), scene.bbox(), instancing, working)
    primitives = int(geometry.first_prim[-1])
    if primitives > EXACT_IDS:
        notices.append(
            f"scene '{name}' has {primitives:,} primitives, and maps that compare ids keep 16 bits "
            f"of each: of pixels in shadow one in {EXACT_IDS:,} may be lit by mistake (none with "
            'compare = "depth")'
        )
    for notice in notices:
        _log.warning("%s", notice)
    _finite(name, geometry.bounds)
    every = list(range(len(scene.shapes())))
    return Scene(
        name=name,
        views=views,
        lights=lights,
        notices=tuple(notices),
        geometry=geometry,
        variant=mi.variant(),
        shape_names=tuple(shape_names),
        path=tuple(path),
        working=working,
        _mi=mi,
        _scene=scene,
        _rays=MitsubaRays(mi, scene, every, geometry, instancing, working),
        _instancing=instancing,
    )
