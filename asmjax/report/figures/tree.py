"""The adaptive map's tree, drawn over what the light sees."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap, ListedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.path import Path

from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.pictures import RunPictures, TreePicture
from asmjax.report.figures.relief import relief, structure
from asmjax.report.figures.scales import power_of_two
from asmjax.report.figures.style import styled
from asmjax.report.figures.tree_windows import Window, seen_nodes, tree_windows

_PANEL = 600
_BAR, _BAR_LABELS = 22, 150

_SMALLEST = 4.5
"""Screen pixels: outlines of smaller nodes would merge into a blot, and are left to the zooms."""

_GRID, _GRID_WIDTH = "#8A8A8A", 0.3
"""Colour and width in points of the nodes of level 0, which are a grid and no news."""

_THIN, _THICK = 0.45, 0.65
"""Widths in points of the outlines of the smallest nodes and of nodes `_LARGE` pixels across."""

_LARGE = 24

_SQUARE = (Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY)

_HUES = ("#26338F", "#1B74C4", "#008C86", "#3A8F22", "#C97B00", "#D2330A", "#B4005F", "#560A78")
"""From level 1 to the deepest; all of them dark enough to show as thin lines on pale grey."""

_STEP = 44
"""Height in pixels of a level in the key, where they have room."""

_WHOLE = Window(0.0, 0.0, 1.0)


@styled
def draw_tree(pictures: RunPictures) -> Figure:
    """Outlines of the nodes over a relief of what the light sees: whole, and two enlargements.

    Left the whole image (all faces of a light that has several), then the window that holds most
    refined nodes, then one where many levels meet; each is marked in the panel before it. Rays
    are cast for each panel at its own resolution. Raises `ValueError` where `pictures.tree` is
    None or empty.
    """
    tree = pictures.tree
    if tree is None or not tree.level.size:
        raise ValueError("there is no tree to draw")
    colours = _level_colours(tree)
    across = int(np.ceil(np.sqrt(tree.faces)))
    side = (_PANEL - (across - 1) * 6) // across
    whole = [_cast(tree, face, _WHOLE, side) for face in range(tree.faces)]
    face, windows = tree_windows(tree, [structure(depth) for depth in whole])
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + (1 + len(windows)) * (_PANEL + GAP) + _BAR + _BAR_LABELS,
        top + _PANEL + GAP + CAPTION + EDGE // 2,
    )
    nodes = f"{tree.level.size:,} nodes"
    if tree.faces > 1:
        nodes += f" on the {tree.faces} faces of its cube"
    board.heading(EDGE, EDGE, _PANEL, "All that the light sees", nodes)
    previous: Axes | None = None
    for k in range(tree.faces):
        x, y = EDGE + (k % across) * (side + 6), top + (k // across) * (side + 6)
        axes = _panel(board, (x, y), tree, k, _WHOLE, whole[k], colours)
        if k == face:
            previous = axes
    titles = ("Where most nodes are refined", "Where most levels meet")
    for i, (window, title) in enumerate(zip(windows, titles, strict=False)):
        x = EDGE + (i + 1) * (_PANEL + GAP)
        axes = _panel(
            board, (x, top), tree, face, window, _cast(tree, face, window, _PANEL), colours
        )
        board.heading(x, EDGE, _PANEL, title, _about(tree, face, window))
        if previous is not None:
            _mark(previous, window)
        previous = axes
    _level_bar(board, tree, colours, top)
    board.caption(
        f"{pictures.title}. Each square is a node of {tree.node_resolution} × "
        f"{tree.node_resolution} texels; those too small for a panel are left out of it. Grey: "
        "depth, near is pale, with relief shading; darkest: nothing."
    )
    return board.figure


def _about(tree: TreePicture, face: int, window: Window) -> str:
    mine = tree.face == face
    seen = seen_nodes(tree.lo[:, mine], tree.size[mine], window, _SMALLEST / _PANEL)
    levels = tree.level[mine][seen]
    times = 1 / window.size
    about = f"enlarged {times:.1f} times" if times < 9.95 else f"enlarged {times:,.0f} times"
    if tree.faces > 1:
        about = f"face {face}, {about if times > 1 else 'whole'}"
    if not levels.size:
        return about
    low, high = levels.min(), levels.max()
    span = f"level {low}" if low == high else f"levels {low} to {high}"
    return f"{about}; {levels.size:,} nodes of {span}"


def _cast(tree: TreePicture, face: int, window: Window, side: int) -> np.ndarray:
    return np.asarray(tree.cast(face, *window, side))


def _panel(
    board: Board,
    place: tuple[int, int],
    tree: TreePicture,
    face: int,
    window: Window,
    depth: np.ndarray,
    colours: dict[int, str],
) -> Axes:
    """Depth, pixel for pixel, and over it the outlines of the nodes that can be told apart."""
    u, v, size = window
    side = depth.shape[0]
    axes = board.image(
        *place,
        side,
        side,
        relief(depth),
        extent=(u, u + size, v + size, v),
        interpolation="nearest",
    )
    mine = tree.face == face
    lo, extent, level = tree.lo[:, mine], tree.size[mine], tree.level[mine]
    shown = seen_nodes(lo, extent, window, _SMALLEST / side)
    # Deep nodes last: their outlines lie on top of their ancestors'. One path for each level:
    # thousands of separate ones would take as long to draw as everything else.
    drawn = np.unique(level[shown]).tolist()
    of_level = [shown & (level == k) for k in drawn]
    pixels = np.array([extent[which].max() for which in of_level]) / size * side
    width = np.interp(pixels, [_SMALLEST, _LARGE], [_THIN, _THICK])
    axes.add_collection(
        PathCollection(
            [_squares(lo[:, which], extent[which]) for which in of_level],
            facecolors="none",
            edgecolors=[colours[k] for k in drawn],
            linewidths=np.where(np.array(drawn) > 0, width, _GRID_WIDTH),
            joinstyle="miter",
            snap=True,
        ),
        autolim=False,
    )
    return axes


def _squares(lo: np.ndarray, size: np.ndarray) -> Path:
    """One path around squares (k,) with those nearest corners (2, k)."""
    (u, v), (far_u, far_v) = lo, lo + size
    corners = np.stack([u, v, far_u, v, far_u, far_v, u, far_v, u, v], axis=1)
    codes = np.tile(_SQUARE, u.size)
    return Path(corners.reshape(-1, 2), codes)


def _level_colours(tree: TreePicture) -> dict[int, str]:
    """A colour for each level that has nodes, dark enough for pale grey; grey for level 0.

    Many hues: neighbouring levels must be told apart, more than put in order.
    """
    deeper = [int(level) for level in np.unique(tree.level) if level > 0]
    scale = LinearSegmentedColormap.from_list("levels", _HUES)
    shades = scale(np.linspace(0.0, 1.0, max(len(deeper), 2)))
    return {0: _GRID} | {k: to_hex(shade) for k, shade in zip(deeper, shades, strict=False)}


def _mark(axes: Axes, window: Window) -> None:
    """Outline of the next panel's window, grown where it would be too small to see."""
    u, v, size = window
    low, high = axes.get_xlim()
    if size >= 0.999 * (high - low):
        return
    drawn = max(size, 0.02 * (high - low))
    corner = (u + 0.5 * size - 0.5 * drawn, v + 0.5 * size - 0.5 * drawn)
    for line, colour in ((2.6, "white"), (1.2, "#101010")):
        axes.add_patch(
            Rectangle(corner, drawn, drawn, fill=False, edgecolor=colour, linewidth=line, zorder=5)
        )


def _level_bar(board: Board, tree: TreePicture, colours: dict[int, str], top: int) -> None:
    """The colour of each level that has nodes, its number, and the flat map as fine as it."""
    levels = np.unique(tree.level).tolist()
    ticks = {}
    for i, level in enumerate(levels):
        exponent = np.log2(tree.node_resolution / tree.size[tree.level == level].min())
        whole = abs(exponent - round(exponent)) < 1e-6
        ticks[float(i)] = f"{level}   {power_of_two(exponent) if whole else f'{2**exponent:,.0f}'}"
    x = board.width - EDGE - _BAR_LABELS - _BAR
    height = min(_PANEL, _STEP * len(levels))
    scale = ListedColormap([colours[level] for level in levels])
    norm = BoundaryNorm(np.arange(len(levels) + 1) - 0.5, len(levels))
    bar = board.scale_bar(scale, norm, x, top, _BAR, height, ticks)
    bar.ax.tick_params(length=0)
    board.heading(x, EDGE, _BAR + _BAR_LABELS, "Level", "texels a side")
