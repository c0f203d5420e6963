"""How error and time spread over the trials with each value of each axis."""

import statistics
from collections.abc import Iterator, Sequence

from asmjax.report.page.markup import Markup
from asmjax.report.page.strips import Strip, Strips, strip_charts
from asmjax.report.page.words import EDGE
from asmjax.report.table import significant
from asmjax.sweep.page.measured import Measured
from asmjax.sweep.page.varied import SweptAxis
from asmjax.sweep.words import value_words

_MOST_NUMBERS, _RANGES = 12, 8
"""Numbers that have a row each; of more so many ranges do."""

_MOST_ROWS = 30
"""Of an axis."""


def spread_charts(done: Sequence[Measured], axes: Sequence[SweptAxis]) -> Markup:
    """For each axis a chart of medians and spreads, on common scales."""
    drawn = []
    for axis in axes:
        rows = list(_rows(done, axis))
        more = len(rows) - _MOST_ROWS
        note = f"{more} more values of {axis.title} are not drawn." if more > 0 else ""
        drawn.append(Strips(axis.title, rows[:_MOST_ROWS], note))
    return strip_charts(drawn, [EDGE, "milliseconds from nothing"])


def strongest(done: Sequence[Measured], axes: Sequence[SweptAxis]) -> str | None:
    """Along which axis the median error changes most, in a sentence; None where none does."""
    found = []
    for axis in axes:
        medians = [(statistics.median(row.values[0]), row.name) for row in _rows(done, axis)]
        if len(medians) > 1:
            (least, at_least), (most, at_most) = min(medians), max(medians)
            # Of no error at all nothing is a multiple.
            times = most / least if least else float("inf")
            found.append((times, most, f"{axis.title}: {significant(most)} px with {at_most}, "
                          f"{significant(least)} px with {at_least}"))  # fmt: skip
    found = [one for one in found if one[1] > 0 and one[0] > 1]
    if not found:
        return None
    return f"The median error changes most with {max(found)[2]}."


def _rows(done: Sequence[Measured], axis: SweptAxis) -> Iterator[Strip]:
    """A row for each value that has trials."""
    for name, values in _grouped(axis):
        own = [trial for trial in done if axis.of(trial.settings) in values]
        if own:
            errors = [trial.error for trial in own]
            yield Strip(name, (errors, [1e3 * trial.seconds for trial in own]))


def _grouped(axis: SweptAxis) -> Iterator[tuple[str, set]]:
    """The values of an axis, of many numbers ranges with as many of them each."""
    count = len(axis.values)
    if count <= _MOST_NUMBERS or not axis.is_number:
        yield from (
            (words, {value}) for words, value in zip(axis.value_words, axis.values, strict=True)
        )
        return
    for k in range(_RANGES):
        part = axis.values[k * count // _RANGES : (k + 1) * count // _RANGES]
        yield f"{value_words(part[0][0])} to {value_words(part[-1][0])}", set(part)
