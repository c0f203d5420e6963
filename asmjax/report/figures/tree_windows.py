"""Where to look at a tree of nodes: around the refined ones, and where many levels meet."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from asmjax.report.figures.pictures import TreePicture

_INNER = (2, 98)
"""Percentiles of the refined nodes' centres that the wider window spans."""

_WIDEST = 0.6
"""A window that shows more of the only face says no more than the whole; a third is shown then."""

_ZOOMS = (5, 8, 16)
"""By how many times the last window may be smaller than the one before."""

_CANDIDATES = 150
"""Nodes around which windows are tried."""

_SEEN = 0.015
"""Nodes smaller than this share of a window do not count: their outlines would be blots."""


class Window(NamedTuple):
    """A square part of a face: u and v of its corner, and its side."""

    u: float
    v: float
    size: float


def tree_windows(tree: TreePicture, interest: Sequence[float] = ()) -> tuple[int, list[Window]]:
    """A face, and up to two windows into it, the second inside or near the first.

    The face is the one with most refined nodes (level 1 and deeper), times `interest` where one
    is given for each face. The first window spans most of its refined nodes, the second is where
    most levels and nodes are seen at once. No windows where nothing is refined.
    """
    refined = tree.level >= 1
    if not refined.any():
        return 0, []
    count = np.bincount(tree.face[refined], minlength=tree.faces)
    face = int((count * (1e-9 + np.asarray(interest or 1.0))).argmax())
    mine = tree.face == face
    level, lo, size = tree.level[mine], tree.lo[:, mine], tree.size[mine]
    refined = level >= 1
    centres = (lo + 0.5 * size)[:, refined]
    low, high = np.percentile(centres, _INNER, axis=1)
    # Room for the nodes around the outermost centres.
    side = float(max(1.15 * (high - low).max(), 8 * size.min()))
    if side <= _WIDEST:
        first = _around(0.5 * (low + high), side)
    elif tree.faces > 1:
        # The whole face: the first panel shows it among the others, and small.
        first = Window(0.0, 0.0, 1.0)
    else:
        first = _richest(level, lo, size, centres, [1 / 3])
    inside = centres[:, _within(centres, first)]
    if not inside.size:
        return face, [first]
    return face, [first, _richest(level, lo, size, inside, [first.size / zoom for zoom in _ZOOMS])]


def seen_nodes(lo: np.ndarray, size: np.ndarray, window: Window, smallest: float) -> np.ndarray:
    """Which nodes (k,) have an outline inside the window, and are at least `smallest` of it."""
    seen = size >= smallest * window.size
    around = np.ones(size.shape, bool)
    for near, low in zip(lo, window[:2], strict=True):
        far, high = near + size, low + window.size
        seen &= (near < high) & (far > low)
        around &= (near <= low) & (far >= high)
    return seen & ~around


def richness(level: np.ndarray, lo: np.ndarray, size: np.ndarray, window: Window) -> int:
    """Number of nodes that a window shows, times the square of the number of their levels."""
    seen = level[seen_nodes(lo, size, window, _SEEN)]
    return int(np.count_nonzero(np.bincount(seen))) ** 2 * seen.size


def _richest(level, lo, size, centres, sides) -> Window:
    """The window of one of those sides, around one of those centres, that shows most."""
    # Windows lie around the centres: what is far from them all, or too small, is never seen.
    reach = max(sides)
    seen = size >= _SEEN * min(sides)
    for near, at in zip(lo, centres, strict=True):
        seen &= (near < at.max() + reach) & (near + size > at.min() - reach)
    level, lo, size = level[seen], lo[:, seen], size[seen]
    tried = centres[:, :: -(-centres.shape[1] // _CANDIDATES)].T
    windows = [_around(centre, side) for side in sides for centre in tried]
    return max(windows, key=lambda window: richness(level, lo, size, window))


def _around(centre: np.ndarray, side: float) -> Window:
    """The window of that side, at most 1, around `centre`, moved to lie inside the face."""
    side = min(side, 1.0)
    u, v = np.clip(centre - 0.5 * side, 0.0, 1.0 - side)
    return Window(float(u), float(v), side)


def _within(points: np.ndarray, window: Window) -> np.ndarray:
    (u, v), (low_u, low_v, size) = points, window
    return (u >= low_u) & (u <= low_u + size) & (v >= low_v) & (v <= low_v + size)
