"""Error against cost on logarithmic axes: every trial, the front, and the yardsticks."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.families import look_of
from asmjax.report.figures.labels import Label, write_labels
from asmjax.report.figures.style import KIND_COLOURS, styled

_WIDTH, _HEIGHT, _LEFT, _BELOW = 900, 760, 104, 70
"""Pixels of one panel, and of what stands left of and below it."""

_APART = 26.0
"""Pixels between two points of the front that both get a label."""

_SIZES = {"*": 10.0}
"""Sizes in points of markers that would look smaller than others."""

_LEGEND_ROW = 34
_COLUMNS = 5
"""Families in a row of the legend for each panel that is drawn."""


@dataclass(frozen=True)
class FrontPoint:
    """One trial.

    Attributes:
        family: decides colour and marker.
        label: written beside it if it is on the front.
        name: unique.
        cost: in the axis' unit; `low` to `high` is its interval.
        error: wrong pixels per pixel of edge.
    """

    family: str
    label: str
    name: str
    cost: float
    error: float
    low: float
    high: float


@dataclass(frozen=True)
class Mark:
    """A cost that is marked by an upright line, and its words."""

    text: str
    cost: float


@dataclass(frozen=True)
class FrontPanel:
    """Error against one cost.

    Attributes:
        title, small: above it.
        axis: what the cost is, with its unit.
        front: names of the points on the front, by rising cost.
    """

    title: str
    small: str
    axis: str
    points: Sequence[FrontPoint]
    front: Sequence[str]
    marks: Sequence[Mark] = field(default=())


BARS = "interval of the median time"
"""What intervals are, where nothing closer is said."""


@styled
def draw_fronts(panels: Sequence[FrontPanel], title: str = "", bars: str = BARS) -> Figure:
    """A panel for each kind of cost, all with the same errors; `bars` says what the intervals are.

    A logarithm has no 0: points without any error stand, as open markers, on a line of their own
    below, labelled 0. The front is the grey staircase: below and left of it lies nothing that was
    measured. Its points are labelled, of several close together the most accurate.
    """
    families = list(dict.fromkeys(point.family for panel in panels for point in panel.points))
    columns = max(1, min(len(families), _COLUMNS * len(panels)))
    rows = -(-len(families) // columns) if families else 0
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + len(panels) * (_LEFT + _WIDTH),
        top + _HEIGHT + _BELOW + rows * _LEGEND_ROW + 2 * CAPTION + EDGE,
    )
    errors = np.array([point.error for panel in panels for point in panel.points])
    floor = zero_line(errors)
    for i, panel in enumerate(panels):
        x = EDGE + i * (_LEFT + _WIDTH) + _LEFT
        board.heading(x, EDGE, _WIDTH, panel.title, panel.small)
        _draw_panel(board.axes(x, top, _WIDTH, _HEIGHT), panel, errors, floor)
    if families:
        board.figure.legend(
            handles=[_handle(family) for family in families],
            loc="upper left",
            ncols=columns,
            bbox_to_anchor=(
                (EDGE + _LEFT - 12) / board.width,
                1 - (top + _HEIGHT + _BELOW - 8) / board.height,
            ),
            columnspacing=1.4,
            handletextpad=0.3,
        )
    board.caption(title, line=1)
    board.caption(
        "Grey staircase: nothing that was measured is cheaper and as accurate. Thin lines: each "
        f"family's own. Bars: {bars}. Open markers on the line of 0: no wrong pixel."
    )
    return board.figure


def zero_line(errors: np.ndarray) -> float:
    """The error at which to draw 0: a third of the smallest that is not."""
    positive = errors[errors > 0]
    return float(positive.min()) / 3 if positive.size else 1e-3


def _handle(family: str) -> Line2D:
    colour, marker = look_of(family)
    return Line2D(
        [], [], linestyle="", marker=marker, color=colour, markersize=_SIZES.get(marker, 6.5),
        markeredgecolor="white", markeredgewidth=0.5, label=family,
    )  # fmt: skip


def _draw_panel(axes: Axes, panel: FrontPanel, errors: np.ndarray, floor: float) -> None:
    axes.set(xscale="log", yscale="log")
    _limits(axes, panel, errors, floor)
    named = {point.name: point for point in panel.points}
    corners = _staircase([named[name] for name in panel.front], floor, axes)
    axes.plot(*corners.T, color="#BDBDBD", linewidth=3.2, zorder=1.5, solid_joinstyle="miter")
    if (errors == 0).any():
        axes.axhline(floor, color="#BBBBBB", linewidth=0.8, zorder=1)
    for family in dict.fromkeys(point.family for point in panel.points):
        _draw_family(axes, [p for p in panel.points if p.family == family], floor)
    written = []
    for mark in panel.marks:
        written.append(_beside(axes, mark))
        axes.axvline(mark.cost, color=KIND_COLOURS["rays"], linewidth=1.2, dashes=(5, 3), zorder=1)
        axes.annotate(
            mark.text, (mark.cost, 1), xycoords=("data", "axes fraction"), xytext=(-4, -6),
            textcoords="offset points", rotation=90, ha="right", va="top",
            color=KIND_COLOURS["rays"], fontsize=8, zorder=3,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
        )  # fmt: skip
    log_ticks(axes, floor, bool((errors == 0).any()))
    axes.set_xlabel(panel.axis)
    axes.set_ylabel("wrong pixels per pixel of shadow edge")
    axes.grid(which="major", color="#ECECEC", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    places = np.array([(p.cost, _height(p, floor)) for p in panel.points]).reshape(-1, 2)
    bars = [
        np.array([(p.low, _height(p, floor)), (p.high, _height(p, floor))])
        for p in panel.points
        if p.high > p.low
    ]
    shown = _apart([named[name] for name in panel.front], floor, axes)
    write_labels(
        axes, [_label(point, floor) for point in shown], places, [corners, *bars, *written]
    )


def _beside(axes: Axes, mark: Mark) -> np.ndarray:
    """Ends (2, 2) of the line along which the words of a mark stand, in the axes' data."""
    frame = axes.get_window_extent()
    across = axes.transData.transform((mark.cost, axes.get_ylim()[1]))[0] - 15
    ends = [(across, frame.y1), (across, frame.y1 - 10.0 * len(mark.text))]
    return axes.transData.inverted().transform(ends)


