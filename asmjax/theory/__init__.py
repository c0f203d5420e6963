"""The theory of shadow-map aliasing: errors of warps and splits in closed form, in JAX.

Three questions, each a file or two: how wide are texels beside pixels along the view
(`parameterization`, `logarithmic`, `subdivision`), how many texels does no pixel see (`storage`
under an overhead light, `light_direction` under any), and what is the error of a given map at a
given point (`aliasing`). Functions run in the precision of their arguments, under `jit`, `vmap` and
`grad`; formulas, limits and the errata of the paper are in docs/theory.md.
"""

from asmjax.theory.aliasing import (
    AxisAliasing,
    axis_aliasing,
    displacement_bounds,
    edge_lengths,
    log2_parallel_beam,
    log2_point_beam,
    mean_displacement,
    rms_displacement,
    texel_edges,
)
from asmjax.theory.light_direction import (
    DIRECTION_WARPS,
    best_strength,
    direction_factors,
    direction_storage,
    lispsm_strength,
)
from asmjax.theory.logarithmic import (
    log_perspective_m_z,
    log_perspective_s,
    log_perspective_z,
    logarithmic_m_z,
    logarithmic_s,
    logarithmic_z,
)
from asmjax.theory.parameterization import (
    g,
    g_max,
    m_x,
    m_x_max,
    m_z,
    m_z_max,
    n_from_u,
    s_of_z,
    u_from_n,
    u_from_xi,
    u_lispsm,
    xi_from_u,
    z_of_s,
)
from asmjax.theory.storage import WARPS, ResolutionFactors, overhead_factors
from asmjax.theory.subdivision import (
    allocate,
    logarithmic_splits,
    practical_splits,
    subdivided_m_z_max,
    uniform_splits,
)

__all__ = [
    "DIRECTION_WARPS",
    "WARPS",
    "AxisAliasing",
    "ResolutionFactors",
    "allocate",
    "axis_aliasing",
    "best_strength",
    "direction_factors",
    "direction_storage",
    "displacement_bounds",
    "edge_lengths",
    "g",
    "g_max",
    "lispsm_strength",
    "log2_parallel_beam",
    "log2_point_beam",
    "log_perspective_m_z",
    "log_perspective_s",
    "log_perspective_z",
    "logarithmic_m_z",
    "logarithmic_s",
    "logarithmic_splits",
    "logarithmic_z",
    "m_x",
    "m_x_max",
    "m_z",
    "m_z_max",
    "mean_displacement",
    "n_from_u",
    "overhead_factors",
    "practical_splits",
    "rms_displacement",
    "s_of_z",
    "subdivided_m_z_max",
    "texel_edges",
    "u_from_n",
    "u_from_xi",
    "u_lispsm",
    "uniform_splits",
    "xi_from_u",
    "z_of_s",
]
