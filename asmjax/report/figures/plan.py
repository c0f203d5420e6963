"""What a plan is made from: each light's shadow in the probe, and how wide penumbrae may be."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from asmjax.report.figures.board import (
    CAPTION,
    EDGE,
    GAP,
    HEAD,
    Board,
    columns_for,
    panel_size,
)
from asmjax.report.figures.scales import (
    beyond,
    half_ticks,
    log2_or_nan,
    scale_limits,
)
from asmjax.report.figures.style import hex_rgb, styled

MOST_LIGHTS = 6
"""Lights that are drawn; the report has all of them."""

_TARGET, _ALONE = 520, 860
"""About how wide a panel is, in pixels, and the only one."""

_BAR, _BAR_LABELS = 18, 104

_LEAST = 900
"""Least width in pixels of the panels together, for the sake of the small print."""

_LETTER = 9.9
"""Mean width in pixels of a letter of small print."""

_NONE = "#EFEFEF"
"""Where no penumbra can be."""


@dataclass(frozen=True, eq=False)
class LightPanel:
    """One light.

    Attributes:
        title: its name and what is done.
        small: what decided, in a line.
        picture: (height, width, 3) uint8, the probe's image with its hard shadow.
        widest: (height, width) the widest penumbra that a pixel may be in, pixels, 0 for none; None
            for a light without a size, or that nobody looked at.
        widths: what is known of penumbrae at edges, in a line.
    """

    title: str
    small: str
    picture: np.ndarray
    widest: np.ndarray | None = None
    widths: str = ""


@styled
def draw_plan(panels: Sequence[LightPanel], title: str, notes: Sequence[str] = ()) -> Figure:
    """The first `MOST_LIGHTS` lights: a row for each with the widths of penumbrae beside it, or all
    in a grid where none has a size. Below, `notes` in small print: what is skipped and missing."""
    drawn = panels[:MOST_LIGHTS]
    soft = any(panel.widest is not None for panel in drawn)
    columns = 2 if soft else columns_for(len(drawn))
    rows = len(drawn) if soft else -(-len(drawn) // columns)
    target = _TARGET if columns > 1 else _ALONE
    seen = drawn[0].picture
    height, width = panel_size(seen.shape[0], seen.shape[1], target)
    bar = GAP // 2 + _BAR + _BAR_LABELS if soft else 0
    board_width = 2 * EDGE + max(columns * width + (columns - 1) * GAP + bar, _LEAST)
    lines = _lines(panels, title, notes, board_width)
    board = Board(board_width, 2 * EDGE + rows * (HEAD + height + GAP) + len(lines) * CAPTION)
    for i, panel in enumerate(drawn):
        row, column = (i, 0) if soft else divmod(i, columns)
        x, y = EDGE + column * (width + GAP), EDGE + row * (HEAD + height + GAP)
        board.heading(x, y, width, panel.title, panel.small)
        picture = board.image(x, y + HEAD, width, height, panel.picture, interpolation="nearest")
        picture.set_label(panel.title)
    if soft:
        _draw_widths(board, drawn, height, width)
    for k, line in enumerate(reversed(lines)):
        board.caption(line, k)
    return board.figure


def _draw_widths(board: Board, panels: Sequence[LightPanel], height: int, width: int) -> None:
    """The right column, on one scale."""
    exponents = [None if p.widest is None else log2_or_nan(p.widest) for p in panels]
    every = np.concatenate([values.ravel() for values in exponents if values is not None])
    low, high = scale_limits(every, centred=False)
    norm, colours = Normalize(low, high), matplotlib.colormaps["viridis"]
    x = EDGE + width + GAP
    for row, (panel, values) in enumerate(zip(panels, exponents, strict=True)):
        if values is None:
            continue
        y = EDGE + row * (HEAD + height + GAP)
        board.heading(x, y, width, "Widest penumbra a pixel may lie in", panel.widths)
        none = ~np.isfinite(values)
        image = colours(norm(np.where(none, low, values)), bytes=True)[..., :3].copy()
        image[none] = hex_rgb(_NONE)
        board.image(x, y + HEAD, width, height, image, interpolation="nearest")
        ticks = {float(k): f"{2.0**k:.3g} px" for k in half_ticks(low, high)}
        ends = beyond(values, low, high)
        board.scale_bar(colours, norm, x + width + GAP // 2, y + HEAD, _BAR, height, ticks, ends)


def _lines(panels: Sequence[LightPanel], title: str, notes: Sequence[str], width: int) -> list[str]:
    """Lines of small print that fit a board of that width."""
    further = "; ".join(panel.title for panel in panels[MOST_LIGHTS:])
    texts = [f"{title}.", *notes, *([f"Not drawn: {further}."] if further else [])]
    letters = int((width - 2 * EDGE) / _LETTER)
    return [line for text in texts for line in textwrap.wrap(text, letters)]
