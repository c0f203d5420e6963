"""What flows between the stages: the eye's image, the light's image, and their meeting."""

from asmjax.buffers.anchored import Anchor, anchor, double, image_rows
from asmjax.buffers.points import (
    BLUR,
    EyeBuffer,
    SeenPoints,
    SurfacePoints,
    eye_buffer,
    seen_points,
)
from asmjax.buffers.rays import (
    EXACT_IDS,
    ChartBuffer,
    LightBuffer,
    LightRays,
    TexelWindows,
    whole_image,
)
from asmjax.buffers.receivers import Receivers, light_offset, project

__all__ = [
    "BLUR",
    "EXACT_IDS",
    "Anchor",
    "ChartBuffer",
    "EyeBuffer",
    "LightBuffer",
    "LightRays",
    "Receivers",
    "SeenPoints",
    "SurfacePoints",
    "TexelWindows",
    "anchor",
    "double",
    "eye_buffer",
    "image_rows",
    "light_offset",
    "project",
    "seen_points",
    "whole_image",
]
