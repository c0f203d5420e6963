"""What accuracy costs: share of wrong pixels against time, with ray tracing as the yardstick."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from asmjax.report.figures.board import EDGE, HEAD, Board
from asmjax.report.figures.families import FAMILY_LOOKS
from asmjax.report.figures.style import KIND_COLOURS, styled
from asmjax.report.table import significant

_LOOKS = FAMILY_LOOKS | {"rays": (KIND_COLOURS["rays"], "D")}


@styled
def draw_accuracy_time(methods: Sequence[Mapping], pixels: int, title: str = "") -> Figure:
    """One point per method on two logarithmic axes: milliseconds, and percent of wrong pixels.

    A logarithm has no 0: methods without a wrong pixel stand, as open markers, on a line of
    their own below the share of a single pixel, labelled 0. A dashed line marks the time of the
    first ray-traced method, which is the truth, or has one ray where truth has many, which then is
    not drawn: what lies right of it costs more than to trace the shadow rays of every pixel.

    Args:
        methods: the `methods` of a report.
        pixels: number of valid pixels, which says how small a share can be.
        title: scene and view.
    """
    # Soft truth is cast once and cold: its time is none to compare with.
    traced = [method for method in methods if method["name"].startswith("rays")]
    if len(traced) > 1:
        methods = [method for method in methods if method is not traced[-1]]
    board = Board(1120, 780)
    left, top = 120, EDGE + HEAD + 6
    axes = board.axes(left, top, board.width - left - 48, board.height - top - 132)
    board.heading(
        EDGE,
        EDGE,
        board.width,
        "What accuracy costs",
        "wrong pixels against build + analysis + query; lower left is better",
    )
    times = np.array([max(1e3 * m["seconds"]["total"], 1e-3) for m in methods])
    shares = np.array([100 * m["error"]["misclassified_fraction"] for m in methods])
    floor = zero_line(shares, pixels)
    heights = np.where(shares > 0, shares, floor)
    axes.set_xscale("log")
    axes.set_yscale("log")
    _limits(axes, times, heights, floor)
    axes.axhline(floor, color="#BBBBBB", linewidth=0.8, zorder=1)
    for method, time, share, height in zip(methods, times, shares, heights, strict=True):
        colour, marker = _look(method)
        axes.plot(
            [time],
            [height],
            marker,
            markersize=7,
            zorder=4,
            markeredgecolor=colour,
            markerfacecolor=colour if share > 0 else "white",
            markeredgewidth=1.6,
            label=method["name"],
        )
    rays = [i for i, method in enumerate(methods) if method["name"].startswith("rays")]
    if rays:
        colour = KIND_COLOURS["rays"]
        axes.axvline(times[rays[0]], color=colour, linewidth=1.2, dashes=(5, 3), zorder=2)
        axes.annotate(
            "time of tracing every pixel",
            (times[rays[0]], 1),
            xycoords=("data", "axes fraction"),
            xytext=(-5, -6),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            color=colour,
            fontsize=8,
        )
    _name_points(axes, methods, times, heights, shares)
    _ticks(axes, floor)
    axes.set_xlabel("time, milliseconds")
    axes.set_ylabel("wrong pixels, %")
    axes.grid(which="major", color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    end = f"At 0, open markers: none of {pixels:,} pixels wrong."
    board.caption(f"{title}. {end}" if title else end, line=1 if rays else 0)
    if rays:
        board.caption(
            f"Dashed: {methods[rays[0]]['name']} traces shadow rays from every pixel; "
            + ("it is the truth, so it errs nowhere." if len(traced) < 2 else "truth is soft.")
        )
    return board.figure


def _look(method: Mapping) -> tuple[str, str]:
    """Colour and marker; what is of no known kind is a map of one resolution."""
    kinds = (kind for kind in _LOOKS if method["name"].startswith(kind))
    return _LOOKS[next(kinds, "uniform")]


def zero_line(shares: np.ndarray, pixels: int) -> float:
    """Percent at which to draw 0: a third of one pixel, or of the smallest share if less."""
    one = 100.0 / max(pixels, 1)
    positive = shares[shares > 0]
    return min([one, *positive.tolist()]) / 3


def _limits(axes: Axes, times: np.ndarray, heights: np.ndarray, floor: float) -> None:
    if times.size:
        axes.set_xlim(times.min() / 2.2, times.max() * 2.6)
        axes.set_ylim(floor / 1.8, max(heights.max() * 2.5, floor * 100))
    else:
        axes.set_xlim(0.1, 1000)
        axes.set_ylim(floor / 1.8, 100)


def _ticks(axes: Axes, floor: float) -> None:
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    top = axes.get_ylim()[1]
    powers = 10.0 ** np.arange(np.ceil(np.log10(floor * 2)), np.floor(np.log10(top)) + 1)
    axes.yaxis.set_major_locator(FixedLocator([floor, *powers]))
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda value, _: "0" if np.isclose(value, floor) else f"{value:g}")
    )
    axes.yaxis.set_minor_formatter(NullFormatter())
    # The line of zeros is off the scale: no ticks between it and the share of one pixel.
    minor = [k * p for p in 10.0 ** np.arange(-9, 3) for k in range(2, 10)]
    axes.yaxis.set_minor_locator(FixedLocator([m for m in minor if 2 * floor < m < top]))


class _Place(NamedTuple):
    """Where a label could stand: its anchor, the side that the anchor is on, and its area."""

    x: float
    y: float
    side: str
    area: tuple[float, float, float, float]


_LINE, _LETTER, _PAD = 20.0, 10.9, 14.0
"""Pixels: height of a label, mean width of its letters, distance from its point. Estimated, not
measured: drawing every label once more to know its width costs 50 ms."""


def _name_points(axes: Axes, methods: Sequence[Mapping], times, heights, shares) -> None:
    """Each point's name and share beside it, on the first side where nothing is in the way."""
    if not methods:
        return
    frame = axes.get_window_extent()
    points = axes.transData.transform(np.stack([times, heights], axis=1)).tolist()
    taken = [(x - 9, y - 9, x + 9, y + 9) for x, y in points]
    for method, (x, y), share in zip(methods, points, shares, strict=True):
        text = f"{method['name']}  {significant(share)} %"

        def trouble(place: _Place) -> int:
            left, bottom, right, top = place.area
            inside = frame.x0 <= left and right <= frame.x1
            inside = inside and frame.y0 <= bottom and top <= frame.y1
            return sum(_overlap(place.area, other) for other in taken) + (0 if inside else 100)

        best = min(_places(x, y, _LETTER * len(text), on_line=bool(share == 0)), key=trouble)
        taken.append(best.area)
        axes.annotate(
            text,
            (best.x, best.y),
            xycoords="figure pixels",
            ha=best.side,
            va="center",
            fontsize=8.5,
            color=_look(method)[0],
            zorder=5,
        )


def _places(x: float, y: float, width: float, on_line: bool) -> list[_Place]:
    """Places for the label of a point, best first; none beside a point on the line of zeros."""
    steps = [_LINE * k for k in (1, -1, 2, -2, 3, -3, 4, -4)]
    rises = [step for step in steps if step > 0] if on_line else [0.0, *steps]
    anchors = [
        *((x + _PAD, y + rise, "left") for rise in rises),
        (x, y + _PAD + _LINE / 2, "center"),
        (x, y - _PAD - _LINE / 2, "center"),
        *((x - _PAD, y + rise, "right") for rise in rises),
    ]
    shift = {"left": 0.0, "center": 0.5, "right": 1.0}
    places = []
    for anchor_x, anchor_y, side in anchors:
        left = anchor_x - shift[side] * width
        area = (left, anchor_y - _LINE / 2, left + width, anchor_y + _LINE / 2)
        places.append(_Place(anchor_x, anchor_y, side, area))
    return places


def _overlap(a: tuple, b: tuple) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
