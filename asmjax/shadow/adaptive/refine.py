"""Deciding what to refine: which pixels a finer map would help, and in which order."""

import math
from enum import Enum
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers import Receivers
from asmjax.footprint import required_level, straddles_discontinuity
from asmjax.shadow.adaptive.address import BITS, centre_offset, fixed_point
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.pool import Requests
from asmjax.shadow.adaptive.tree import Tree, TreeShape, find_pages, page_outcome, texel_of
from asmjax.shadow.comparison import plane_is_trusted

COARSE = 4.0
"""Texel / pixel size, over the matched one, that coarse coverage is content with."""


class Wish(Enum):
    """What a pass looks for."""

    EDGES = "mismatched pixels that straddle a discontinuity (Fernando et al. 2001)"
    COARSE_COVERAGE = "all pixels `COARSE` times too coarse: finds what the first texels missed"
    COVERAGE = "all mismatched pixels"
    FINER_EDGES = "pixels that straddle a discontinuity, one level beyond what they have"


LOOK_SIZES = tuple(4**k for k in range(6, 14))
"""Numbers of receivers that are looked at: others are padded, so that nothing retraces."""


class Audience(eqx.Module):
    """The receivers that a pass looks at, on the device and, what the host needs of them, there.

    Attributes:
        receivers: on the device, padded to one of `LOOK_SIZES` or whole.
        log2_ratio: (n,) log2 of texel / pixel size for one texel per face side.
        at, face, facing, ratio_here: the same on the host: fixed-point coordinates (2, n), faces,
            facing masks, and `log2_ratio`.
    """

    receivers: Receivers
    log2_ratio: Float[Array, " n"]
    at: np.ndarray
    face: np.ndarray
    facing: np.ndarray
    ratio_here: np.ndarray

    def only(self, which: Bool[np.ndarray, " n"]) -> "Audience":
        """The chosen receivers, padded with ones that face no light."""
        index = np.flatnonzero(which)
        size = next((s for s in LOOK_SIZES if s >= index.size), self.face.size)
        if size >= self.face.size:
            return self
        padded = np.zeros(size, np.int32)
        padded[: index.size] = index
        receivers, log2_ratio = _taken(self.receivers, self.log2_ratio, padded, index.size)
        return audience(receivers, log2_ratio)


def audience(receivers: Receivers, log2_ratio: Float[Array, " n"]) -> Audience:
    """All of `receivers`."""
    return Audience(
        receivers=receivers,
        log2_ratio=log2_ratio,
        at=np.asarray(_fixed_point(receivers.uv)),
        face=np.asarray(receivers.face),
        facing=np.asarray(receivers.facing),
        ratio_here=np.asarray(log2_ratio),
    )


_fixed_point = jax.jit(fixed_point)


@jax.jit
def _taken(receivers: Receivers, log2_ratio, index, count):
    chosen, ratio = jax.tree.map(lambda a: a[..., index], (receivers, log2_ratio))
    real = jnp.arange(index.size) < count
    return eqx.tree_at(lambda r: r.facing, chosen, chosen.facing & real), ratio


class Analysis(eqx.Module):
    """What one look at all receivers found.

    Attributes:
        level: (n,) level of the page that serves each receiver now.
        target: (n,) level at which it is matched.
        finest: (n,) deepest level worth having for it.
        coarse: (n,) level at which its texels are `COARSE` times as large.
        straddles: (n,) whether the 2 x 2 texels around it disagree about it, or one of them
            cannot decide.
    """

    level: Int[Array, " n"]
    target: Int[Array, " n"]
    finest: Int[Array, " n"]
    coarse: Int[Array, " n"]
    straddles: Bool[Array, " n"]


