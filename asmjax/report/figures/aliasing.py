"""The theory of perspective aliasing as curves: along z, by subdivisions, by light direction."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.labels import tick_words
from asmjax.report.figures.style import FAINT, INK, styled

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's palette, in the order in which curves take them."""

_WIDTH, _HEIGHT = 620, 470
"""Size in pixels of a panel, axis labels not included."""

_LEFT, _BELOW, _LEGEND = 110, 66, 360


@dataclass(frozen=True)
class Curve:
    """One line of a panel.

    Attributes:
        label: for the legend.
        x, y: its points.
        marks: (2, n) points of a reference, drawn as open circles; none if empty.
        dashed: drawn with dashes, and in the colour of the curve before.
    """

    label: str
    x: np.ndarray
    y: np.ndarray
    marks: np.ndarray | None = None
    dashed: bool = False


@styled
def draw_distribution(curves: Sequence[Curve], alpha: float) -> Figure:
    """g over depth for several warps (figure 4 of TR05-024)."""
    board = _board(1)
    axes = _panel(
        board, 0, "Error distribution along the view",
        f"α = far / near = {alpha:g}, light overhead", "depth z, in near distances",
        "g: error / largest error of any warp",
    )  # fmt: skip
    _draw(axes, curves)
    axes.set_xlim(1, alpha)
    axes.set_ylim(0, 1.03)
    axes.xaxis.set_major_locator(FixedLocator([1, *(t for t in axes.get_xticks() if 1 < t)]))
    axes.axhline(alpha**-0.5, color=FAINT, linewidth=0.8, dashes=(2, 2), zorder=0.5)
    axes.annotate(
        "1/√α", (alpha, alpha**-0.5), xytext=(-4, 3), textcoords="offset points", ha="right",
        color=FAINT, fontsize=8,
    )  # fmt: skip
    _legend(board, axes, 1)
    board.caption("n: distance of the warp's centre in front of the near plane, in near distances.")
    return board.figure


@styled
def draw_subdivision(shapes: Sequence[Curve], excesses: Sequence[Curve]) -> Figure:
    """Largest error against the number of face subdivisions (figure 7 of TR05-024).

    Args:
        shapes: error / error of the undivided face, by number of parts.
        excesses: error / error of the logarithm.
    """
    board = _board(2)
    left = _panel(
        board, 0, "Largest error against parts k", "relative to one part; LiSPSM in each part",
        "parts k of a face", "error / error at k = 1",
    )  # fmt: skip
    _draw(left, shapes, marker="o")
    left.set_ylim(0, 1.03)
    right = _panel(
        board, 1, "What is left to the logarithm",
        "solid: ξ = 0 (LiSPSM); dashed: ξ = ±1 (PSM, uniform)", "parts k of a face",
        "error / error of the logarithm",
    )  # fmt: skip
    _draw(right, excesses, marker="o")
    _logarithmic(right)
    for axes in (left, right):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlim(left=0.8)
    _legend(board, right, 2)
    board.caption("Light overhead; parts split at z = α^(i/k), texels shared equally.")
    return board.figure


@styled
def draw_directions(curves: Sequence[Curve], theta_deg: float, alpha: float) -> Figure:
    """Storage factor against the angle between light and view direction, degrees."""
    board = _board(1)
    axes = _panel(
        board, 0, "Texels needed, by light direction",
        f"α = far / near = {alpha:g}, half field of view θ = {theta_deg:g}°",
        "angle γ between light and view direction, degrees",
        "storage factor: texels / image pixels",
    )  # fmt: skip
    _logarithmic(axes)
    _draw(axes, curves)
    axes.set_xlim(0, 90)
    axes.xaxis.set_major_locator(FixedLocator(range(0, 91, 15)))
    axes.axvline(theta_deg, color=FAINT, linewidth=0.8, dashes=(2, 2), zorder=0.5)
    axes.annotate(
        "γ < θ: light\ninside the\nview cone", (theta_deg, 0), xytext=(-4, 4), ha="right",
        va="bottom",
        xycoords=("data", "axes fraction"), textcoords="offset points", color=FAINT, fontsize=8,
    )  # fmt: skip
    _legend(board, axes, 1)
    if any(curve.marks is not None for curve in curves):
        board.caption(
            "Circles: an independent computation. With so many texels none is wider than a pixel."
        )
    return board.figure


def _board(panels: int) -> Board:
    return Board(
        2 * EDGE + panels * (_LEFT + _WIDTH) + _LEGEND,
        EDGE + HEAD + _HEIGHT + _BELOW + CAPTION + EDGE,
    )


def _panel(board: Board, column: int, title: str, small: str, x_label: str, y_label: str) -> Axes:
    x = EDGE + column * (_LEFT + _WIDTH) + _LEFT
    board.heading(x, EDGE, _WIDTH, title, small)
    axes = board.axes(x, EDGE + HEAD, _WIDTH, _HEIGHT)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(which="major", color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def _draw(axes: Axes, curves: Sequence[Curve], marker: str = "") -> None:
    solid = -1
    for curve in curves:
        solid += not curve.dashed
        colour = COLOURS[solid % len(COLOURS)]
        axes.plot(
            curve.x, curve.y, color=colour, linewidth=1.4, marker=marker, markersize=3.5,
            markerfacecolor="white" if curve.dashed else colour,
            dashes=(4, 2) if curve.dashed else (), label=curve.label,
        )  # fmt: skip
        if curve.marks is not None:
            axes.plot(
                *curve.marks,
                "o",
                markersize=5,
                color=colour,
                markerfacecolor="white",
                clip_on=False,
            )


def _legend(board: Board, axes: Axes, panels: int) -> None:
    """Right of the last panel, in the order of the curves."""
    handles, labels = axes.get_legend_handles_labels()
    board.figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(
            (EDGE + panels * (_LEFT + _WIDTH) + 8) / board.width,
            1 - (EDGE + HEAD - 12) / board.height,
        ),
        labelcolor=INK,
        handlelength=2.2,
        labelspacing=0.7,
    )


def _logarithmic(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(tick_words))
    axes.yaxis.set_minor_locator(NullLocator())
