"""The adaptive map's tree, drawn over what the light sees."""

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.pictures import RunPictures, TreePicture
from asmjax.report.figures.scales import power_of_two
from asmjax.report.figures.style import styled

_PANEL = 560
_BAR, _BAR_LABELS = 16, 170

_SMALLEST = 4
"""Screen pixels: outlines of smaller nodes would merge into a blot, and are left to the zooms."""

_ZOOM_NODES = 8
"""Nodes of the deepest level along a side of the deepest zoom."""

_NOTHING, _DARKEST, _LIGHTEST = 100, 140, 250
"""Grey values of no surface, the farthest and the nearest surface; pale, for lines to show."""


@styled
def draw_tree(pictures: RunPictures) -> Figure:
    """Outlines of the nodes over the light's image, whole and zoomed to the deepest place.

    Left the whole image (all faces of a light that has several), then two zooms to where the
    deepest nodes are densest; each zoom is outlined in the panel before it. Raises `ValueError`
    where `pictures.tree` is None or empty.
    """
    tree = pictures.tree
    if tree is None or not tree.level.size:
        raise ValueError("there is no tree to draw")
    colours, norm = _level_colours(int(tree.level.max()))
    face, windows = zoom_windows(tree)
    panels = 1 + len(windows)
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + panels * _PANEL + panels * GAP + _BAR + _BAR_LABELS,
        top + _PANEL + GAP + CAPTION + EDGE // 2,
    )
    faces = tree.light_depth.shape[0]
    board.heading(EDGE, EDGE, _PANEL, "The light's image", _count(tree))
    across = int(np.ceil(np.sqrt(faces)))
    side = (_PANEL - (across - 1) * 6) // across
    previous: Axes | None = None
    for k in range(faces):
        x, y = EDGE + (k % across) * (side + 6), top + (k // across) * (side + 6)
        axes = _panel(board, x, y, side, tree, k, (0.0, 0.0, 1.0), colours, norm)
        if k == face:
            previous = axes
    for i, (u, v, size) in enumerate(windows):
        x = EDGE + (i + 1) * (_PANEL + GAP)
        axes = _panel(board, x, top, _PANEL, tree, face, (u, v, size), colours, norm)
        middle = f"around u = {u + size / 2:.6f}, v = {v + size / 2:.6f}"
        board.heading(x, EDGE, _PANEL, f"Enlarged {1 / size:,.0f} times", middle)
        if previous is not None:
            _mark(previous, u, v, size)
        previous = axes
    _level_bar(board, tree, colours, norm, top)
    board.caption(
        f"{pictures.title}. Each square is a node of {tree.node_resolution} × "
        f"{tree.node_resolution} texels; the smallest are drawn in the enlargements only."
    )
    return board.figure


def _count(tree: TreePicture) -> str:
    faces = tree.light_depth.shape[0]
    nodes = f"{tree.level.size:,} nodes" + (f" on {faces} faces" if faces > 1 else "")
    return f"{nodes}; paler is nearer, darkest is nothing"


def zoom_windows(tree: TreePicture) -> tuple[int, list[tuple[float, float, float]]]:
    """The face of the deepest nodes, and up to two windows (u, v, size) into it.

    The last window spans `_ZOOM_NODES` of the deepest nodes around the place where they are
    densest, the first is the geometric mean between it and the whole. Without depth, none.
    """
    deepest = tree.level == tree.level.max()
    size = float(tree.size[deepest].min())
    face = int(np.bincount(tree.face[deepest]).argmax())
    span = _ZOOM_NODES * size
    if span > 0.5:
        return face, []
    centres = (tree.lo + 0.5 * tree.size)[:, deepest & (tree.face == face)]
    # The node with most others of its level in the window around it.
    sample = centres[:, :: max(1, centres.shape[1] // 500)]
    near = np.abs(sample[:, :, None] - centres[:, None, :]).max(axis=0) <= 0.5 * span
    focus = sample[:, near.sum(axis=1).argmax()]
    spans = [float(np.sqrt(span)), span] if span < 0.1 else [span]
    windows = []
    for side in spans:
        u, v = np.clip(focus - 0.5 * side, 0.0, 1.0 - side)
        windows.append((float(u), float(v), side))
    return face, windows


def _panel(board, x, y, side, tree: TreePicture, face: int, window, colours, norm) -> Axes:
    u, v, size = window
    axes = board.image(
        x,
        y,
        side,
        side,
        depth_image(tree.light_depth[face]),
        extent=(0, 1, 1, 0),
        interpolation="nearest" if size < 1 else "auto",
    )
    axes.set_xlim(u, u + size)
    axes.set_ylim(v + size, v)
    lo, extent = tree.lo, tree.size
    shown = (
        (tree.face == face)
        & (extent / size * side >= _SMALLEST)
        & (lo[0] < u + size)
        & (lo[0] + extent > u)
        & (lo[1] < v + size)
        & (lo[1] + extent > v)
    )
    # Deep nodes last: their outlines lie on top of their ancestors'.
    order = np.flatnonzero(shown)[np.argsort(tree.level[shown], kind="stable")]
    near, far = lo[:, order], lo[:, order] + extent[order]
    corners = np.stack(
        [
            np.stack([a, b], axis=-1)
            for a, b in ((near[0], near[1]), (far[0], near[1]), (far[0], far[1]), (near[0], far[1]))
        ],
        axis=1,
    )
    axes.add_collection(
        PolyCollection(
            list(corners),
            facecolors="none",
            edgecolors=colours(norm(tree.level[order])),
            linewidths=0.9,
            joinstyle="miter",
        ),
        autolim=False,
    )
    return axes


def depth_image(depth) -> np.ndarray:
    """(n, n, 3) uint8: near pale, far dark, by the logarithm of depth; darkest for none.

    The scale spans the 1st to the 99th percentile, so that one far wall does not flatten the rest.
    """
    values = np.asarray(depth, np.float64)
    good = np.isfinite(values) & (values > 0)
    image = np.full((*values.shape, 3), _NOTHING, np.uint8)
    if good.any():
        logs = np.log(values[good])
        near, far = np.percentile(logs, [1, 99])
        share = np.clip((logs - near) / max(far - near, 1e-9), 0, 1)
        image[good] = np.round(_LIGHTEST + (_DARKEST - _LIGHTEST) * share)[:, None]
    return image


def _level_colours(deepest: int) -> tuple[ListedColormap, BoundaryNorm]:
    """One colour per level; the palest part of the scale would vanish on a pale image."""
    count = deepest + 1
    shades = matplotlib.colormaps["plasma"](np.linspace(0.0, 0.85, count))
    return ListedColormap(shades), BoundaryNorm(np.arange(count + 1) - 0.5, count)


def _mark(axes: Axes, u: float, v: float, size: float) -> None:
    """Outline of the next panel's window, grown where it would be too small to see."""
    low, high = axes.get_xlim()
    drawn = max(size, 0.02 * (high - low))
    corner = (u + 0.5 * size - 0.5 * drawn, v + 0.5 * size - 0.5 * drawn)
    for line, colour in ((2.6, "#202020"), (1.3, "white")):
        axes.add_patch(
            Rectangle(corner, drawn, drawn, fill=False, edgecolor=colour, linewidth=line, zorder=5)
        )


def _level_bar(board: Board, tree: TreePicture, colours, norm, top: int) -> None:
    deepest = int(tree.level.max())
    step = max(1, -(-(deepest + 1) // 14))
    ticks = {}
    for level in range(0, deepest + 1, step):
        mine = tree.size[tree.level == level]
        text = str(level)
        if mine.size:
            exponent = np.log2(tree.node_resolution / mine.min())
            whole = abs(exponent - round(exponent)) < 1e-6
            text += f"   {power_of_two(exponent) if whole else f'{2**exponent:,.0f}'}"
        ticks[float(level)] = text
    x = board.width - EDGE - _BAR_LABELS - _BAR
    bar = board.scale_bar(colours, norm, x, top, _BAR, _PANEL, ticks)
    bar.ax.tick_params(length=0)
    board.heading(x, EDGE, _BAR + _BAR_LABELS, "Level", "and texels a side")
