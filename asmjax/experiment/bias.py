"""What a depth test cannot tell apart, in scene units: the bias of a map where it is asked."""

from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, light_offset, project
from asmjax.footprint import determinant
from asmjax.geometry import LightFrame
from asmjax.numerics import safe_divide, safe_sqrt, scalar
from asmjax.shadow import ShadowAlgorithm
from asmjax.shadow.comparison import Tested, bias_distance


def stated_bias(algorithm: ShadowAlgorithm, state, eye: EyeBuffer, frame: LightFrame) -> np.ndarray:
    """(n,) float64 distance along the normal, scene units, below which a caster may be taken for
    the receiver that each eye pixel sees; NaN where none faces the light or no texel answers.

    Walls that stand farther above a receiver do not let light through, but for two primitives
    whose ids agree in the 16 bits that maps keep. Ids need no bias: it is 0 where nothing else is
    compared.
    """
    points, test = eye.points, cast(Tested, algorithm)
    density = algorithm.density(state, points)
    seen = points, frame, light_offset(points, frame)
    distance, known = _distance(*seen, density, scalar(test.bias))
    distance = np.zeros(known.shape) if test.compare == "id" else np.asarray(distance)
    return np.where(known, distance.astype(np.float64), np.nan)


def bias_summary(bias: np.ndarray) -> dict:
    """Median and largest of `stated_bias` over the receivers, scene units; 0 without any."""
    known = bias[~np.isnan(bias)]
    if known.size == 0:
        return {"median": 0.0, "max": 0.0}
    return {"median": float(np.median(known)), "max": float(known.max())}


@eqx.filter_jit
def _distance(points, frame, offset, density: Float[Array, "2 2 n"], bias):
    receivers = project(points, frame, offset)
    area = determinant(density)
    # The longer side of a texel, as a fraction of the image's longer side.
    extent = jnp.asarray(frame.extent, points.position.dtype)[receivers.face].T
    sides = [
        safe_sqrt(
            (safe_divide(density[1 - j, 1], area) * extent[0]) ** 2
            + (safe_divide(density[1 - j, 0], area) * extent[1]) ** 2
        )
        for j in range(2)
    ]
    texel = safe_divide(jnp.maximum(*sides), jnp.max(extent, axis=0))
    known = receivers.facing & (area != 0)
    return bias_distance(receivers, frame, texel, bias), known
