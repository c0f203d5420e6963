"""Deciding what to refine: which nodes the receivers ask for, and in which order."""

from enum import Enum
from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from asmjax.shadow.adaptive.address import BITS
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.look import Analysis, Audience
from asmjax.shadow.adaptive.page_table import level_of
from asmjax.shadow.adaptive.pool import Requests
from asmjax.shadow.adaptive.shape import TreeShape


class Wish(Enum):
    """What a pass looks for."""

    EDGES = "mismatched pixels that straddle a discontinuity (Fernando et al. 2001)"
    COARSE_COVERAGE = "all pixels `COARSE` times too coarse: finds what the first texels missed"
    COVERAGE = "all mismatched pixels"
    FINER_EDGES = "pixels that straddle a discontinuity, `FINER_LEVELS` beyond what they have"
    FOLLOW = "a moving view: mismatched edges, and coarse coverage where there are none"


FINER_LEVELS = 2
"""Levels that a pass over finer edges goes deeper, at most. One at a time takes as many nodes again
for the levels between; three and more take them for texels that turn out to hold no edge."""

_EDGES_ONLY = (Wish.EDGES, Wish.FINER_EDGES)
"""Wishes of pixels that straddle an edge, which all face the light."""


class Asking(NamedTuple):
    """Receivers that ask for a deeper page, each (k,): their number in the audience, the level that
    serves them, and the level they ask for."""

    who: Int[np.ndarray, " k"]
    level: Int[np.ndarray, " k"]
    target: Int[np.ndarray, " k"]


def asking_of(analysis: Analysis, audience: Audience, wish: Wish) -> Asking:
    """Which receivers of a look want what: several levels at once where they need them."""
    straddles = np.asarray(analysis.straddles)
    may = straddles if wish in _EDGES_ONLY else np.asarray(audience.receivers.facing)
    who = np.flatnonzero(may)
    level = level_of(np.asarray(analysis.entry)[who])
    target = np.asarray(analysis.coarse if wish is Wish.COARSE_COVERAGE else analysis.target)[who]
    if wish is Wish.FINER_EDGES:
        finer = np.minimum(level + FINER_LEVELS, np.asarray(analysis.finest)[who])
        target = np.maximum(target, finer)
    elif wish is Wish.FOLLOW:
        target = np.where(straddles[who], target, np.asarray(analysis.coarse)[who])
    wants = level < target
    return Asking(who[wants], level[wants].astype(np.int64), target[wants].astype(np.int64))


def requests_of(shape: TreeShape, audience: Audience, asking: Asking) -> Requests:
    """The nodes that receivers ask for, each once, with benefit and N_required.

    A receiver asks for the node over it at its target level.
    N_required = N_current * area ratio, its largest value over the node's square.
    """
    who, level, target = asking
    shift = BITS - shape.log2_nodes_at(target)
    column, row = (np.asarray(at)[who] >> shift for at in (audience.address.x, audience.address.y))
    face = np.asarray(audience.receivers.face)[who].astype(np.int64)
    # Nodes of a level are below 2^26 a side: face, level, row, column fit into 63 bits.
    key = ((((face << 5) + target) << 26) + row << 26) + column
    order = np.argsort(key)
    key = key[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]]) if key.size else np.zeros(0, int)
    log2_ratio = np.asarray(audience.log2_ratio)[who].astype(np.float64)
    # N_current: texels of the serving page within the node's square.
    log2_now = 2 * (shape.log2_node - (target - level) * shape.log2_cells)
    required = np.exp2(log2_now + 2 * (log2_ratio - shape.log2_resolution(level)))[order]
    chosen = order[first]
    return Requests(
        squares=np.stack([face, target, column, row])[:, chosen],
        benefit=np.diff(np.r_[first, key.size]) * float(audience.weight),
        n_required=np.maximum.reduceat(required, first) if first.size else np.zeros(0),
    )


def most_profitable_first(
    requests: Requests, cost: CostModel, least_profit: float = 0.0
) -> Requests:
    """Requests by benefit per cost, largest first; ties by level, face, row and column. Those of
    less than `least_profit` eye pixels per second are left out.

    "Sorted according to this ratio" (Fernando et al. 2001, 3.1) leaves the direction open; the
    greedy order by benefit / cost solves the fractional knapsack.
    """
    profit = requests.benefit / cost.seconds(requests.n_required)
    face, level, column, row = requests.squares
    order = np.lexsort((column, row, face, level, -profit))
    return requests.take(order[profit[order] >= least_profit])
