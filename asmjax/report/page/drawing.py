"""What the charts of the page are drawn with: logarithmic axes and their grids, points that have a
name, and the frame in which a few lines of script show it."""

import math
from collections.abc import Sequence

from asmjax.report.page.markup import Markup, joined, tag

_MOST_LABELS = 9
"""Of powers of ten along an axis."""


class LogAxis:
    """A logarithmic axis.

    Args:
        low, high: its ends, above 0.
        start, end: pixels at which they lie.
        zero: where 0 is drawn, which a logarithm does not have; None where all is above 0.
        decades: beyond so many only powers of ten are labelled.
        room: pixels that the label of 0 takes.
    """

    def __init__(
        self,
        low: float,
        high: float,
        start: float,
        end: float,
        zero: float | None = None,
        decades: float = 3.2,
        room: float = 20,
    ):
        self._low, self._high, self._start, self._end = low, high, start, end
        self._zero, self._decades, self._room = zero, decades, room

    def at(self, value: float) -> float:
        """Pixels of a value."""
        value = max(value, self._low if self._zero is None else self._zero)
        part = math.log(value / self._low) / math.log(self._high / self._low)
        return self._start + part * (self._end - self._start)

    def labels(self) -> list[tuple[float, str]]:
        """Pixels and words of its ticks."""
        wide = math.log10(self._high / self._low)
        steps = (1, 2, 5) if wide <= self._decades else (1,)
        apart = math.ceil(wide / _MOST_LABELS)
        powers = range(math.floor(math.log10(self._low)), math.ceil(math.log10(self._high)) + 1)
        values = [k * 10.0**power for power in powers if power % apart == 0 for k in steps]
        ticks = [(self.at(v), _number(v)) for v in values if self._low <= v <= self._high]
        if self._zero is None:
            return ticks
        # No tick between the line of zeros and the smallest value.
        start, least = self.at(0), self.at(2 * self._zero)
        free = max(abs(least - start), self._room)
        return [(start, "0"), *(tick for tick in ticks if abs(tick[0] - start) > free)]


def zero_line(values: Sequence[float]) -> float:
    """The value at which 0 is drawn: a third of the smallest that is above it."""
    return min((value for value in values if value > 0), default=3e-3) / 3


def _number(value: float) -> str:
    """0.002, 0.5, 20, 1,000: without an exponent."""
    return f"{value:,.9f}".rstrip("0").rstrip(".")


def upright_grid(axis: LogAxis, top: float, bottom: float) -> Markup:
    """The grid of an axis that lies, its numbers below."""
    parts = []
    for at, words in axis.labels():
        x = f"{at:.1f}"
        parts.append(tag("line", x1=x, x2=x, y1=top, y2=bottom, class_="grid"))
        parts.append(tag("text", words, x=x, y=bottom + 20, text_anchor="middle"))
    return joined(parts)


def lying_grid(axis: LogAxis, left: float, right: float) -> Markup:
    """The grid of an axis that stands, its numbers to the left."""
    parts = []
    for at, words in axis.labels():
        y = f"{at:.1f}"
        parts.append(tag("line", x1=left, x2=right, y1=y, y2=y, class_="grid"))
        parts.append(tag("text", words, x=left - 8, y=f"{at + 4:.1f}", text_anchor="end"))
    return joined(parts)


def named_point(words: Sequence[str], x: float, y: float, *shapes: Markup | None) -> Markup:
    """Shapes around a place, with what is said to those who point there: a name, and facts."""
    return tag(
        "g",
        tag("title", "\n".join(words)),
        *shapes,
        transform=f"translate({x:.1f} {y:.1f})",
        class_="point",
        data_x=f"{x:.1f}",
        data_y=f"{y:.1f}",
    )


def chart_figure(
    drawing: Sequence[Markup | None],
    size: tuple[int, int],
    *,
    title: str,
    says: str,
    note: str,
    legend: Markup | None = None,
) -> Markup:
    """A drawing whose points tell their names.

    Args:
        size: width and height, pixels.
        title: of its tab.
        says: what it shows, for those who do not see it.
        note: below it.
    """
    svg = tag(
        "svg",
        *drawing,
        viewBox=f"0 0 {size[0]} {size[1]}",
        role="img",
        tabindex="0",
        aria_label=f"{says}; the arrow keys go from one to the next",
    )
    return tag(
        "figure",
        tag("div", svg, tag("p", class_="tip", hidden=True, aria_live="polite"), class_="plot"),
        legend,
        tag("figcaption", note) if note else None,
        class_="chart",
        data_tab=title,
    )
