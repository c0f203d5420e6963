"""A comparison as text and as CSV: what is on the front, and what a given error costs."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from asmjax.experiment.comparison import (
    Compared,
    EqualError,
    by_family,
    equal_errors,
    front_of,
    telling_errors,
)
from asmjax.report.compare_record import measured_record
from asmjax.report.compare_result import ComparisonResult
from asmjax.report.table import MB, Column, csv_text, significant, table_text

_SCALE = {"seconds": (1e3, "milliseconds", "ms"), "bytes": (1 / MB, "MB", "MB")}
"""What tables show of a cost: its scale, its unit, and the unit's sign."""


def comparison_text(result: ComparisonResult) -> str:
    """Three tables for each number of samples, without a last newline."""
    parts = []
    for samples in result.samples:
        items = result.of(samples)
        front = front_of(items, "seconds")
        rays = [item for item in result.yardsticks if item.trial.samples == samples]
        parts.append(f"{_per_pixel(samples)}: the fastest for their error, and the yardstick, rays")
        parts.append(table_text(_COLUMNS, [{"item": item} for item in (*front, *rays)]))
        wanted = telling_errors(items)
        if wanted:
            for kind, (_, unit, _) in _SCALE.items():
                parts.append(
                    f"{_per_pixel(samples)}: {unit} for an error of so many wrong pixels per pixel "
                    "of edge"
                )
                parts.append(table_text(*_equal_error_table(items, kind, wanted)))
    return "\n\n".join(parts)


def _per_pixel(samples: int) -> str:
    return f"{samples} sample{'s' if samples > 1 else ''} per pixel"


def _equal_error_table(
    items: Sequence[Compared], kind: str, wanted: Sequence[float]
) -> tuple[list[Column], list[Mapping]]:
    found = equal_errors(items, kind, wanted)
    rows: list[Mapping] = [
        {"family": family, **{item.error_px: item for item in found if item.family == family}}
        for family in by_family(items)
    ]
    columns = [Column("", "family", lambda row: row["family"], str, "family")]
    for error in wanted:
        columns.append(Column(f"{error:g} px", _SCALE[kind][2], _value(error, kind), str, "value"))
        columns.append(Column(f"{error:g} px", "x least", _ratio(error), str, "ratio"))
    return columns, rows


def _value(error: float, kind: str) -> Callable[[Mapping], str | None]:
    def text(row: Mapping) -> str | None:
        reach = row[error].reach
        if reach is None:
            return None
        return ("<" if reach.bound else "") + significant(reach.cost * _SCALE[kind][0])

    return text


def _ratio(error: float) -> Callable[[Mapping], str | None]:
    def text(row: Mapping) -> str | None:
        found: EqualError = row[error]
        return None if found.ratio is None else f"{found.ratio:.2g}"

    return text


def _of(group: str, head: str, value: Callable[[Compared], Any], text: Callable = significant):
    return Column(group, head, lambda row: value(row["item"]), text, head)


def _range(item: Compared) -> str:
    time = item.seconds.scaled(1e3)
    return f"{significant(time.low)}-{significant(time.high)}"


_COLUMNS: tuple[Column, ...] = (
    _of("", "method", lambda item: item.name, str),
    _of("edge off, px", "wrong/edge", lambda item: item.trial.edge_px),
    _of("edge off, px", "p95", lambda item: item.trial.p95_px),
    _of("edge off, px", "predicted", lambda item: item.trial.predicted_px),
    _of("wrong", "%", lambda item: 100 * item.trial.wrong),
    _of("milliseconds", "median", lambda item: 1e3 * item.cost("seconds")),
    _of("milliseconds", "interval", _range, str),
    _of("", "x rays", lambda item: item.trial.ratio.value),
    _of("", "MB", lambda item: item.trial.bytes / MB),
)


def trials_csv(result: ComparisonResult) -> str:
    """A row for each setting, number of samples and view, and where there are several views one
    for all of them, unrounded."""
    rows = []
    for item in [*result.trials, *result.yardsticks]:
        trials = item.views if len(item.views) == 1 else [item.trial, *item.views]
        rows += [
            {
                "label": item.label,
                "trial": trial,
                "ranked": 1e3 * trial.ratio.value * item.yardstick,
                **measured_record(trial),
            }
            for trial in trials
        ]
    return csv_text(rows, _csv_columns())


def _csv_columns() -> list[Column]:
    def column(name: str, value: Callable) -> Column:
        return Column("", name, value, str, name)

    def moved(which: str) -> Callable:
        return lambda row: row["error"]["boundary_displacement_px"][which]

    def interval(key: str, end: str, scale: float = 1.0) -> Callable:
        return lambda row: scale * (row["seconds"][key] if key in STAGES else row[key])[end]

    return [
        column("family", lambda row: row["trial"].family),
        column("label", lambda row: row["label"]),
        column("view", lambda row: row["trial"].view),
        column("samples", lambda row: row["trial"].samples),
        column("per_edge_length_px", moved("per_edge_length")),
        column("boundary_displacement_mean_px", moved("mean")),
        column("boundary_displacement_p95_px", moved("p95")),
        column("predicted_displacement_px", lambda row: row["predicted_displacement_px"]),
        *(
            column(f"{kind}_percent", lambda row, kind=kind: 100 * row["error"][f"{kind}_fraction"])
            for kind in ("misclassified", "false_lit", "false_dark")
        ),
        *(
            column(f"{stage}_ms{tail}", interval(stage, end, 1e3))
            for stage in STAGES
            for end, tail in (("median", ""), ("low", "_low"), ("high", "_high"))
        ),
        *(
            column(f"ratio_to_rays{tail}", interval("ratio", end))
            for end, tail in (("median", ""), ("low", "_low"), ("high", "_high"))
        ),
        column("ranked_ms", lambda row: row["ranked"]),
        column("runs", interval("total", "runs")),
        *(
            column(name, lambda row, name=name: row[name])
            for name in ("bytes", "texels", "rays", "nodes", "status")
        ),
    ]


STAGES = ("build", "analysis", "query", "total")
"""Times of a trial."""
