"""Measurements that outlive an interruption: a file with a line for each, read when one goes on.

What is written is a dictionary of plain values under a key of plain values. A key says all that a
measurement depends on: another scene, view, setting, version or machine has another key.
"""

import hashlib
import json
import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from asmjax.errors import UseError

FORMAT = "asmjax/measurement/1"

_log = logging.getLogger("asmjax")


class Ledger:
    """A growing file of measurements; without a path, they are kept in memory only.

    A line that is torn, as the last one is after a crash, is left out with a warning, and measured
    again.

    Args:
        path: of the file; made with the first measurement.

    Attributes:
        taken: measurements that were asked for and found.
        added: measurements that were made and written.
    """

    def __init__(self, path: Path | None = None):
        self.path, self.taken, self.added = path, 0, 0
        self._known: dict[str, dict] = {}
        if path is not None and path.exists():
            self._known = dict(_lines(path))

    def __len__(self) -> int:
        return len(self._known)

    def get(self, key: Mapping[str, Any]) -> dict | None:
        """The measurement of that key, if there is one."""
        found = self._known.get(digest(key))
        self.taken += found is not None
        return found

    def add(self, key: Mapping[str, Any], measurement: Mapping[str, Any]) -> None:
        """Keep a measurement, on disk before this returns.

        Raises:
            UseError: the file cannot be written.
        """
        name = digest(key)
        self._known[name] = dict(measurement)
        self.added += 1
        if self.path is None:
            return
        line = {"format": FORMAT, "key": name, "of": dict(key), "measured": dict(measurement)}
        text = json.dumps(line, allow_nan=False) + "\n"
        try:
            with self.path.open("a+b") as file:
                # After a crash the file may end within a line.
                if file.tell() and _last_byte(file) != b"\n":
                    file.write(b"\n")
                file.write(text.encode())
                file.flush()
                os.fsync(file.fileno())
        except OSError as problem:
            raise UseError(
                f"cannot write measurements to '{self.path}' ({problem.strerror}); choose another "
                "--out."
            ) from problem


def digest(key: Mapping[str, Any]) -> str:
    """A name for a key of plain values: equal for equal ones, whatever the order of their parts."""
    return hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]


def _last_byte(file) -> bytes:
    file.seek(-1, os.SEEK_END)
    return file.read(1)


def _lines(path: Path):
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as problem:
        raise UseError(
            f"cannot read the measurements in '{path}' ({problem.strerror}); choose another --out."
        ) from problem
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
            if entry["format"] != FORMAT or digest(entry["of"]) != entry["key"]:
                raise ValueError("not a measurement of this version")
            yield entry["key"], dict(entry["measured"])
        except (ValueError, TypeError, KeyError) as problem:
            _log.warning(
                "line %d of '%s' is left out (%s); it is measured again.", number, path, problem
            )
