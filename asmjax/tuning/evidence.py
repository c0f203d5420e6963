"""What a view tells about refining a map for it: its shadow's edges and its receivers, sampled.

All that the surrogate knows of a scene stands here as plain arrays: no renderer and no map.
"""

from dataclasses import replace
from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import Receivers, light_offset, project
from asmjax.errors import require
from asmjax.experiment.bench import Bench
from asmjax.experiment.displacement import truth_edges
from asmjax.footprint import uv_jacobian
from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.adaptive.look import MEASURES, Measure
from asmjax.shadow.comparison import BIAS
from asmjax.theory import mean_displacement, texel_edges

SAMPLES = 128
"""Edges, and receivers, that stand for all of them."""

DEEPEST = 20
"""log2 of the nodes a side of the finest grid in which neighbours are counted."""

GAP_STEPS = 6
"""Radii about an edge: 1 to 32 pixels."""

LEAST_SPAN, SPANS = -5, 18
"""log2 of the width of nodes in pixels, from R = 8 at texels of 1/256 pixel to 128 of 32."""

GAPS = np.geomspace(BIAS, 0.2, 17)
"""Distances of casters from receivers that are told apart, in parts of the receiver's depth."""

Numbers: TypeAlias = Array | np.ndarray
"""NumPy's, which compiled code sees as JAX's."""


class Evidence(eqx.Module):
    """Samples of a view, each standing for as many as all others.

    Attributes:
        log2_ratio: (n,) of edges: log2 of texel / pixel size, by the map's measure, for one texel
            per face side.
        spread: (n,) mean displacement of the edge in pixels by texels as large as pixels (M4).
        log_gap: (GAP_STEPS, n) natural logarithm of the distance of casters from receivers, in
            parts of the receiver's depth: the largest within 1, 2, 4, ... pixels of the edge.
        served: (SPANS, n) log2 of the nodes a side at which the map serves each one, where nodes
            are 2^k pixels wide for k from `LEAST_SPAN` on: the finest that any pixel beneath the
            node asks for, whose own node covers both.
        crowd: (DEEPEST + 1, n) pixels of edge in each one's node, by log2 of the nodes a side.
        all_log2_ratio: (m,) of all receivers that the light shines on.
        all_crowd: (DEEPEST + 1, m) how many of them are in each one's node.
        edges, receivers: () how many pixels the samples stand for.
        faces: () of the light.
    """

    log2_ratio: Float[Numbers, " n"]
    spread: Float[Numbers, " n"]
    log_gap: Float[Numbers, "steps n"]
    served: Float[Numbers, "spans n"]
    crowd: Float[Numbers, "levels n"]
    all_log2_ratio: Float[Numbers, " m"]
    all_crowd: Float[Numbers, "levels m"]
    edges: Float[Numbers, ""]
    receivers: Float[Numbers, ""]
    faces: Float[Numbers, ""]


def evidence_of(bench: Bench, reference: AdaptiveShadowMap, seed: int = 0) -> Evidence:
    """The evidence of a view: truth's edges, and what a map of `reference`, built here, tells of
    how far casters are from where their shadows fall.

    Raises:
        UseError: the view has no shadow edge.
    """
    eye, frame = bench.eyes[0], bench.frame
    offset = light_offset(eye.points, frame)
    receivers, jacobian, log2_ratio = _seen(
        eye.points, eye.camera, frame, offset, reference.measure
    )  # fmt: skip
    facing = np.asarray(receivers.facing)
    counted = np.asarray(eye.valid) & facing
    edges = truth_edges(bench.truth, eye, counted)
    require(
        edges.length.size > 0,
        f"view '{bench.view}' sees no edge of a shadow, so no setting changes what it shows; "
        "choose another view or light.",
    )
    lit = bench.truth[edges.pixel] >= 0.5
    dark = np.where(lit[0], edges.pixel[1], edges.pixel[0])
    generator = np.random.default_rng(seed)
    log2_of = np.asarray(log2_ratio, np.float64)
    chosen = _spread(log2_of[dark], edges.length, generator)
    texels = texel_edges(jnp.asarray(jacobian)[..., dark[chosen]], 1.0)
    normal = jnp.asarray(edges.normal[:, chosen], texels.dtype)
    moved = np.asarray(mean_displacement(texels, normal), np.float64)
    lit_side = np.flatnonzero(facing)
    some = _spread(log2_of[lit_side], np.ones(lit_side.size), generator)
    mine, keys = log2_of[dark[chosen]], _keys(receivers, dark)
    return Evidence(
        log2_ratio=mine,
        spread=moved / np.exp2(mine),
        log_gap=_log_gaps(bench, reference, counted)[:, dark[chosen]],
        served=_served(keys, log2_of[dark])[:, chosen],
        crowd=_crowd(keys, edges.length)[:, chosen],
        all_log2_ratio=log2_of[lit_side[some]],
        all_crowd=_crowd(_keys(receivers, lit_side), np.ones(lit_side.size))[:, some],
        edges=np.asarray(edges.length.sum()),
        receivers=np.asarray(float(facing.sum())),
        faces=np.asarray(float(frame.faces)),
    )  # fmt: skip


