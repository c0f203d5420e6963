"""The section of `asmjax compare`: error against time and memory, for all families."""

from collections.abc import Mapping, Sequence
from typing import Any

from asmjax.report.figures.families import FAMILY_LOOKS
from asmjax.report.page.chart import Chart, Mark, Point, charts
from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.provenance import provenance_block
from asmjax.report.page.tables import table
from asmjax.report.page.words import EDGE, listed, megabytes, milliseconds, plural
from asmjax.report.table import MB, Column, significant

_COSTS = {"seconds": "time", "bytes": "memory"}


def compare_part(results: Results) -> Part:
    """The section of a comparison."""
    report = results.report
    counts = sorted({trial["samples"] for trial in report["trials"]})
    drawn = [_chart(report, samples, kind) for samples in counts for kind in _COSTS]
    body = joined(
        [
            tag("h3", "What accuracy costs"),
            charts(drawn),
            *(_tables(report, samples) for samples in counts),
            provenance_block(results),
        ]
    )
    title = f"Comparison: {report['scene']}, {report['view']}"
    return Part(title, _summary(report, counts), body)


def _summary(report: Mapping, counts: Sequence[int]) -> tuple[str, ...]:
    trials = report["trials"]
    families = len({trial["family"] for trial in trials})
    said = [f"{plural(len(trials), 'trial')} measured, of {families} families of algorithms"]
    if report["ended"] != "complete":
        said[0] += f", {report['trials_asked']} asked: ended by {report['ended']}"
    said[0] += "."
    for samples in counts:
        rays = _yardstick(report, samples)
        exact = ""
        if rays is not None:
            exact = (
                f"; traced rays take {milliseconds(rays['ranked_seconds']['median'])}, whatever "
                "the error"
            )
        best = _most_accurate(report, samples)
        said.append(
            f"{_per_pixel(samples)}, {best['family']} ({best['label']}) errs least: its shadow "
            f"edges lie {significant(edge_error(best))} px off, in "
            f"{milliseconds(_cost(best, 'seconds'))}."
        )
        cheapest = _cheapest(report, samples)
        if cheapest:
            said.append(
                f"{_per_pixel(samples)}, the fastest map for an error of {listed(cheapest)} per "
                f"pixel of shadow edge{exact}."
            )
    return tuple(said)


def _most_accurate(report: Mapping, samples: int) -> Mapping:
    """Of equal errors the fastest."""
    own = [trial for trial in report["trials"] if trial["samples"] == samples]
    return min(own, key=lambda trial: (edge_error(trial), _cost(trial, "seconds")))


def _per_pixel(samples: int) -> str:
    return f"With {plural(samples, 'sample')} a pixel"


def _cheapest(report: Mapping, samples: int) -> list[str]:
    """The fastest family for each error: "0.1 px is adaptive (55 ms)"."""
    rows = [row for row in report["equal_error"] if row["samples"] == samples]
    told = []
    for error in sorted({row["error_px"] for row in rows}, reverse=True):
        reached = [
            row for row in rows if row["error_px"] == error and row["seconds"]["value"] is not None
        ]
        if reached:
            best = min(reached, key=lambda row: row["seconds"]["value"])
            told.append(f"{error:g} px is {best['family']} ({_reach(best['seconds'], 'seconds')})")
    return told


def _reach(reach: Mapping, kind: str) -> str:
    words = milliseconds if kind == "seconds" else megabytes
    return ("below " if reach["bound"] else "") + words(reach["value"])


def _yardstick(report: Mapping, samples: int) -> Mapping | None:
    return next((one for one in report["yardsticks"] if one["samples"] == samples), None)


def _chart(report: Mapping, samples: int, kind: str) -> Chart:
    trials = [trial for trial in report["trials"] if trial["samples"] == samples]
    front = _front(trials, kind)
    points = [_point(trial, kind, front) for trial in trials if _cost(trial, kind) > 0]
    families = dict.fromkeys(point.group for point in points)
    marks = []
    if kind == "seconds":
        marks = [
            Mark(f"{plural(one['samples'], 'ray')} per pixel", 1e3 * _cost(one, kind))
            for one in report["yardsticks"]
        ]
    return Chart(
        title=f"{_COSTS[kind]}, {plural(samples, 'sample')} a pixel",
        x_axis="time from nothing, milliseconds" if kind == "seconds" else "memory, MB",
        y_axis=EDGE,
        points=points,
        looks={family: FAMILY_LOOKS.get(family, ("#000000", "h")) for family in families},
        marks=marks,
        note="Grey staircase: nothing that was measured is cheaper and as accurate; its points are "
        "numbered as in the table below. Open markers on the line of 0: no wrong pixel. Bars: "
        "interval of the median time.",
    )


