"""The tables of a sweep: how its trials ended, which are best, and which failed and why."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence

from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.tables import table
from asmjax.report.page.words import plural
from asmjax.report.table import MB, Column, significant
from asmjax.sweep.ended import End
from asmjax.sweep.page.cases import Case
from asmjax.sweep.page.measured import Swept
from asmjax.sweep.page.varied import SEEN, SweptAxis
from asmjax.sweep.results import flat
from asmjax.sweep.store import BASE

_MOST_ROWS = 100
"""Of a table."""

_MOST_LETTERS = 500
"""Of a cause."""

ENDS: Mapping[str, str] = {
    End.DONE: "done",
    End.FAILED: "failed",
    End.CRASHED: "crashed",
    End.TIMEOUT: "timed out",
    End.MEMORY: "ran out of memory",
}
"""How trials end, in words."""


def end_words(status: str) -> str:
    """How a trial ended; as it stands there where that is not known."""
    return ENDS.get(status, status)


def ends_table(swept: Swept, known: Collection[str]) -> Markup:
    """How many trials ended in which way, in the last run and before."""
    before = Counter(row.status for row in swept.rows if row.key in known)
    ends = Counter(row.status for row in swept.rows)
    rows = [
        {"end": end_words(status), "run": count - before[status], "before": before[status]}
        for status, count in ends.most_common()
    ]
    if swept.left:
        rows.append({"end": "still to be run", "run": None, "before": None, "all": swept.left})
    columns = [
        Column("", "trials", lambda row: row["end"], str, "end"),
        Column("", "in the last run", lambda row: row["run"], str, "run"),
        Column("", "before (cached)", lambda row: row["before"], str, "before"),
        Column(
            "", "together", lambda row: row.get("all") or row["run"] + row["before"], str, "all"
        ),
    ]
    return table(columns, rows, "How the trials ended")


def best_table(cases: Sequence[Case], axes: Sequence[SweptAxis]) -> Markup | None:
    """The trials on the front of each case."""
    rows = [
        {"trial": trial, "case": case.words, "number": number}
        for case in cases
        for number, trial in enumerate(case.best, start=1)
    ]
    if not rows:
        return None
    # Where it was measured and by which family stands there already.
    own = [axis for axis in axes if not axis.says((*SEEN, "algorithm"))]
    columns = [
        Column("", "no.", lambda row: row["number"], str, "number"),
        Column("", "method", lambda row: row["trial"].name, str, "name"),
        Column("edge off, px", "wrong/edge", lambda row: row["trial"].error, significant, "error"),
        Column("wrong", "%", lambda row: 100 * row["trial"].wrong, significant, "wrong"),
        Column("milliseconds", "median", lambda r: 1e3 * r["trial"].seconds, significant, "ms"),
        Column("", "x rays", lambda row: row["trial"].ratio, significant, "ratio"),
        Column("", "MB", lambda row: row["trial"].bytes / MB, significant, "bytes"),
        Column("", "trial", lambda row: row["trial"].row.key[:8], str, "key"),
        Column("", "with", lambda row: _settings(own, row["trial"].settings), str, "settings"),
    ]
    if len(cases) > 1:
        columns.insert(1, Column("", "on", lambda row: row["case"], str, "case"))
    caption = "Best trials: none is faster and errs as little"
    if len(cases) > 1:
        caption += ", of those with the same scene, view, light, size and samples"
    return _cut(columns, rows, caption, wordy=1)


def failures_table(swept: Swept, axes: Sequence[SweptAxis]) -> Markup | None:
    """The trials that did not end well, with their causes; None where all did."""
    if not swept.bad:
        return None
    rows = [{"row": row, "settings": dict(flat(row.config))} for row in swept.bad]
    columns = [
        Column("", "trial", lambda row: row["row"].key[:8], str, "key"),
        Column("", "ended", lambda row: end_words(row["row"].status), str, "status"),
        Column("", "attempts", lambda row: row["row"].attempts, str, "attempts"),
        Column("", "s", lambda row: row["row"].seconds, significant, "seconds"),
        Column("", "with", lambda row: _settings(axes, row["settings"]), str, "settings"),
        Column("", "cause", lambda row: _shortened(row["row"].error), str, "error"),
    ]
    note = f"Tracebacks, and what a process said last, are in {BASE}, column details."
    whole = _cut(columns, rows, "Trials that did not end well", wordy=2)
    return joined([whole, tag("p", note, class_="note")])


def _settings(axes: Sequence[SweptAxis], settings: dict) -> str:
    """What of the axes a trial has."""
    said = ((axis.title, axis.words(settings)) for axis in axes)
    return "; ".join(f"{title}: {words}" for title, words in said if words is not None)


def _shortened(cause: str) -> str:
    return cause if len(cause) <= _MOST_LETTERS else f"{cause[: _MOST_LETTERS - 3]}..."


def _cut(columns: Sequence[Column], rows: Sequence[dict], caption: str, wordy: int) -> Markup:
    """A table of the first rows; its caption says how many there are."""
    if len(rows) > _MOST_ROWS:
        caption += f" (the first {_MOST_ROWS} of {plural(len(rows), 'row')})"
    return table(columns, rows[:_MOST_ROWS], caption, wordy)
