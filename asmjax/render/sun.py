"""The sun of Mitsuba's `sunsky` emitter as a directional light with an angular diameter."""

from collections.abc import Mapping

import numpy as np

from asmjax.geometry import SUN_DEG, sun_light, unit
from asmjax.render.area_emitters import LUMINANCE
from asmjax.scene.spec import LightSpec


def read_sun(mi, name: str, emitter, words: Mapping) -> LightSpec | None:
    """The sun of a `sunsky` emitter, whose sky is left out; None where it is turned off or below
    the horizon.

    A scene gives the sun's direction, or a time and a place; the emitter makes one of the other, in
    world coordinates.

    Args:
        words: what the scene says of the emitter (`ParsedScene.properties`).
    """
    params = mi.traverse(emitter)
    # As it was said: the emitter itself holds float32.
    to_sun = unit(np.array(words.get("sun_direction", params["sun_direction"])).ravel())
    aperture = float(np.radians(words.get("sun_aperture", SUN_DEG)))
    solid_angle = 2 * np.pi * (1 - np.cos(aperture / 2))
    scale = float(np.array(params["sun_scale"]).ravel()[0])
    irradiance = _luminance_from(mi, emitter, to_sun) * solid_angle if scale > 0 else 0.0
    if irradiance <= 0:
        return None
    x, y, z = (-to_sun).tolist()
    return LightSpec(
        name,
        "directional",
        direction=(x, y, z),
        area=sun_light((x, y, z), aperture),
        intensity=irradiance,
    )


def _luminance_from(mi, emitter, to_sun: np.ndarray) -> float:
    """Of the middle of the sun's disk, all of which is as bright in RGB; the sky before it, a part
    in 10,000, included."""
    seen = mi.SurfaceInteraction3f()
    seen.wi = mi.Vector3f(*(-to_sun).tolist())
    seen.time = mi.Float(0.0)
    return float(LUMINANCE @ np.array(emitter.eval(seen), np.float64).ravel())