@eqx.filter_jit
def _seen(points, camera, frame, offset, measure: Measure) -> tuple[Receivers, Array, Array]:
    receivers = project(points, frame, offset)
    jacobian = uv_jacobian(points, camera, frame, receivers)
    return receivers, jacobian, MEASURES[measure](points, camera, frame, receivers)


def _spread(order: np.ndarray, weight: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """`SAMPLES` numbers of items, as often as they weigh, spread evenly over their `order`."""
    by_order = np.argsort(order, kind="stable")
    upto = np.cumsum(weight[by_order])
    at = (np.arange(SAMPLES) + generator.random(SAMPLES)) / SAMPLES * upto[-1]
    return by_order[np.minimum(np.searchsorted(upto, at), order.size - 1)]


def _log_gaps(bench: Bench, reference: AdaptiveShadowMap, counted: np.ndarray) -> np.ndarray:
    """(GAP_STEPS, n) logarithm of the largest of `GAPS` at which any pixel within 1, 2, 4, ... of
    each one is in shadow still; of those that are `counted` (n,), as the sky is always dark."""
    # Imported late: it takes long.
    from scipy.ndimage import maximum_filter

    eye = bench.eyes[0]
    state = reference.build(eye, bench.frame, bench.rays)
    gap = np.full(eye.valid.size, GAPS[0])
    dark = counted & (bench.truth < 0.5)
    for threshold in GAPS[1:]:
        lit = np.asarray(replace(reference, bias=float(threshold)).visibility(state, eye.points))
        gap = np.where(dark & (lit < 0.5), threshold, gap)
    image = np.log(gap).reshape(eye.size)
    return np.stack([
        maximum_filter(image, 2 * radius + 1).reshape(-1) for radius in 2 ** np.arange(GAP_STEPS)
    ])  # fmt: skip


def _keys(receivers: Receivers, pixels: np.ndarray) -> np.ndarray:
    """(DEEPEST + 1, k) the number of each one's node among those that hold any of `pixels` (k,), on
    grids of 1, 2, 4, ... nodes a side."""
    face = np.asarray(receivers.face)[pixels].astype(np.int64)
    column, row = (np.asarray(receivers.uv, np.float64)[:, pixels] * 2**DEEPEST).astype(np.int64)
    numbers = []
    for level in range(DEEPEST + 1):
        shift = DEEPEST - level
        key = ((face << DEEPEST) + (row >> shift) << DEEPEST) + (column >> shift)
        numbers.append(np.unique(key, return_inverse=True)[1])
    return np.stack(numbers)


def _crowd(keys: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(levels, k) the weight (k,) of all that share each one's node."""
    return np.stack([np.bincount(key, weight)[key] for key in keys])


def _served(keys: np.ndarray, log2_ratio: np.ndarray) -> np.ndarray:
    """(SPANS, k) the level that serves each one: the largest, over levels x, of min(x, what the
    most demanding pixel of its node at level x asks for)."""
    demand = np.full(keys.shape, -np.inf)
    for level, key in enumerate(keys):
        most = np.full(key.max() + 1, -np.inf)
        np.maximum.at(most, key, log2_ratio)
        demand[level] = most[key]
    level = np.arange(DEEPEST + 1.0)[:, None]
    spans = LEAST_SPAN + np.arange(SPANS)
    return np.stack([
        np.maximum(np.minimum(level, demand - span).max(axis=0), log2_ratio - span)
        for span in spans
    ])  # fmt: skip
