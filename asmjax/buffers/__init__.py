"""What flows between the stages: the eye's image, the light's image, and their meeting."""

from asmjax.buffers.points import EyeBuffer, SeenPoints, SurfacePoints, eye_buffer, seen_points
from asmjax.buffers.rays import LightBuffer, LightRays, TexelWindows, whole_image
from asmjax.buffers.receivers import Receivers, light_offset, project

__all__ = [
    "EyeBuffer",
    "LightBuffer",
    "LightRays",
    "Receivers",
    "SeenPoints",
    "SurfacePoints",
    "TexelWindows",
    "eye_buffer",
    "light_offset",
    "project",
    "seen_points",
    "whole_image",
]
