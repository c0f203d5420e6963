"""The section of a sweep: in words, charts over all trials and along each axis, tables, origin."""

from collections import Counter
from collections.abc import Collection, Sequence

from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.words import listed, milliseconds, plural
from asmjax.report.table import significant
from asmjax.sweep.driver import SweepStatus
from asmjax.sweep.page.cases import Case, cases_of
from asmjax.sweep.page.costs import CostCharts
from asmjax.sweep.page.measured import Measured, Swept, swept_in
from asmjax.sweep.page.origin import origin_block
from asmjax.sweep.page.spreads import spread_charts, strongest
from asmjax.sweep.page.tables import best_table, end_words, ends_table, failures_table
from asmjax.sweep.page.varied import SweptAxis, axes_in
from asmjax.sweep.results import flat
from asmjax.sweep.words import in_words

_MOST_CASES = 4
"""That have a sentence each."""

_UNFINISHED = {
    SweepStatus.RUNNING.value: "the last run was ended from outside, or goes on",
    SweepStatus.INTERRUPTED.value: "the last run was interrupted",
    SweepStatus.LOST.value: "the last run lost its scheduler",
    SweepStatus.ALONE.value: "the last run ended without workers",
    SweepStatus.FAILED.value: "the last run failed",
}


def sweep_part(results: Results) -> Part:
    """The section of a sweep, as it stands; also while it is running.

    Raises:
        UseError: its trials cannot be read, or are none that this version knows.
    """
    swept = swept_in(results.folder, results.report)
    known = set(results.report["skipped"])
    axes = axes_in([dict(flat(row.config)) for row in swept.rows])
    cases = cases_of(swept.done, axes)
    body = joined(
        [
            ends_table(swept, known),
            *(_charts(swept.done, cases, axes, known) if swept.done else []),
            best_table(cases, axes),
            failures_table(swept, axes),
            origin_block(results, swept),
        ]
    )
    name = results.report["name"]
    summary = (*_ended(swept, known), *_found(swept.done, cases, axes))
    return Part(f"Sweep: {name}", summary, body, subject=f"sweep {name}")


def _charts(
    done: Sequence[Measured],
    cases: Sequence[Case],
    axes: Sequence[SweptAxis],
    known: Collection[str],
) -> list[Markup | None]:
    drawing = CostCharts(cases, axes, known)
    each = drawing.of_cases()
    return [
        tag("h3", "What accuracy costs: all trials"),
        drawing.of_all(),
        tag("h3", "Case by case") if each else None,
        each,
        tag("h3", "Along each axis"),
        tag(
            "p",
            "For each value all trials that have it, whatever else they have: a dot at their "
            "median, a broad line over the middle half, a thin one over all. The scales are the "
            "same for all axes.",
            class_="note",
        ),
        spread_charts(done, axes),
    ]


def _ended(swept: Swept, known: Collection[str]) -> list[str]:
    """How the trials ended, when, and what is left."""
    report = swept.report
    ends = Counter(end_words(row.status) for row in swept.rows)
    told = [f"{count:,} {end}" for end, count in ends.most_common()]
    told += [f"{swept.left:,} still to be run"] if swept.left else []
    said = [f"{plural(report['trials'], 'trial')}: {listed(told)}."]
    if swept.left:
        why = _UNFINISHED.get(report["status"], f"the last run ended {report['status']}")
        said.append(f"It is not complete: {why}; the same command goes on.")
    before = sum(row.key in known for row in swept.rows)
    ran = len(swept.rows) - before
    time = f" in {in_words(report['seconds'])}" if report["seconds"] else ""
    cached = f"; {before:,} finished before and not run again (cached)" if before else ""
    said.append(f"The last run measured {ran:,}{time}, {_where(report)}{cached}.")
    if swept.others:
        said.append(
            f"The folder has {plural(swept.others, 'more trial')}, which the sweep file does not "
            "ask for any more; they are not shown."
        )
    return said


def _where(report) -> str:
    if report["scheduler"] is not None:
        return f"by workers of the scheduler {report['scheduler']}"
    if report["workers"] == 0:
        return "one after the other in one process"
    return f"by {plural(report['workers'], 'worker')}"


def _found(
    done: Sequence[Measured], cases: Sequence[Case], axes: Sequence[SweptAxis]
) -> list[str]:  # fmt: skip
    """The best of each case, and which axis matters most."""
    if not done:
        return ["No trial is done yet."]
    said = [_best(case, axes) for case in cases[:_MOST_CASES]]
    if len(cases) > _MOST_CASES:
        more = len(cases) - _MOST_CASES
        said.append(f"The best of {plural(more, 'more case')} are in the table.")
    matters = strongest(done, axes)
    return [*said, *([matters] if matters else [])]


def _best(case: Case, axes: Sequence[SweptAxis]) -> str:
    fastest, finest = case.best[0], case.best[-1]
    said = f"{case.prefix}{_trial(finest)} errs least"
    if fastest is finest:
        return f"{said}, and is the fastest too: {_numbers(finest)}."
    return f"{said}: {_numbers(finest)}; {_trial(fastest)} is the fastest: {_numbers(fastest)}."


def _trial(trial: Measured) -> str:
    return f"{trial.name} ({trial.row.key[:8]})"


def _numbers(trial: Measured) -> str:
    off = f"{significant(trial.error)} px off" if trial.error else "no wrong pixel"
    return f"{off} in {milliseconds(trial.seconds)}"
