"""A smooth stand-in for the adaptive map: error and seconds for any settings, differentiable.

The real map decides: an edge is refined or is not, a node fits or does not, a pass is made or is
not. Here each decision is a sigmoid of how far it is from tipping, `temperature` wide in log2 of
what it compares; levels are continuous; and refinement is a ladder of texel sizes that each costs
nodes, texels and passes, down which a map goes as far as its goal, memory and time let it.

| the map | here |
| --- | --- |
| straddles at texels of r pixels | a band 2 reach r wide along an edge, within the node |
| nodes over n pixels that ask, on average | 1 - exp(-n) of the places (occupancy, Poisson) |
| edge moved by texels of r pixels | d = spread r (M4), from `miss` on as sqrt(d miss): lost |
| time of a pass, a node, a texel, a look | coefficients, fitted to trials |

What is fitted (`Fit`) are sixteen numbers with meanings, not a table of the trials.
"""

import math
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.comparison import texel_bytes
from asmjax.tuning.evidence import LEAST_SPAN, Evidence, Numbers
from asmjax.tuning.space import node_cost

TEMPERATURE = 0.25
"""Width of its decisions, in factors of 2, where the surrogate is corrected, asked and shown. Its
numbers are fitted, and searches begin, with wider ones."""

RUNGS = 6
"""Passes along edges, at most: from matched texels 2^-10 is reached by the smallest steps."""

PAGE_OVERHEAD = 300
"""Bytes of a page besides its texels: tables, on the device and on the host."""

START_LOG2 = 9.0
"""log2 of the starting resolution."""

COARSE_LOG2 = 2.0
"""log2 of texel / matched texel that coverage of all receivers is content with."""

TABLES = 0.4
"""Natural logarithm of the nodes that fit with cells of a side / with twice as many. A path down
takes a table every three levels of 2: where nodes share none it is ln 2, where they are dense 0."""

GREED = 0.5
"""Part of the edges that a part of their nodes serves, as an exponent: most profitable first."""

COVER_SHARE = 0.25
"""Part of the free memory that coverage may take."""

FINER_LEVELS = 2.0
"""Levels that a pass goes deeper."""

SLOWER = 1.5
"""Times as long as by its cost model that the map has seen launches take."""

LN2 = math.log(2.0)


Number: TypeAlias = Array | np.ndarray | float
"""() of NumPy, of JAX in compiled code, or plain."""


class Fit(NamedTuple):
    """What is fitted to trials: natural logarithms, 0 for as expected, () each.

    Attributes:
        fixed, look, turn, texel, node, launch: seconds of a frame's fixed part (its query
            included), of looking at every pixel once, of one turn's share of all pixels, per texel
            cast and stored, per node decided on, per launch.
        reach: of a pixel's stencil along edges, beside one texel.
        miss: displacement in pixels from which on features are lost rather than moved.
        scale, floor: of the error: scale * predicted + floor.
        memory: nodes that fit / nodes that are counted here.
        tables: the same for each doubling of the cells a side, which takes tables.
        profit: benefit of a node / benefit that is counted here.
        greed: exponent of the part of the edges that a part of their nodes serves, beside `GREED`.
        gap: distance of casters / as it is counted here.
        hurry: slowness of launches that a limit of time reckons with, beside `SLOWER`.
    """

    fixed: Number
    look: Number
    turn: Number
    texel: Number
    node: Number
    launch: Number
    reach: Number
    miss: Number
    scale: Number
    floor: Number
    memory: Number
    tables: Number
    profit: Number
    greed: Number
    gap: Number
    hurry: Number


class Costs(NamedTuple):
    """Where the fit starts: seconds as of `Fit`."""

    fixed: float = 0.01
    look: float = 0.02
    turn: float = 0.004
    texel: float = 4e-8
    node: float = 4e-6
    launch: float = 1e-3


COSTS = Costs()
"""The expected ones."""


class Rules(NamedTuple):
    """What the map goes by besides the settings that are tuned; () each.

    Attributes:
        per_texel, launch: seconds by its cost model, by which it weighs benefits and keeps to
            limits of time.
        texel_bytes: of one texel.
        cover: 1 where it refines where no edge was seen too, else 0.
    """

    per_texel: Number
    launch: Number
    texel_bytes: Number
    cover: Number


def rules_of(base: AdaptiveShadowMap) -> Rules:
    """The rules of maps that differ from `base` in what is tuned only; it has a cost model."""
    per_texel, launch = node_cost(base)
    return Rules(per_texel, launch, float(texel_bytes(base.compare)), float(base.cover))


class Predicted(NamedTuple):
    """What the surrogate says; () each.

    Attributes:
        edge_px: wrong pixels per pixel of edge.
        seconds: from nothing.
        nodes: made.
    """

    edge_px: Float[Array, ""]
    seconds: Float[Array, ""]
    nodes: Float[Array, ""]


