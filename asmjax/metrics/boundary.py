"""How far a method moves shadow boundaries, in eye pixels (M2, M3 of docs/theory.md).

A boundary is a set of pixel edges: the unit segments between two neighbouring pixels of which
one is lit (visibility >= 1/2) and the other is not. Distances are between midpoints of edges, so
equal images give exactly 0 and a straight boundary that moves by d pixels gives d. Only where
edges lie counts, not which side is lit: an image and its negative have the same boundary.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Shaped

from asmjax.errors import require
from asmjax.metrics.visibility_error import VisibilityError, visibility_error
from asmjax.metrics.windows import box_sum

CAP_PX = 64.0
"""Distances end here, in pixels: an edge with no partner this near is not displaced but missing
from one image or invented by the other. It also bounds `per_edge_length`."""

DEPTH_GAP = 0.005
"""Relative gap in depth that two neighbouring pixels of one surface may always have."""

_WINDOW = 5
"""Side, in pixels, of the window that tells a boundary's local direction."""


class SurfacePairs(NamedTuple):
    """Which neighbouring pixels see the same surface patch, so that an edge between them counts.

    Attributes:
        right: (height, width - 1) bool, pixel (r, c) with (r, c + 1).
        down: (height - 1, width) bool, pixel (r, c) with (r + 1, c).
    """

    right: np.ndarray
    down: np.ndarray


@dataclass(frozen=True)
class BoundaryDisplacement:
    """Distances from each edge of one image's boundary to the other's, both ways together.

    All in pixels but the fraction; all 0 where neither image has a boundary.

    Attributes:
        mean: mean distance.
        p95: 95th percentile.
        hausdorff: largest distance.
        unmatched_fraction: share of edges with no partner within `CAP_PX`; their distance counts
            as `CAP_PX` in the three above.
        per_edge_length: misclassified pixels per pixel of truth's boundary length (taken as at
            least 1), at most `CAP_PX`: the mean displacement where edges are straight, and the
            steadier figure below one pixel.
        truth_length: length of truth's boundary.
        edges: number of edges in both images.
    """

    mean: float
    p95: float
    hausdorff: float
    unmatched_fraction: float
    per_edge_length: float
    truth_length: float
    edges: int


def surface_pairs(
    valid: Bool[np.ndarray, "height width"],
    depth: Shaped[np.ndarray, "height width"] | None = None,
) -> SurfacePairs:
    """Neighbours that are both valid and between which the depth does not jump.

    Along a silhouette truth and method change together whatever the method does; such edges
    would dilute the mean. The inverse of axial depth is linear in the image over a plane, so
    both sides are extrapolated to the middle of the pair: a crease leaves at most half the sum
    of the two slopes between them, a jump leaves more.

    Args:
        valid: (height, width) bool.
        depth: (height, width) axial depth, positive; any value where not valid. None counts
            every pair of valid pixels.
    """
    mask = np.asarray(valid, bool)
    if depth is None:
        return SurfacePairs(mask[:, :-1] & mask[:, 1:], mask[:-1] & mask[1:])
    positive = np.where(mask, np.asarray(depth, np.float64), 1.0)
    require(
        positive.shape == mask.shape and bool(np.all(positive > 0)),
        "the depth of a valid pixel must be positive, in an image of the mask's shape.",
    )
    # In parts of the largest one, where that could be infinite: only ratios count.
    inverse = np.min(positive, initial=1.0) / positive
    return SurfacePairs(_continuous(inverse, mask), _continuous(inverse.T, mask.T).T)


