"""The comparison of methods as a table: plain text for the terminal, CSV for everything else."""

import csv
import io
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from asmjax.writing import text_writer, write_file

MB = 2**20
"""Bytes per MB, on the command line and in tables."""

MAX_WIDTH = 110
"""Columns that a table keeps to, by cutting method names, while runs stay below an hour."""


def significant(value: float) -> str:
    """About three digits without an exponent: 0, 0.0031, 0.153, 2.51, 84.9, 1234."""
    if value == 0:
        return "0"
    size = abs(value)
    if size < 0.0001:
        # Not 0: a single wrong pixel of a large image must not look like none.
        return "<.0001"
    decimals = 4 if size < 0.01 else 3 if size < 1 else 2 if size < 10 else 1 if size < 100 else 0
    return f"{value:.{decimals}f}"


def short_count(value: int) -> str:
    """A count in at most six characters: 950, 65.5k, 4.19M, 17.2G."""
    for unit, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        # 999.5 of a unit would round to a fourth digit: say 1.00 of the next.
        if value >= 0.9995 * unit:
            return f"{significant(max(value / unit, 1.0))}{suffix}"
    return str(value)


def is_long_power(count: int) -> bool:
    """Whether a number of texels is a power of two better written as one: from 2^17 on."""
    return count > 2**16 and count & (count - 1) == 0


def texels_a_side(count: int) -> str:
    """915, 2048, 2^22: what is above 65536 as the power of two that it is."""
    return f"2^{count.bit_length() - 1}" if is_long_power(count) else str(count)


def _decimal(value: float) -> str:
    return f"{value:.1f}" if value < 999.95 else f"{value:.0f}"


@dataclass(frozen=True)
class Column:
    """A column: the heading that it shares with its neighbours, its own, value and formats.

    A `value` of None is printed as "-".
    """

    group: str
    head: str
    value: Callable[[Mapping], float | int | str | None]
    text: Callable
    csv_name: str


def milliseconds(stage: str) -> Column:
    """The wall time of one stage of `seconds`."""
    return Column(
        "milliseconds",
        stage,
        lambda method: 1e3 * method["seconds"][stage],
        _decimal,
        f"{stage}_ms",
    )


def _percent(kind: str, head: str) -> Column:
    return Column(
        "false, % of pixels",
        head,
        lambda method: 100 * method["error"][f"{kind}_fraction"],
        significant,
        f"{kind}_percent",
    )


def _edge(which: str) -> Column:
    return Column(
        "edge off, px",
        which,
        lambda method: method["error"]["boundary_displacement_px"][which],
        lambda value: f"{value:.2f}",
        f"boundary_displacement_{which}_px",
    )


METHOD_COLUMNS: tuple[Column, ...] = (
    Column("", "method", lambda method: method["name"], str, "method"),
    Column(
        "eff. texels",
        "per side",
        lambda method: method["effective_resolution"],
        texels_a_side,
        "effective_resolution",
    ),
    Column("", "MB", lambda method: method["bytes"] / MB, _decimal, "megabytes"),
    Column("", "rays", lambda method: method["rays"], short_count, "rays"),
    *(milliseconds(stage) for stage in ("build", "analysis", "query", "total")),
    _percent("misclassified", "all"),
    _percent("false_lit", "lit"),
    _percent("false_dark", "dark"),
    _edge("mean"),
    _edge("p95"),
)


def _soft(key: str, head: str, factor: float = 100, group: str = "off, % of the light") -> Column:
    """An error of penumbrae; "-" where truth has none."""

    def value(method: Mapping) -> float | None:
        soft = method["error"].get("soft")
        return None if soft is None else factor * soft[key]

    unit = "px" if factor == 1 else "percent"
    return Column(group, head, value, _signed, f"soft_{key.removesuffix('_px')}_{unit}")


def _signed(value: float) -> str:
    return f"-{significant(-value)}" if value < 0 else significant(value)


