"""What error a warped, partitioned layout will have, before any chart of it exists; differentiable.

Visible receivers of one or more faces of a light stand for all that is seen. A layout cuts them
into slabs of eye depth, gives each slab of each face a perspective along the face's axis and a
share of the texels; the error of a receiver is the width of its texel / the width of its pixel, m.
Everything is smooth, or continuous with kinks, in the layout and in what is seen, so it can be
differentiated with respect to warp strength, splits, shares, and the light behind them.

| the paper's | here |
| --- | --- |
| n | near / u: u = 0 does not warp, u = 1 is the eye's own perspective (`asmjax.theory`) |
| z' = z - 1 + n | (1 + r q) / r, with q the distance along the axis from the near end, r = 1 / n |
| ds/dz, equation 1 | (1 + r L) / (L (1 + r q)^2), with L the slab's length along the axis |

**Splits.** Receivers are samples, so the extents of a slab, and which receivers it holds, are steps
in a split's position: derivatives would be 0. But the samples stand for surfaces, whose extents
move with the split, and whose points change sides there: by Leibniz' rule the derivative of a mean
over slabs has a term for either. Here a split stands for splits at the two edges of the bin of log
depth that it lies in, in proportion to its place between them: extents and memberships are their
averages. That is exact at the edges of bins, and in between both terms of the derivative are
differences over one bin.

Source: Lloyd, Yoon, Tuft, Manocha, TR05-024, sections 3 and 4 (warp, error, texels in proportion).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from asmjax.footprint import log2_m
from asmjax.numerics import safe_divide
from asmjax.shadow.warped.sight import BINS, Seen, bin_of, in_bins
from asmjax.theory.arguments import held

LEAST_SIZE = 1e-9
"""Extents of a slab are at least this part of the largest coordinate of all that is seen."""


class Layout(NamedTuple):
    """How k slabs of each face are warped and share the texels.

    Attributes:
        u: (faces, k) warp strength in 1 / (near distance of the slab), 0 or more.
        splits: (k - 1,) eye depths between the slabs, ascending.
        shares: (faces, k) of all texels, above 0; those of slabs that hold something are scaled to
            a sum of 1.
        aspect: (faces, k) columns / rows, above 0.
    """

    u: Float[Array, "faces k"]
    splits: Float[Array, " splits"]
    shares: Float[Array, "faces k"]
    aspect: Float[Array, "faces k"]


class Slabs(NamedTuple):
    """Where the slabs lie; (faces, k) each but `edges`.

    Attributes:
        edges: (k + 1,) in bins.
        start: eye depth of the near end.
        low, length: nearest place along the axis, and the extent from there, plane units.
        held: bool, whether there is a receiver.
    """

    edges: Float[Array, " edges"]
    start: Float[Array, "faces k"]
    low: Float[Array, "faces k"]
    length: Float[Array, "faces k"]
    held: Bool[Array, "faces k"]


def slabs_of(seen: Seen, splits: Float[Array, " splits"]) -> Slabs:
    """The slabs between the nearest receiver, the splits, and the farthest one."""
    edges = jnp.pad(in_bins(splits, seen.near, seen.far), 1).at[-1].set(BINS)
    start = jnp.concatenate([seen.near[None], held(splits, seen.near, seen.far)])
    low, high = _extent(edges, seen.outline.plane[1][:, None], seen.outline.empty)
    low, size = _sized(seen, low, high)
    first, last = jnp.floor(edges[:-1]), jnp.ceil(edges[1:])
    bins = jnp.arange(BINS)
    touched = (bins >= first[:, None]) & (bins < last[:, None])
    holds = (touched & ~seen.outline.empty[:, None]).any(axis=-1)
    start = jnp.broadcast_to(start, low.shape)
    return Slabs(edges, start, low, size, holds)


def slab_alpha(seen: Seen, splits: Float[Array, " splits"]) -> Float[Array, "faces k"]:
    """Far / near distance of each slab along its axis, 1 or more: what xi is measured by
    (`asmjax.theory.u_from_xi`); 1 where there is no axis."""
    slabs = slabs_of(seen, splits)
    return 1 + slabs.length * seen.pace[:, None] / slabs.start


def log2_errors(
    seen: Seen, layout: Layout, texels
) -> tuple[Float[Array, "k n"], Float[Array, "k n"]]:
    """log2 m of each receiver in each slab's parameterization, and how much it counts there.

    Args:
        texels: in all, over faces and slabs.

    Returns:
        (k, n) log2 of texel / pixel width in the worst direction (`asmjax.footprint.m`), and (k, n)
        weights that sum to `seen.weight` over the slabs. A charted map has these errors but for
        what its charts are larger than the receivers, and for whole rows and columns: 1e-3.
    """
    slabs = slabs_of(seen, layout.splits)
    rate = layout.u * seen.pace[:, None] / slabs.start
    left, right = _extent(slabs.edges, _bent(seen, slabs, rate), seen.outline.empty)
    _, width = _sized(seen, left, right)
    shares = jnp.where(slabs.held, layout.shares, 0)
    shares = safe_divide(shares, shares.sum())
    area = jnp.where(slabs.held, shares, 1) * texels
    columns, rows = jnp.sqrt(area * layout.aspect), jnp.sqrt(area / layout.aspect)

    def of(table):
        """(k, n) from (faces, k)."""
        return table[seen.face].T

    rate, length = of(rate), of(slabs.length)
    across = seen.plane[0] - seen.centre[seen.face]
    grown = 1 + rate * held(seen.plane[1] - of(slabs.low), 0.0, length)
    per_across = of(columns) / of(width) / grown
    per_along = -per_across * rate * across / grown
    along = of(rows) / length * (1 + rate * length) / grown**2
    texel = jnp.stack([
        jnp.stack([per_across * seen.jacobian[0, i] + per_along * seen.jacobian[1, i]
                   for i in range(2)]),
        jnp.stack([along * seen.jacobian[1, i] for i in range(2)]),
    ])  # fmt: skip
    log2 = log2_m(texel.reshape(2, 2, -1), 1).reshape(rate.shape)
    return log2, seen.weight * _membership(slabs.edges, seen)


def log2_p_mean(log2_values: Float[Array, "..."], weight: Float[Array, "..."], power) -> Array:
    """log2 of the weighted power mean (sum w x^p / sum w)^(1/p); 0 where nothing counts."""
    counts = weight > 0
    raised = jnp.where(counts, power * log2_values, -jnp.inf)
    most = jax.lax.stop_gradient(jnp.where(counts.any(), raised.max(), 0))
    part = jnp.where(counts, jnp.exp2(jnp.where(counts, raised - most, 0)), 0)
    total, whole = (weight * part).sum(), weight.sum()
    some = (whole > 0) & (total > 0)
    mean = jnp.where(some, total, 1) / jnp.where(some, whole, 1)
    return jnp.where(some, (jnp.log2(mean) + most) / power, 0)


def _membership(edges, seen: Seen):
    """(k, n) the part of each receiver that lies in each slab: that of its bin."""
    beyond = bin_of(seen.depth, seen.near, seen.far) + 1 - edges[1:-1, None]
    after = held(beyond, 0.0, 1.0)
    one = jnp.ones((1, seen.depth.size), after.dtype)
    after = jnp.concatenate([one, after, 0 * one])
    return after[:-1] - after[1:]


def _bent(seen: Seen, slabs: Slabs, rate):
    """(faces, k, BINS, DIRECTIONS) what a slab's warp makes of the outline across its axis."""
    across, along = seen.outline.plane[:, :, None]
    low, length, rate = (table[..., None, None] for table in (slabs.low, slabs.length, rate))
    return (across - seen.centre[:, None, None, None]) / (1 + rate * held(along - low, 0.0, length))


