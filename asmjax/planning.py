"""Plans for scenes that are loaded: what a view calls for, asked of the renderer's scene."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from asmjax.effects import (
    TOLERANCE,
    LightAsked,
    Plan,
    Rates,
    SceneAsked,
    plan_lights,
    probe_size,
)
from asmjax.effects.convex import is_convex
from asmjax.errors import UseError
from asmjax.options import PlanOptions
from asmjax.preparation import calibrated
from asmjax.render.load import Scene
from asmjax.render.materials import (
    materials_of,
    rays_to_surroundings,
    stand_in,
    surroundings_of,
    unknown_emitters,
)
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import ALGORITHMS
from asmjax.shadow.adaptive import kept_model, on_this_machine


def plan_effects(
    scene: Scene,
    view: ViewSpec | str | int | None = None,
    tolerance: float = TOLERANCE,
    *,
    force: Mapping[str, str] | None = None,
    lights: Sequence[str] = (),
    moving: bool = False,
    seed: int = 0,
) -> Plan:
    """Which shadow effects a view of a scene calls for, what is skipped, and what is missing.

    Args:
        view: of the scene, or its name or index; the first one without.
        tolerance: part of the picture's light, mean over its pixels, whose change nobody minds.
        force: what to simulate whatever the numbers say, by light ("*" is all others): none, hard,
            or soft (of lights with a size).
        lights: that are decided about, as parts of the light of all; all without.
        moving: whether anything moves between frames.
        seed: of the directions in which the surroundings are looked at.

    Raises:
        UseError: no such view, light or kind, or the view sees nothing.
    """
    spec = view if isinstance(view, ViewSpec) else scene.view(view)
    asked = asked_of(scene, spec, lights, moving)
    return plan_lights(asked, tolerance, force, ALGORITHMS, known_rates(scene), seed)


def asked_of(
    scene: Scene, view: ViewSpec, lights: Sequence[str] = (), moving: bool = False
) -> SceneAsked:
    """A view of a scene with the probe's image of it, ready to be planned for.

    Raises:
        UseError: no such light, or the view sees nothing.
    """
    chosen = frozenset(scene.light(name).name for name in lights)
    eye = scene.eye(view.resized(*probe_size(view.width, view.height)))
    return SceneAsked(
        name=scene.name,
        view=view,
        eye=eye,
        lights=[_light(scene, name, eye) for name in scene.lights],
        rays=rays_to_surroundings(scene),
        first_prim=scene.geometry.first_prim,
        materials=materials_of(scene),
        surroundings=surroundings_of(scene),
        unknown=unknown_emitters(scene),
        lone_convex=_lone_convex(scene, eye.camera.origin),
        moving=moving,
        chosen=chosen,
    )


def _light(scene: Scene, name: str, eye) -> LightAsked:
    spec, spread = scene.light(name), scene.lights[name].spread
    try:
        frame, why = scene.light_frame(eye, name), ""
    except UseError as problem:
        frame, why = None, str(problem)
    rays = partial(scene.light_rays, name)
    return LightAsked(spec, frame, rays, why, stand_in(scene, spec.name), spread)


def _lone_convex(scene: Scene, eye: np.ndarray) -> bool:
    """Whether the scene is one convex mesh and the eye is outside of it."""
    geometry = scene.geometry
    if geometry.first_prim.size != 2 or geometry.to_world is not None:
        return False
    if not geometry.on_mesh(np.arange(geometry.first_prim[-1])).all():
        return False
    return is_convex(geometry.vertices, geometry.faces, eye)


def known_rates(scene: Scene) -> Rates:
    """What things cost: texels as an earlier run measured them on this machine and scene."""
    geometry = scene.geometry
    for item in scene.lights.values():
        what = on_this_machine(
            scene.name, geometry.triangles, geometry.bounds, item.spec.kind, scene.variant
        )
        model = kept_model(what)
        if model is not None:
            return Rates(texel=model.a_seconds_per_texel, measured=True)
    return Rates()


def measured_rates(scene: Scene, asked: SceneAsked, options: PlanOptions) -> Rates:
    """The same, measured now and kept for later; of the first light that shines on anything."""
    for light in asked.lights:
        if light.frame is not None:
            model = calibrated(scene, light.spec, light.rays(), light.frame, options)
            return Rates(texel=model.a_seconds_per_texel, measured=True)
    return Rates()