@eqx.filter_jit
def analyse(
    shape: TreeShape,
    tree: Tree,
    receivers: Receivers,
    log2_ratio: Float[Array, " n"],
    log2_target: float,
    log2_finest: float,
    bias: float,
    perspective: bool,
) -> Analysis:
    """Serve every receiver, and see whether more texels could change the answer.

    Args:
        log2_ratio: (n,) log2 of texel / pixel size for one texel per face side.
        log2_target: log2 of the ratio at which a pixel is matched; 0 for texels as small as pixels.
        log2_finest: log2 of the smallest ratio worth having.
    """
    at = fixed_point(receivers.uv)
    page = find_pages(shape, tree, receivers, at)
    outcome = partial(page_outcome, shape, tree, receivers, at, page)
    rules = {"bias": bias, "perspective": perspective}
    level = tree.level[page]
    # Half a texel in fixed point: its bit says which neighbours are nearest.
    half = (at >> (BITS - 1 - shape.log2_resolution(level))) & 1
    side = jnp.where(half == 1, 1, -1).astype(at.dtype)
    steps = [side * jnp.array([[dx], [dy]], at.dtype) for dy in (0, 1) for dx in (0, 1)]
    taps = jnp.stack([outcome(step, **rules) for step in steps])
    texel, log2 = texel_of(shape, tree, at, page)
    undecided = jnp.zeros_like(receivers.facing)
    for step in steps:
        offset = centre_offset(at, texel + step, log2, log2_ratio.dtype)
        undecided |= ~plane_is_trusted(receivers, offset, perspective)
    at_start = log2_ratio - shape.log2_resolution(0)

    def whole_level(log2_goal):
        wanted = required_level(at_start, shape.log2_cells, log2_goal)
        return jnp.clip(jnp.ceil(wanted), 0, shape.levels).astype(jnp.int32)

    return Analysis(
        level=level,
        target=whole_level(log2_target),
        finest=whole_level(log2_finest),
        coarse=whole_level(log2_target + math.log2(COARSE)),
        straddles=(straddles_discontinuity(taps) | undecided) & receivers.facing,
    )


def requests_of(shape: TreeShape, analysis: Analysis, audience: Audience, wish: Wish) -> Requests:
    """The nodes that the receivers ask for, each once, with benefit and N_required.

    A receiver asks for the node over it at its target level: several levels at once where it
    needs them. N_required = N_current * largest area ratio, over the node's square.
    """
    at, face, log2_ratio = audience.at, audience.face, audience.ratio_here
    level, target = np.asarray(analysis.level), np.asarray(analysis.target)
    if wish is Wish.COARSE_COVERAGE:
        target = np.asarray(analysis.coarse)
    elif wish is Wish.FINER_EDGES:
        target = np.maximum(target, np.minimum(level + 1, np.asarray(analysis.finest)))
    wants = audience.facing & (level < target)
    if wish not in (Wish.COVERAGE, Wish.COARSE_COVERAGE):
        wants &= np.asarray(analysis.straddles)
    who = np.flatnonzero(wants)
    level, target = level[who].astype(np.int64), target[who].astype(np.int64)
    log2_nodes = shape.log2_nodes_at(target)
    column, row = (at[:, who].astype(np.int64) >> (BITS - log2_nodes)).astype(np.int64)
    # Nodes of a level are below 2^26 a side: face, level, row, column fit into 63 bits.
    key = ((((face[who].astype(np.int64) << 5) + target) << 26) + row << 26) + column
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]]) if key.size else np.zeros(0, int)
    benefit = np.diff(np.r_[first, key.size])
    texels_now = np.ldexp(1.0, 2 * (shape.log2_node - ((target - level) * shape.log2_cells)[order]))
    ratio = np.exp2(2 * (log2_ratio[who][order] - shape.log2_resolution(level[order])))
    required = texels_now * ratio
    largest = np.maximum.reduceat(required, first) if first.size else np.zeros(0)
    chosen = order[first]
    return Requests(
        face=face[who][chosen].astype(np.int64),
        level=target[chosen],
        column=column[chosen],
        row=row[chosen],
        benefit=benefit,
        n_required=largest,
    )


def most_profitable_first(requests: Requests, cost: CostModel) -> Requests:
    """Requests by benefit per cost, largest first; ties by level, face, row and column.

    "Sorted according to this ratio" (Fernando et al. 2001, 3.1) leaves the direction open; the
    greedy order by benefit / cost solves the fractional knapsack.
    """
    profit = requests.benefit / cost.seconds(requests.n_required)
    order = np.lexsort((requests.column, requests.row, requests.face, requests.level, -profit))
    return requests.take(order)