# Compiled on its own too: who compiles derivatives of it traces it once and not each time it is
# called.
@jax.jit
def predict(
    evidence: Evidence,
    settings: dict[str, Array],
    fit: Fit,
    temperature: float | Array,
    rules: Rules,
    costs: Costs = COSTS,
) -> Predicted:
    """Error and seconds of a map with continuous settings (`asmjax.tuning.space.values_at`).

    Args:
        temperature: width of decisions, in factors of 2.
        rules: that the map goes by.
    """
    t = temperature
    log2 = {name: jnp.log2(value) for name, value in settings.items()}
    target, node, cells = log2["ratio_target"], log2["node_resolution"], log2["cells"]
    finest = _least(log2["finest_ratio"], target, t)
    side = settings["node_resolution"] + 2
    page = side**2 * rules.texel_bytes + PAGE_OVERHEAD
    pages = settings["memory_bytes"] / page
    # Where memory is little, fewer texels to start with: a power of two, a quarter of the pages.
    most = node + 0.5 * (jnp.log2(pages / evidence.faces) - 2)
    start = _least(START_LOG2, most - 0.4, t)
    pages = pages * jnp.exp(fit.memory + (fit.tables - TABLES) * (cells - 1))
    roots = evidence.faces * jnp.exp2(2 * (start - node))
    discontinuity = jnp.log(settings["discontinuity"])

    def nodes_of(count, size, weight: Array | float = 1.0):
        """Part of the nodes made over (n,) crowds of so many asking pixels each, which stand for
        `weight` pixels, and part of those pixels that get one. Nodes have texels of log2 `size`
        (n,) beside a pixel's: the coarser, the more texels pixels there ask for."""
        # Nodes that help few pixels may not be worth their cost.
        seconds = rules.per_texel * jnp.exp2(2 * (node + size)) + rules.launch
        asked = settings["least_profit"] * seconds / weight - 0.5
        asked = jnp.log2(_above(asked, 0.2) * jnp.exp(fit.profit))
        occupied = 1 - jnp.exp(-count)
        worth = jax.nn.sigmoid((jnp.log2(count / occupied) - asked) / t)
        return occupied * worth, worth

    def up(*octaves):
        """Levels (rows, n) that the start is deepened by for resolutions so many octaves above its
        own, a row (n,) each."""
        return _above(_whole(jnp.stack(octaves) / cells, 0.3 * t), 0.1)

    def made_at(above, below):
        """Whether there are nodes at a level that should be below another."""
        return 1 - jnp.exp(-3 * _above(below - above, 0.05))

    # First receivers that are far too coarse, with or without an edge.
    coarse = target + COARSE_LOG2
    log_all, log_crowd = jnp.log(evidence.all_crowd), jnp.log(evidence.crowd)
    (level,) = up(evidence.all_log2_ratio - coarse - start)
    crowd = jnp.exp(_between(log_all, start + cells * level - node))
    size = evidence.all_log2_ratio - start - cells * level
    share = settings["pixel_share"]
    part, worth = nodes_of(crowd / share, size, share)
    coarser = made_at(0.0, level)
    covering = rules.cover * evidence.receivers * jnp.mean(coarser * part / crowd)
    # It may take a quarter of what the first texels leave.
    room = _above(pages / roots - 1, 0.05) * roots * COVER_SHARE
    covers = rules.cover / (1 + (covering / room) ** 4) ** 0.25
    covering = covering * covers
    # Edges lie where receivers do: as many of them are in nodes that are worth their cost.
    covers = covers * jnp.sum(coarser * worth) / (jnp.sum(coarser) + 1e-3)

    # Then along the edges: texels that match, and from there pass by pass to the finest.
    begun = evidence.log2_ratio - start
    same = jnp.ones_like(begun)

    def goal(ratio):
        """Octaves (n,) above the start that serve each edge where all ask for texels of log2
        `ratio`."""
        nodes = _between(evidence.served, (ratio + node - LEAST_SPAN) * same)
        return nodes + node - start

    # Within a pixel casters come nearer as they did outside of it.
    steep = jnp.maximum(evidence.log_gap[2] - evidence.log_gap[0], 0) / 2
    covered, first, last = up(begun - coarse, goal(target), goal(finest))
    covered = rules.cover * covered
    deeper = first + FINER_LEVELS * jnp.arange(RUNGS)[:, None]
    deeper = covered + _above(last - _above(last - deeper, 0.1) - covered, 0.1)
    parents = jnp.concatenate([covered[None], deeper[:-1]])

    def rung(parent, level):
        """Nodes along all edges at `level` (n,) below `parent`, and the part (n,) that has them."""
        size = begun - cells * parent
        texel = jnp.exp2(size + fit.reach / LN2)
        finer = begun - cells * level
        width = jnp.exp2(finer + node)
        # Casters as far off as texels of that size show them.
        gap = _between(evidence.log_gap, size) - steep * _above(-size, t) + fit.gap
        far_off = jax.nn.sigmoid((gap - discontinuity) / (0.7 * t))
        # Pixels that straddle, per pixel of edge: a band of the parent's texels in the node.
        band = 2 * texel / (1 + 2 * texel / width)
        crowd = jnp.exp(_between(log_crowd, start + cells * level - node))
        part, worth = nodes_of(crowd * band, finer)
        share = made_at(parent, level)
        nodes = far_off * share * part / crowd * (1 + 2 * texel / width)
        return evidence.edges * jnp.mean(nodes), far_off * worth, jnp.mean(share)

    per_rung, gates, passes = jax.vmap(rung)(parents, deeper)
    one, none = jnp.ones(1), jnp.zeros(1)
    made = jnp.concatenate([jnp.stack([roots, covering]), per_rung])
    looks = jnp.concatenate([none, none, one, 0.4 * passes[1:]])
    turns = jnp.concatenate([none, 8 / settings["pixel_share"] * one, 0 * passes])
    passes = jnp.concatenate([one, one, passes])

    looking = costs.look * jnp.exp(fit.look) * looks + costs.turn * jnp.exp(fit.turn) * turns
    casting = (
        costs.texel * jnp.exp(fit.texel) * made * side**2
        + costs.node * jnp.exp(fit.node) * made
        + costs.launch * jnp.exp(fit.launch) * passes
    )
    spent = looking + casting
    room = _part(pages, made, t)
    # The map keeps time for another look, and for launches as slow as the slowest one.
    before = jnp.cumsum(spent) - spent + 2 * looking
    left = settings["time_limit"] - before
    reckoned = SLOWER * jnp.exp(fit.hurry) * (rules.per_texel * side**2 * made + rules.launch)
    time = _within(left / (reckoned + 1e-4), t)
    # The first texels are there whatever the limits say.
    done = (room * time).at[0].set(1.0)
    fixed = costs.fixed * jnp.exp(fit.fixed)
    seconds = fixed + jnp.sum(done * spent)
    nodes = jnp.sum(done * made)

    # Edges end at the rung that they reach, with texels that overshoot by half a level.
    miss = jnp.exp(fit.miss)

    def moved(size):
        pixels = evidence.spread * jnp.exp2(size)
        # Features that are thinner than their texels are lost, and move no further.
        return pixels / jnp.sqrt(1 + pixels / miss)

    covers = done[1] * covers
    start_error = covers * moved(begun - cells * covered) + (1 - covers) * moved(begun)
    ends = moved(begun - cells * deeper)
    served = (done[2:] + 1e-9) ** (GREED * jnp.exp(fit.greed))
    reach = jnp.cumprod(served[:, None] * gates, axis=0)
    left = jnp.concatenate([reach[:-1] - reach[1:], reach[-1:]])
    error = jnp.mean((1 - reach[0]) * start_error + jnp.sum(left * ends, axis=0))
    return Predicted(jnp.exp(fit.scale) * error + 1e-3 * jnp.exp(fit.floor), seconds, nodes)


