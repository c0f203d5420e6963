"""One view under one light with its truth, and what any map makes of it."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.experiment import Measured, measure, measure_rays
from asmjax.experiment.aliasing import AliasingMaps, aliasing_maps, aliasing_numbers
from asmjax.experiment.displacement import displacement
from asmjax.geometry import LightFrame
from asmjax.metrics import error_summary, surface_pairs
from asmjax.render.caster import MitsubaRays
from asmjax.render.load import Scene, load_scene
from asmjax.scene.other_scenes import OTHER_SCENES, other_scene, why_left_out
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import ShadowAlgorithm
from tr05.sizes import Analysis

COLUMNS = """<scene version="3.0.0">
<sensor type="perspective" id="along_the_columns">
<float name="fov" value="50"/>
<transform name="to_world"><lookat origin="90, 7, 12" target="20, -3, 4" up="0, 1, 0"/></transform>
</sensor>
<emitter type="directional" id="sun"><vector name="direction" x="0.25" y="-0.5" z="0.83"/></emitter>
<shape type="ply" id="columns">
<string name="filename" value="{mesh}"/>
<boolean name="face_normals" value="true"/>
<bsdf type="twosided"><bsdf type="diffuse">
<rgb name="reflectance" value="0.62, 0.58, 0.52"/>
</bsdf></bsdf>
</shape>
</scene>
"""
"""A sun across 900 units of columns, y up, and an eye beside the first of them."""


@dataclass(frozen=True, eq=False)
class Setting:
    """A view, a light, and the shadow rays of both.

    Attributes:
        truth: the traced rays, with their time.
        far_near: ratio of the largest to the smallest eye depth that is seen.
        angle_deg: between the light's direction and the view's, where light is parallel.
    """

    scene: Scene
    light: LightSpec
    eye: EyeBuffer
    frame: LightFrame
    rays: MitsubaRays
    truth: Measured

    @property
    def far_near(self) -> float:
        depth = self.eye.depth[self.eye.valid]
        return float(depth.max() / depth.min())

    @property
    def angle_deg(self) -> float:
        cosine = self.frame.rotation[0, 2] @ self.eye.camera.rotation[2]
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))

    def record(self) -> dict:
        """What it is, in plain values."""
        return {
            "scene": self.scene.name,
            "triangles": self.scene.geometry.triangles,
            "light": self.light.name,
            "far_near": self.far_near,
            "angle_deg": self.angle_deg,
            "pixels": list(self.eye.size),
        }


def scene_of(analysis: Analysis, name: str) -> Scene | None:
    """A scene by name; None, and a reason in the record, where its file is not there."""
    if name not in OTHER_SCENES:
        return load_scene(name)
    path = other_scene(name)
    if path is None:
        analysis.record["skipped"][name] = why_left_out(name)
        return None
    if path.suffix == ".xml":
        return load_scene(path)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.xml"
        file.write_text(COLUMNS.format(mesh=path), encoding="utf-8")
        return load_scene(file)


def setting_of(
    scene: Scene, view: ViewSpec, repeats: int = 1, light: LightSpec | None = None
) -> Setting:
    """`scene` seen by `view`, under its first light or under `light` instead of it."""
    if light is not None:
        scene = scene.with_light(light)
    eye = scene.eye(view)
    frame, rays = scene.light_frame(eye), scene.light_rays()
    truth = measure_rays([scene.shadow_rays(eye, frame, rays)], [eye], repeats)
    return Setting(scene, scene.light(), eye, frame, rays, truth)


def sun_along(view: ViewSpec, degrees: float) -> LightSpec:
    """Parallel light that far off the view's direction, falling as seen by the eye."""
    _, down, forward = view.camera().rotation
    angle = np.radians(degrees)
    x, y, z = (np.cos(angle) * forward + np.sin(angle) * down).tolist()
    return LightSpec(f"{degrees:g}° off the view", "directional", direction=(x, y, z))


@dataclass(frozen=True, eq=False)
class Row:
    """What a map makes of a setting.

    Attributes:
        numbers: for the record, by name.
        visibility: (n,) of the pixels.
        maps: its texels beside the pixels.
    """

    numbers: dict
    visibility: np.ndarray
    maps: AliasingMaps


def measured_row(setting: Setting, algorithm: ShadowAlgorithm, repeats: int = 1) -> Row:
    """Build, query, and compare with truth and with the pixels."""
    eye = setting.eye
    found = measure(algorithm, [eye], setting.frame, setting.rays, repeats)
    maps = aliasing_maps(algorithm, found.state, eye, setting.frame)
    numbers = aliasing_numbers(maps, found.cost.texels)
    moved = displacement(setting.truth.visibility, found.visibility, eye, maps)
    pairs = surface_pairs(
        eye.valid.reshape(eye.size), np.where(eye.valid, eye.depth, 1.0).reshape(eye.size)
    )
    error = error_summary(
        setting.truth.visibility.reshape(eye.size),
        found.visibility.reshape(eye.size),
        eye.valid.reshape(eye.size),
        pairs,
    )
    row = {
        "name": found.name,
        "bytes": found.cost.bytes,
        "seconds": found.cost.seconds,
        "status": found.status.name.lower(),
        "wrong": error["misclassified_fraction"],
        "wrong_per_edge_pixel": error["boundary_displacement_px"]["per_edge_length"],
        "mean_displacement": error["boundary_displacement_px"]["mean"],
        "predicted": moved.predicted,
        "measured": moved.measured,
        "edge_pixels": moved.length,
        "edge_share": moved.share,
        "worst_depth": _worst_depth(eye, maps),
        **numbers.record(),
    }
    return Row(row, found.visibility, maps)


def _worst_depth(eye: EyeBuffer, maps: AliasingMaps) -> float:
    """Eye depth at which the perspective factor is largest, in the smallest depth that is seen."""
    if not maps.known.any():
        return 0.0
    worst = int(np.nanargmax(maps.perspective))
    return float(eye.depth[worst] / eye.depth[eye.valid].min())


def at_size(view: ViewSpec, pixels: int) -> ViewSpec:
    """`view` as a square image."""
    return view.resized(pixels, pixels)


def from_above_ground(view: ViewSpec, height: float, near: float) -> ViewSpec:
    """`view` from another height, with what is nearer than `near` left out."""
    x, y, _ = view.origin
    return replace(view, origin=(x, y, height), near=near)
