"""Mitsuba emitters as light specifications."""

from dataclasses import dataclass

import numpy as np

from asmjax.render.sensors import plugin_names
from asmjax.scene.spec import LightSpec


@dataclass(frozen=True)
class SceneLight:
    """A light, and the shape that carries it: a lamp does not shade its own light.

    `shape` is the dense shape id of an area emitter, None for other lights.
    """

    spec: LightSpec
    shape: int | None = None


def read_emitters(mi, scene, notices: list[str]) -> dict[str, SceneLight]:
    """The lights that cast hard shadows, by id, in scene order; the others go to `notices`."""
    lights: dict[str, SceneLight] = {}
    shapes = scene.shapes()
    emitters = scene.emitters()
    for emitter, name in zip(emitters, plugin_names(emitters, "light"), strict=True):
        kind = emitter.class_name()
        params = mi.traverse(emitter)
        if kind == "PointLight":
            position = _vector(params["position"])
            lights[name] = SceneLight(LightSpec(name, "point", position=position))
        elif kind == "SpotLight":
            matrix = _matrix(params)
            lights[name] = SceneLight(
                LightSpec(
                    name,
                    "spot",
                    position=_vector(matrix[:3, 3]),
                    direction=_vector(matrix[:3, 2]),
                    cutoff_deg=float(np.array(params["cutoff_angle"]).ravel()[0]),
                )
            )
        elif kind == "DirectionalEmitter":
            direction = _vector(_matrix(params)[:3, 2])
            lights[name] = SceneLight(LightSpec(name, "directional", direction=direction))
        elif kind == "AreaLight":
            shape = emitter.get_shape()
            box = shape.bbox()
            centre = (np.array(box.min, np.float64) + np.array(box.max, np.float64)).ravel() / 2
            notices.append(
                f"light '{name}' is an area emitter; represented by a point at its centre "
                f"({', '.join(f'{x:g}' for x in centre)}), which casts hard shadows"
            )
            lights[name] = SceneLight(
                LightSpec(name, "point", position=_vector(centre)),
                shape=next(i for i, s in enumerate(shapes) if s == shape),
            )
        else:
            notices.append(f"light '{name}' ({kind}) casts no hard shadow; left out")
    return lights


def _vector(value) -> tuple[float, float, float]:
    x, y, z = np.array(value, np.float64).ravel()
    return float(x), float(y), float(z)


def _matrix(params) -> np.ndarray:
    return np.array(params["to_world"].matrix, np.float64).reshape(4, 4)
