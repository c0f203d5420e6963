"""What was tried while tuning, and what was chosen: error against time, on two sets of views."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.fronts import BARS, log_ticks, zero_line
from asmjax.report.figures.labels import Label, write_labels
from asmjax.report.figures.style import FAINT, KIND_COLOURS, styled

_WIDTH, _HEIGHT, _LEFT, _BELOW = 900, 760, 104, 70
"""Pixels of one panel, and of what stands left of and below it."""

_LEGEND_ROW = 34

YARDSTICKS = {1: "1 ray per pixel", 16: "16 rays per pixel: 16 times as long"}
"""Traced rays beside which times are read: one is measured, sixteen are reckoned from it."""

CURVE = "#CC3311"
"""Colour of what the surrogate says."""


class Look(NamedTuple):
    """Words, colour and marker of a role."""

    words: str
    colour: str
    marker: str


ROLES = {
    "default": Look("default", "#1A1A1A", "D"),
    "single": Look("one setting changed", "#8C8C8C", "v"),
    "sample": Look("drawn for the fit", "#8C8C8C", "o"),
    "random": Look("random search", "#CC79A7", "P"),
    "grid": Look("grid", "#E69F00", "s"),
    "surrogate": Look("proposed by the surrogate", "#009E73", "^"),
    "neighbour": Look("neighbours of the best", "#0072B2", "v"),
}
"""How settings are drawn by why they were tried."""


@dataclass(frozen=True)
class Dot:
    """Settings as measured: `role` of `ROLES`, milliseconds, wrong pixels per pixel of edge."""

    role: str
    ms: float
    error: float


@dataclass(frozen=True)
class Rival:
    """A dot with a name, and the interval of its time in milliseconds."""

    name: str
    dot: Dot
    low: float
    high: float


@dataclass(frozen=True)
class TriedPanel:
    """One set of views.

    Attributes:
        title, small: above it.
        curve: (2, k) milliseconds and errors of the surrogate's front; None for none.
        levels: objectives along which lines are drawn, by what they are called.
    """

    title: str
    small: str
    dots: Sequence[Dot]
    yardstick_ms: float
    rivals: Sequence[Rival] = field(default=())
    curve: np.ndarray | None = None
    levels: Sequence[tuple[str, float]] = field(default=())


@dataclass(frozen=True)
class Asked:
    """The goal: pixels per second, or a limit in milliseconds, or one in pixels; the others are
    None."""

    price: float | None = None
    ms: float | None = None
    error: float | None = None


@styled
def draw_tried(
    panels: Sequence[TriedPanel], asked: Asked, title: str = "", bars: str = BARS
) -> Figure:
    """A panel for each set of views, all on the same axes; no error at all stands on a line 0.
    `bars` says what the intervals of times are."""
    roles = [name for name in ROLES if any(d.role == name for p in panels for d in _all(p))]
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + len(panels) * (_LEFT + _WIDTH),
        top + _HEIGHT + _BELOW + _LEGEND_ROW + 2 * CAPTION + EDGE,
    )
    dots = [dot for panel in panels for dot in _all(panel)]
    errors = np.array([dot.error for dot in dots])
    floor = zero_line(errors)
    marks = [rays * panel.yardstick_ms for panel in panels for rays in YARDSTICKS]
    spans = np.array([*(dot.ms for dot in dots), *marks])
    for i, panel in enumerate(panels):
        x = EDGE + i * (_LEFT + _WIDTH) + _LEFT
        board.heading(x, EDGE, _WIDTH, panel.title, panel.small)
        axes = board.axes(x, top, _WIDTH, _HEIGHT)
        axes.set(xscale="log", yscale="log")
        axes.set_xlim(spans.min() / 1.5, spans.max() * 1.6)
        least = floor / 1.6 if (errors == 0).any() else errors.min() / 1.8
        axes.set_ylim(least, max(errors.max(), 3 * floor) * 1.8)
        _draw_panel(axes, panel, asked, floor, bool((errors == 0).any()))
    handles = [_handle(ROLES[name]) for name in roles]
    if any(panel.curve is not None for panel in panels):
        handles.append(Line2D([], [], color=CURVE, linewidth=1.4, label="front by the surrogate"))
    board.figure.legend(
        handles=handles,
        loc="upper left",
        ncols=len(handles),
        bbox_to_anchor=(
            (EDGE + _LEFT - 12) / board.width,
            1 - (top + _HEIGHT + _BELOW - 8) / board.height,
        ),
        columnspacing=1.4,
        handletextpad=0.3,
    )
    board.caption(title, line=1)
    board.caption(f"{_explained(asked)} Bars: {bars}.")
    return board.figure


def _explained(asked: Asked) -> str:
    if asked.price is not None:
        return "Grey lines: settings on one are equally good at the price; lower left is better."
    return "Grey line: the limit."


def _all(panel: TriedPanel) -> list[Dot]:
    return [*panel.dots, *(rival.dot for rival in panel.rivals)]


def _handle(look: Look) -> Line2D:
    return Line2D(
        [], [], linestyle="", marker=look.marker, color=look.colour, markersize=6,
        markeredgecolor="white", markeredgewidth=0.4, label=look.words,
    )  # fmt: skip


def _draw_panel(axes: Axes, panel: TriedPanel, asked: Asked, floor: float, zeros: bool) -> None:
    if zeros:
        axes.axhline(floor, color="#BBBBBB", linewidth=0.8, zorder=1)
    yardstick = KIND_COLOURS["rays"]
    for rays, words in YARDSTICKS.items():
        ms = rays * panel.yardstick_ms
        axes.axvline(ms, color=yardstick, linewidth=1.2, dashes=(5, 3), zorder=1)
        axes.annotate(
            words, (ms, 1), xycoords=("data", "axes fraction"), xytext=(4, -6),
            textcoords="offset points", rotation=90, ha="left", va="top", color=yardstick,
            fontsize=8,
        )  # fmt: skip
    lines = _draw_goal(axes, panel, asked, floor)
    if panel.curve is not None:
        axes.plot(*panel.curve, color=CURVE, linewidth=1.4, zorder=2)
        lines.append(panel.curve.T)
    for dot in panel.dots:
        look = ROLES[dot.role]
        axes.plot(
            [dot.ms], [_height(dot, floor)], look.marker, color=look.colour, markersize=5,
            markeredgecolor="white", markeredgewidth=0.4, alpha=0.85, zorder=3,
        )  # fmt: skip
    for rival in panel.rivals:
        look, height = ROLES[rival.dot.role], _height(rival.dot, floor)
        axes.plot([rival.low, rival.high], [height, height], color=look.colour, linewidth=1.2)
        axes.plot(
            [rival.dot.ms], [height], look.marker, color=look.colour, markersize=9,
            markeredgecolor="#1A1A1A", markeredgewidth=0.9, zorder=5,
        )  # fmt: skip
    log_ticks(axes, floor, zeros)
    axes.set_xlabel("time, milliseconds")
    axes.set_ylabel("wrong pixels per pixel of shadow edge")
    axes.grid(which="major", color="#ECECEC", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    places = np.array([(dot.ms, _height(dot, floor)) for dot in _all(panel)]).reshape(-1, 2)
    labels = [
        Label(r.dot.ms, _height(r.dot, floor), r.name, ROLES[r.dot.role].colour)
        for r in panel.rivals
    ]
    write_labels(axes, labels, places, lines)


def _height(dot: Dot, floor: float) -> float:
    return dot.error if dot.error > 0 else floor


def _draw_goal(axes: Axes, panel: TriedPanel, asked: Asked, floor: float) -> list[np.ndarray]:
    """The limit, or lines of equal objective; their corners (k, 2)."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    if asked.ms is not None:
        axes.axvline(asked.ms, color=FAINT, linewidth=1.2)
        return [np.array([(asked.ms, low), (asked.ms, high)])]
    if asked.error is not None:
        axes.axhline(asked.error, color=FAINT, linewidth=1.2)
        return [np.array([(left, asked.error), (right, asked.error)])]
    assert asked.price is not None
    drawn = []
    for number, (words, level) in enumerate(panel.levels):
        line = equal_objective(level, asked.price, left, right)
        if line.size == 0:
            continue
        axes.plot(*line, color="#9A9A9A", linewidth=1.0, zorder=1.5)
        drawn.append(line.T)
        if low < line[1, 0] < high:
            # Lines may be close: the second's words stand below it.
            side = 1 if number == 0 else -1
            axes.annotate(
                words, (line[0, 0], line[1, 0]), xytext=(4, 2 * side), textcoords="offset points",
                ha="left", va="bottom" if side > 0 else "top", fontsize=7.5, color=FAINT,
            )  # fmt: skip
    return drawn


def equal_objective(level: float, price: float, left: float, right: float) -> np.ndarray:
    """(2, k) milliseconds from `left` on and errors, of which error + price * seconds is `level`;
    no point where even `left` costs more."""
    end = min(1e3 * level / price, right)
    if not math.isfinite(level) or end <= left:
        return np.zeros((2, 0))
    ms = np.geomspace(left, end * (1 - 1e-6), 200)
    return np.stack([ms, level - price * ms / 1e3])