SOFT_COLUMNS: tuple[Column, ...] = (
    METHOD_COLUMNS[0],
    _soft("mae", "mean"),
    _soft("rmse", "rms"),
    _soft("max", "max"),
    _soft("leak_fraction", "leaks", group="% of pixels"),
    _soft("acne_fraction", "acne", group="% of pixels"),
    _soft("penumbra_width_px", "width off", 1, "penumbra, px"),
)
"""Of methods that are judged by a soft truth."""


def has_penumbrae(methods: Sequence[Mapping]) -> bool:
    """Whether truth is soft."""
    return any("soft" in method["error"] for method in methods)


def comparison_table(methods: Sequence[Mapping]) -> str:
    """The `methods` of a report as text, at most `MAX_WIDTH` columns wide, without a last newline.

    Effective texels per side are those of a flat map as fine as the method's finest part; false
    pixels are all misclassified ones, the falsely lit and the falsely dark; `edge off` is the
    displacement of shadow boundaries in eye pixels. Where truth is soft a second table follows, of
    the errors of penumbrae.
    """
    table = table_text(METHOD_COLUMNS, methods)
    return f"{table}\n\n{table_text(SOFT_COLUMNS, methods)}" if has_penumbrae(methods) else table


def table_text(columns: Sequence[Column], items: Sequence[Mapping]) -> str:
    """A row for each item, at most `MAX_WIDTH` columns wide, without a last newline."""
    rows = [
        ["-" if (v := column.value(item)) is None else column.text(v) for column in columns]
        for item in items
    ]
    heads = [column.head for column in columns]
    widths = [max(len(line[i]) for line in [heads, *rows]) for i in range(len(columns))]
    # A group's heading may be wider than its columns; the first of them then takes the rest.
    spans = [(name, list(span)) for name, span in _spans(columns)]
    for name, span in spans:
        missing = len(name) - (sum(widths[i] for i in span) + 2 * (len(span) - 1))
        widths[span[0]] += max(missing, 0)
    room = MAX_WIDTH - sum(widths[1:]) - 2 * (len(widths) - 1)
    widths[0] = max(min(widths[0], room), len(heads[0]))
    for row in rows:
        if len(row[0]) > widths[0]:
            row[0] = row[0][: widths[0] - 1] + "~"
    lines = [_aligned(line, widths) for line in [heads, *rows]]
    groups = "  ".join(
        _heading(name, sum(widths[i] for i in span) + 2 * (len(span) - 1)) for name, span in spans
    )
    rule = "-" * max(map(len, lines))
    return "\n".join([groups.rstrip(), lines[0], rule, *lines[1:]])


def _spans(columns: Sequence[Column]) -> list[tuple[str, range]]:
    """Runs of columns that share a heading; a column without one stands alone."""
    spans: list[tuple[str, range]] = []
    for i, column in enumerate(columns):
        if spans and column.group and spans[-1][0] == column.group:
            spans[-1] = (column.group, range(spans[-1][1].start, i + 1))
        else:
            spans.append((column.group, range(i, i + 1)))
    return spans


def _heading(name: str, width: int) -> str:
    """A group's name over its columns, with a rule on both sides where there is room."""
    if not name or width < len(name) + 4:
        return name.rjust(width)
    return f" {name} ".center(width, "-")


def _aligned(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.ljust(width) if i == 0 else cell.rjust(width)
        for i, (cell, width) in enumerate(zip(cells, widths, strict=True))
    )
    return "  ".join([first, *others]).rstrip()


def csv_text(methods: Sequence[Mapping], columns: Sequence[Column] = METHOD_COLUMNS) -> str:
    """The same numbers unrounded, comma separated, with the units in the header's names."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(column.csv_name for column in columns)
    for method in methods:
        writer.writerow(column.value(method) for column in columns)
    return buffer.getvalue()


def write_csv(
    path: str | os.PathLike, methods: Sequence[Mapping], columns: Sequence[Column] = METHOD_COLUMNS
) -> None:
    """Write `csv_text` to `path`, whole or not at all. Raises `WriteError` where it cannot."""
    write_file(path, text_writer(lambda: csv_text(methods, columns)))
