"""A folder of results, read and checked before anything is made of it."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asmjax.errors import UseError, file_errors, require
from asmjax.report.keys import InvalidReport
from asmjax.report.schema import validate_report

REPORT = "report.json"

LARGEST = 1e100
"""Of a number in a report."""

MOST_BYTES = 256 * 2**20
"""Of a report.json: that of a walkthrough of 10,000 frames has 50 MB."""


@dataclass(frozen=True)
class Results:
    """What a command left in a folder.

    Attributes:
        folder: as it was named.
        report: its report.json, checked against its schema.
        digest: first 16 hex digits of the SHA-256 of that file.
    """

    folder: Path
    report: Mapping[str, Any]
    digest: str

    def file(self, name: str) -> Path | None:
        """A file of the folder; None where there is none, or the name would lead out of it."""
        if not name or Path(name).name != name:
            return None
        path = self.folder / name
        return path if path.is_file() else None


Check = Callable[[object], None]
"""What raises `InvalidReport` unless a report follows its schema."""


def read_results(folder: Path, check: Check = validate_report) -> Results:
    """What a command wrote to `folder`.

    Raises:
        UseError: no such folder, no report in it, or one that is damaged or of something else.
    """
    path = folder / REPORT
    remedy = "name a folder that asmjax run, analyze, compare, tune, plan or sweep wrote"
    require(folder.is_dir(), f"'{folder}' is no folder; {remedy}.")
    require(path.is_file(), f"'{folder}' has no {REPORT}; {remedy}.")
    with file_errors(f"'{path}' cannot be read", remedy):
        require(
            path.stat().st_size <= MOST_BYTES,
            f"'{path}' has more than {MOST_BYTES // 2**20} MB; {remedy}.",
        )
        content = path.read_bytes()
    try:
        report = json.loads(content, parse_constant=_refused, parse_int=_whole, parse_float=_real)
    except (ValueError, RecursionError) as problem:
        raise UseError(
            f"'{path}' is damaged ({str(problem)[:80]}); run the command again that wrote it."
        ) from problem
    try:
        check(report)
    except InvalidReport as problem:
        raise UseError(
            f"'{path}' is no report that this version knows ({str(problem)[:200]}); {remedy}."
        ) from problem
    return Results(folder, report, hashlib.sha256(content).hexdigest()[:16])


def _refused(word: str) -> None:
    raise ValueError(f"{word} is no number of JSON")


def _whole(digits: str) -> int:
    return int(_bounded(digits, int))


def _real(digits: str) -> float:
    return _bounded(digits, float)


def _bounded(digits: str, kind: type[int] | type[float]) -> float:
    """A number with which one can reckon: nothing that is measured is as large as 1e100."""
    value = kind(digits)
    if abs(value) > LARGEST:
        raise ValueError(f"{digits[:20]} is beyond {LARGEST:g}")
    return value
