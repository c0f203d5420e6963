"""Errors of hard cases against severity: a panel for each case of a theme."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from asmjax.hard_cases.case import HardCase
from asmjax.hard_cases.measure import PRECISIONS, Measured, Precision
from asmjax.hard_cases.numbers import power_of_ten, severity_text
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.style import FAINT, FALSE_DARK, FALSE_LIT, INK, styled

_WIDTH, _HEIGHT, _LEFT, _BELOW = 440, 220, 70, 84
"""Pixels of a panel, and of its axes' labels."""

_COLUMNS = 3
_LEGEND = 30

COLOURS: dict[Precision, str] = {"float32": FALSE_LIT, "float64": FALSE_DARK}

_ALL = "#B9B9B9"

_KERNEL = (-17.0, 3.0)
_SCENE = (-4.0, 0.3)
"""log10 of the errors that a panel shows; its floor stands for 0 and its top for more, or none."""


@styled
def draw_theme(cases: Sequence[HardCase], records: Iterable[Measured]) -> Figure:
    """A panel for each of `cases`: the largest error, over all algorithms, at each severity.

    Hollow points are beyond the bound and announced; on the floor the error is 0, at the top there
    is no number because the toolkit refused.
    """
    found = list(records)
    rows = -(-len(cases) // _COLUMNS)
    high = HEAD + _HEIGHT + _BELOW
    board = Board(
        2 * EDGE + _COLUMNS * (_LEFT + _WIDTH) + (_COLUMNS - 1) * GAP,
        EDGE + rows * high + _LEGEND + CAPTION + EDGE,
    )
    for k, case in enumerate(cases):
        x = EDGE + (k % _COLUMNS) * (_LEFT + _WIDTH + GAP)
        y = EDGE + (k // _COLUMNS) * high
        board.heading(x, y, _LEFT + _WIDTH, case.name, case.bound.unit)
        axes = board.axes(x + _LEFT, y + HEAD, _WIDTH, _HEIGHT)
        _draw(axes, case, [record for record in found if record.case == case.name])
    _legend(board, cases[0].is_scene)
    board.caption(
        "Severity grows to the right. Lowest line: 0, or less than the scale shows. "
        "Highest: no number, because it was refused."
    )
    return board.figure


def _draw(axes: Axes, case: HardCase, records: list[Measured]) -> None:
    low, high = _SCENE if case.is_scene else _KERNEL
    severities = list(dict.fromkeys(record.severity for record in records))
    if case.is_scene:
        at, wrong = _worst(records, severities, "float32", "wrong")
        known = np.where(np.isnan(wrong), np.nan, _shown(wrong, low, high))
        axes.plot(at, known, color=_ALL, linewidth=3, zorder=1)
    for precision, colour in COLOURS.items():
        at, worst = _worst(records, severities, precision, "error")
        heights = _shown(worst, low, high)
        # Of scenes few severities are measured in float64, and a line would tell of others.
        single = precision == "float32" or not case.is_scene
        line = "-" if single else "none"
        axes.plot(at, heights, linestyle=line, color=colour, linewidth=1.4, zorder=3)
        for k, height in zip(at, heights, strict=True):
            mine = [r for r in records if (r.precision, r.severity) == (precision, severities[k])]
            stable = all(record.verdict == "stable" for record in mine)
            axes.plot(
                k, height, "o", markersize=(5.5 if stable else 6.5) - (0 if single else 2.5),
                color=colour, markerfacecolor=colour if stable else "white",
                markeredgewidth=1.4, zorder=4 if single else 5,
            )  # fmt: skip
        at, slopes = _worst(records, severities, precision, "gradient_error")
        if np.isfinite(slopes).any():
            axes.plot(
                at, _shown(slopes, low, high), ":", color=colour, linewidth=1.1, zorder=2
            )  # fmt: skip
        bound, same = case.bound.of(precision), case.bound.float32 == case.bound.float64
        if bound > 10**low:
            axes.axhline(
                np.log10(bound), color=FAINT if same else colour, dashes=(4, 3), linewidth=0.9,
                zorder=0,
            )  # fmt: skip
    axes.set_xlim(-0.35, len(severities) - 0.65)
    span = high - low
    axes.set_ylim(low - 0.05 * span, high + 0.05 * span)
    axes.set_xlabel(case.axis, fontsize=8)
    axes.xaxis.set_major_locator(FixedLocator(range(len(severities))))
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda value, _: severity_text(severities[round(value)]))
    )
    ticks = [-3, -2, -1, 0] if case.is_scene else [-15, -10, -5, 0]
    axes.yaxis.set_major_locator(FixedLocator([low, *ticks]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: _error_label(v, low, case.is_scene)))
    axes.grid(axis="y", color="#E9E9E9", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _error_label(value: float, low: float, share: bool) -> str:
    if value == low:
        return "0"
    return f"{100 * 10**value:g} %" if share else power_of_ten(value)


def _worst(
    records: list[Measured], severities: list[float], precision: Precision, what: str
) -> tuple[list[int], np.ndarray]:
    """Numbers of the severities that were measured in that precision, and the largest of what is
    asked for at each; NaN where there is none."""
    at, largest = [], []
    for k, severity in enumerate(severities):
        mine = [r for r in records if (r.precision, r.severity) == (precision, severity)]
        if mine:
            known = [x for x in (getattr(r, what) for r in mine) if x is not None and x == x]
            at.append(k)
            largest.append(max(known, default=np.nan))
    return at, np.asarray(largest)


def _shown(x: np.ndarray, low: float, high: float) -> np.ndarray:
    """log10, held within the panel; no number is drawn at the top."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.isnan(x), high, np.clip(np.log10(x), low, high))


def _legend(board: Board, scenes: bool) -> None:
    def line(colour: str, label: str, **look) -> Line2D:
        return Line2D([], [], color=colour, label=label, linewidth=1.4, **look)

    handles = [
        line(COLOURS[precision], precision, marker="o", markersize=5) for precision in PRECISIONS
    ]
    handles.append(
        line(INK, "announced: refused or marked", marker="o", markerfacecolor="white", markersize=6)
    )
    handles.append(line(FAINT, "bound", linestyle=(0, (4, 3))))
    if scenes:
        handles.append(
            Line2D([], [], color=_ALL, linewidth=3, label="wrong in all, edges of texels included")
        )
    else:
        handles.append(line(INK, "gradient", linestyle=":"))
    board.figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=((EDGE - 8) / board.width, (EDGE + CAPTION - 8) / board.height),
        ncols=len(handles),
        columnspacing=1.8,
        handlelength=2.4,
    )