def _extent(edges, values, empty):
    """Least and largest (faces, k) of `values` (faces, 1 or k, BINS, DIRECTIONS) in each slab."""
    least = jnp.where(empty[:, None], jnp.inf, values.min(axis=-1))
    most = jnp.where(empty[:, None], -jnp.inf, values.max(axis=-1))
    whole = jax.lax.stop_gradient(jnp.floor(edges))
    part, bins = edges - whole, jnp.arange(BINS)
    # The widest choice of edges first: it stands in where another leaves nothing between them.
    ups = jnp.asarray([(0, 1), (0, 0), (1, 1), (1, 0)])[:, :, None]
    start, end = (whole[:-1] + ups[:, 0])[..., None], (whole[1:] + ups[:, 1])[..., None]
    inside = ((bins >= start) & (bins < end))[:, None]
    low = jnp.where(inside, least, jnp.inf).min(axis=-1)
    high = jnp.where(inside, most, -jnp.inf).max(axis=-1)
    none = low > high
    low, high = (jnp.where(none, jnp.where(none[0], 0, v[0]), v) for v in (low, high))
    share = jnp.where(ups[:, 0] == 1, part[:-1], 1 - part[:-1])
    share = (share * jnp.where(ups[:, 1] == 1, part[1:], 1 - part[1:]))[:, None]
    return (share * low).sum(axis=0), (share * high).sum(axis=0)


def _sized(seen: Seen, low, high):
    """`low`, and the extent to `high`, which is not 0."""
    outline = jnp.where(seen.outline.empty[..., None], 0, jnp.abs(seen.outline.plane))
    largest = outline.max()
    # Of the unit where all that is seen lies at the very origin.
    least = LEAST_SIZE * jnp.where(largest > 0, largest, 1)
    return low, jnp.maximum(high - low, jax.lax.stop_gradient(least))
