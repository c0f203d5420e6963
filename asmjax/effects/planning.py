"""Making a plan: looking at the lights of a view, no closer than the decisions need.

A light below the tolerance gets no ray, a light without size no search for blockers, an opaque
scene no rays through casters, and surroundings that hardly shine none either.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.effects import probe, widths
from asmjax.effects.decide import FAMILIES, TOLERANCE, Rates, check_force, decide_light
from asmjax.effects.plan import LightSeen, Plan
from asmjax.effects.records import LightNumbers, NotSimulated, Outcome, Skipped, percent
from asmjax.geometry import LightFrame
from asmjax.scene.materials import Materials, Surroundings
from asmjax.scene.spec import LightSpec, ViewSpec


@dataclass(frozen=True, eq=False)
class LightAsked:
    """A light that is planned for.

    Attributes:
        spec: what it is.
        frame: for what the probe sees; None where it shines on nothing there.
        rays: makes what casts its rays, when they are needed.
        why: there is no frame.
    """

    spec: LightSpec
    frame: LightFrame | None
    rays: Callable[[], LightRays]
    why: str = ""


@dataclass(frozen=True, eq=False)
class SceneAsked:
    """A view of a scene that is planned for.

    Attributes:
        name: of the scene.
        view: at the size of the picture.
        eye: the probe's image of it (`probe_size`).
        lights: to plan for.
        rays: against everything, for the surroundings.
        first_prim: (n_shapes + 1,) first primitive of each shape, and their number.
        materials: of the shapes.
        surroundings: emitters all around.
        lone_convex: whether one convex object is all there is.
        moving: whether anything moves between frames.
    """

    name: str
    view: ViewSpec
    eye: EyeBuffer
    lights: Sequence[LightAsked]
    rays: LightRays
    first_prim: np.ndarray
    materials: Materials
    surroundings: Sequence[Surroundings] = ()
    lone_convex: bool = False
    moving: bool = False


def plan_lights(
    asked: SceneAsked,
    tolerance: float = TOLERANCE,
    force: Mapping[str, str] | None = None,
    available: Collection[str] = FAMILIES,
    rates: Rates | None = None,
    seed: int = 0,
) -> Plan:
    """The plan of a view; the same arguments give the same plan.

    Args:
        tolerance: part of the light, mean over the picture, whose change nobody minds.
        force: what to do about a light, by name, or "*" for all others: none, hard, soft or all.
        available: families of shadow algorithms that are registered.
        rates: what things cost.
        seed: of the directions in which the surroundings are looked at.

    Raises:
        UseError: `force` names no light or effect, or the tolerance is below 0.
    """
    force = dict(force or {})
    check_force(force, [light.spec.name for light in asked.lights])
    rates = rates or Rates()
    eye = asked.eye
    paths = [
        None if light.frame is None else probe.light_paths(eye, light.frame)
        for light in asked.lights
    ]
    parts, notes = _parts(asked, paths)
    sky, cast = _surroundings(asked, parts, tolerance, seed)
    order = sorted(range(len(paths)), key=lambda k: -float(parts[k][eye.valid].mean()))
    outcomes, numbers, seen = [], [], []
    for k in order:
        light = asked.lights[k]
        chosen = force.get(light.spec.name, force.get("*"))
        known, looked = _numbers(asked, light, paths[k], parts[k], tolerance, chosen)
        outcome = decide_light(known, tolerance, chosen, available, rates)
        if light.frame is None:
            outcome = _because(outcome, light.why)
        outcomes.append(outcome)
        numbers.append(known)
        seen.append(looked)
    return Plan(
        scene=asked.name,
        view=asked.view,
        tolerance=tolerance,
        decisions=tuple(d for outcome in outcomes for d in outcome.decisions),
        skipped=(
            *(item for outcome in outcomes for item in outcome.skipped),
            *_of_scene(asked),
            *sky.skipped,
        ),
        not_simulated=(
            *(item for outcome in outcomes for item in outcome.not_simulated),
            *sky.not_simulated,
        ),
        numbers=tuple(numbers),
        seen=tuple(seen),
        probe_rays=eye.valid.size + cast + sum(known.rays for known in numbers),
        notes=tuple(notes),
        rates=rates,
    )


def _because(outcome: Outcome, why: str) -> Outcome:
    """The outcome of a light that has no frame, with the words of who could not make one."""
    (decision,), (skipped,) = outcome.decisions, outcome.skipped
    return Outcome((replace(decision, reason=why),), (replace(skipped, reason=why),))


def _parts(
    asked: SceneAsked, paths: Sequence[probe.Paths | None]
) -> tuple[list[np.ndarray], list[str]]:
    """What part of the light each light brings to each pixel (n,) where nothing shades it; what
    the surroundings bring comes last. And how that was told, where it was not by brightness."""
    brought = [
        np.zeros(asked.eye.valid.size)
        if path is None or light.frame is None
        else probe.irradiance(light.spec, light.frame, path)
        for light, path in zip(asked.lights, paths, strict=True)
    ]
    around = math.pi * sum(item.radiance for item in asked.surroundings)
    brought.append(np.where(asked.eye.valid, around, 0.0))
    specs = [light.spec for light in asked.lights]
    kinds = {(spec.kind, spec.area is None) for spec in specs}
    if len(kinds) > 1 and around == 0 and all(spec.intensity == 1.0 for spec in specs):
        # Intensity, irradiance and radiance of 1 have nothing to do with each other.
        note = "the scene does not say how bright its lights are: each is planned as if alone"
        return [np.where(light > 0, 1.0, 0.0) for light in brought], [note]
    total = np.sum(brought, axis=0)
    return [light / np.where(total > 0, total, 1.0) for light in brought], []


def _surroundings(
    asked: SceneAsked, parts: Sequence[np.ndarray], tolerance: float, seed: int
) -> tuple[Outcome, int]:
    """What is missing as nothing shades the surroundings, and the rays that told."""
    if not asked.surroundings:
        return Outcome(()), 0
    names, valid = ", ".join(item.name for item in asked.surroundings), asked.eye.valid
    share = float(parts[-1][valid].mean())
    if share < tolerance:
        why = f"'{names}' brings {percent(share)} of the light, below the tolerance"
        return Outcome((), (Skipped(None, "surroundings", why, share),)), 0
    open_, cast = probe.sky_visibility(asked.eye, asked.rays, seed)
    error = float((parts[-1] * (1 - open_))[valid].mean())
    if error < tolerance:
        why = f"hardly anything shades '{names}'"
        return Outcome((), (Skipped(None, "surroundings", why, error),)), cast
    why = (
        f"'{names}' shines from all around and brings {percent(share)} of the light where nothing "
        f"shades it; {percent(float(1 - open_[valid].mean()))} of the sky is hidden"
    )
    return Outcome((), (), (NotSimulated(None, "surroundings", why, error),)), cast


def _numbers(
    asked: SceneAsked,
    light: LightAsked,
    paths: probe.Paths | None,
    part: np.ndarray,
    tolerance: float,
    force: str | None,
) -> tuple[LightNumbers, LightSeen]:
    """What is known of a light: no more than the decision needs."""
    eye, frame, spec = asked.eye, light.frame, light.spec
    valid, size = eye.valid, eye.size
    pixels = round(float(valid.mean()) * asked.view.width * asked.view.height)
    if paths is None or frame is None or not paths.facing.any():
        nothing = np.zeros(size)
        known = LightNumbers(spec.name, spec.kind, share=0.0, facing=0.0, faces=0, pixels=pixels)
        return known, LightSeen(spec.name, nothing > 0, nothing)
    known = LightNumbers(
        name=spec.name,
        kind=spec.kind,
        shape=None if frame.area is None else frame.area.shape,
        share=min(float(part[valid].mean()), 1.0),
        facing=float(paths.facing[valid].mean()),
        faces=frame.faces,
        fov_deg=_field_of_view(frame) if frame.perspective else None,
        pixels=pixels,
        solid_angle=probe.solid_angle(frame, paths),
        lone_convex=asked.lone_convex,
    )
    seen = LightSeen(spec.name, paths.facing.reshape(size), paths.cosine.reshape(size))
    asked_for = force in ("hard", "soft", "all")
    if force == "none" or (not asked_for and (known.share < tolerance or known.lone_convex)):
        return known, seen
    rays = light.rays()
    look = probe.hard_look(paths, rays)
    known = replace(
        known,
        shadowed=float((~look.lit)[paths.facing].mean()),
        rays=look.rays,
    )
    seen = replace(seen, lit=look.lit.reshape(size))
    if not asked.materials.opaque:
        through = probe.transmission(paths, look, rays, asked.materials, asked.first_prim)
        known = replace(
            known,
            transmitted=float((part * through.part)[valid].mean()),
            refracted=float((part * through.refracted)[valid].mean()),
            rays=known.rays + through.rays,
        )
    if frame.area is None:
        return known, seen
    return _with_penumbra(known, seen, asked, frame, paths, look, part, rays)


def _with_penumbra(
    known: LightNumbers,
    seen: LightSeen,
    asked: SceneAsked,
    frame: LightFrame,
    paths: probe.Paths,
    look: probe.HardLook,
    part: np.ndarray,
    rays: LightRays,
) -> tuple[LightNumbers, LightSeen]:
    """The same with how wide penumbrae are."""
    eye, area = asked.eye, frame.area
    assert area is not None
    scale = asked.view.width / eye.camera.width
    ellipse = widths.light_ellipse(eye, area, paths, scale)
    blockers = widths.find_blockers(frame, rays)
    gaps = widths.widest_gaps(eye, frame, area, paths, blockers)
    bound = 2 * gaps * widths.widest(ellipse)
    edges = widths.shadow_edges(eye, paths, look, scale)
    k = widths.gap_ratio(area, paths, look.stop)
    if edges.dark.size:
        some = edges.dark
        u, v = ellipse
        found = widths.width_across((u[:, some], v[:, some]), k[some], edges.across)
        length = edges.length
    else:
        # Nothing that the probe resolves: what might be there, as if all of it were penumbra.
        some = np.flatnonzero(bound > 0)
        found = bound[some]
        length = scale**2 * some.size / float(found.mean()) if some.size else 0.0
    seen = replace(seen, widest=bound.reshape(eye.size))
    known = replace(known, rays=known.rays + blockers.rays)
    if not some.size:
        return known, seen
    p50, p95 = np.percentile(found, [50, 95])
    return replace(
        known,
        edge_px=length,
        contrast=min(float(part[some].mean()), 1.0),
        width_p50=float(p50),
        width_p95=float(p95),
        width_mean=float(found.mean()),
        umbra=widths.umbra_share(eye, paths.facing & ~look.lit, edges, ellipse, k, scale),
    ), seen


def _field_of_view(frame: LightFrame) -> float:
    """Of the widest face, along its wider side, degrees."""
    ends = np.arctan(frame.corner + frame.extent) - np.arctan(frame.corner)
    return float(np.degrees(ends.max()))


def _of_scene(asked: SceneAsked) -> list[Skipped]:
    """What is skipped for all lights together."""
    skipped = []
    if asked.materials.opaque:
        why = "no transmissive surface or medium in the scene"
        skipped.append(Skipped(None, "transmittance", why))
    if not asked.moving:
        why = "nothing moves: maps are made once and kept while lights and casters rest"
        skipped.append(Skipped(None, "updates", why))
    return skipped
