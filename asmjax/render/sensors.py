"""Mitsuba sensors as view specifications."""

from collections.abc import Mapping

import numpy as np

from asmjax.errors import UseError
from asmjax.scene.spec import ViewSpec

NEAR, FAR = 1e-6, 1e4
"""Clip distances in diagonals of the scene, where it says none and the renderer's own would cut."""

LARGEST_NEAR, LEAST_FAR = 1e-2, 4.0
"""Up to and from here, in diagonals of the scene, the renderer's own clip distances are taken."""

SUPPORTED = ("PerspectiveCamera", "ThinLensCamera")


def read_sensors(
    mi, sensors: list, notices: list[str], said: Mapping[str, dict], diagonal: float
) -> dict[str, ViewSpec]:
    """The scene's pinhole views by id, in scene order; what is left out is added to `notices`.

    Args:
        said: what the scene says of each plugin, by id (`ParsedScene.properties`).
        diagonal: of the scene's box, scene units.
    """
    views: dict[str, ViewSpec] = {}
    for sensor, name in zip(sensors, plugin_names(sensors, "sensor"), strict=True):
        if sensor.class_name() not in SUPPORTED:
            notices.append(
                f"sensor '{name}' ({sensor.class_name()}) is left out: asmjax sees through "
                "perspective and thinlens sensors"
            )
            continue
        if sensor.class_name() == "ThinLensCamera":
            notices.append(f"sensor '{name}' is a thin lens; seen as a pinhole, all in focus")
        views[name] = _read_view(mi, name, sensor, said.get(sensor.id(), {}), diagonal)
    return views


def plugin_names(plugins: list, kind: str) -> list[str]:
    """A name for each plugin: the id that the scene file gives it, or `kind` and its index.

    Names differ from each other; an id that comes twice stays with the first that has it.
    """
    ids = [plugin.id() for plugin in plugins]
    names = []
    for index, name in enumerate(ids):
        if not name or name.startswith("_unnamed") or name in ids[:index]:
            name = f"{kind}{index}"
            while name in ids:
                name += "_"
        names.append(name)
    return names


def _read_view(mi, name: str, sensor, said: Mapping, diagonal: float) -> ViewSpec:
    params = mi.traverse(sensor)
    # As it was said: the sensor itself holds float32.
    if "to_world" in said:
        matrix = said["to_world"]
    else:
        matrix = np.array(params["to_world"].matrix, np.float64).reshape(4, 4)
    if not np.isfinite(matrix).all():
        raise UseError(
            f"sensor '{name}' has a to_world transform that is not finite; give a camera with "
            "finite numbers."
        )
    left, up, forward = (matrix[:3, k] / np.linalg.norm(matrix[:3, k]) for k in range(3))
    origin = matrix[:3, 3]
    width, height = (int(x) for x in np.array(params["film.size"]).ravel())
    crop_width, crop_height = (int(x) for x in np.array(params["film.crop_size"]).ravel())
    crop_x, crop_y = (int(x) for x in np.array(params["film.crop_offset"]).ravel())
    # A thin lens has no principal point offset.
    fov_deg, shift_x, shift_y = (
        float(np.array(params.get(key, 0.0)).ravel()[0])
        for key in ("x_fov", "principal_point_offset_x", "principal_point_offset_y")
    )
    if not np.isfinite([shift_x, shift_y]).all():
        raise UseError(
            f"sensor '{name}' has a principal point that is not finite; give finite offsets."
        )
    near, far = float(params["near_clip"]), float(params["far_clip"])
    focal = 0.5 * width / np.tan(np.radians(fov_deg) / 2)
    principal = width * (0.5 - shift_x) - crop_x, height * (0.5 - shift_y) - crop_y
    return ViewSpec(
        name=name,
        origin=tuple(origin),
        target=tuple(origin + forward),
        up=tuple(up),
        fov_x_deg=float(np.degrees(2 * np.arctan(0.5 * crop_width / focal))),
        width=crop_width,
        height=crop_height,
        near=near if "near_clip" in said or near <= LARGEST_NEAR * diagonal else NEAR * diagonal,
        far=far if "far_clip" in said or far >= LEAST_FAR * diagonal else FAR * diagonal,
        principal_point=(principal[0] / crop_width - 0.5, principal[1] / crop_height - 0.5),
        mirrored=bool(np.dot(np.cross(left, up), forward) < 0),
    )