def _front(trials: Sequence[Mapping], kind: str) -> list[tuple[str, str]]:
    """Family and label of what is on the front, from the cheapest on."""
    own = [trial for trial in trials if trial["on_front"][kind]]
    return [_key(trial) for trial in sorted(own, key=lambda trial: _cost(trial, kind))]


def _key(trial: Mapping) -> tuple[str, str]:
    return trial["family"], trial["label"]


def _cost(trial: Mapping, kind: str) -> float:
    return trial["ranked_seconds"]["median"] if kind == "seconds" else trial["bytes"]


def edge_error(trial: Mapping) -> float:
    """Wrong pixels per pixel of edge; where a view has no edge, which jobs refuse, the mean."""
    moved = trial["error"]["boundary_displacement_px"]
    return moved.get("per_edge_length", moved["mean"])


def _point(trial: Mapping, kind: str, front: Sequence[tuple[str, str]]) -> Point:
    scale = 1e3 if kind == "seconds" else 1 / MB
    ends = (_cost(trial, kind),) * 2
    if kind == "seconds":
        ends = trial["ranked_seconds"]["low"], trial["ranked_seconds"]["high"]
    key = _key(trial)
    return Point(
        group=trial["family"],
        name=f"{trial['family']}, {trial['label']}",
        x=scale * _cost(trial, kind),
        y=edge_error(trial),
        low=scale * ends[0],
        high=scale * ends[1],
        facts=(
            f"{significant(edge_error(trial))} {EDGE}",
            f"{milliseconds(_cost(trial, 'seconds'))}, {significant(trial['ratio']['median'])} "
            "times the rays",
            megabytes(trial["bytes"]),
        ),
        number=front.index(key) + 1 if key in front else None,
    )


def _of(group: str, head: str, value: Any, text: Any = significant) -> Column:
    return Column(group, head, value, text, head)


_FRONT_COLUMNS = (
    _of("", "no.", lambda row: row["number"], str),
    _of("", "method", lambda row: row["family"], str),
    _of("", "settings", lambda row: row["label"], str),
    _of("edge off, px", "wrong/edge", edge_error),
    _of("edge off, px", "predicted", lambda row: row["predicted_displacement_px"]),
    _of("wrong", "%", lambda row: 100 * row["error"]["misclassified_fraction"]),
    _of("milliseconds", "median", lambda row: 1e3 * row["ranked_seconds"]["median"]),
    _of("milliseconds", "low", lambda row: 1e3 * row["ranked_seconds"]["low"]),
    _of("milliseconds", "high", lambda row: 1e3 * row["ranked_seconds"]["high"]),
    _of("", "x rays", lambda row: row["ratio"]["median"]),
    _of("", "MB", lambda row: row["bytes"] / MB),
)


def _tables(report: Mapping, samples: int) -> Markup:
    trials = [trial for trial in report["trials"] if trial["samples"] == samples]
    parts = []
    for kind, words in _COSTS.items():
        named = {_key(trial): trial for trial in trials}
        rows = [
            {**named[key], "number": number}
            for number, key in enumerate(_front(trials, kind), start=1)
        ]
        if rows:
            caption = f"The front of {words}, {plural(samples, 'sample')} a pixel"
            parts.append(table(_FRONT_COLUMNS, rows, caption))
        parts.append(_equal_errors(report, samples, kind))
    return joined(parts)


def _equal_errors(report: Mapping, samples: int, kind: str) -> Markup | None:
    """What each family needs for the same error; none where nothing reaches a round error."""
    own = [row for row in report["equal_error"] if row["samples"] == samples]
    if not own:
        return None
    errors = sorted({row["error_px"] for row in own}, reverse=True)
    rows: list[dict] = []
    for family in dict.fromkeys(row["family"] for row in own):
        of_family = {row["error_px"]: row[kind] for row in own if row["family"] == family}
        rows.append({"family": family, **of_family})

    def column(error: float) -> Column:
        def value(row: Mapping) -> str | None:
            reach = row.get(error)
            return None if reach is None or reach["value"] is None else _reach(reach, kind)

        return Column("", f"{error:g} px", value, str, "value")

    columns = [Column("", "family", lambda row: row["family"], str, "family")]
    caption = (
        f"{_COSTS[kind].capitalize()} for an error of so many wrong pixels per pixel of edge, "
        f"{plural(samples, 'sample')} a pixel"
    )
    return table([*columns, *(column(error) for error in errors)], rows, caption)
