"""An analysis as a table: what each map does to the view, at equal memory."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from asmjax.report.table import (
    METHOD_COLUMNS,
    Column,
    csv_text,
    milliseconds,
    significant,
    table_text,
)

_PLAIN = {column.head: column for column in METHOD_COLUMNS}


def _of(group: str, head: str, part: str, key: str, unit: str, scale: float = 1.0) -> Column:
    """A number of `aliasing` or `displacement`, "-" for rays."""

    def value(method: Mapping) -> float | None:
        return scale * method[part][key] if part in method else None

    text: Callable[[float], str] = significant
    return Column(group, head, value, text, f"{key}{unit}")


ANALYSIS_COLUMNS = (
    _PLAIN["method"],
    _of("m: texel / pixel", "max", "aliasing", "max_m", ""),
    _of("m: texel / pixel", "p95", "aliasing", "p95_m", ""),
    _of("m: texel / pixel", "> 1, %", "aliasing", "above_1", "_percent", 100),
    _of("perspective", "max", "aliasing", "max_perspective", ""),
    _of("texels", "wasted, %", "aliasing", "wasted", "_percent", 100),
    Column(
        "pixels",
        "wrong, %",
        lambda method: 100 * method["error"]["misclassified_fraction"],
        significant,
        "misclassified_percent",
    ),
    _of("edge off, px", "predicted", "displacement", "predicted", "_displacement_px"),
    _of("edge off, px", "measured", "displacement", "measured", "_displacement_px"),
    _PLAIN["MB"],
    replace(milliseconds("total"), group="", head="ms"),
)

_FURTHER = (
    _of("", "", "aliasing", "receivers", ""),
    _of("", "", "aliasing", "median_m", ""),
    _of("", "", "aliasing", "p95_perspective", ""),
    _of("", "", "aliasing", "below_1", "_percent", 100),
    _of("", "", "displacement", "length", "_of_edges_px"),
    *(milliseconds(stage) for stage in ("build", "analysis", "query")),
    *(_PLAIN[head] for head in ("per side", "rays")),
)


def analysis_table(methods: Sequence[Mapping]) -> str:
    """The `methods` of an analysis as text, without a last newline.

    Milliseconds are build, analysis and query together; edges are off by wrong pixels per pixel of
    truth's edge, predicted from the texels' sizes and measured.
    """
    return table_text(ANALYSIS_COLUMNS, methods)


def analysis_csv(methods: Sequence[Mapping]) -> str:
    """The unrounded numbers."""
    return csv_text(methods, (*ANALYSIS_COLUMNS, *_FURTHER))
