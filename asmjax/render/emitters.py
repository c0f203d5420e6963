"""Mitsuba emitters as light specifications."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from asmjax.render.area_emitters import area_of_shape, brightness
from asmjax.render.geometry import box_of
from asmjax.render.sensors import plugin_names
from asmjax.render.sun import read_sun
from asmjax.render.working_frame import WorkingFrame
from asmjax.scene.spec import LightSpec


@dataclass(frozen=True)
class SceneLight:
    """A light, and the shape that carries it: a lamp does not shade its own light.

    `shape` is the dense shape id of an area emitter, None for other lights. `spread` is how much
    its radiance varies over it, as `brightness` has it; None where brightness is not known and
    taken for 1.
    """

    spec: LightSpec
    shape: int | None = None
    spread: float | None = 0.0


def read_emitters(
    mi, scene, notices: list[str], said: Mapping[str, dict], working: WorkingFrame
) -> dict[str, SceneLight]:
    """The lights that cast shadows, by id, in scene order; what is left out goes to `notices`.

    Args:
        said: what the scene says of each plugin, by id (`ParsedScene.properties`).
        working: the frame in which the shapes stand.
    """
    lights: dict[str, SceneLight] = {}
    shapes = scene.shapes()
    emitters = scene.emitters()
    for emitter, name in zip(emitters, plugin_names(emitters, "light"), strict=True):
        kind = emitter.class_name()
        params, words = mi.traverse(emitter), said.get(emitter.id(), {})
        if kind == "PointLight":
            # As it was said: the emitter itself holds float32.
            said_at = words.get("to_world", np.zeros((4, 4)))[:3, 3]
            at = said_at if "to_world" in words else words.get("position", params["position"])
            position = _vector(at)
            bright, spread = brightness(params, "intensity")
            light = LightSpec(name, "point", position=position, intensity=bright)
            lights[name] = SceneLight(light, spread=spread)
        elif kind == "SpotLight":
            matrix = _matrix(params, words)
            bright, spread = brightness(params, "intensity")
            lights[name] = SceneLight(
                LightSpec(
                    name,
                    "spot",
                    position=_vector(matrix[:3, 3]),
                    direction=_vector(matrix[:3, 2]),
                    cutoff_deg=float(np.array(params["cutoff_angle"]).ravel()[0]),
                    intensity=bright,
                ),
                spread=spread,
            )
        elif kind == "DirectionalEmitter":
            direction = _direction(params, words)
            bright, spread = brightness(params, "irradiance")
            light = LightSpec(name, "directional", direction=direction, intensity=bright)
            lights[name] = SceneLight(light, spread=spread)
        elif kind == "AreaLight":
            shape = emitter.get_shape()
            centre = _vector(box_of(shape.bbox(), working).mean(axis=1))
            area = area_of_shape(mi, shape, working)
            at = f"the point at its centre ({', '.join(f'{x:g}' for x in centre)})"
            notices.append(
                f"light '{name}' is an area emitter; hard methods take {at}"
                if area is not None
                else f"light '{name}' is an area emitter on a shape that is no rectangle, disk or "
                f"sphere that emits outwards ({shape.class_name()}); represented by {at}, which "
                "casts hard shadows"
            )
            bright, spread = brightness(params, "radiance")
            light = LightSpec(
                name,
                "point",
                position=centre,
                area=None if area is None else area.at(centre),
                intensity=bright,
            )
            lights[name] = SceneLight(
                light,
                shape=next(i for i, s in enumerate(shapes) if s == shape),
                spread=spread,
            )
        elif kind == "SunskyEmitter" and (sun := read_sun(mi, name, emitter, words)):
            notices.append(
                f"light '{name}' is a sun and a sky; the sky ({kind}) casts no hard shadow and is "
                "left out"
            )
            lights[name] = SceneLight(sun)
        else:
            notices.append(f"light '{name}' ({kind}) casts no hard shadow; left out")
    return lights


def _vector(value) -> tuple[float, float, float]:
    x, y, z = np.array(value, np.float64).ravel()
    return float(x), float(y), float(z)


def _direction(params, words: Mapping) -> tuple[float, float, float]:
    """Along a parallel light, as it was said: the emitter itself holds a float32 rotation."""
    said = words["direction"] if "direction" in words else _matrix(params, words)[:3, 2]
    length = float(np.linalg.norm(said))
    # One that is none is refused where lights are checked.
    return _vector(said / length if 0 < length < np.inf else said)


def _matrix(params, words: Mapping) -> np.ndarray:
    if "to_world" in words:
        return words["to_world"]
    return np.array(params["to_world"].matrix, np.float64).reshape(4, 4)
