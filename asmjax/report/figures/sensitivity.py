"""How the best settings move with the price of time: slopes at one price, and the way over many."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    NullLocator,
)

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.fronts import significant_tick
from asmjax.report.figures.style import FAINT, styled
from asmjax.report.figures.tuning import CURVE

_WORDS, _BARS, _AXIS = 470, 400, 70
"""Pixels: width of what stands left of the bars, of the bars, height of what stands below them."""

_COLUMNS, _SMALL, _LOW, _APART, _UNDER, _BETWEEN = 3, 300, 190, 84, 52, 50
"""Small panels: in a row, width, height, space left of each, for its words and below it."""

_LETTERS = 36
"""In a line of such words, of which there are two."""

_WAY = "#0072B2"
_CHANGED = ("#0072B2", "#D55E00")
"""Colours of what grows and of what falls as a second costs more."""


@dataclass(frozen=True)
class Slope:
    """d log(what) / d log(price), and its words."""

    words: str
    value: float


@dataclass(frozen=True)
class Way:
    """A quantity along the front.

    Attributes:
        words: what it is, with its unit.
        values: (k,) positive, one for each price.
        ends: of its range.
        mark: as it was chosen by measurement; None where nothing lies in the range.
    """

    words: str
    values: np.ndarray
    ends: tuple[float, float]
    mark: float | None = None


@styled
def draw_sensitivity(
    slopes: Sequence[Slope],
    ways: Sequence[Way],
    prices: np.ndarray,
    price: float,
    title: str = "",
) -> Figure:
    """Bars of the slopes at `price`, and a small panel for each quantity over `prices` (k,)."""
    rows = -(-len(ways) // _COLUMNS)
    height = rows * (_LOW + _BETWEEN + _UNDER)
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + _WORDS + _BARS + 40 + _COLUMNS * (_APART + _SMALL),
        top + height + 2 * CAPTION + EDGE + 20,
    )
    board.heading(
        EDGE, EDGE, _WORDS + _BARS, f"What a dearer second changes, at {price:g} px/s",
        "d log(setting) / d log(price): 1 is twice as much for twice the price",
    )  # fmt: skip
    _draw_slopes(board.axes(EDGE + _WORDS, top, _BARS, height - _AXIS), slopes)
    left = EDGE + _WORDS + _BARS + 40
    board.heading(
        left + _APART, EDGE, _COLUMNS * (_APART + _SMALL), "The best settings over the price",
        "by the surrogate, between steps; cross: as measurements chose; none where it is off",
    )  # fmt: skip
    for i, way in enumerate(ways):
        row, column = divmod(i, _COLUMNS)
        x = left + column * (_APART + _SMALL) + _APART
        y = top + row * (_LOW + _BETWEEN + _UNDER) + _UNDER
        board.text(x, y - 8, textwrap.fill(way.words, _LETTERS), fontsize=7.5, va="bottom")
        _draw_way(board.axes(x, y, _SMALL, _LOW), way, prices, price, row == rows - 1)
    board.caption(title, line=1)
    board.caption("Settings at an end of their range stay there. Axes span the ranges searched.")
    return board.figure


def _draw_slopes(axes: Axes, slopes: Sequence[Slope]) -> None:
    values = np.array([slope.value for slope in slopes])
    most = max(float(np.abs(values).max(initial=0.0)), 1e-3)
    axes.barh(
        np.arange(len(slopes)), values, height=0.6,
        color=[_CHANGED[0] if value >= 0 else _CHANGED[1] for value in values],
    )  # fmt: skip
    axes.axvline(0, color="#444444", linewidth=0.8)
    axes.set(xlim=(-1.35 * most, 1.35 * most), ylim=(len(slopes) - 0.4, -0.6))
    axes.set_yticks(np.arange(len(slopes)), [slope.words for slope in slopes])
    axes.tick_params(axis="y", length=0)
    for k, value in enumerate(values):
        side = 1 if value >= 0 else -1
        axes.annotate(
            f"{round(value, 2) + 0.0:+.2f}", (value, k), xytext=(4 * side, 0),
            textcoords="offset points", ha="left" if side > 0 else "right", va="center",
            fontsize=7.5, color=FAINT,
        )  # fmt: skip
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.set_xlabel("d log / d log price")
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)


def _draw_way(axes: Axes, way: Way, prices: np.ndarray, price: float, last: bool) -> None:
    axes.set(xscale="log", yscale="log")
    low, high = way.ends
    middle = (high / low) ** 0.06 if high > low else 1.5
    axes.set(xlim=(prices.min() / 1.15, prices.max() * 1.15), ylim=(low / middle, high * middle))
    axes.axvline(price, color="#BBBBBB", linewidth=0.8, zorder=1)
    axes.plot(prices, way.values, color=_WAY, linewidth=1.4, marker="o", markersize=2.5)
    if way.mark is not None:
        axes.plot(
            [price], [np.clip(way.mark, low, high)], "x", color=CURVE, markersize=6,
            markeredgewidth=1.6, zorder=4,
        )  # fmt: skip
    subs = (1.0, 2.0, 5.0) if prices.max() / prices.min() < 50 else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs, numticks=9))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: significant_tick(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(FixedLocator([low, high] if high > low else [low]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _end(value)))
    axes.yaxis.set_minor_locator(NullLocator())
    if last:
        axes.set_xlabel("price, px/s")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _end(value: float) -> str:
    """A range's end in few letters."""
    if 1e3 <= value < 1e6:
        return f"{value / 1000:.3g}k"
    return f"{value:.3g}" if value >= 1 else f"{value:.2g}"