def _continuous(inverse: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(height, width - 1) bool: valid pairs along rows with no jump between them."""
    left, right = inverse[:, :-1], inverse[:, 1:]
    both = mask[:, :-1] & mask[:, 1:]
    slope = np.where(both, right - left, 0.0)
    none = np.zeros((inverse.shape[0], 1))
    # Slope of the pair before and after each pair; 0 at the border and beside invalid pixels.
    before = np.hstack([none, slope[:, :-1]]) if slope.shape[1] else slope
    after = np.hstack([slope[:, 1:], none]) if slope.shape[1] else slope
    gap = np.abs((left + 0.5 * before) - (right - 0.5 * after))
    allowed = 0.75 * (np.abs(before) + np.abs(after)) + DEPTH_GAP * np.maximum(left, right)
    return both & (gap <= allowed)


def boundary_edges(
    visibility: Shaped[np.ndarray, "height width"], pairs: SurfacePairs
) -> SurfacePairs:
    """The edges of a visibility image's boundary, as masks over `pairs`."""
    lit = _lit(visibility, pairs)
    return SurfacePairs(
        pairs.right & (lit[:, :-1] != lit[:, 1:]), pairs.down & (lit[:-1] != lit[1:])
    )


def _lit(visibility, pairs: SurfacePairs) -> np.ndarray:
    image = np.asarray(visibility)
    size = (pairs.right.shape[0], pairs.down.shape[1])
    require(
        image.shape == size,
        f"a visibility image of shape {image.shape} does not fit pairs for {size}.",
    )
    return image >= 0.5


def edge_midpoints(edges: SurfacePairs) -> Float64[np.ndarray, "edges 2"]:
    """Midpoints (x, y) in pixels; the centre of pixel (0, 0) is (0.5, 0.5)."""
    rows, columns = np.nonzero(edges.right)
    right = np.stack([columns + 1.0, rows + 0.5], axis=1)
    rows, columns = np.nonzero(edges.down)
    down = np.stack([columns + 0.5, rows + 1.0], axis=1)
    return np.concatenate([right, down])


def boundary_length(edges: SurfacePairs) -> float:
    """Length of a boundary in pixels, as the smooth curve that its staircase stands for.

    Per unit length, a curve with unit normal (a, b) crosses |a| pairs to the right and |b| down.
    The counts in a window give that normal, and each edge then counts |a| or |b|: a line at
    45 degrees has its own length and not sqrt(2) times it.
    """
    height, width = edges.right.shape[0], edges.down.shape[1]
    across, along = np.zeros((height, width)), np.zeros((height, width))
    across[:, :-1] += edges.right
    across[:, 1:] += edges.right
    along[:-1] += edges.down
    along[1:] += edges.down
    across, along = box_sum(across, _WINDOW), box_sum(along, _WINDOW)
    total = 0.0
    for mask, first, second in (
        (edges.right, (slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        (edges.down, (slice(None, -1), slice(None)), (slice(1, None), slice(None))),
    ):
        a = (across[first] + across[second])[mask]
        b = (along[first] + along[second])[mask]
        own = a if mask is edges.right else b
        # `own` counts the edge itself, so the norm is positive.
        total += float(np.sum(own / np.hypot(a, b)))
    return total


def distances(
    points: Float64[np.ndarray, "points 2"], targets: Float64[np.ndarray, "targets 2"]
) -> Float64[np.ndarray, " points"]:
    """Distance in pixels from each point to the nearest target; inf beyond `CAP_PX`.

    A k-d tree and not a distance transform: boundaries are sparse, and it is some ten times
    faster at 512 x 512 with the same distances (the tests compare the two).
    """
    if not len(points) or not len(targets):
        return np.full(len(points), np.inf)
    # Imported late: half of this package's start-up time.
    from scipy.spatial import KDTree

    # Lattice points on a line degrade the balanced tree's medians; the plain one is exact too.
    tree = KDTree(targets, balanced_tree=False, compact_nodes=False)
    distance, _ = tree.query(points, distance_upper_bound=CAP_PX)
    return np.asarray(distance)


def boundary_displacement(
    truth: Shaped[np.ndarray, "height width"],
    visibility: Shaped[np.ndarray, "height width"],
    valid: Bool[np.ndarray, "height width"],
    pairs: SurfacePairs,
    *,
    error: VisibilityError | None = None,
    length: float | None = None,
) -> BoundaryDisplacement:
    """M2 and M3: distances between the boundaries of truth and of a method, in pixels.

    The two one-sided sets of distances, method to truth and truth to method, are pooled: the
    first holds what the method invents, the second what it misses. The nearest edge is the
    nearest in the image, on whichever surface it lies.

    Args:
        truth: (height, width) visibility in truth.
        visibility: (height, width) visibility of the method.
        valid: (height, width) bool.
        pairs: which neighbours count, from `surface_pairs`.
        error, length: `visibility_error` of the same images and `boundary_length` of truth's
            edges, where they are known: they take two fifths of the time.

    Raises:
        UseError: as `signed_error`, or an image does not fit `pairs`.
    """
    error = visibility_error(truth, visibility, valid) if error is None else error
    wrong = error.misclassified_fraction * error.count
    truth_edges = boundary_edges(truth, pairs)
    length = boundary_length(truth_edges) if length is None else length
    ours, theirs = (edge_midpoints(e) for e in (boundary_edges(visibility, pairs), truth_edges))
    raw = np.concatenate([distances(ours, theirs), distances(theirs, ours)])
    capped = np.minimum(raw, CAP_PX)
    some = raw.size > 0
    return BoundaryDisplacement(
        mean=float(capped.mean()) if some else 0.0,
        p95=float(np.percentile(capped, 95)) if some else 0.0,
        hausdorff=float(capped.max()) if some else 0.0,
        unmatched_fraction=float(np.mean(np.isinf(raw))) if some else 0.0,
        per_edge_length=min(wrong / max(length, 1.0), CAP_PX),
        truth_length=length,
        edges=raw.size,
    )