def _apart(front: Sequence[FrontPoint], floor: float, axes: Axes) -> list[FrontPoint]:
    """Of points that lie close to each other the most accurate one."""
    kept: list[tuple[FrontPoint, np.ndarray]] = []
    for point in reversed(front):
        at = axes.transData.transform((point.cost, _height(point, floor)))
        if all(np.hypot(*(at - other)) >= _APART for _, other in kept):
            kept.append((point, at))
    return [point for point, _ in reversed(kept)]


def _label(point: FrontPoint, floor: float) -> Label:
    text = f"{point.family}, {point.label}"
    return Label(point.cost, _height(point, floor), text, look_of(point.family)[0])


def _height(point: FrontPoint, floor: float) -> float:
    return point.error if point.error > 0 else floor


def _draw_family(axes: Axes, points: Sequence[FrontPoint], floor: float) -> None:
    colour, marker = look_of(points[0].family)
    ordered = sorted(points, key=lambda p: (p.cost, p.error))
    own = []
    for point in ordered:
        if not own or point.error < own[-1].error:
            own.append(point)
    axes.plot(
        [p.cost for p in own], [_height(p, floor) for p in own],
        color=colour, linewidth=0.8, alpha=0.55, zorder=2,
    )  # fmt: skip
    for point in points:
        height = _height(point, floor)
        if point.high > point.low:
            axes.plot(
                [point.low, point.high], [height, height], color=colour, linewidth=0.9,
                alpha=0.5, zorder=2.5,
            )  # fmt: skip
        axes.plot(
            [point.cost], [height], marker, color=colour, zorder=4,
            markersize=_SIZES.get(marker, 6.5),
            markerfacecolor=colour if point.error > 0 else "white",
            markeredgecolor="white" if point.error > 0 else colour,
            markeredgewidth=0.5 if point.error > 0 else 1.4,
        )  # fmt: skip


def _staircase(front: Sequence[FrontPoint], floor: float, axes: Axes) -> np.ndarray:
    """Corners (k, 2) of the edge of what was reached, from the top to the right."""
    corners: list[tuple[float, float]] = []
    height = axes.get_ylim()[1]
    for point in front:
        corners += [(point.cost, height), (point.cost, _height(point, floor))]
        height = _height(point, floor)
    if corners:
        corners.append((axes.get_xlim()[1], height))
    return np.array(corners).reshape(-1, 2)


def _limits(axes: Axes, panel: FrontPanel, errors: np.ndarray, floor: float) -> None:
    spans = [(p.low, p.high) for p in panel.points] + [(m.cost, m.cost) for m in panel.marks]
    if not spans:
        axes.set(xlim=(1, 1000), ylim=(1e-3, 10))
        return
    low, high = min(low for low, _ in spans), max(high for _, high in spans)
    axes.set_xlim(low / 1.6, high * 1.9)
    least = floor / 1.6 if (errors == 0).any() else errors[errors > 0].min() / 1.8
    most = errors.max() if (errors > 0).any() else 100 * floor
    axes.set_ylim(least, most * 1.8)


def log_ticks(axes: Axes, floor: float, zeros: bool) -> None:
    """Ticks of both logarithmic axes; with `zeros`, 0 stands at `floor` on the upright one."""
    low, high = axes.get_ylim()
    subs = (1.0, 2.0, 5.0) if high / low < 1e4 else (1.0,)
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    least = 2 * floor if zeros else low
    values = [k * p for p in decades for k in subs if least < k * p <= high]
    axes.yaxis.set_major_locator(FixedLocator([floor, *values] if zeros else values))
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda v, _: "0" if zeros and np.isclose(v, floor) else significant_tick(v))
    )
    minor = [k * p for p in decades for k in range(1, 10) if least < k * p <= high]
    axes.yaxis.set_minor_locator(FixedLocator([m for m in minor if m not in values]))
    axes.yaxis.set_minor_formatter(NullFormatter())
    left, right = axes.get_xlim()
    axes.xaxis.set_major_locator(
        LogLocator(subs=(1.0, 2.0, 5.0) if right / left < 1e4 else (1.0,), numticks=99)
    )
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: significant_tick(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())


def significant_tick(value: float) -> str:
    """0.002, 0.5, 20: without an exponent down to a hundred-thousandth."""
    return f"{value:.5f}".rstrip("0").rstrip(".") if value < 1e6 else f"{value:g}"
