"""Finished trials on disk: a row for each in an SQLite file, their arrays in files beside it.

    FOLDER/sweep.sqlite     one row a trial, by its key
    FOLDER/sweep.lock       held by the one process that writes
    FOLDER/arrays/KEY.npz   the arrays of a trial that has some

One process writes: the driver of a sweep. A row is on disk, whole, when `add` returns, and its
arrays before it: what a row names is there. A trial that is done is never written again. Killing
the process at any point loses nothing that `add` returned for.
"""

import contextlib
import fcntl
import json
import re
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO
from urllib.parse import quote

from asmjax.errors import UseError, require
from asmjax.paths import write_atomic
from asmjax.sweep.ended import End, Ended

BASE, LOCK, ARRAYS = "sweep.sqlite", "sweep.lock", "arrays"

VERSION = 1
"""Of the table."""

PATIENCE = 60.0
"""Seconds to wait for somebody who reads."""

NETWORK = ("nfs", "cifs", "smb", "lustre", "gpfs", "beegfs", "ceph", "gluster", "afs", "9p", "fuse")
"""How names of file systems begin whose readers share no memory, as a write-ahead log needs it."""

COLUMNS = (
    "key", "config", "status", "attempts", "error", "details", "record", "arrays", "versions",
    "machine", "started", "seconds",
)  # fmt: skip

_KINDS = {"attempts": int, "started": float, "seconds": float}
"""Of columns that hold no text."""

LATEST = 2.0**37
"""Seconds since 1970 of no trial's start; dates have a year of four digits until then."""

_TABLE = """
CREATE TABLE IF NOT EXISTS trials (
    key      TEXT PRIMARY KEY,
    config   TEXT NOT NULL,     -- JSON
    status   TEXT NOT NULL,
    attempts INTEGER NOT NULL,  -- of all runs together
    error    TEXT NOT NULL,
    details  TEXT NOT NULL,
    record   TEXT NOT NULL,     -- JSON
    arrays   TEXT NOT NULL,     -- name of a file, empty without arrays
    versions TEXT NOT NULL,     -- JSON
    machine  TEXT NOT NULL,     -- JSON
    started  REAL NOT NULL,     -- seconds since 1970
    seconds  REAL NOT NULL
)"""

_ADD = f"""
INSERT INTO trials ({", ".join(COLUMNS)}) VALUES ({", ".join("?" * len(COLUMNS))})
ON CONFLICT (key) DO UPDATE SET
    {", ".join(f"{name} = excluded.{name}" for name in COLUMNS if name not in ("key", "attempts"))},
    attempts = trials.attempts + excluded.attempts
WHERE trials.status <> '{End.DONE}'"""


class StoreError(UseError):
    """Rows cannot be kept: whatever is run next would be lost as well."""


@dataclass(frozen=True)
class Row:
    """One trial as it is stored.

    Attributes:
        attempts: of all runs together.
        arrays: path of its .npz file; None without arrays.

    The others are as in `Ended`, JSON read.
    """

    key: str
    config: dict
    status: str
    attempts: int
    error: str
    details: str
    record: dict
    arrays: Path | None
    versions: dict
    machine: dict
    started: float
    seconds: float


class Store:
    """The rows of a folder, for the one process that adds to them; a context that closes itself."""

    def __init__(self, folder: Path, base: sqlite3.Connection, lock: TextIO):
        self.folder, self._base, self._lock = folder, base, lock

    @classmethod
    def open(cls, folder: str | Path) -> "Store":
        """The store in `folder`, made where there is none.

        Raises:
            UseError: another process writes there, or something else stands there.
            StoreError: nothing can be written there.
        """
        folder = Path(folder)
        with _written(folder):
            (folder / ARRAYS).mkdir(parents=True, exist_ok=True)
        lock = _locked(folder / LOCK)
        try:
            # Of a process that was killed as it wrote; while the lock is held, nobody else does.
            for draft in (folder / ARRAYS).glob(".*.tmp"):
                draft.unlink(missing_ok=True)
            return cls(folder, _base(folder / BASE, journal_of(folder)), lock)
        except BaseException:
            lock.close()
            raise

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __len__(self) -> int:
        return self._base.execute("SELECT count(*) FROM trials").fetchone()[0]

    def statuses(self) -> dict[str, str]:
        """What became of each trial that is known, by key."""
        return dict(self._base.execute("SELECT key, status FROM trials"))

    def causes(self) -> dict[str, str]:
        """Why trials that are not done ended, in one line each, by key."""
        wanted = "SELECT key, error FROM trials WHERE status <> ?"
        return dict(self._base.execute(wanted, (End.DONE,)))

    def add(self, key: str, config: Mapping[str, Any], ended: Ended) -> None:
        """Keep how a trial ended, on disk before this returns; one that is done stays as it is.

        Raises:
            StoreError: it cannot be written; with the path. Rows of before are not touched.
        """
        require(
            re.fullmatch("[0-9a-f]{8,64}", key) is not None,
            f"'{key[:80]}' is no key of a trial; allowed: 8 to 64 hexadecimal digits.",
        )
        name = f"{key}.npz" if ended.arrays else ""
        if name:
            with _written(self.folder / ARRAYS / name):
                write_atomic(self.folder / ARRAYS / name, ended.arrays)
        row = (
            key, json.dumps(dict(config)), str(ended.status), ended.attempts, ended.error,
            ended.details, ended.record, name, json.dumps(ended.versions),
            json.dumps(ended.machine), ended.started, ended.seconds,
        )  # fmt: skip
        with _written(self.folder / BASE):
            self._base.execute(_ADD, row)

    def close(self) -> None:
        """Leave one plain file, which can be copied and read anywhere, and let others write."""
        try:
            # On a full disk, or while somebody reads, the log stays, and is read with the file.
            with contextlib.suppress(sqlite3.Error):
                self._base.execute("PRAGMA busy_timeout = 1000")
                self._base.execute("PRAGMA journal_mode = DELETE")
            self._base.close()
        finally:
            self._lock.close()