def _whole(x: Float[Array, "rows n"], width) -> Float[Array, "rows n"]:
    """The next whole number above x, as a staircase blurred by a Gaussian that wide."""
    steps = sum(
        wave * jnp.exp(-2 * (jnp.pi * k * width) ** 2) / (jnp.pi * k)
        for k, wave in enumerate(_waves(x), start=1)
    )
    return x + 0.5 + steps


def _waves(x: Float[Array, "rows n"]) -> tuple[Float[Array, "rows n"], ...]:
    """sin 2 pi k x for k = 1, 2, 3."""
    # Row by row in a loop: XLA's CPU backend takes a sine anew for each use of what comes of it,
    # fourteen times here, which was more than half of the time of a gradient.
    sine, cosine = jax.lax.map(lambda row: (jnp.sin(row), jnp.cos(row)), 2 * jnp.pi * x)
    return sine, 2 * sine * cosine, sine * (3 - 4 * sine**2)


def _between(table: Float[Numbers, "rows n"], at: Float[Array, " n"]) -> Float[Array, " n"]:
    """Columns of a table between its rows, each at its own place: cubic, with smooth slopes."""
    at = jnp.clip(at, 0.0, table.shape[0] - 1 - 1e-6)
    low = jax.lax.stop_gradient(jnp.floor(at)).astype(int)
    x = at - low

    def of(row):
        row = jnp.clip(row, 0, table.shape[0] - 1)
        return jnp.take_along_axis(table, row[None], axis=0)[0]

    before, here, there, after = of(low - 1), of(low), of(low + 1), of(low + 2)
    slope, next_slope, rise = 0.5 * (there - before), 0.5 * (after - here), there - here
    bend = 3 * rise - 2 * slope - next_slope
    return here + x * (slope + x * (bend + x * (slope + next_slope - 2 * rise)))


def _part(limit, amounts: Float[Array, " k"], t) -> Float[Array, " k"]:
    """How much of each amount, in order, fits into a limit: 0 to 1, smooth."""
    before = jnp.cumsum(amounts) - amounts
    return _within((limit - before) / (amounts + 1e-3 * limit), t)


def _within(x, t):
    """Smooth x from 0 to 1."""
    return _above(x, 0.3 * t) - _above(x - 1, 0.3 * t)


def _above(x, t):
    """Smooth max(x, 0)."""
    return t * jax.nn.softplus(x / t)


def _least(x, y, t):
    """Smooth min(x, y)."""
    return x - _above(x - y, 0.3 * t)
