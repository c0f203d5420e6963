"""Predicted against measured: wrong pixels per pixel of shadow edge, a point for each map."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.families import look_of
from asmjax.report.figures.style import FAINT, styled

_SIDE = 620
"""Size in pixels of the square panel, axis labels not included."""

_LEFT, _BELOW, _LEGEND = 110, 66, 420


@dataclass(frozen=True)
class EdgePoint:
    """One map: its family, its name, and both numbers in pixels."""

    family: str
    name: str
    predicted: float
    measured: float


@styled
def draw_displacement(points: Sequence[EdgePoint], title: str = "") -> Figure:
    """Both axes logarithmic and alike; on the line prediction and measurement agree, within the
    band they are a factor of 2 apart. Maps with a 0 have no place on it and are named below."""
    board = Board(
        2 * EDGE + _LEFT + _SIDE + _LEGEND, EDGE + HEAD + _SIDE + _BELOW + 2 * CAPTION + EDGE
    )
    board.heading(
        EDGE, EDGE, board.width - 2 * EDGE, "Displacement of shadow edges",
        "wrong pixels per pixel of true edge: texel sizes against truth",
    )  # fmt: skip
    axes = board.axes(EDGE + _LEFT, EDGE + HEAD, _SIDE, _SIDE)
    drawn = [point for point in points if point.predicted > 0 and point.measured > 0]
    values = [value for point in drawn for value in (point.predicted, point.measured)]
    low, high = (min(values) / 2, max(values) * 2) if values else (0.1, 10.0)
    line = np.array([low / 4, high * 4])
    axes.fill_between(line, line / 2, line * 2, color="#EEEEEE", linewidth=0)
    axes.plot(line, line, color=FAINT, linewidth=0.9)
    for point in drawn:
        colour, marker = look_of(point.family)
        axes.plot(
            [point.predicted], [point.measured], marker, color=colour, markersize=8,
            markeredgecolor="white", markeredgewidth=0.6, label=point.name,
        )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high))
    axes.set_xlabel("predicted from texels and edges (M4), pixels")
    axes.set_ylabel("measured against truth, pixels")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100 * low else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    if drawn:
        board.figure.legend(
            *axes.get_legend_handles_labels(),
            loc="upper left",
            bbox_to_anchor=(
                (EDGE + _LEFT + _SIDE + 8) / board.width, 1 - (EDGE + HEAD - 12) / board.height
            ),
        )  # fmt: skip
    board.caption(f"{title}. Line: equal; band: within a factor of 2.", line=1)
    absent = [point.name for point in points if point not in drawn]
    if absent:
        board.caption(f"Not drawn, as one of the numbers is 0: {', '.join(absent)}.")
    return board.figure
