"""From a light and a view to the light frame that serves them."""

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import UseError
from asmjax.geometry import (
    LightFrame,
    fitted_directional_frame,
    fitted_point_frame,
    fixed_frame,
)
from asmjax.scene.spec import LightSpec

NEAR_FRACTION = 1e-6
"""Receivers nearer to a light than this fraction of the scene's diagonal are not lit by it."""


def light_frame(light: LightSpec, eye: EyeBuffer, bounds: np.ndarray) -> LightFrame:
    """The frame of `light`: its fixed field of view, or fitted to the receivers the eye sees.

    Args:
        bounds: (3, 2) float64, the scene's box, min and max per axis.

    Raises:
        UseError: no visible surface faces the light.
    """
    near = np.float64(NEAR_FRACTION * np.linalg.norm(bounds[:, 1] - bounds[:, 0]))
    if light.kind != "directional" and light.fov_deg is not None:
        axis = light.direction if light.direction is not None else (0.0, 0.0, -1.0)
        return fixed_frame(light.position, axis, light.fov_deg, near, light.cutoff_deg)
    if light.kind == "directional":
        to_light = -np.asarray(light.direction, np.float64)[:, None]
    else:
        to_light = np.asarray(light.position, np.float64)[:, None] - eye.world
    faces_light = eye.valid & (np.einsum("in,in->n", eye.normal, to_light + 0 * eye.normal) > 0)
    receivers = eye.world[:, faces_light]
    if receivers.shape[1] == 0:
        raise UseError(
            f"light '{light.name}' shines on no surface that this view sees; choose another "
            "--light or --view."
        )
    if light.kind == "directional":
        return fitted_directional_frame(light.direction, receivers, bounds)
    return fitted_point_frame(
        light.position, receivers, near, axis=light.direction, cutoff_deg=light.cutoff_deg
    )
