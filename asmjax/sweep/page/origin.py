"""Where the numbers of a sweep come from: command, machines, versions, what all trials share."""

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup
from asmjax.report.page.provenance import file_row, machine_words, origin, versions_words
from asmjax.sweep.page.measured import Swept
from asmjax.sweep.results import flat
from asmjax.sweep.store import BASE, Row
from asmjax.sweep.words import in_words, value_words

_FEW = 8
"""Machines, or notices, that are listed."""

_NOT_SHOWN = ("content", "trust_scene", "variant")
"""Of what all trials share: said elsewhere, or no setting."""


def origin_block(results: Results, swept: Swept) -> Markup:
    """Command, file, machines and versions, and what was left out or approximated."""
    report, rows = results.report, swept.rows
    records = [trial.row.record for trial in swept.done]
    found = [
        ("command", report["command"]),
        ("sweep file", report["file"]),
        ("scenes", _listed(record.get("scene") for record in records)),
        ("all trials", _shared(rows)),
        ("machine of the command", machine_words(report["machine"])),
        ("machines of the trials", _listed(_machine(row) for row in rows)),
        ("renderer", _listed(record.get("variant") for record in records)),
        ("kernels", _listed(f"JAX on {r['device']}" for r in records if r.get("device"))),
        ("versions", versions_words(report["versions"])),
        ("other versions of trials", _listed(_others(report["versions"], rows))),
        ("code of the trials", _listed(record.get("code") for record in records)),
        ("measured", _when(rows)),
        ("time estimated", in_words(report["estimated_seconds"])),
        file_row(results),
        ("trials", f"{swept.folder / BASE}, a row each"),
    ]
    notices = dict.fromkeys(
        str(notice) for record in records for notice in record.get("notices") or ()
    )
    return origin([(name, words) for name, words in found if words], list(notices)[:_FEW])


def _listed(words: Iterable[Any]) -> str:
    """Each once, the first few."""
    found = list(dict.fromkeys(str(word) for word in words if word))
    more = f" and {len(found) - _FEW} more" if len(found) > _FEW else ""
    return ", ".join(found[:_FEW]) + more


def _shared(rows: Sequence[Row]) -> str:
    """Settings that all trials have, and have the same."""
    settings = [dict(flat(row.config)) for row in rows]
    if not settings:
        return ""
    first, *others = settings
    return ", ".join(
        f"{name} {value_words(value)}"
        for name, value in first.items()
        if name not in _NOT_SHOWN
        and value is not None
        and all(name in other and other[name] == value for other in others)
    )


def _machine(row: Row) -> str:
    told = row.machine
    return f"{told.get('host', 'unknown')} ({told.get('cpu', 'unknown')})"


def _others(versions: dict, rows: Sequence[Row]) -> Iterable[str]:
    """Packages that a trial was measured with in another version."""
    for row in rows:
        for name, version in row.versions.items():
            if versions.get(name) != version:
                yield f"{name} {version}"


def _when(rows: Sequence[Row]) -> str:
    """When the first trial started, and the last one."""
    if not rows:
        return ""
    ends = min(row.started for row in rows), max(row.started for row in rows)
    first, last = (datetime.fromtimestamp(end, UTC) for end in ends)
    return f"{first:%Y-%m-%d %H:%M:%S} to {last:%Y-%m-%d %H:%M:%S} UTC"
