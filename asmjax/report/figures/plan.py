"""What a plan is made from: each light's shadow in the probe, and how wide penumbrae may be."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board, panel_size
from asmjax.report.figures.scales import (
    beyond,
    exponent_ticks,
    log2_or_nan,
    power_of_two,
    scale_limits,
)
from asmjax.report.figures.style import FAINT, hex_rgb, styled

MOST_LIGHTS = 4
"""Lights that are drawn; the report has all of them."""

_TARGET = 520
"""About how wide a panel is, in pixels."""

_BAR, _BAR_LABELS = 18, 84
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
        reason: said in place of it.
    """

    title: str
    small: str
    picture: np.ndarray
    widest: np.ndarray | None
    reason: str


@styled
def draw_plan(panels: Sequence[LightPanel], title: str, notes: Sequence[str] = ()) -> Figure:
    """A row for each of the first `MOST_LIGHTS` lights, on one scale; below, `notes` in small
    print: what is skipped, and what is not simulated."""
    drawn = panels[:MOST_LIGHTS]
    height, width = panel_size(*drawn[0].picture.shape[:2], _TARGET)
    board_width = 2 * EDGE + 2 * width + GAP + GAP // 2 + _BAR + _BAR_LABELS
    further = [panel.title for panel in panels[MOST_LIGHTS:]]
    left_out = [f"Not drawn: {'; '.join(further)}."] if further else []
    letters = int((board_width - 2 * EDGE) / _LETTER)
    lines = [
        line for note in (f"{title}.", *notes, *left_out) for line in textwrap.wrap(note, letters)
    ]
    board = Board(board_width, 2 * EDGE + len(drawn) * (HEAD + height + GAP) + len(lines) * CAPTION)
    exponents = [None if p.widest is None else log2_or_nan(p.widest) for p in drawn]
    every = np.concatenate([np.zeros(0), *(e.ravel() for e in exponents if e is not None)])
    low, high = scale_limits(every, centred=False)
    norm, colours = Normalize(low, high), matplotlib.colormaps["viridis"]
    for row, (panel, values) in enumerate(zip(drawn, exponents, strict=True)):
        y = EDGE + row * (HEAD + height + GAP)
        right = EDGE + width + GAP
        board.heading(EDGE, y, width, panel.title, panel.small)
        axes = board.image(EDGE, y + HEAD, width, height, panel.picture, interpolation="nearest")
        axes.set_label(panel.title)
        if values is None:
            wrapped = textwrap.wrap(panel.reason, int(0.9 * width / _LETTER))
            for k, line in enumerate(wrapped):
                board.text(right, y + HEAD + k * CAPTION, line, fontsize=8, color=FAINT)
            continue
        board.heading(
            right, y, width, "Width of penumbrae, pixels", "the widest that a pixel may lie in"
        )
        none = ~np.isfinite(values)
        image = colours(norm(np.where(none, low, values)), bytes=True)[..., :3].copy()
        image[none] = hex_rgb(_NONE)
        board.image(right, y + HEAD, width, height, image, interpolation="nearest")
        ticks = {float(k): power_of_two(k) for k in exponent_ticks(low, high)}
        bar = right + width + GAP // 2
        board.scale_bar(
            colours, norm, bar, y + HEAD, _BAR, height, ticks, beyond(values, low, high)
        )
    for k, line in enumerate(reversed(lines)):
        board.caption(line, k)
    return board.figure
