"""How a shadow map's texels compare with the eye's pixels, receiver by receiver, and in a few
numbers: the same for every algorithm, from what it says of its own density."""

from dataclasses import asdict, dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from asmjax.buffers import EyeBuffer, light_offset, project
from asmjax.footprint import (
    determinant,
    log2_m,
    log2_perspective_error,
    uv_jacobian,
)
from asmjax.geometry import LightFrame
from asmjax.shadow import ShadowAlgorithm


@dataclass(frozen=True, eq=False)
class AliasingMaps:
    """Per eye pixel, NaN where no receiver faces the light or no texel answers it.

    Attributes:
        m: (n,) texel / pixel width on the receiver, in the worst direction; 1 is clean.
        perspective: (n,) its perspective factor alone: widest texel's beam / narrowest pixel's.
        texels: (n,) texels that the pixel covers, as an area: above 1 some are never asked.
        jacobian: (2, 2, n) d(texel)_i / d(pixel)_k; 0 where not known.
    """

    m: np.ndarray
    perspective: np.ndarray
    texels: np.ndarray
    jacobian: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """(n,) bool: where there is a number."""
        return ~np.isnan(self.m)


@dataclass(frozen=True)
class AliasingNumbers:
    """What `AliasingMaps` come to.

    Attributes:
        receivers: pixels that count.
        max_m, p95_m, median_m: of m.
        above_1: share of the receivers with m > 1: the map is too coarse there.
        max_perspective, p95_perspective: of the perspective factor.
        below_1: share of the receivers with m < 1: finer than the eye can tell.
        wasted: share of the stored texels that answer no pixel: those that no visible receiver lies
            in, and those beyond one a pixel.
    """

    receivers: int
    max_m: float
    p95_m: float
    median_m: float
    above_1: float
    max_perspective: float
    p95_perspective: float
    below_1: float
    wasted: float

    def record(self) -> dict:
        """The numbers as plain values by name."""
        return asdict(self)


def aliasing_maps(
    algorithm: ShadowAlgorithm, state, eye: EyeBuffer, frame: LightFrame
) -> AliasingMaps:
    """The maps of a state for what `eye` sees; `frame` is the light frame it was built for."""
    points = eye.points
    density = algorithm.density(state, points)
    jacobian, m, perspective, area, known = _texels_and_pixels(
        points, eye.camera, frame, light_offset(points, frame), density
    )
    m, perspective, area = (
        np.where(known, np.asarray(values, np.float64), np.nan) for values in (m, perspective, area)
    )
    return AliasingMaps(m, perspective, area, np.asarray(jacobian))


def aliasing_numbers(maps: AliasingMaps, texels: int) -> AliasingNumbers:
    """The numbers of maps whose algorithm stores `texels` texels; all 0, and everything wasted,
    where no visible receiver faces the light."""
    known = maps.known
    count = int(known.sum())
    if count == 0:
        return AliasingNumbers(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    m, perspective = maps.m[known], maps.perspective[known]
    asked = float(np.minimum(maps.texels[known], 1).sum())
    return AliasingNumbers(
        receivers=count,
        max_m=float(m.max()),
        p95_m=float(np.percentile(m, 95)),
        median_m=float(np.median(m)),
        above_1=float(np.mean(m > 1)),
        max_perspective=float(perspective.max()),
        p95_perspective=float(np.percentile(perspective, 95)),
        below_1=float(np.mean(m < 1)),
        wasted=max(0.0, 1 - asked / texels),
    )


@eqx.filter_jit
def _texels_and_pixels(
    points, camera, frame, offset, density: Float[Array, "2 2 n"]
) -> tuple[Array, Array, Array, Array, Bool[Array, " n"]]:
    receivers = project(points, frame, offset)
    jacobian = uv_jacobian(points, camera, frame, receivers)
    texels = jnp.stack([
        jnp.stack([sum(density[i, k] * jacobian[k, j] for k in range(2)) for j in range(2)])
        for i in range(2)
    ])  # fmt: skip
    known = receivers.facing & (determinant(density) != 0)
    perspective = jnp.exp2(log2_perspective_error(points, camera, frame, receivers, density))
    return texels, jnp.exp2(log2_m(texels, 1)), perspective, jnp.abs(determinant(texels)), known
