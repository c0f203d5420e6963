"""What of a Mitsuba scene lets light through, and which of its emitters surround it."""

from typing import Any

import numpy as np

from asmjax.geometry import AreaLight, sphere_light
from asmjax.render.area_emitters import LUMINANCE
from asmjax.render.caster import MitsubaRays
from asmjax.render.load import Scene
from asmjax.render.sensors import plugin_names
from asmjax.scene.materials import Materials, Surroundings, even_directions

PLACES = 8
"""Places along each side of a texture at which its opacity is looked at."""

SUN_RIM = 1.001
"""Directions so little beyond the rim of a sun's disk, in parts of its radius, count as on it."""

SAME = 1e-3
"""Opacities that differ by less are one."""


def materials_of(scene: Scene) -> Materials:
    """The materials of a scene's shapes; of an instance, what any part of its group lets through.

    A surface passes light straight on as its `eval_null_transmission` says, at right angles and in
    the middle of its texture's cells: masks, null surfaces, thin dielectrics, blends of those.
    """
    mi, instancing = scene._mi, scene._instancing
    # Kept, as ids of Python objects are told apart while these are there only.
    known: dict[int, tuple] = {}
    rows = []
    for shape, group in zip(scene._scene.shapes(), instancing.group.tolist(), strict=True):
        parts = [shape] if group < 0 else instancing.parts[group]
        found = [(*_of_surface(mi, part.bsdf(), known), _inside(mi, part)) for part in parts]
        rows.append([max(values) for values in zip(*found, strict=True)])
    straight, textured, refracts, extinction = np.array(rows, np.float64).T
    return Materials(straight, textured > 0, refracts > 0, extinction)


def _of_surface(mi, bsdf, known: dict[int, tuple]) -> tuple[float, bool, bool]:
    """What passes straight on, whether that differs from place to place, whether light turns."""
    if bsdf is None:
        return 0.0, False, False
    if id(bsdf) not in known:
        flags, bits = mi.BSDFFlags, bsdf.flags()
        turns = flags.DeltaTransmission | flags.GlossyTransmission
        if mi.has_flag(bits, flags.Null):
            values = _straight(mi, bsdf)
            answer = float(values.mean()), bool(np.ptp(values) > SAME), False
        else:
            answer = 0.0, False, bool(bits & int(turns))
        known[id(bsdf)] = bsdf, answer
    return known[id(bsdf)][1]


def _straight(mi, bsdf) -> np.ndarray:
    """Part of the light (PLACES^2,) that passes at right angles, over the unit square of uv."""
    at = (np.arange(PLACES) + 0.5) / PLACES
    uv = np.stack([np.tile(at, PLACES), np.repeat(at, PLACES)])
    if mi.variant().startswith("scalar"):
        return np.concatenate([_luminance(_passed(mi, bsdf, pair)) for pair in uv.T.tolist()])
    # A constant comes back once.
    return np.broadcast_to(_luminance(_passed(mi, bsdf, uv.astype(np.float32))), uv[0].shape)


def _passed(mi, bsdf, uv):
    import drjit as dr

    hit = dr.zeros(mi.SurfaceInteraction3f)
    hit.uv, hit.wi = mi.Point2f(*uv), mi.Vector3f(0, 0, 1)
    return bsdf.eval_null_transmission(hit)


def _inside(mi, shape) -> float:
    """The largest extinction of the medium inside a shape, per scene unit."""
    import drjit as dr

    medium = shape.interior_medium() if shape.is_medium_transition() else None
    if medium is None:
        return 0.0
    return float(_luminance(medium.get_majorant(dr.zeros(mi.MediumInteraction3f))).max())


def surroundings_of(scene: Scene) -> tuple[Surroundings, ...]:
    """The emitters all around a scene, with their radiance from all sides."""
    return tuple(
        _seen_around(scene._mi, name, emitter, _sun_of(scene, name))
        for name, emitter in _emitters(scene)
        if emitter.is_environment()
    )


def _sun_of(scene: Scene, name: str) -> AreaLight | None:
    """The sun of a sky that is a light of the scene too."""
    return scene.lights[name].spec.area if name in scene.lights else None


def unknown_emitters(scene: Scene) -> tuple[str, ...]:
    """Names of the emitters that are neither lights of the scene nor around it."""
    return tuple(
        name
        for name, emitter in _emitters(scene)
        if name not in scene.lights and not emitter.is_environment()
    )


def _emitters(scene: Scene) -> list[tuple[str, Any]]:
    emitters = scene._scene.emitters()
    return [*zip(plugin_names(emitters, "light"), emitters, strict=True)]


def stand_in(scene: Scene, light: str) -> AreaLight | None:
    """For a lamp that a point stands for, a sphere that looks as large, on average over directions
    if the lamp is convex (Cauchy: a quarter of its surface); None for all other lights."""
    item = scene.lights[light]
    if item.shape is None or item.spec.area is not None:
        return None
    surface = float(np.array(scene._scene.shapes()[item.shape].surface_area()).ravel()[0])
    radius = float(np.sqrt(surface / (4 * np.pi))) / scene.working.scale
    return sphere_light(item.spec.position, radius) if radius > 0 else None


def rays_to_surroundings(scene: Scene) -> MitsubaRays:
    """What casts rays against all shapes, lamps too."""
    return scene._rays


def _seen_around(mi, name: str, emitter, sun: AreaLight | None) -> Surroundings:
    """What the emitter brings from each direction; not from those of its own `sun`, which is a
    light by itself."""
    directions = even_directions()
    if sun is not None:
        off = -sun.normal @ directions < np.cos(SUN_RIM * np.arctan(sun.radius))
        directions = directions[:, off]
    if mi.variant().startswith("scalar"):
        seen = [_luminance(_towards(mi, emitter, one)) for one in directions.T.tolist()]
        return Surroundings(name, directions, np.concatenate(seen))
    seen = _luminance(_towards(mi, emitter, directions.astype(np.float32)))
    # A constant comes back once.
    return Surroundings(name, directions, np.broadcast_to(seen, directions[0].shape))


def _towards(mi, emitter, direction):
    import drjit as dr

    hit = dr.zeros(mi.SurfaceInteraction3f)
    hit.wi = -mi.Vector3f(*direction)
    return emitter.eval(hit)


def _luminance(colour) -> np.ndarray:
    """(k,) float64 of a colour of the renderer."""
    parts = [np.array(part, np.float64).ravel() for part in colour]
    return np.sum([w * part for w, part in zip(LUMINANCE, parts, strict=True)], axis=0)
