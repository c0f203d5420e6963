"""Tuning by gradient: the settings of least predicted error, from a start that is never made worse.

What is minimised is the power mean of m over receivers, (mean of m^p)^(1/p): a smooth stand-in for
the largest m that still feels all the others. Its logarithm is scale free, and its gradient at p is
that of the mean of log m weighted by m^p.

Where the error is g of TR05-024, equation 3, and receivers lie evenly in log z over [1, alpha], the
least power mean is at n = 1 + sqrt(alpha) for every p, not only for the maximum: there g is
symmetric in log z about sqrt(alpha), and d(log g) / du is antisymmetric.
"""

from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from asmjax.shadow.warped.predicted import Layout, log2_errors, log2_p_mean
from asmjax.shadow.warped.sight import Seen

POWER = 4.0
"""Default p. Of two equal groups of receivers, one with twice the m of the other, the worse one has
94 % of the gradient; at 8 it has all but 0.4 %, and the median of m pays for the worst few."""

MAX_STEPS = 256
"""Steps of BFGS in each round, those that a line search takes back among them."""

ROUNDS = 3
"""Searches, each from the best of the one before: what BFGS has learnt on one side of a kink holds
it up on the other."""

TOLERANCE = 1e-5
"""A layout is at rest where a step moves logarithms of its numbers by less; far below what whole
rows and columns can tell."""


class Rest(Enum):
    """How a search ended."""

    SETTLED = "settled"
    STEPS_SPENT = "steps spent"
    NOT_FINITE = "not finite"


class Minimum(NamedTuple):
    """What `minimised` found.

    Attributes:
        value: the better one of start and end, as the start.
        loss, start_loss: there, and at the start.
        improved: whether that is the end.
        settled: whether the search came to rest.
    """

    value: Any
    loss: Float[Array, ""]
    start_loss: Float[Array, ""]
    improved: Bool[Array, ""]
    settled: Bool[Array, ""]

    @property
    def rest(self) -> Rest:
        """In words, once it is known."""
        if bool(self.settled):
            return Rest.SETTLED
        return Rest.STEPS_SPENT if bool(jnp.isfinite(self.loss)) else Rest.NOT_FINITE


def minimised(
    loss: Callable[[Any], Float[Array, ""]],
    start: Any,
    max_steps: int = MAX_STEPS,
    tolerance: float = TOLERANCE,
) -> Minimum:
    """BFGS (optimistix) from `start`, a pytree of unconstrained numbers; pure, for use under jit.

    A search that does not come to rest, or ends where the loss is larger or no number, is no error:
    the result says so and holds the better one of the two ends.
    """
    import optimistix as optx  # 0.3 s: only who tunes pays for it

    solver = optx.BFGS(rtol=tolerance, atol=tolerance)

    def descend(best, _):
        found = optx.minimise(lambda y, _: loss(y), solver, best, max_steps=max_steps, throw=False)
        # One copy of the loss for both: compiling it takes longer than all of the search.
        ends = jax.tree.map(lambda a, b: jnp.stack([a, b]), best, found.value)
        before, after = jax.lax.map(loss, ends)
        better = after < before
        best = jax.tree.map(lambda a, b: jnp.where(better, a, b), found.value, best)
        settled = found.result == optx.RESULTS.successful
        return best, (before, jnp.where(better, after, before), better, settled)

    value, rounds = jax.lax.scan(descend, start, length=ROUNDS)
    before, after, better, settled = rounds
    return Minimum(value, after[-1], before[0], better.any(), settled[-1])


class Free(NamedTuple):
    """A `Layout` as unconstrained numbers.

    Attributes:
        log_u, log_shares, log_aspect: (faces, k) natural logarithms.
        log_parts: (k,) of the parts of log depth between the splits, up to a factor.
    """

    log_u: Float[Array, "faces k"]
    log_shares: Float[Array, "faces k"]
    log_aspect: Float[Array, "faces k"]
    log_parts: Float[Array, " k"]


def free(layout: Layout, near, far) -> Free:
    """The numbers of a layout; `near` and `far` are the ends of the depths that it splits."""
    ends = jnp.log(jnp.asarray(near))[None], jnp.log(jnp.asarray(far))[None]
    parts = jnp.diff(jnp.concatenate([ends[0], jnp.log(layout.splits), ends[1]]))
    least = jnp.finfo(parts.dtype).eps
    return Free(
        jnp.log(jnp.maximum(layout.u, least)),
        jnp.log(layout.shares),
        jnp.log(layout.aspect),
        jnp.log(jnp.maximum(parts, least)),
    )


def layout_of(numbers: Free, near, far, warped: bool) -> Layout:
    """The layout of unconstrained numbers; without warps `log_u` is not read."""
    # A centre 2^20 times nearer than the eye's, or farther, is one on the spot, or none.
    u = jnp.exp(jnp.clip(numbers.log_u, -14, 14)) if warped else jnp.zeros_like(numbers.log_u)
    parts = jnp.cumsum(jax.nn.softmax(numbers.log_parts))[:-1]
    shares = jax.nn.softmax(numbers.log_shares.ravel()).reshape(numbers.log_shares.shape)
    return Layout(u, near * (far / near) ** parts, shares, jnp.exp(numbers.log_aspect))


@eqx.filter_jit
def tuned_layout(
    seen: Seen,
    start: Layout,
    texels: Float[Array, ""],
    power: Float[Array, ""],
    warped: bool,
    max_steps: int = MAX_STEPS,
) -> tuple[Layout, Minimum]:
    """The layout of least p-mean of the predicted m, from `start`.

    Args:
        texels: in all.
        power: p.
        warped: whether slabs may be warped.
    """

    def loss(numbers):
        layout = layout_of(numbers, seen.near, seen.far, warped)
        return log2_p_mean(*log2_errors(seen, layout, texels), power)

    found = minimised(loss, free(start, seen.near, seen.far), max_steps)
    return layout_of(found.value, seen.near, seen.far, warped), found
