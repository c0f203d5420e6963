"""The texels around points, which filters ask of every map alike.

A filter weighs the outcomes of shadow tests (docs/theory.md, "Filtering"); what a texel is, where
the next one lies and what is beyond the last one, only the map knows.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers import Receivers
from asmjax.footprint import straddles_discontinuity

Step = int | Int[Array, "..."]
"""Whole texels: one number, () or (n,)."""


class Neighbourhood(eqx.Module):
    """The texels around n points.

    Attributes:
        fraction: (2, n) in [0, 1): how far each point lies into the texel that answers it, along
            its columns and rows. What a filter's gradient flows through.
        receivers: the points as the light sees them.
    """

    receivers: eqx.AbstractVar[Receivers]
    fraction: eqx.AbstractVar[Float[Array, "2 n"]]

    @abc.abstractmethod
    def lit(
        self, columns: Step = 0, rows: Step = 0, *, most: int | None = None
    ) -> Bool[Array, " n"]:
        """Whether the texel so many columns and rows beside each point's own lets light through to
        it: the shadow test at that texel's own centre. Without any, what `visibility` says.

        Steps count in the size of the point's own texel. Beyond the border of what holds it, the
        last texel answers; of an adaptive map, whatever serves that place. `most` promises that no
        step is larger, which may save a search.
        """

    def straddles(self) -> Bool[Array, " n"]:
        """Points about which the 2 x 2 nearest texels disagree."""
        x, y = jnp.where(self.fraction >= 0.5, 1, -1).astype(jnp.int32)
        return straddles_discontinuity(
            [self.lit(dx * x, dy * y, most=1) for dy in (0, 1) for dx in (0, 1)]
        )


def beside(at: Int[Array, " n"], step: Step, last: Step) -> Int[Array, " n"]:
    """The index `step` beyond each of `at`, kept between 0 and `last`."""
    return at if isinstance(step, int) and step == 0 else jnp.clip(at + step, 0, last)


def is_own(columns: Step, rows: Step) -> bool:
    """Whether it is known while tracing that this is no step."""
    return isinstance(columns, int) and isinstance(rows, int) and columns == rows == 0
