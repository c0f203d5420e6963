"""How a trial ended, packed where it ran: plain text and bytes, which nobody unpickles later."""

import enum
import functools
import io
import json
import os
import platform
import signal
import threading
import time
import traceback
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from asmjax.memory import MemoryShort
from asmjax.report.provenance import provenance

DETAILS = 4000
"""Characters of a traceback, or of what a process said last, that are kept."""

MACHINE = ("cpu", "cores", "memory_bytes")
"""Of a report's `machine`, what every process knows of itself."""

T = TypeVar("T")


class End(enum.StrEnum):
    """What became of a trial. Only `DONE` has a record; the others have a cause."""

    DONE = "done"
    FAILED = "failed"
    CRASHED = "crashed"
    TIMEOUT = "timeout"
    MEMORY = "out of memory"


@dataclass(frozen=True)
class Ended:
    """One trial, carried out.

    Attributes:
        status: what became of it.
        record: of the outcome, as JSON; numbers that are not finite stand as NaN and Infinity.
        arrays: of the outcome, as the bytes of an .npz file; empty without arrays.
        error: the cause in one line, empty when it is done.
        details: the traceback, or what the process said last.
        attempts: processes that it took.
        started: seconds since 1970, of the first attempt.
        seconds: wall time of the last attempt.
        versions, machine: of where it ran, as in reports.
        trial: its key, as the process of a worker was told; empty elsewhere.
    """

    status: End
    record: str = "{}"
    arrays: bytes = b""
    error: str = ""
    details: str = ""
    attempts: int = 1
    started: float = 0.0
    seconds: float = 0.0
    versions: dict[str, str] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=dict)
    trial: str = ""


class Overdue(BaseException):
    """The deadline of a trial passed; no `except Exception` of the trial may hold it up."""


def attempt(run: Callable[[dict], Any], config: dict) -> Ended:
    """Carry out a trial in this process; whatever it raises is how it ended.

    Raises:
        KeyboardInterrupt: of the user.
        Overdue: of `within`.
    """
    started, begun = time.time(), time.perf_counter()
    try:
        outcome = run(config)
        record, arrays = _record(outcome.record), _packed(outcome.arrays)
        ended = Ended(End.DONE, record=record, arrays=arrays)
    except (KeyboardInterrupt, Overdue):
        raise
    except MemoryShort as problem:
        ended = Ended(End.MEMORY, error=str(problem))
    except BaseException as problem:  # SystemExit too: a trial must not end its process
        ended = Ended(
            End.FAILED,
            error=_one_line(f"{type(problem).__name__}: {problem}"),
            details=traceback.format_exc()[-DETAILS:],
        )
    return _told_here(ended, started, begun)


def attempt_within(seconds: float, run: Callable[[dict], Any], config: dict) -> Ended:
    """`attempt`, ended as soon as that time has passed and Python runs again."""
    started, begun = time.time(), time.perf_counter()
    try:
        return within(seconds, lambda: attempt(run, config))
    except Overdue:
        late = Ended(End.TIMEOUT, error="it took longer than its deadline")
        return _told_here(late, started, begun)


def within(seconds: float, work: Callable[[], T]) -> T:
    """What `work` gives, if it does so in time.

    Only the main thread is held to it: elsewhere Python takes no signals.

    Raises:
        Overdue: it did not; raised inside of it, as soon as Python runs again.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    armed = True

    def ring(*_) -> None:
        nonlocal armed
        if armed:
            armed = False
            raise Overdue

    begun = time.monotonic()
    theirs, _ = signal.setitimer(signal.ITIMER_REAL, 0)
    before = signal.signal(signal.SIGALRM, ring)
    # The alarm may ring at any step in here, the last one of `work` and those after it too: what is
    # outside is done in any case, and undisturbed.
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, seconds)
            return work()
        finally:
            armed = False
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        if theirs:
            # Somebody else's alarm goes on from where it was.
            left = max(theirs - (time.monotonic() - begun), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, left)


@functools.cache
def _versions() -> dict[str, str]:
    return provenance("")["versions"]


@functools.cache
def _machine() -> dict[str, Any]:
    told = provenance("")["machine"]
    return {"host": platform.node()} | {name: told[name] for name in MACHINE}


def facts() -> tuple[dict[str, str], dict[str, Any]]:
    """Versions and machine of this process."""
    return dict(_versions()), _machine() | {"process": os.getpid()}


def _told_here(ended: Ended, started: float, begun: float) -> Ended:
    """With where and when this process carried it out."""
    versions, machine = facts()
    seconds = time.perf_counter() - begun
    return replace(ended, started=started, seconds=seconds, versions=versions, machine=machine)


def _record(record: Mapping[str, Any]) -> str:
    """As JSON. Raises `TypeError` for what has no word in it."""
    return json.dumps(dict(record), default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"its record holds a {type(value).__name__}, which JSON has no word for")


def _packed(arrays: Mapping[str, Any]) -> bytes:
    """As an .npz file. Raises `ValueError` for arrays of Python objects."""
    if not arrays:
        return b""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as packed:
        for name, values in arrays.items():
            with packed.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(values), allow_pickle=False)
    return file.getvalue()


def _one_line(text: str) -> str:
    return " ".join(text.split())
