"""Predicted against measured: how far texels of a known size must move a shadow's edge.

A texel's square of edges a and b (pixels) moves an edge of unit normal n by A/4 + B^2 / (12 A) on
average, A >= B the two of |a . n| and |b . n| (M4 of docs/theory.md): so many pixels go wrong per
pixel of edge. The prediction knows the map's density and truth's edges; it looks up no texel.

It speaks of one edge at a time. Where the next edge, or the end of the surface, is nearer than
texels may move both, edges merge or vanish: such edges, and the wrong pixels beside them, are left
out, and `share` says how much is left.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from asmjax.buffers import EyeBuffer
from asmjax.experiment.aliasing import AliasingMaps
from asmjax.metrics.boundary import SurfacePairs, boundary_edges, edge_midpoints, surface_pairs
from asmjax.metrics.windows import box_sum
from asmjax.theory import mean_displacement, texel_edges

WINDOW = 5
"""Side, in pixels, of the window that first tells an edge's direction."""

REACH = (5.0, 12.0)
"""Pixels along an edge within which its other pairs then tell the direction better: a texel twenty
times as long as wide is moved by a pixel where the direction is off by three degrees."""

STRAIGHT = 1.0
"""Pixels off the line at which a pair is no longer of the same straight edge."""

NEIGHBOURS = 64
"""Pairs that are looked at around each, at most."""

FARTHEST = 32
"""Pixels that are looked along an edge's normal for the next edge."""


@dataclass(frozen=True)
class Displacement:
    """Pixels that go wrong per pixel of truth's edges, where edges stand alone.

    Attributes:
        predicted: from the texels' sizes alone (M4).
        measured: misclassified pixels / length.
        length: of the edges that count, pixels.
        share: their part of all edges on surfaces that texels answer.
    """

    predicted: float
    measured: float
    length: float
    share: float


@dataclass(frozen=True, eq=False)
class TruthEdges:
    """Where the shadow's edges of truth lie in the image, pair by pair of neighbouring pixels.

    Attributes:
        pixel: (2, k) the two pixels of each pair, flat.
        middle: (2, k) right and down, in pixels; the centre of pixel (0, 0) is (0.5, 0.5).
        normal: (2, k) unit normal of the edge, into the light.
        length: (k,) pixels of edge that the pair stands for.
        room: (k,) pixels along the normal, both ways, without another edge or the surface's end,
            at most `FARTHEST`.
    """

    pixel: np.ndarray
    middle: np.ndarray
    normal: np.ndarray
    length: np.ndarray
    room: np.ndarray


def truth_edges(truth: ArrayLike, eye: EyeBuffer, counted: np.ndarray) -> TruthEdges:
    """The edges of `truth` (n,) between neighbours that see one surface and are both `counted`."""
    height, width = eye.size
    lit = (np.asarray(truth) >= 0.5).reshape(height, width)
    pairs = surface_pairs(counted.reshape(height, width), eye.depth.reshape(height, width))
    edges = boundary_edges(lit, pairs)
    right, down = _signed(lit, edges)
    across, along = box_sum(right, WINDOW), box_sum(down, WINDOW)
    number = np.arange(height * width).reshape(height, width)
    parts = []
    for mask, one, other in (
        (edges.right, np.s_[:, :-1], np.s_[:, 1:]),
        (edges.down, np.s_[:-1], np.s_[1:]),
    ):
        normal = np.stack([(a[one] + a[other])[mask] for a in (across, along)])
        own = normal[0] if mask is edges.right else normal[1]
        norm = np.hypot(*normal)
        # Two edges of a thin shadow cancel: each pair is then taken for an edge of its own.
        alone = np.abs(own) < 0.1 * norm
        alone |= norm == 0
        straight = np.zeros_like(normal)
        straight[0 if mask is edges.right else 1] = 1
        normal = np.where(alone, straight, normal / np.where(norm == 0, 1, norm))
        length = np.abs(normal[0] if mask is edges.right else normal[1])
        parts.append((np.stack([number[one][mask], number[other][mask]]), normal, length))
    pixel, normal, length = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    middle = edge_midpoints(edges).T
    for reach in REACH:
        normal = _straightened(middle, normal, reach)
    first = np.arange(length.size) < np.count_nonzero(edges.right)
    length = np.abs(np.where(first, normal[0], normal[1]))
    room = _room(lit, _whole(pairs), middle, normal)
    return TruthEdges(pixel, middle, normal, length, room)


