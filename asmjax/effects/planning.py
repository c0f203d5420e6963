"""Making a plan: what part of the light each light brings, a look at each, and what to do."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from asmjax.effects import probe
from asmjax.effects.asked import SceneAsked
from asmjax.effects.decide import (
    FAMILIES,
    SUBPIXEL,
    TOLERANCE,
    check_force,
    decide_light,
)
from asmjax.effects.looking import look_at_light
from asmjax.effects.plan import Plan
from asmjax.effects.records import (
    LightNumbers,
    NotSimulated,
    Outcome,
    Rates,
    Skipped,
    percent,
    pixels,
)
from asmjax.geometry import SUN_DEG


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
        force: what to do about a light, by name, or "*" for all others: none, hard or soft.
        available: families of shadow algorithms that are registered.
        rates: what things cost.
        seed: of the directions in which the surroundings are looked at.

    Raises:
        UseError: `force` names no light or effect, or the tolerance is below 0.
    """
    force = dict(force or {})
    names = [light.spec.name for light in asked.lights]
    check_force(force, names)
    rates = rates or Rates()
    eye = asked.eye
    paths = [
        None if light.frame is None else probe.light_paths(eye, light.frame)
        for light in asked.lights
    ]
    parts, notes = parts_of(asked, paths)
    sky, cast = _surroundings(asked, parts, tolerance, seed)
    order = sorted(
        (k for k, light in enumerate(asked.lights) if light.spec.name in (asked.chosen or names)),
        key=lambda k: -float(parts[k][eye.valid].mean()),
    )
    outcomes, numbers, seen = [], [], []
    for k in order:
        light = asked.lights[k]
        chosen = force.get(light.spec.name, force.get("*"))
        known, looked = look_at_light(asked, light, paths[k], parts[k], tolerance, chosen)
        outcome = decide_light(known, tolerance, chosen, available, rates)
        if light.frame is None:
            outcome = _because(outcome, light.why)
        outcomes.append(outcome)
        notes += _unknown_brightness(known) + _if_it_were_the_sun(known, tolerance)
        notes += _straddled(known, paths[k], parts[k], tolerance)
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
        not_simulated=tuple(
            sorted(
                (item for outcome in (*outcomes, sky) for item in outcome.not_simulated),
                key=lambda item: -item.error,
            )
            + [_unknown(name) for name in asked.unknown]
        ),
        numbers=tuple(numbers),
        seen=tuple(seen),
        probe_rays=eye.valid.size + cast + sum(known.rays for known in numbers),
        notes=tuple(notes),
        rates=rates,
    )


def _unknown_brightness(known: LightNumbers) -> list[str]:
    if known.spread is not None:
        return []
    return [f"how bright '{known.name}' is cannot be read from the scene, and is taken for 1"]


def _if_it_were_the_sun(known: LightNumbers, tolerance: float) -> list[str]:
    """A note where parallel light has hard edges that those of the sun would not be."""
    parallel = known.shape is None and known.kind == "directional"
    if not parallel or known.width_p95 <= SUBPIXEL or known.soft_error < tolerance:
        return []
    return [
        f"'{known.name}' is parallel; if it stands for the sun, {SUN_DEG:.2g} degrees across, "
        f"penumbrae are {pixels(known.width_p50)} wide (5 % of edges above "
        f"{pixels(known.width_p95)}) and hard edges change {percent(known.soft_error)} of the "
        "light: give it a size then"
    ]


def _straddled(
    known: LightNumbers, paths: probe.Paths | None, part: np.ndarray, tolerance: float
) -> list[str]:
    """A note where a light stands in the planes of pixels to which it matters; `part` (n,) of their
    light comes from it."""
    if paths is None or not paths.straddled.any():
        return []
    # Where nothing is seen, nothing is straddled: the mean is over the pixels of the picture.
    there = known.straddled * float(part[paths.straddled].mean())
    if there < tolerance:
        return []
    return [
        f"'{known.name}' stands in the plane of {percent(known.straddled)} of the pixels, where it "
        f"brings {percent(there)} of the light: a part of it is behind what they see, which soft "
        "methods tell, hard ones do not, and widths of penumbrae leave out"
    ]


def _because(outcome: Outcome, why: str) -> Outcome:
    """The outcome of a light that has no frame, with the words of who could not make one."""
    (decision,), (skipped,) = outcome.decisions, outcome.skipped
    return Outcome((replace(decision, reason=why),), (replace(skipped, reason=why),))


def parts_of(
    asked: SceneAsked, paths: Sequence[probe.Paths | None]
) -> tuple[list[np.ndarray], list[str]]:
    """What part of the light each light brings to each pixel (n,) where nothing shades it; what
    the surroundings bring comes last. And how that was told, where it was not by brightness."""
    brought = [
        np.zeros(asked.eye.valid.size)
        if path is None or light.frame is None
        else probe.irradiance(light.spec, light.frame, path, light.stand_in)
        for light, path in zip(asked.lights, paths, strict=True)
    ]
    around = np.zeros(asked.eye.valid.size)
    for item in asked.surroundings:
        around += np.where(asked.eye.valid, item.irradiance(asked.eye.normal), 0.0)
    brought.append(around)
    specs = [light.spec for light in asked.lights]
    kinds = {(spec.kind, spec.area is None) for spec in specs}
    if len(kinds) > 1 and not around.any() and all(spec.intensity == 1.0 for spec in specs):
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
    open_, cast = probe.sky_visibility(asked.eye, asked.rays, asked.surroundings, seed)
    error = float((parts[-1] * (1 - open_))[valid].mean())
    if error < tolerance:
        why = f"hardly anything shades '{names}'"
        return Outcome((), (Skipped(None, "surroundings", why, error),)), cast
    why = (
        f"'{names}' shines from all around and brings {percent(share)} of the light where nothing "
        f"shades it; {percent(float(1 - open_[valid].mean()))} of the sky is hidden"
    )
    return Outcome((), (), (NotSimulated(None, "surroundings", why, error),)), cast


def _unknown(name: str) -> NotSimulated:
    why = f"emitters of the kind of '{name}' are left out, and how much they bring is not known"
    return NotSimulated(None, "a light", why)


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
