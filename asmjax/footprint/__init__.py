"""Footprints: the sizes of pixels and texels on a surface, and what follows from them."""

from asmjax.footprint.area import orthographic_area, perspective_area
from asmjax.footprint.beams import log2_perspective_error, narrowest_pixel
from asmjax.footprint.benefit import (
    cell_benefit,
    cell_index,
    cell_worst,
    straddles_discontinuity,
)
from asmjax.footprint.jacobian import (
    determinant,
    singular_values,
    surface_tangents,
    uv_jacobian,
)
from asmjax.footprint.mipmap import (
    log2_footprint_axes,
    log2_mip_value,
    log2_mipmap_ratio,
    log2_sampled_length,
)
from asmjax.footprint.ratio import (
    LOG2_WORST,
    area_ratio,
    linear_ratio,
    log2_linear_ratio,
    log2_m,
    m,
    n_required,
    required_level,
)

__all__ = [
    "LOG2_WORST",
    "area_ratio",
    "cell_benefit",
    "cell_index",
    "cell_worst",
    "determinant",
    "linear_ratio",
    "log2_footprint_axes",
    "log2_linear_ratio",
    "log2_m",
    "log2_mip_value",
    "log2_mipmap_ratio",
    "log2_perspective_error",
    "log2_sampled_length",
    "m",
    "n_required",
    "narrowest_pixel",
    "orthographic_area",
    "perspective_area",
    "required_level",
    "singular_values",
    "straddles_discontinuity",
    "surface_tangents",
    "uv_jacobian",
]
