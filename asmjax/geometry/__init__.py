"""Coordinate conventions, written once.

* A set of n points or vectors is `(3, n)`, rows x, y, z ("component-first"). Images are
  `(height, width)`, row 0 at the top; kernels see them flat, row by row.
* **world**: the scene's axes and units. **eye**: axes image right, image down, forward. **light**:
  axes u, v, and the light's axis w.
* Eye pixel (column, row): pixel centres at +0.5. **Axial depth** is the distance along the
  forward (or the light's) axis, in scene units, never 1/z; the range along a ray is not used.
* Light image coordinates u, v in [0, 1] over a face's rectangle; at resolution N texel (j, i)
  covers u in [i, i + 1) / N and v in [j, j + 1) / N, its centre at +0.5.
* Large offsets cancel: points are stored relative to an `origin` near them (the eye), and the
  light's position relative to that origin is formed in float64 on the host.
"""

from asmjax.geometry.area_light import (
    SUN_DEG,
    AreaLight,
    AreaShape,
    concentric,
    disk_light,
    rectangle_light,
    sphere_light,
    stratified,
    sun_light,
)
from asmjax.geometry.basis import bases_along, basis_from_axis, unit
from asmjax.geometry.camera import Camera, look_at
from asmjax.geometry.charts import (
    Chart,
    Charts,
    image_to_plane,
    laid_out,
    padded,
    plane_to_image,
)
from asmjax.geometry.light_frame import (
    ANY_LAMP,
    NO_LAMP,
    LightFrame,
    fitted_directional_frame,
    fitted_point_frame,
    fixed_frame,
    in_domain,
    towards_light,
)

__all__ = [
    "ANY_LAMP",
    "NO_LAMP",
    "SUN_DEG",
    "AreaLight",
    "AreaShape",
    "Camera",
    "Chart",
    "Charts",
    "LightFrame",
    "bases_along",
    "basis_from_axis",
    "concentric",
    "disk_light",
    "fitted_directional_frame",
    "fitted_point_frame",
    "fixed_frame",
    "image_to_plane",
    "in_domain",
    "laid_out",
    "look_at",
    "padded",
    "plane_to_image",
    "rectangle_light",
    "sphere_light",
    "stratified",
    "sun_light",
    "towards_light",
    "unit",
]
