"""The chart of accuracy against cost, as SVG: it prints, and a few lines of script name its points.

Own SVG rather than a charting library: the smallest that works offline and can be tested would add
0.9 to 4.8 MB to each page and 34 to 98 MB of dependencies, for axes that these 300 lines draw.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from asmjax.report.page.drawing import (
    LogAxis,
    chart_figure,
    lying_grid,
    named_point,
    upright_grid,
    zero_line,
)
from asmjax.report.page.markers import outline
from asmjax.report.page.markup import Markup, joined, tag

_WIDTH, _HEIGHT = 920, 560
_LEFT, _TOP, _RIGHT, _BOTTOM = 84, 16, 20, 56
"""Pixels of the drawing, and around its axes."""

_NAMED = 6
"""Up to so many points have their names beside them."""

_NAME_ROOM = 200
"""Pixels that a name may need to the right of its point."""


@dataclass(frozen=True)
class Point:
    """Something that was measured.

    Attributes:
        group: entry of the legend.
        name: unique among the points of its group.
        x: cost, above 0, in the axis' unit; `low` to `high` is its interval.
        y: error, 0 or above.
        facts: further lines for those who point at it.
        number: on the front, from the left; None for others.
    """

    group: str
    name: str
    x: float
    y: float
    low: float
    high: float
    facts: tuple[str, ...] = ()
    number: int | None = None


@dataclass(frozen=True)
class Mark:
    """A cost that is marked by an upright line, and its words."""

    words: str
    x: float


@dataclass(frozen=True)
class Chart:
    """Error against one cost, both on logarithmic axes.

    Attributes:
        title: of its tab.
        x_axis, y_axis: what they are, with units.
        looks: colour and marker of each group, in the order of the legend.
        note: below it; says what the marks and numbers are.
    """

    title: str
    x_axis: str
    y_axis: str
    points: Sequence[Point]
    looks: Mapping[str, tuple[str, str]]
    marks: Sequence[Mark] = ()
    note: str = ""


def charts(drawn: Sequence[Chart]) -> Markup:
    """Charts side by side behind tabs; without script and on paper one below the other."""
    shown = [replace(chart, points=[p for p in chart.points if p.x > 0]) for chart in drawn]
    return tag("div", *(_whole(chart) for chart in shown if chart.points), class_="tabs")


def _whole(chart: Chart) -> Markup:
    errors = [point.y for point in chart.points]
    floor = zero_line(errors)
    heights = [max(error, floor) for error in errors]
    spans = [end for point in chart.points for end in (point.low, point.high, point.x) if end > 0]
    spans += [mark.x for mark in chart.marks if mark.x > 0]
    right, bottom = _WIDTH - _RIGHT, _HEIGHT - _BOTTOM
    across = LogAxis(min(spans) / 1.5, 1.5 * max(spans), _LEFT, right)
    zero = floor if 0 in errors else None
    up = LogAxis(min(heights) / 1.6, 1.8 * max(heights), bottom, _TOP, zero)
    return chart_figure(
        [
            upright_grid(across, _TOP, bottom),
            lying_grid(up, _LEFT, right),
            tag("path", d=f"M{_LEFT} {_TOP}V{bottom}H{right}", class_="axis"),
            _titles(chart),
            _front(chart, across, up),
            *(_mark(mark, across) for mark in chart.marks if mark.x > 0),
            *(_group(name, look, chart, across, up) for name, look in chart.looks.items()),
            _labels(chart, across, up),
        ],
        (_WIDTH, _HEIGHT),
        title=chart.title,
        says=f"{chart.title}: {chart.y_axis} against {chart.x_axis}, {len(chart.points)} points",
        note=chart.note,
        legend=_legend(chart),
    )


def _titles(chart: Chart) -> Markup:
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    return joined(
        [
            tag(
                "text",
                chart.x_axis,
                x=(_LEFT + _WIDTH - _RIGHT) / 2,
                y=_HEIGHT - 10,
                text_anchor="middle",
                class_="name",
            ),
            tag(
                "text",
                chart.y_axis,
                transform=f"translate(18 {middle:g}) rotate(-90)",
                text_anchor="middle",
                class_="name",
            ),
        ]
    )


def _front(chart: Chart, across: LogAxis, up: LogAxis) -> Markup | None:
    """The staircase below and left of which nothing was measured."""
    front = sorted(
        (point for point in chart.points if point.number is not None),
        key=lambda point: point.number or 0,
    )
    if not front:
        return None
    steps = [f"M{across.at(front[0].x):.1f} {_TOP}"]
    for point in front:
        steps.append(f"H{across.at(point.x):.1f}V{up.at(point.y):.1f}")
    return tag("path", d="".join([*steps, f"H{_WIDTH - _RIGHT}"]), class_="front")


def _mark(mark: Mark, across: LogAxis) -> Markup:
    x = across.at(mark.x)
    line = tag("line", x1=f"{x:.1f}", x2=f"{x:.1f}", y1=_TOP, y2=_HEIGHT - _BOTTOM)
    words = tag(
        "text",
        mark.words,
        transform=f"translate({x - 5:.1f} {_TOP + 4}) rotate(-90)",
        text_anchor="end",
    )
    return tag("g", line, words, class_="mark")


def _group(
    name: str, look: tuple[str, str], chart: Chart, across: LogAxis, up: LogAxis
) -> Markup | None:  # fmt: skip
    colour, marker = look
    own = [point for point in chart.points if point.group == name]
    if not own:
        return None
    drawn = [_point(point, marker, across, up) for point in own]
    return tag("g", *drawn, fill=colour, stroke=colour, data_group=name)


def _point(point: Point, marker: str, across: LogAxis, up: LogAxis) -> Markup:
    x, y = across.at(point.x), up.at(point.y)
    bar = None
    if point.high > point.low:
        ends = [f"{across.at(end) - x:.1f}" for end in (point.low, point.high)]
        bar = tag("line", x1=ends[0], x2=ends[1], class_="bar")
    marked = tag("path", d=outline(marker), class_="hollow" if point.y == 0 else None)
    return named_point([point.name, *point.facts], x, y, bar, marked)


def _labels(chart: Chart, across: LogAxis, up: LogAxis) -> Markup:
    """In front of all points: names where there are few, else the numbers of the front."""
    labels = []
    for point in chart.points:
        x, y = across.at(point.x), up.at(point.y)
        if len(chart.points) <= _NAMED:
            left = x > _WIDTH - _RIGHT - _NAME_ROOM
            place = {"x": f"{x - 11 if left else x + 11:.1f}", "y": f"{y + 4.5:.1f}"}
            anchor = "end" if left else "start"
            words, kind = point.name, None
        elif point.number is not None:
            place, anchor = {"x": f"{x + 7:.1f}", "y": f"{y - 7:.1f}"}, "start"
            words, kind = str(point.number), "number"
        else:
            continue
        labels.append(
            tag("text", words, **place, text_anchor=anchor, class_=kind, data_group=point.group)
        )
    return joined(labels)


def _legend(chart: Chart) -> Markup:
    """A button for each group that has points; script makes it hide and show them."""
    shown = {point.group for point in chart.points}
    entries = []
    for name, (colour, marker) in chart.looks.items():
        if name in shown:
            sign = tag("path", d=outline(marker), fill=colour)
            icon = tag("svg", sign, viewBox="-8 -8 16 16", aria_hidden="true")
            entries.append(tag("li", tag("button", icon, name, type="button", data_group=name)))
    return tag("ul", *entries, class_="legend")
