"""Measurements that outlive an interruption: a file with a line for each, read when one goes on.

What is written is a dictionary of plain values under a key of plain values. A key says what a
measurement depends on: another scene, view, setting, code, library or machine has another key.

A line is JSON as Python writes it: numbers that are not finite stand as NaN and Infinity, which an
endless setting is and a measurement may be, and which must not be lost for it.
"""

import hashlib
import json
import logging
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from asmjax.errors import UseError, file_errors, require
from asmjax.writing import why

FORMAT = "asmjax/measurement/1"

_BEGINNING = '{"format": "asmjax/measurement/'
"""Of every line, of whatever version."""

_log = logging.getLogger("asmjax")


class LedgerError(UseError):
    """Measurements cannot be kept: whatever is measured next would be lost as well."""


class Ledger:
    """A growing file of measurements; without a path, they are kept in memory only.

    A line that is torn, as the last one is after a crash, is left out with a warning, and measured
    again. Of two lines with one key the later counts.

    Args:
        path: of the file; made with the first measurement.

    Attributes:
        taken: measurements that were asked for and found.
        added: measurements that were made and kept.

    Raises:
        UseError: the file cannot be read, or holds something else.
    """

    def __init__(self, path: Path | None = None):
        self.path, self.taken, self.added = path, 0, 0
        self._known: dict[str, dict] = {}
        if path is not None and path.exists():
            self._known = dict(_entries(path))

    def __len__(self) -> int:
        return len(self._known)

    def get(self, key: Mapping[str, Any]) -> dict | None:
        """The measurement of that key, if there is one: the same now as after a restart."""
        found = self._known.get(digest(key))
        self.taken += found is not None
        return found

    def add(self, key: Mapping[str, Any], measurement: Mapping[str, Any]) -> None:
        """Keep a measurement, on disk before this returns.

        Raises:
            LedgerError: the file cannot be written; `get` knows the measurement all the same.
        """
        name = digest(key)
        line = {"format": FORMAT, "key": name, "of": dict(key), "measured": dict(measurement)}
        text = json.dumps(line, default=_plain)
        self._known[name] = json.loads(text)["measured"]
        self.added += 1
        if self.path is None:
            return
        try:
            with self.path.open("a+b") as file:
                # After a crash the file may end within a line.
                torn = file.tell() > 0 and _last_byte(file) != b"\n"
                file.write(b"\n" * torn + text.encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as problem:
            reason = why(problem, "choose another `out`")
            raise LedgerError(
                f"cannot write measurements to '{self.path}' {reason} "
                "Those of before are kept, and the same command goes on after them."
            ) from problem


def digest(key: Mapping[str, Any]) -> str:
    """A name for a key of plain values: equal for equal ones, whatever the order of their parts."""
    text = json.dumps(dict(key), sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is no plain value")


def _last_byte(file) -> bytes:
    file.seek(-1, os.SEEK_END)
    return file.read(1)


def _entries(path: Path) -> Iterator[tuple[str, dict]]:
    """Keys and measurements of the lines of a file that are whole."""
    with file_errors(f"cannot read the measurements in '{path}'", "choose another `out`"):
        text = path.read_text(encoding="utf-8", errors="replace")
    lines = {number: line for number, line in enumerate(text.split("\n"), 1) if line.strip()}
    first = next(iter(lines.values()), "")
    require(
        first.startswith(_BEGINNING) or _BEGINNING.startswith(first),
        f"'{path}' holds something else than measurements; move it away, or choose another `out`.",
    )
    left_out = []
    for number, line in lines.items():
        try:
            entry = json.loads(line)
            if entry["format"] != FORMAT or digest(entry["of"]) != entry["key"]:
                raise ValueError("not a measurement of this version")
            yield entry["key"], dict(entry["measured"])
        except (ValueError, TypeError, KeyError) as problem:
            left_out.append(f"line {number}: {problem}")
    if left_out:
        _log.warning(
            "%d of %d measurements in '%s' are left out, and made again if asked for (%s).",
            len(left_out), len(lines), path, left_out[0],
        )  # fmt: skip
