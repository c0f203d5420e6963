"""Per-pixel maps of a conventional shadow map: where it aliases, and what each pixel needs."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from asmjax.buffers import EyeBuffer, Receivers, light_offset, project
from asmjax.footprint import (
    cell_benefit,
    cell_index,
    log2_linear_ratio,
    log2_m,
    n_required,
    uv_jacobian,
)
from asmjax.geometry import LightFrame
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap
from asmjax.shadow.adaptive import AdaptiveState
from asmjax.shadow.uniform import UniformState

CELL_TEXELS = 16
"""Texels per side of the cells that benefit is counted in."""


def analysis_maps(
    eye: EyeBuffer, frame: LightFrame, algorithm: UniformShadowMap, state: UniformState
) -> dict[str, np.ndarray]:
    """`area_ratio`, `linear_ratio`, `m`, `n_required` and `benefit` of a flat map, (n,) each.

    Ratios are NaN where no receiver faces the light; benefit is 0 there. `n_required` counts the
    texels of a flat map over the whole light frame that matches the pixel. `benefit` is that of
    the pixel's cell: a pixel counts where it straddles a discontinuity and is mismatched (m > 1).
    """
    receivers, log2_ratio, log2_axis = _footprints(
        eye.points, eye.camera, frame, light_offset(eye.points, frame), algorithm.resolution
    )
    cells = -(-algorithm.resolution // CELL_TEXELS)
    index = cell_index(receivers.uv, receivers.face, cells)
    counted = algorithm.straddling(state, receivers) & (log2_axis > 0)
    benefit = cell_benefit(index, counted, frame.faces * cells**2)[index]
    facing = receivers.facing
    area = jnp.exp2(2 * log2_ratio)
    maps = {
        "area_ratio": area,
        "linear_ratio": jnp.exp2(log2_ratio),
        "m": jnp.exp2(log2_axis),
        "n_required": n_required(float(algorithm.resolution) ** 2, area),
    }
    nan = {name: np.asarray(jnp.where(facing, values, jnp.nan)) for name, values in maps.items()}
    return nan | {"benefit": np.asarray(jnp.where(facing, benefit, 0))}


def answered_resolution(
    eye: EyeBuffer, frame: LightFrame, algorithm: AdaptiveShadowMap, state: AdaptiveState
) -> np.ndarray:
    """Texels a side (n,) of a flat map as fine as the texel that answered each pixel.

    NaN where the light does not shine on the side that is seen: no texel decides there.
    """
    _, log2 = algorithm.lookup(state, eye.points)
    facing = project(eye.points, frame, light_offset(eye.points, frame)).facing
    return np.where(np.asarray(facing), np.exp2(np.asarray(log2, np.float64)), np.nan)


@eqx.filter_jit
def _footprints(points, camera, frame, offset, resolution: int) -> tuple[Receivers, Array, Array]:
    receivers = project(points, frame, offset)
    jacobian = uv_jacobian(points, camera, frame, receivers)
    return receivers, log2_linear_ratio(jacobian, resolution), log2_m(jacobian, resolution)
