"""Errors of hard cases against severity: a panel for each case of a theme, in scenes with a line
for each algorithm."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from asmjax.hard_cases.case import HardCase
from asmjax.hard_cases.measure import PRECISIONS, Measured, Precision, families_of
from asmjax.hard_cases.numbers import power_of_ten, severity_text
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.families import look_of
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
    """A panel for each of `cases`: the error at each severity; of scenes, of each algorithm.

    Hollow points are beyond the bound and announced; on the floor the error is 0, at the top there
    is no number because the toolkit refused.
    """
    found = list(records)
    rows = -(-len(cases) // _COLUMNS)
    high = HEAD + _HEIGHT + _BELOW
    board = Board(
        2 * EDGE + _COLUMNS * (_LEFT + _WIDTH) + (_COLUMNS - 1) * GAP,
        EDGE + rows * high + _LEGEND * (2 if cases[0].is_scene else 1) + CAPTION + EDGE,
    )
    for k, case in enumerate(cases):
        x = EDGE + (k % _COLUMNS) * (_LEFT + _WIDTH + GAP)
        y = EDGE + (k // _COLUMNS) * high
        board.heading(x, y, _LEFT + _WIDTH, case.name, case.bound.unit)
        axes = board.axes(x + _LEFT, y + HEAD, _WIDTH, _HEIGHT)
        _draw(axes, case, [record for record in found if record.case == case.name])
    _legend(board, cases[0])
    board.caption(
        "Severity grows to the right. Lowest: 0, or less than is shown. Highest: more, or refused."
        + _whole(cases[0])
    )
    return board.figure


def _draw(axes: Axes, case: HardCase, records: list[Measured]) -> None:
    low, high = _SCENE if case.is_scene else _KERNEL
    severities = list(dict.fromkeys(record.severity for record in records))
    if case.is_scene:
        _draw_scene(axes, case, records, severities)
    else:
        _draw_kernel(axes, records, severities)
    for precision, colour in COLOURS.items():
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


def _draw_kernel(axes: Axes, records: list[Measured], severities: list[float]) -> None:
    for precision, colour in COLOURS.items():
        at, worst = _worst(records, severities, precision, "error")
        heights = _shown(worst, *_KERNEL)
        axes.plot(at, heights, color=colour, linewidth=1.4, zorder=3)
        for k, height in zip(at, heights, strict=True):
            mine = [r for r in records if (r.precision, r.severity) == (precision, severities[k])]
            _point(axes, k, height, mine, colour, "o", 5.5)
        at, slopes = _worst(records, severities, precision, "gradient_error")
        if np.isfinite(slopes).any():
            axes.plot(at, _shown(slopes, *_KERNEL), ":", color=colour, linewidth=1.1, zorder=2)


def _draw_scene(
    axes: Axes, case: HardCase, records: list[Measured], severities: list[float]
) -> None:
    """A line for each algorithm in float32, and the largest of all in float64 as a cross."""
    at, wrong = _worst(records, severities, "float32", "wrong")
    axes.plot(at, np.where(np.isnan(wrong), np.nan, _shown(wrong, *_SCENE)), color=_ALL,
              linewidth=3, zorder=1)  # fmt: skip
    for family in families_of(case):
        mine = [r for r in records if r.algorithm == family]
        colour, marker = look_of(family)
        at, errors = _worst(mine, severities, "float32", "error")
        heights = _shown(errors, *_SCENE)
        axes.plot(at, heights, color=colour, linewidth=1.2, zorder=3)
        for k, height in zip(at, heights, strict=True):
            _point(axes, k, height, [r for r in mine if r.severity == severities[k]], colour,
                   marker, 5.0)  # fmt: skip
    at, errors = _worst(records, severities, "float64", "error")
    axes.plot(at, _shown(errors, *_SCENE), "x", color=INK, markersize=4, zorder=5)


def _point(
    axes: Axes,
    k: int,
    height: float,
    records: list[Measured],
    colour: str,
    marker: str,
    size: float,
) -> None:
    """Hollow where a record is beyond the bound."""
    stable = all(record.verdict == "stable" for record in records)
    axes.plot(
        k, height, marker, markersize=size if stable else size + 1, color=colour,
        markerfacecolor=colour if stable else "white", markeredgewidth=1.4, zorder=4,
    )  # fmt: skip


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


def _whole(case: HardCase) -> str:
    """What the grey line of a scene is."""
    if not case.is_scene:
        return ""
    what = "off by half of the light or more" if case.is_soft else "wrong, edges of texels included"
    return f" Grey: pixels {what}."


def _legend(board: Board, case: HardCase) -> None:
    def line(colour: str, label: str, **look) -> Line2D:
        return Line2D([], [], color=colour, label=label, linewidth=1.4, **look)

    announced = line(
        INK, "announced: refused or marked", marker="o", markerfacecolor="white", markersize=6
    )
    bound = line(FAINT, "bound", linestyle=(0, (4, 3)))
    if case.is_scene:
        looks = {family: look_of(family) for family in families_of(case)}
        handles = [
            *(line(colour, family, marker=marker, markersize=5)
              for family, (colour, marker) in looks.items()),
            Line2D([], [], color=INK, marker="x", linestyle="none", label="largest in float64"),
            announced, bound,
            Line2D([], [], color=_ALL, linewidth=3, label="wrong in all"),
        ]  # fmt: skip
    else:
        handles = [line(COLOURS[p], p, marker="o", markersize=5) for p in PRECISIONS]
        handles += [announced, bound, line(INK, "gradient", linestyle=":")]
    board.figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=((EDGE - 8) / board.width, (EDGE + CAPTION - 8) / board.height),
        ncols=7 if case.is_scene else len(handles),
        columnspacing=1.8,
        handlelength=2.4,
    )
