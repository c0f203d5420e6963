"""Trials in a process that stays warm, that is watched, and that may die of one.

What runs in a worker of dask: it starts `asmjax.sweep.child` once, hands it trial after trial, and
looks at it twenty times a second. So the cause of every end is known exactly (an exit code, a
signal, the deadline, the memory), the worker itself never ends by a trial, and the deadline is kept
where the trial runs, whatever becomes of the network.
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import Pipe
from typing import Any

import psutil

from asmjax import paths
from asmjax.sweep.cpus import claim_cpu, stay_on
from asmjax.sweep.ended import DETAILS, End, Ended, facts

ATTEMPTS = 3
"""Processes that a trial may end: an earlier trial may have spoilt one, or somebody ended it."""

LOOK = 0.05
"""Seconds between looks at a process that is busy."""

START = 120.0
"""Seconds in which a process must be there; a fraction of one where nothing else runs."""

GONE = 5.0
"""Seconds after which a killed process is left to the system, as one that waits for a dead disk."""


@dataclass(frozen=True)
class Limits:
    """What a trial may take.

    Attributes:
        deadline_s: seconds for all attempts, from when its process is ready.
        memory_bytes: main memory that its process may hold; None for no limit.
    """

    deadline_s: float
    memory_bytes: int | None = None


def carry_out(run: bytes, config: dict, limits: Limits, sweep: str = "") -> Ended:
    """One trial in the warm process of this worker, in a fresh one where that died of it.

    Args:
        run: the pickled function of a configuration.
        sweep: a name for who asks, for `stop_now`.
    """
    return _of_this_worker().carry_out(run, config, limits, sweep)


def stop_now(sweep: str) -> None:
    """End the trial that runs in this worker, if it is one of that sweep: nobody waits for it."""
    if _of_this_worker.cache_info().currsize:
        _of_this_worker().stop(sweep)


class WatchedProcess:
    """The process of one worker, started when the first trial comes."""

    def __init__(self):
        self._cpu = claim_cpu()
        self._said = tempfile.TemporaryFile()
        self._process: subprocess.Popen | None = None
        self._sweep: str | None = None

    def carry_out(self, run: bytes, config: dict, limits: Limits, sweep: str = "") -> Ended:
        """One trial; attempts that end the process are repeated in a fresh one."""
        self._sweep = sweep
        begun, ends, attempts = time.time(), None, 0
        while True:
            attempts += 1
            ended = self._ready()
            if ended is None:
                ends = time.monotonic() + limits.deadline_s if ends is None else ends
                ended = self._once(run, config, ends, limits)
            if ended.status != End.CRASHED or attempts == ATTEMPTS or self._sweep is None:
                self._sweep = None
                return replace(ended, attempts=attempts, started=begun)

    def stop(self, sweep: str = "") -> None:
        """End the trial of that sweep, and try it no more; from another thread."""
        process = self._process
        if self._sweep == sweep and process is not None:
            self._sweep = None
            process.kill()

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._kill()
        self._said.close()

    def _ready(self) -> Ended | None:
        """Have a process that waits for a trial; else why there is none."""
        if self._process is not None:
            if self._process.poll() is None:
                return None
            self._kill()
        stay_on(self._cpu)
        self._line, theirs = Pipe()
        self._forget_said()
        with theirs:
            end = theirs.fileno()
            self._process = subprocess.Popen(
                [sys.executable, "-Pm", "asmjax.sweep.child", str(end), str(os.getpid())],
                stdin=subprocess.DEVNULL,
                stdout=self._said,
                stderr=self._said,
                pass_fds=[end],
                # An interruption at the terminal is the driver's to handle.
                start_new_session=True,
                env=os.environ | _environment(),
            )
        return None if self._heard(time.monotonic() + START, None) == "ready" else self._died()

    def _once(self, run: bytes, config: dict, ends: float, limits: Limits) -> Ended:
        """One attempt."""
        self._forget_said()
        begun = time.perf_counter()
        try:
            self._line.send((run, config))
        except OSError:
            answer = None  # it ended since the last look
        else:
            answer = self._heard(ends, limits.memory_bytes)
        if isinstance(answer, Ended):
            return answer
        if answer is None:
            ended = self._died()
        else:
            self._kill()
            ended = self._told(answer, _excess(answer, limits))
        return replace(ended, seconds=time.perf_counter() - begun)

    def _heard(self, ends: float, memory: int | None) -> Any:
        """What the process sends; None when it died, and what limit it reached when it did."""
        process = self._process
        assert process is not None
        while True:
            left = ends - time.monotonic()
            try:
                if self._line.poll(min(LOOK, max(left, 0))):
                    return self._line.recv()
            except (OSError, EOFError):
                return None
            if process.poll() is not None:
                return None
            if left <= 0:
                return End.TIMEOUT
            if memory is not None and _held(process.pid) > memory:
                return End.MEMORY

    def _died(self) -> Ended:
        """How a process that says nothing more ended."""
        code = self._kill()
        if code is None:
            error = f"its process did not answer within {START:g} s"
        elif code >= 0:
            error = f"it ended its process with exit code {code}"
        elif -code == signal.SIGKILL:
            error = "its process was killed (SIGKILL): memory ran out, or somebody did it"
        else:
            error = f"its process ended by {signal.Signals(-code).name}"
        return self._told(End.CRASHED, error)

    def _told(self, status: End, error: str) -> Ended:
        """With what the process said last, and where it ran."""
        said = _text(self._said)
        last = said.rpartition("\n")[2][:200]
        versions, machine = facts()
        return Ended(
            status,
            error=f"{error}; it said: {last}" if last and status == End.CRASHED else error,
            details=said,
            versions=versions,
            machine=machine,
        )

    def _forget_said(self) -> None:
        # The place in the file is the process's too: both begin anew.
        self._said.seek(0)
        self._said.truncate()

    def _kill(self) -> int | None:
        """End the process; its exit code, or None where it did not end by itself."""
        process, self._process = self._process, None
        assert process is not None
        self._line.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            # One that just closed its line may need a moment to be gone.
            return process.wait(LOOK)
        process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GONE)
        return None


@cache
def _of_this_worker() -> WatchedProcess:
    return WatchedProcess()


def _excess(limit: End, limits: Limits) -> str:
    if limit == End.TIMEOUT:
        return f"it took longer than its deadline of {limits.deadline_s:g} s"
    assert limits.memory_bytes is not None
    return f"it held more main memory than the {limits.memory_bytes / 2**20:,.0f} MB that it may"


def _text(said) -> str:
    """The end of what a process said."""
    length = said.seek(0, os.SEEK_END)
    said.seek(max(0, length - DETAILS))
    return said.read().decode(errors="replace").strip()


def _held(process: int) -> int:
    """Main memory of a process, bytes; 0 once it has ended."""
    try:
        return psutil.Process(process).memory_info().rss
    except psutil.Error:
        return 0


def _environment() -> dict[str, str]:
    """Of the process: it finds modules where this one does, and JAX's compiled code of before."""
    found = {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    folder = paths.writable_dir(paths.jax_cache_dir())
    if folder is not None:
        kept = {
            "JAX_COMPILATION_CACHE_DIR": str(folder),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        }
        found |= {name: value for name, value in kept.items() if name not in os.environ}
    return found