def _straightened(middle, normal, reach: float) -> np.ndarray:
    """Normals (2, k) of the lines through each pair's neighbours of the same straight edge."""
    # Imported late: it takes long.
    from scipy.spatial import KDTree

    count = middle.shape[1]
    if count < 3:
        return normal
    tree = KDTree(middle.T, balanced_tree=False, compact_nodes=False)
    distance, who = tree.query(middle.T, min(NEIGHBOURS, count), distance_upper_bound=reach)
    there = np.isfinite(distance)
    who = np.where(there, who, 0)
    offset = middle[:, who] - middle[:, :, None]
    off = np.einsum("ik,ikj->kj", normal, offset)
    same = there & (np.abs(off) <= STRAIGHT + 0.1 * np.where(there, distance, 0.0))
    same &= np.einsum("ik,ikj->kj", normal, normal[:, who]) > 0.8
    weight = same / np.maximum(same.sum(axis=1, keepdims=True), 1)
    centred = offset - (offset * weight).sum(axis=-1)[..., None]
    (xx, xy), (_, yy) = np.einsum("ikj,lkj,kj->ilk", centred, centred, weight)
    # The direction of least spread.
    angle = 0.5 * np.arctan2(2 * xy, xx - yy) + 0.5 * np.pi
    found = np.stack([np.cos(angle), np.sin(angle)])
    found = found * np.where((found * normal).sum(axis=0) < 0, -1.0, 1.0)
    long = (same.sum(axis=1) >= 4) & ((found * normal).sum(axis=0) > 0.8)
    return np.where(long, found, normal)


def _whole(pairs: SurfacePairs) -> np.ndarray:
    """(height, width) bool: pixels that see the same surface as all their neighbours."""
    whole = np.ones((pairs.right.shape[0], pairs.down.shape[1]), bool)
    whole[:, :-1] &= pairs.right
    whole[:, 1:] &= pairs.right
    whole[:-1] &= pairs.down
    whole[1:] &= pairs.down
    return whole


def _room(lit, whole, middle, normal) -> np.ndarray:
    """Steps along the normal, into light and into shadow, until it is otherwise, or not `whole`."""
    height, width = lit.shape
    room = np.full(middle.shape[1], float(FARTHEST))
    for side in (1, -1):
        going = np.ones(room.size, bool)
        for step in range(1, FARTHEST + 1):
            x, y = np.floor(middle + side * step * normal).astype(int)
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            x, y = np.where(inside, x, 0), np.where(inside, y, 0)
            on = inside & whole[y, x] & (lit[y, x] == (side > 0))
            room = np.where(going & ~on, np.minimum(room, step - 1), room)
            going &= on
    return room


def _signed(lit: np.ndarray, edges: SurfacePairs) -> tuple[np.ndarray, np.ndarray]:
    """Images (height, width) of steps to the right and down: +1 into light, -1 out of it, at both
    pixels of a pair."""
    right, down = np.zeros(lit.shape), np.zeros(lit.shape)
    step = np.where(edges.right, lit[:, 1:].astype(float) - lit[:, :-1], 0.0)
    right[:, :-1] += step
    right[:, 1:] += step
    step = np.where(edges.down, lit[1:].astype(float) - lit[:-1], 0.0)
    down[:-1] += step
    down[1:] += step
    return right, down


def displacement(
    truth: ArrayLike, visibility: ArrayLike, eye: EyeBuffer, maps: AliasingMaps
) -> Displacement:
    """Both numbers for one map. Without any edge that counts, all are 0."""
    counted = eye.valid & maps.known
    edges = truth_edges(truth, eye, counted)
    total = float(edges.length.sum())
    if total == 0:
        return Displacement(0.0, 0.0, 0.0, 0.0)
    # Of the two pixels' Jacobians the mean of what they predict.
    sizes = [_moves(maps.jacobian[..., pixel], edges.normal) for pixel in edges.pixel]
    expected, most = np.mean([size[0] for size in sizes], 0), np.max([size[1] for size in sizes], 0)
    alone = edges.room >= 2 * most
    length = float(edges.length[alone].sum())
    if length == 0:
        return Displacement(0.0, 0.0, 0.0, 0.0)
    wrong = (np.asarray(truth) >= 0.5) != (np.asarray(visibility) >= 0.5)
    row, column = np.divmod(np.flatnonzero(wrong & counted), eye.size[1])
    whose, distance = _nearest(np.stack([column + 0.5, row + 0.5]), edges.middle)
    mine = alone[whose] & (distance <= most[whose] + 1)
    predicted = float((expected * edges.length)[alone].sum()) / length
    return Displacement(predicted, float(mine.sum()) / length, length, length / total)


def _moves(jacobian: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and largest displacement (k,) of edges by texels, pixels: the second is (A + B) / 2."""
    texels = texel_edges(jnp.asarray(jacobian), 1.0)
    mean = mean_displacement(texels, jnp.asarray(normal, texels.dtype))
    falls = np.abs(np.einsum("kin,kn->in", np.asarray(texels, np.float64), normal))
    return np.asarray(mean, np.float64), 0.5 * falls.sum(axis=0)


def _nearest(points: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of `points` (2, n) the nearest of `targets` (2, k), and how far it is."""
    # Imported late: it takes long.
    from scipy.spatial import KDTree

    if not points.size:
        return np.zeros(0, int), np.zeros(0)
    distance, whose = KDTree(targets.T, balanced_tree=False, compact_nodes=False).query(points.T)
    return np.asarray(whose), np.asarray(distance)
