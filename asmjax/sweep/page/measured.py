"""The trials of a sweep as its page shows them: of those that are done the numbers, checked."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asmjax.errors import UseError
from asmjax.report.page.compare import edge_error
from asmjax.report.page.folder import LARGEST
from asmjax.sweep.ended import End
from asmjax.sweep.results import flat
from asmjax.sweep.store import Row, stored_rows

_YARDSTICK = "yardstick"


@dataclass(frozen=True)
class Measured:
    """A trial that is done.

    Attributes:
        row: as it is stored.
        settings: what it was asked for, by names with dots.
        name, family: of the algorithm.
        error: wrong pixels per pixel of shadow edge.
        wrong: part of the valid pixels.
        seconds: from nothing, the median of the runs; `low` and `high` are the fastest and the
            slowest of them.
        ratio: times the yardstick's time; None where there is none.
        bytes: of all arrays.
    """

    row: Row
    settings: Mapping[str, Any]
    name: str
    family: str
    error: float
    wrong: float
    seconds: float
    low: float
    high: float
    ratio: float | None
    bytes: float


@dataclass(frozen=True)
class Swept:
    """What a folder holds of a sweep.

    Attributes:
        report: of the last run.
        rows: of trials that the sweep file asks for.
        done: of these, those that ended well.
        others: trials of the folder that the file does not ask for.
    """

    folder: Path
    report: Mapping[str, Any]
    rows: tuple[Row, ...]
    done: tuple[Measured, ...]
    others: int

    @property
    def left(self) -> int:
        """Trials that did not end yet, in whichever way."""
        return self.report["trials"] - len(self.rows)

    @property
    def bad(self) -> list[Row]:
        """Trials that did not end well."""
        return [row for row in self.rows if row.status != End.DONE]


def swept_in(folder: Path, report: Mapping[str, Any]) -> Swept:
    """The trials of the sweep that `report` is of; also while it is running.

    Raises:
        UseError: there are none, they cannot be read, or a record is none of a trial.
    """
    place = {key: k for k, key in enumerate(report["keys"])}
    rows = stored_rows(folder)
    own = sorted((row for row in rows if row.key in place), key=lambda row: place[row.key])
    done = tuple(_measured(folder, row) for row in own if row.status == End.DONE)
    return Swept(folder, report, tuple(own), done, len(rows) - len(own))


def _measured(folder: Path, row: Row) -> Measured:
    record = row.record
    try:
        ratio = record["yardstick_ratio"]
        runs = record["runs_seconds"]
        totals = _totals(values for stage, values in runs.items() if stage != _YARDSTICK)
        return Measured(
            row=row,
            settings=dict(flat(row.config)),
            name=_text(record["name"]),
            family=_text(record["family"]),
            error=_amount(edge_error(record)),
            wrong=_amount(record["error"]["misclassified_fraction"]),
            seconds=_amount(record["seconds"]["total"]),
            low=min(totals),
            high=max(totals),
            ratio=None if ratio is None else _amount(ratio),
            bytes=_amount(record["bytes"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise UseError(
            f"trial {row.key} in '{folder}' has a record that this version does not know "
            f"({type(problem).__name__}: {str(problem)[:80]}); sweep anew with another --out."
        ) from problem


def _totals(stages: Iterable[Any]) -> list[float]:
    """Seconds of each run, all stages together."""
    return [sum(map(_amount, run)) for run in zip(*stages, strict=True)]


def _amount(value: Any) -> float:
    if type(value) in (int, float) and 0 <= value <= LARGEST:
        return value
    raise ValueError(f"{value!r:.20} is no amount")


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    raise ValueError(f"{value!r:.20} is no text")
