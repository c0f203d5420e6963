"""Views of analytic scenes as planning takes them, and what planning casts at them."""

from collections.abc import Sequence

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.effects import LightAsked, SceneAsked, probe_size
from asmjax.errors import UseError
from asmjax.scene.analytic import primitive_offsets
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import AnalyticScene
from asmjax.scene.lights import light_frame
from asmjax.scene.materials import Materials, Surroundings, opaque_materials
from asmjax.scene.spec import LightSpec, ViewSpec

CLOSE = 0.05
"""How near to a threshold a decision must flip: relative."""


class CountedRays(LightRays):
    """Passes everything on; counts rays by who asked for them."""

    def __init__(self, inner: LightRays):
        self.inner = inner
        self.single = self.texels = self.occlusion = 0

    def closest(self, origins, directions, t_min=0.0):
        self.single += directions.shape[1]
        return self.inner.closest(origins, directions, t_min)

    def occluded(self, origins, directions, t_max):
        self.occlusion += directions.shape[1]
        return self.inner.occluded(origins, directions, t_max)

    def light_buffer(self, frame, windows):
        self.texels += windows.texels
        return self.inner.light_buffer(frame, windows)

    @property
    def all(self) -> int:
        return self.single + self.texels + self.occlusion


def asked_about(
    scene: AnalyticScene,
    lights: Sequence[LightSpec],
    *,
    view: ViewSpec | None = None,
    side: int = 512,
    materials: Materials | None = None,
    surroundings: Sequence[Surroundings] = (),
    rays: LightRays | None = None,
    chosen: Sequence[str] = (),
) -> SceneAsked:
    """A view of `side` x `side` pixels of an analytic scene under other lights."""
    shapes = scene.spec.shapes
    view = (view or next(iter(scene.spec.views.values()))).resized(side, side)
    eye = analytic_eye(shapes, view.resized(*probe_size(side, side)))
    caster = rays or AnalyticRays(shapes)
    return SceneAsked(
        name=scene.spec.name,
        view=view,
        eye=eye,
        lights=[_asked(light, eye, shapes, caster) for light in lights],
        rays=caster,
        first_prim=primitive_offsets(shapes),
        materials=materials or opaque_materials(len(shapes)),
        surroundings=surroundings,
        chosen=chosen,
    )


def _asked(light: LightSpec, eye: EyeBuffer, shapes, rays: LightRays) -> LightAsked:
    try:
        return LightAsked(light, light_frame(light, eye, scene_bounds(shapes)), lambda: rays)
    except UseError as problem:
        return LightAsked(light, None, lambda: rays, str(problem))


def on_image(view: ViewSpec, points: np.ndarray) -> np.ndarray:
    """Pixels (2, n), right and down, at which a view sees world points (3, n)."""
    camera = view.camera()
    right, down, forward = camera.rotation @ (points - camera.origin[:, None])
    return camera.principal[:, None] + camera.focal[:, None] * np.stack(
        [right / forward, down / forward]
    )
