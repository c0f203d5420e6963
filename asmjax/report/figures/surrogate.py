"""What the surrogate says of settings against what was measured: error and time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.fronts import log_ticks
from asmjax.report.figures.style import styled
from asmjax.report.figures.tuning import ROLES

_SIDE, _LEFT, _BELOW, _LEGEND_ROW = 660, 104, 70, 34

LEAST = 1e-4
"""Errors below this are drawn here: a logarithm has no 0."""


@styled
def draw_surrogate(
    roles: Sequence[str],
    measured: np.ndarray,
    said: np.ndarray,
    spearman: float | None,
    title: str = "",
) -> Figure:
    """Two panels with the line on which both agree.

    Args:
        roles: (k,) of `ROLES`.
        measured, said: (2, k) wrong pixels per pixel of edge, and seconds.
        spearman: rank correlation of the objective, of settings that it was not fitted to.
    """
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + 2 * (_LEFT + _SIDE),
        top + _SIDE + _BELOW + _LEGEND_ROW + 2 * CAPTION + EDGE,
    )
    names = ("error, wrong pixels per pixel of edge", "time, milliseconds")
    for i, (name, scale) in enumerate(zip(names, (1.0, 1e3), strict=True)):
        x = EDGE + i * (_LEFT + _SIDE) + _LEFT
        real, guess = (np.maximum(scale * row[i], LEAST) for row in (measured, said))
        good = np.isfinite(real) & np.isfinite(guess)
        off = np.exp(np.median(np.abs(np.log(guess[good] / real[good])))) if good.any() else 1.0
        board.heading(
            x, EDGE, _SIDE, f"{name.partition(',')[0].capitalize()}{_spearman(real, guess, good)}",
            f"typically off by a factor of {off:.2f}; {np.count_nonzero(good)} settings",
        )  # fmt: skip
        axes = board.axes(x, top, _SIDE, _SIDE)
        axes.set(xscale="log", yscale="log")
        both = np.concatenate([real[good], guess[good], [LEAST] if not good.any() else []])
        ends = both.min() / 1.4, both.max() * 1.4
        axes.set(xlim=ends, ylim=ends)
        axes.plot(ends, ends, color="#9A9A9A", linewidth=1.0, zorder=1)
        for role, across, up, shown in zip(roles, real, guess, good, strict=True):
            if not shown:
                continue
            look = ROLES[role]
            axes.plot(
                [across], [up], look.marker, color=look.colour, markersize=5,
                markeredgecolor="white", markeredgewidth=0.4, zorder=3,
            )  # fmt: skip
        log_ticks(axes, ends[0], False)
        axes.set_xlabel(f"measured: {name}")
        axes.set_ylabel("by the surrogate")
        axes.grid(which="major", color="#ECECEC", linewidth=0.6)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    looks = [look for name, look in ROLES.items() if name in roles]
    board.figure.legend(
        handles=[
            Line2D(
                [], [], linestyle="", marker=look.marker, color=look.colour, markersize=6,
                markeredgecolor="white", markeredgewidth=0.4, label=look.words,
            )
            for look in looks
        ],
        loc="upper left",
        ncols=len(looks),
        bbox_to_anchor=(
            EDGE / board.width,
            1 - (top + _SIDE + _BELOW - 8) / board.height,
        ),
        columnspacing=0.8,
        handletextpad=0.3,
    )  # fmt: skip
    rank = ""
    if spearman is not None:
        rank = f" Spearman of the objective, of settings it was not fitted to: {spearman:.2f}."
    board.caption(title, line=1)
    board.caption(f"On the line both agree; above it the surrogate says too much.{rank}")
    return board.figure


def _spearman(real: np.ndarray, guess: np.ndarray, good: np.ndarray) -> str:
    """Words for a title; none where nothing varies."""
    # Imported late: it takes long.
    from scipy.stats import spearmanr

    if np.unique(real[good]).size < 2 or np.unique(guess[good]).size < 2:
        return ""
    correlation, _ = spearmanr(real[good], guess[good])
    return f": Spearman {float(np.asarray(correlation)):.2f}"