def stored_rows(folder: str | Path) -> list[Row]:
    """All rows of a store, in the order in which trials started; also while a sweep is running.

    Raises:
        UseError: there is no store, or it cannot be read.
    """
    path = Path(folder) / BASE
    require(
        path.is_file(),
        f"'{folder}' holds no sweep ({BASE} is missing); run one with `asmjax sweep` first.",
    )
    wanted = f"SELECT {', '.join(COLUMNS)} FROM trials ORDER BY started, key"
    try:
        with contextlib.closing(_reader(path)) as base:
            if not _has_tables(base, path):
                return []
            return [_row(Path(folder), found) for found in base.execute(wanted)]
    except (sqlite3.Error, ValueError, RecursionError) as problem:
        # A `UseError` says what to do already.
        if isinstance(problem, UseError):
            raise
        raise UseError(f"cannot read '{path}' ({problem}); restore it, or sweep anew.") from problem


def journal_of(folder: Path, mounts: Path = Path("/proc/self/mountinfo")) -> str:
    """How SQLite shall write there: with a write-ahead log, "WAL", or where the file system is a
    network's, "DELETE"."""
    kind, longest = "", -1
    try:
        lines = mounts.read_text(errors="replace").splitlines()
    except OSError:
        return "DELETE"
    place = folder.resolve()
    for line in lines:
        before, _, after = line.partition(" - ")
        # Blanks of a name stand as \040.
        point = Path(re.sub(r"\\(\d{3})", lambda m: chr(int(m[1], 8)), before.split()[4]))
        if place.is_relative_to(point) and len(point.parts) >= longest:
            kind, longest = after.split()[0], len(point.parts)
    return "DELETE" if kind.startswith(NETWORK) else "WAL"


def _base(path: Path, journal: str) -> sqlite3.Connection:
    """The SQLite file, with its table; every statement is a transaction of its own."""
    with _written(path):
        base = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
        try:
            base.execute(f"PRAGMA journal_mode = {journal}")
            base.execute("PRAGMA synchronous = FULL")
            if not _has_tables(base, path):
                with base:
                    base.execute("BEGIN IMMEDIATE")
                    base.execute(_TABLE)
                    base.execute(f"PRAGMA user_version = {VERSION}")
        except BaseException:
            base.close()
            raise
        return base


def _has_tables(base: sqlite3.Connection, path: Path) -> bool:
    """Whether there is more than a file that was just made: a process may end before its first
    transaction.

    Raises:
        UseError: what is there is of another version.
    """
    if not base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        return False
    (found,) = base.execute("PRAGMA user_version").fetchone()
    require(
        found == VERSION,
        f"'{path}' is of version {found}; this asmjax reads version {VERSION}: choose another "
        "--out.",
    )
    return True


def _reader(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro", uri=True, timeout=PATIENCE)


def _row(folder: Path, found: tuple) -> Row:
    values = dict(zip(COLUMNS, found, strict=True))
    for name in COLUMNS:
        kind = _KINDS.get(name, str)
        if not isinstance(values[name], kind):
            raise ValueError(f"{name} of trial {str(values['key'])[:40]} is no {kind.__name__}")
    for name in ("config", "record", "versions", "machine"):
        values[name] = json.loads(values[name])
        if not isinstance(values[name], dict):
            raise ValueError(f"{name} of trial {values['key'][:40]} is no table")
    if not 0 <= values["started"] < LATEST:
        raise ValueError(f"trial {values['key'][:40]} started at no time")
    values["arrays"] = folder / ARRAYS / values["arrays"] if values["arrays"] else None
    return Row(**values)


def _locked(path: Path) -> TextIO:
    """The lock file, held until it is closed or the process ends, however it does."""
    with _written(path):
        lock = path.open("a", encoding="utf-8")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as problem:
        lock.close()
        if isinstance(problem, BlockingIOError):
            raise UseError(
                f"another sweep writes to '{path.parent}'; wait until it ends, or choose another "
                "--out."
            ) from problem
        raise StoreError(
            f"cannot lock '{path}' ({problem.strerror}); choose an --out on a file system that "
            "knows locks."
        ) from problem
    return lock


@contextlib.contextmanager
def _written(path: Path) -> Iterator[None]:
    """Whatever ends a write inside becomes a `StoreError` that names `path`."""
    try:
        yield
    except (OSError, sqlite3.Error) as problem:
        reason = problem.strerror if isinstance(problem, OSError) else str(problem)
        raise StoreError(
            f"cannot write '{path}' ({reason}); make room or choose another --out. Rows of before "
            "are kept, and the same command goes on after them."
        ) from problem
