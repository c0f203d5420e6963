"""Measured against predicted displacement of shadow edges: a point for each map and resolution."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from asmjax.report.figures.aliasing import COLOURS
from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.style import FAINT, INK, styled

_MARKERS = "osD^vP"
_WIDTH, _LEFT, _BELOW, _LEGEND = 720, 110, 66, 300


class Point(NamedTuple):
    """One map of one resolution in one scene; displacements in pixels."""

    map: str
    scene: str
    predicted: float
    measured: float


@styled
def draw_scatter(points: Sequence[Point], explained: Mapping[str, float]) -> Figure:
    """All points on logarithmic axes with the line on which prediction and measurement agree.

    Args:
        explained: R^2 by axes and line, for the small print.
    """
    board = Board(
        2 * EDGE + _LEFT + _WIDTH + _LEGEND, EDGE + HEAD + _WIDTH + _BELOW + 2 * CAPTION + EDGE
    )
    board.heading(
        EDGE + _LEFT, EDGE, _WIDTH, "Displacement of shadow edges, pixels",
        f"{len(points)} maps; on the line, texels' sizes say all",
    )  # fmt: skip
    axes = board.axes(EDGE + _LEFT, EDGE + HEAD, _WIDTH, _WIDTH)
    maps = list(dict.fromkeys(point.map for point in points))
    scenes = list(dict.fromkeys(point.scene for point in points))
    shown = [point for point in points if point.measured > 0]
    for point in shown:
        axes.plot(
            point.predicted, point.measured, _MARKERS[scenes.index(point.scene) % len(_MARKERS)],
            color=COLOURS[maps.index(point.map) % len(COLOURS)], markersize=5.5,
            markerfacecolor="none", markeredgewidth=1.2,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    ends = np.array([v for point in shown for v in (point.predicted, point.measured)])
    low, high = (ends.min() / 1.4, ends.max() * 1.4) if ends.size else (0.01, 10.0)
    axes.plot([low, high], [low, high], color=INK, linewidth=0.9, zorder=0.5)
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    for axis in (axes.xaxis, axes.yaxis):
        _plain_ticks(axis)
    axes.set_xlabel("predicted from texel sizes")
    axes.set_ylabel("measured: wrong pixels / pixel of edge")
    axes.grid(which="major", color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    handles = [
        *(axes.plot([], [], "o", color=COLOURS[i % len(COLOURS)], label=name)[0]
          for i, name in enumerate(maps)),
        *(axes.plot([], [], _MARKERS[i % len(_MARKERS)], color=FAINT, markerfacecolor="none",
                    label=name)[0] for i, name in enumerate(scenes)),
    ]  # fmt: skip
    board.figure.legend(
        handles=handles, loc="upper left", labelspacing=0.7,
        bbox_to_anchor=((EDGE + _LEFT + _WIDTH + 8) / board.width,
                        1 - (EDGE + HEAD - 12) / board.height),
    )  # fmt: skip
    for line, kind in enumerate(("log-log", "linear")):
        about = [f"{name.split(', ')[1]} {signed(value)}" for name, value in explained.items()
                 if name.startswith(kind) and not name.endswith("slope")]  # fmt: skip
        board.caption(f"R² on {kind} axes: {', '.join(about) or 'not known'}.", line=line)
    return board.figure


def _plain_ticks(axis: Axis) -> None:
    """1, 2, 5, 10 and so on, and nothing between."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=30))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def signed(value: float) -> str:
    """Four decimals with a proper minus."""
    return f"{value:.4f}".replace("-", "−")
