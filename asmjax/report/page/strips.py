"""Medians and spreads of what shares something, a row each: small charts on common scales."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from asmjax.report.page.drawing import (
    LogAxis,
    chart_figure,
    named_point,
    upright_grid,
    zero_line,
)
from asmjax.report.page.markers import outline
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.words import plural
from asmjax.report.table import significant

_WIDTH, _NAMES, _GAP, _RIGHT = 920, 230, 44, 24
"""Pixels of the drawing, of the names at its left, between scales, and right of the last one."""

_TOP, _ROW, _BOTTOM = 8, 26, 52
"""Pixels above the rows, of each, and below them."""

_LETTERS = 28
"""Of a name that fits beside its row; what ends it tells it apart, as of a path."""

_DECADES = 2.2
"""Beyond so many decades only powers of ten are labelled: scales are narrow."""

_ROOM = 50
"""Pixels between the label of 0 and others."""

_COLOUR = "#0072B2"


@dataclass(frozen=True)
class Strip:
    """A row: what some things share, and for each scale what was measured of them, 0 or above."""

    name: str
    values: tuple[Sequence[float], ...]


@dataclass(frozen=True)
class Strips:
    """The rows of one chart, which differ in what `title` names."""

    title: str
    rows: Sequence[Strip]
    note: str = ""


def strip_charts(drawn: Sequence[Strips], scales: Sequence[str]) -> Markup:
    """Charts one below the other; each scale is the same in all of them."""
    wide = (_WIDTH - _NAMES - _GAP * (len(scales) - 1) - _RIGHT) / len(scales)
    axes = []
    for k in range(len(scales)):
        left = _NAMES + k * (wide + _GAP)
        values = [v for chart in drawn for row in chart.rows for v in row.values[k]]
        axes.append(_axis(values, left, left + wide))
    return joined(_chart(chart, scales, axes) for chart in drawn)


def _axis(values: Sequence[float], start: float, end: float) -> LogAxis:
    zero = zero_line(values)
    heights = [max(value, zero) for value in values] or [zero]
    low, high = min(heights) / 1.4, 1.4 * max(heights)
    return LogAxis(low, high, start, end, zero if 0 in values else None, _DECADES, _ROOM)


def _chart(chart: Strips, scales: Sequence[str], axes: Sequence[LogAxis]) -> Markup:
    bottom = _TOP + _ROW * len(chart.rows)
    parts: list[Markup | None] = []
    wide = (_WIDTH - _NAMES - _GAP * (len(scales) - 1) - _RIGHT) / len(scales)
    for k, (scale, axis) in enumerate(zip(scales, axes, strict=True)):
        left = _NAMES + k * (wide + _GAP)
        parts.append(upright_grid(axis, _TOP, bottom))
        parts.append(tag("path", d=f"M{left:.1f} {bottom}h{wide:.1f}", class_="axis"))
        words = tag(
            "text",
            scale,
            x=f"{left + wide / 2:.1f}",
            y=bottom + 42,
            text_anchor="middle",
            class_="name",
        )
        parts.append(words)
    for i, row in enumerate(chart.rows):
        y = _TOP + _ROW * (i + 0.5)
        parts.append(_name(row.name, y))
        parts += [
            _strip(row, k, chart.title, scale, axis, y)
            for k, (scale, axis) in enumerate(zip(scales, axes, strict=True))
        ]
    return chart_figure(
        [tag("g", *parts, fill=_COLOUR, stroke=_COLOUR)],
        (_WIDTH, bottom + _BOTTOM),
        title=chart.title,
        says=f"{' and '.join(scales)} by {chart.title}: medians and "
        f"spreads of {plural(len(chart.rows), 'row')}",
        note=chart.note,
    )


def _name(name: str, y: float) -> Markup:
    shown = name if len(name) <= _LETTERS else f"...{name[3 - _LETTERS :]}"
    return tag("text", shown, x=_NAMES - 12, y=f"{y + 4.5:.1f}", text_anchor="end")


def _strip(
    row: Strip, k: int, title: str, scale: str, axis: LogAxis, y: float
) -> Markup | None:  # fmt: skip
    """Where the median, the middle half and all values lie on one scale."""
    values = row.values[k]
    if not values:
        return None
    least, low, middle, high, most = np.quantile(values, (0, 0.25, 0.5, 0.75, 1)).tolist()
    x = axis.at(middle)
    said = [f"{title}: {row.name}", scale, f"median {significant(middle)}"]
    if len(values) > 1:
        said[2] += f" of {len(values):,}"
        said.append(f"half of them {significant(low)} to {significant(high)}")
        said.append(f"all {significant(least)} to {significant(most)}")
    return named_point(
        said,
        x,
        y,
        _bar(axis.at(least) - x, axis.at(most) - x, "bar"),
        _bar(axis.at(low) - x, axis.at(high) - x, "half"),
        tag("path", d=outline("o"), class_="hollow" if middle == 0 else None),
    )


def _bar(start: float, end: float, kind: str) -> Markup | None:
    if end - start < 0.05:
        return None
    return tag("line", x1=f"{start:.1f}", x2=f"{end:.1f}", class_=kind)
