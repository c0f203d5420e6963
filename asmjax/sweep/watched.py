"""Trials in a process that stays warm, that is watched, and that may die of one.

What runs in a worker of dask, in each of its threads: it starts `asmjax.sweep.child` once, hands it
trial after trial, and looks at it twenty times a second. So the cause of every end is known exactly
(an exit code, a signal, the deadline, the memory), the worker itself never ends by a trial, and the
deadline is kept where the trial runs, whatever becomes of the network.
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, replace
from multiprocessing import Pipe
from typing import Any

import psutil

from asmjax import paths
from asmjax.sweep.cpus import claim_cpu, stay_on
from asmjax.sweep.ended import DETAILS, End, Ended, facts

ATTEMPTS = 3
"""Processes that a trial may end, as an earlier trial may have spoilt one, or somebody ended it;
and that may fail to start."""

LOOK = 0.05
"""Seconds between looks at a process that is busy."""

START = 120.0
"""Seconds in which a process must be there; a fraction of one where nothing else runs."""

GONE = 5.0
"""Seconds that a process may take to end: one that closed its line may have to give back much
memory; one that was killed is left to the system then, as it may wait for a dead disk."""


class CannotRun(Exception):
    """This worker has no process for trials, whatever the trial; another one may have."""


@dataclass(frozen=True)
class Limits:
    """What a trial may take.

    Attributes:
        deadline_s: seconds for all attempts, from when its process is ready.
        memory_bytes: main memory that its process may hold; None for no limit.
    """

    deadline_s: float
    memory_bytes: int | None = None


def carry_out(key: str, run: bytes, config: dict, limits: Limits, sweep: str = "") -> Ended:
    """One trial in the warm process of this thread, in a fresh one where that died of it.

    Args:
        key: of the trial.
        run: the pickled function of a configuration.
        sweep: a name for who asks, for `stop_now`.

    Raises:
        CannotRun: there is no process.
    """
    return _of_this_thread().carry_out(key, run, config, limits, sweep)


def stop_now(sweep: str) -> None:
    """End the trials of that sweep that run in this worker: nobody waits for them."""
    for process in tuple(_all):
        process.stop(sweep)


class WatchedProcess:
    """The process of one thread of a worker, started when the first trial comes."""

    def __init__(self):
        self._cpu = claim_cpu()
        self._said = tempfile.TemporaryFile()
        self._process: subprocess.Popen | None = None
        self._warm = False
        self._sweep: str | None = None
        self._one_at_a_time = threading.Lock()

    def carry_out(
        self, key: str, run: bytes, config: dict, limits: Limits, sweep: str = ""
    ) -> Ended:  # fmt: skip
        """One trial. Attempts that end the process are repeated in a fresh one, and one for which
        memory was too short if earlier trials may have left some of it taken.

        Raises:
            CannotRun: no process starts, or nobody waits for the trial any more.
        """
        with self._one_at_a_time:
            self._sweep = sweep
            begun, ends, attempts = time.time(), None, 0
            while True:
                attempts += 1
                self._have()
                warm, self._warm = self._warm, True
                ends = time.monotonic() + limits.deadline_s if ends is None else ends
                ended = self._once(key, run, config, ends, limits)
                again = ended.status == End.CRASHED or (ended.status == End.MEMORY and warm)
                if not again or attempts == ATTEMPTS or self._sweep is None:
                    self._sweep = None
                    return replace(ended, attempts=attempts, started=begun, trial=key)
                self._end()

    def stop(self, sweep: str = "") -> None:
        """End the trial of that sweep, and try it no more; from another thread."""
        if self._sweep == sweep:
            self._sweep = None
            if (process := self._process) is not None:
                process.kill()

    def close(self) -> None:
        """End the process."""
        self._end()
        self._said.close()

    def _have(self) -> None:
        """Have a process that waits for a trial. Raises `CannotRun`."""
        cause = ""
        for _ in range(ATTEMPTS):
            if self._sweep is None:
                raise CannotRun("its sweep was stopped")
            if self._process is not None and self._process.poll() is None:
                return
            self._end()
            cause = self._start()
            if not cause:
                return
        raise CannotRun(f"its process for trials does not start: {cause}")

    def _start(self) -> str:
        """Start the process; why it does not answer, empty where it does."""
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
        self._warm = False
        answer = self._heard(time.monotonic() + START, None)
        if answer == "ready":
            return ""
        if answer is None:
            return self._with_last_words(self._cause_of_death())
        self._end()
        return self._with_last_words(f"it did not answer within {START:g} s")

    def _once(
        self, key: str, run: bytes, config: dict, ends: float, limits: Limits
    ) -> Ended:  # fmt: skip
        """One attempt."""
        self._forget_said()
        begun = time.perf_counter()
        try:
            self._line.send((key, run, config))
        except OSError:
            answer = None  # it ended since the last look
        else:
            answer = self._heard(ends, limits.memory_bytes)
        if isinstance(answer, Ended) and answer.trial == key:
            return answer
        if answer is None:
            ended = self._told(End.CRASHED, self._cause_of_death())
        elif isinstance(answer, Ended):
            self._end()
            ended = self._told(End.CRASHED, f"its process answered for trial {answer.trial}")
        else:
            self._end()
            ended = self._told(answer, _excess(answer, limits))
        return replace(ended, seconds=time.perf_counter() - begun)

    def _heard(self, ends: float, memory: int | None) -> Any:
        """What the process sends; None when its line is closed, and what limit it reached when it
        did."""
        process = self._process
        assert process is not None
        while True:
            left = ends - time.monotonic()
            try:
                if self._line.poll(min(LOOK, max(left, 0))):
                    return self._line.recv()
            except Exception:  # of what a trial wrote there, too
                return None
            if process.poll() is not None:
                return None
            if left <= 0:
                return End.TIMEOUT
            if memory is not None and _held(process.pid) > memory:
                return End.MEMORY

    def _cause_of_death(self) -> str:
        """How a process whose line is closed ended."""
        code = self._end(GONE)
        if code is None:
            return f"its process broke its connection off, and did not end within {GONE:g} s"
        if code >= 0:
            return f"it ended its process with exit code {code}"
        if -code == signal.SIGKILL:
            return "its process was killed (SIGKILL): memory ran out, or somebody did it"
        named = {one.value: one.name for one in signal.Signals}
        return f"its process ended by {named.get(-code, f'signal {-code}')}"

    def _told(self, status: End, error: str) -> Ended:
        """With what the process said last, and where it ran."""
        versions, machine = facts()
        return Ended(
            status,
            error=self._with_last_words(error) if status == End.CRASHED else error,
            details=_text(self._said),
            versions=versions,
            machine=machine,
        )

    def _with_last_words(self, error: str) -> str:
        last = _text(self._said).rpartition("\n")[2][:200]
        return f"{error}; it said: {last}" if last else error

    def _forget_said(self) -> None:
        # The place in the file is the process's too: both begin anew.
        self._said.seek(0)
        self._said.truncate()

    def _end(self, patience: float = 0.0) -> int | None:
        """End the process if there is one; its exit code, or None where it did not end by itself
        within so many seconds."""
        process, self._process = self._process, None
        if process is None:
            return None
        self._line.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(patience)
        process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GONE)
        return None


_mine = threading.local()

_all: list[WatchedProcess] = []
"""Of all threads."""


def _of_this_thread() -> WatchedProcess:
    found = getattr(_mine, "process", None)
    if found is None:
        found = _mine.process = WatchedProcess()
        _all.append(found)
    return found


def _excess(limit: End, limits: Limits) -> str:
    if limit == End.TIMEOUT:
        return f"it took longer than its deadline of {limits.deadline_s:g} s"
    assert limits.memory_bytes is not None
    return (
        f"it held more main memory than the {limits.memory_bytes / 2**20:,.0f} MB that it may; "
        "fewer --workers, or a larger --max-memory, leave it more"
    )


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
