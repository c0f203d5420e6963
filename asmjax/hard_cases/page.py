"""The page docs/stability.md: every hard case measured, with its figures.

`python -m asmjax.hard_cases.page docs/stability.md` measures all of them (some minutes), writes
the tables between the page's two markers, and the figures into `images/` beside the page.
"""

import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from asmjax.hard_cases import CASES
from asmjax.hard_cases.case import ROWS, THEMES, HardCase, Theme
from asmjax.hard_cases.figure import draw_theme
from asmjax.hard_cases.measure import (
    PRECISIONS,
    SIDE,
    Measured,
    Precision,
    families_of,
    measure,
)
from asmjax.hard_cases.numbers import error_text, severity_text, share_text
from asmjax.report.figures.board import save
from asmjax.shadow.pages import between_markers

BEGIN = "<!-- begin: written by `python -m asmjax.hard_cases.page docs/stability.md` -->"
END = "<!-- end -->"


def of_theme(theme: Theme) -> list[HardCase]:
    """The cases of a theme, in the catalogue's order."""
    return [case for case in CASES.values() if case.theme == theme]


def text_of(records: Sequence[Measured]) -> str:
    """All that is written between the markers."""
    parts = [_limits(records), _overview(records)]
    for theme, title in THEMES.items():
        parts.append(f"## {title}\n\n![{title}: error against severity](images/{_image(theme)})\n")
        if of_theme(theme)[0].is_scene:
            parts.append(_scenes(theme, records))
        parts.append(_words(theme))
    return "\n".join(parts)


def written_into(page: str, records: Sequence[Measured]) -> str:
    """`page` with the tables between its markers.

    Raises:
        UseError: the page has not one line of each marker, in their order.
    """
    return between_markers(page, BEGIN, END, text_of(records))


def severities_text(case: HardCase) -> str:
    """The severities of a case, as its row lists them."""
    return ", ".join(severity_text(severity) for severity in case.severities)


def _limits(records: Sequence[Measured]) -> str:
    """What is not stable, a sentence for each case."""
    lines = ["## What is not stable\n"]
    for case in CASES.values():
        mine = [record for record in records if record.case == case.name]
        failed = [record for record in mine if record.verdict != "stable"]
        if not failed:
            continue
        least = min(failed, key=lambda record: case.severities.index(record.severity))
        asked = families_of(case)
        families = [f for f in asked if any(record.algorithm == f for record in failed)]
        who = ""
        if families and len(families) < len(asked):
            who = f" ({', '.join(families)})"
        kinds = {record.precision for record in failed}
        only = f" in {kinds.pop()}" if len(kinds) == 1 else ""
        silent = " **Silent.**" if any(record.verdict == "silent" for record in failed) else ""
        lines.append(
            f"* **{case.name}**{who}: from {severity_text(least.severity)} on{only} ({case.axis}). "
            f"{_sentence(case.announced)}{silent}"
        )
    return "\n".join([*lines, ""])


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _overview(records: Sequence[Measured]) -> str:
    lines = [
        "## All cases\n",
        "Errors are the largest over the severities at which the case is stable, and over all "
        "algorithms; the units are those of the figures.\n",
        "| rows | case | severities | float32 | float64 | gradient | verdict |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for case in sorted(CASES.values(), key=lambda case: case.rows):
        mine = [record for record in records if record.case == case.name]
        numbers = ", ".join(str(row) for row in case.rows)
        write = share_text if case.is_scene else error_text
        cells = [
            numbers,
            case.name,
            f"{severities_text(case)} ({case.axis})",
            *(write(_largest_stable(mine, p)) for p in ("float32", "float64")),
            error_text(_gradient(mine)),
            _verdict(case, mine),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines.append("")
    names = "; ".join(f"{number} {name}" for number, name in ROWS.items())
    lines.append(f"Rows: {names}.\n")
    return "\n".join(lines)


def _largest_stable(records: Iterable[Measured], precision: Precision) -> float:
    return max(
        (r.error for r in records if r.precision == precision and r.verdict == "stable"),
        default=math.nan,
    )


def _gradient(records: Iterable[Measured]) -> float | None:
    found = [
        record.gradient_error
        for record in records
        if record.gradient_error is not None and record.verdict == "stable"
    ]
    return max(found) if found else None


def _verdict(case: HardCase, records: Iterable[Measured]) -> str:
    failed = [record for record in records if record.verdict != "stable"]
    if not failed:
        return "stable"
    first = min(failed, key=lambda record: case.severities.index(record.severity)).severity
    if any(record.verdict == "silent" for record in failed):
        return f"**fails silently** from {severity_text(first)}"
    return f"stable, then announced from {severity_text(first)}"


def _scenes(theme: Theme, records: Sequence[Measured]) -> str:
    cases = of_theme(theme)
    families = families_of(cases[0])
    what = "Share of pixels wrong beyond a texel of an edge"
    brackets = "wrong in all, edges of texels included"
    if cases[0].is_soft:
        what, brackets = "Mean error, of the light", "pixels that are off by half of it or more"
    lines = [
        f"{what}, in float32 / in float64, the largest over the severities at which the algorithm "
        f"is stable; in brackets: {brackets}, the worst of both. \\*N from severity N on not "
        f"stable any more, and announced. {SIDE} x {SIDE} pixels.\n",
        f"| case | {' | '.join(families)} |",
        f"| --- | {' | '.join(['---'] * len(families))} |",
    ]
    for case in cases:
        mine = [record for record in records if record.case == case.name]
        cells = [_cell([r for r in mine if r.algorithm == family]) for family in families]
        lines.append(f"| {case.name} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def _cell(records: Sequence[Measured]) -> str:
    """One algorithm's errors on one scene."""
    kept = [record for record in records if record.verdict == "stable"]
    errors = " / ".join(share_text(_largest_stable(records, p)) for p in PRECISIONS)
    text = f"{errors} ({share_text(max(r.wrong or 0.0 for r in kept))})" if kept else "-"
    failed = [record for record in records if record.verdict != "stable"]
    if failed:
        text += f" \\*{severity_text(min(record.severity for record in failed))}"
    if any(record.verdict == "silent" for record in failed):
        text += " **silent**"
    return text


def _words(theme: Theme) -> str:
    lines = ["| case | what breaks | what is done instead | truth |", "| --- | --- | --- | --- |"]
    for case in of_theme(theme):
        lines.append(f"| {case.name} | {case.breaks} | {case.source} | {case.truth} |")
    return "\n".join([*lines, ""])


def _image(theme: Theme) -> str:
    return f"stability_{theme}.png"


def write(path: Path) -> list[Measured]:
    """Measure everything, write the page's part and its figures; returns the records."""
    records = [record for case in CASES.values() for record in measure(case)]
    page = path.read_text(encoding="utf-8")
    path.write_text(written_into(page, records), encoding="utf-8")
    for theme in THEMES:
        save(draw_theme(of_theme(theme), records), path.parent / "images" / _image(theme))
    return records


if __name__ == "__main__":
    for name in sys.argv[1:]:
        write(Path(name))
