"""Trials in workers of dask: on this machine by default, or on a cluster that somebody started.

Dask brings trials to workers, and gives those of a worker that is gone to another one; everything
else about a trial is known where it runs (`asmjax.sweep.watched`).
"""

import contextlib
import logging
import queue
import signal
import time
import uuid
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cloudpickle
import dask.config
from distributed import Client, KilledWorker, LocalCluster, Security, WorkerPlugin
from distributed.client import Future
from distributed.utils import silence_logging_cmgr

from asmjax import machine
from asmjax.errors import UseError
from asmjax.memory import SHARE
from asmjax.sweep.addresses import check_certificates, scheduler_address
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.pool import Lost, Run, Runnable
from asmjax.sweep.watched import Limits, carry_out, stop_now

CONNECT = 20.0
"""Seconds in which a scheduler must answer."""

ROUNDS = 5
"""Times that dask may give a trial up because every worker was lost that it gave it to."""

COUNT = 1.0
"""Seconds between looks at which workers there are."""

FETCH = 60.0
"""Seconds in which what a worker answered must be here."""


class Workers:
    """Workers of dask as a pool: of a cluster of our own, or of somebody's scheduler."""

    def __init__(
        self,
        run: Run,
        limits: Limits,
        workers: int,
        scheduler: str | None = None,
        scheduler_file: Path | None = None,
    ):
        """
        Args:
            limits: without one of memory, each worker of our own gets a share of what is free.
            workers: of a cluster of our own.

        Raises:
            UseError: the scheduler's address may not be used, or nobody answers there.
        """
        address = scheduler_address(scheduler, scheduler_file)
        if address is None and limits.memory_bytes is None:
            limits = Limits(limits.deadline_s, _share(workers))
        self._run, self._limits, self._name = cloudpickle.dumps(run), limits, uuid.uuid4().hex
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._running: dict[str, tuple[Runnable, Future]] = {}
        self._rounds: Counter[str] = Counter()
        self._threads, self._counted = 0, -COUNT
        self._open = contextlib.ExitStack()
        self._client = self._open.enter_context(
            _own_cluster(workers) if address is None else _connected(address)
        )

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *_) -> None:
        with self._open:
            if self._running and self._client.status == "running":
                self._client.cancel([future for _, future in self._running.values()], force=True)
                # A worker would carry on to the end of its trial.
                self._client.run(stop_now, self._name, on_error="ignore")

    @property
    def workers(self) -> int:
        """Threads of all workers, as of a second ago at most."""
        if time.monotonic() - self._counted >= COUNT:
            with self._lost_when_closed():
                threads: Any = self._client.nthreads()
                self._threads = sum(threads.values())
            self._counted = time.monotonic()
        return self._threads

    @property
    def room(self) -> int:
        """For each worker one that runs and one that waits there, and two on the way."""
        return max(0, 2 * self.workers + 2 - self.running)

    @property
    def running(self) -> int:
        return len(self._running)

    def start(self, trial: Runnable) -> None:
        with self._lost_when_closed():
            future = self._client.submit(
                carry_out, self._run, trial.config, self._limits, self._name, pure=False
            )
        self._running[str(future.key)] = trial, future
        future.add_done_callback(self._ended.put)

    def next(self) -> tuple[Runnable, Ended] | None:
        """A trial that ended; None where none does for about a second.

        Raises:
            Lost: the scheduler is gone.
            UseError: workers cannot run trials of this asmjax at all.
        """
        try:
            future = self._ended.get(timeout=COUNT)
        except queue.Empty:
            return None
        key = str(future.key)
        trial, _ = self._running[key]
        try:
            ended = future.result(timeout=FETCH)
        except KilledWorker:
            del self._running[key]
            self._rounds[trial.key] += 1
            if self._rounds[trial.key] < ROUNDS:
                self.start(trial)
                return None
            return trial, Ended(End.CRASHED, error="worker after worker was lost that ran it")
        except (TimeoutError, OSError):
            # Its worker was lost with the answer, and another one runs it now.
            self._ended.put(future)
            return None
        except Exception as problem:
            if future.cancelled():
                raise Lost from problem
            raise UseError(
                f"workers cannot run trials ({type(problem).__name__}: {problem}); give them the "
                "environment of this process, with the same asmjax."
            ) from problem
        del self._running[key]
        return trial, ended

    @contextlib.contextmanager
    def _lost_when_closed(self) -> Iterator[None]:
        """What goes wrong inside because the client is not connected any more becomes `Lost`."""
        try:
            yield
        except Exception as problem:
            if self._client.status == "running":
                raise
            raise Lost from problem


@contextlib.contextmanager
def _own_cluster(workers: int) -> Iterator[Client]:
    """A client of a cluster on this machine: loopback only, no dashboard, one thread a worker."""
    # Dask would set variables of this process, and so of all that it starts later.
    unset = dask.config.set({"distributed.nanny.pre-spawn-environ": {}})
    with unset, warnings.catch_warnings():
        # On a busy machine it takes a second, which says nothing about its disk.
        warnings.filterwarnings("ignore", "Creating scratch directories")
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            # No dashboard; what is left of its server takes any port of the loopback.
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            # Trials have processes and limits of their own.
            memory_limit=0,
            # Workers that come and go are the driver's to tell.
            silence_logs=logging.CRITICAL,
        )
    with cluster, Client(cluster, set_as_default=False) as client:
        client.register_plugin(_Deaf())
        yield client


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Client]:
    """A client of somebody's scheduler."""
    security = Security()
    if address.startswith("tls://"):
        check_certificates(security)
    try:
        client = Client(address, timeout=CONNECT, security=security, set_as_default=False)
    except (OSError, TimeoutError) as problem:
        raise UseError(
            f"no scheduler answers at '{address}' within {CONNECT:g} s ({problem}); start one: "
            "dask scheduler."
        ) from problem
    # What comes and goes is the driver's to tell.
    with silence_logging_cmgr(logging.CRITICAL), client:
        yield client


class _Deaf(WorkerPlugin):
    """A worker that an interruption at the terminal does not end: the driver ends it."""

    def setup(self, worker) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _share(workers: int) -> int | None:
    """Main memory for the process of each worker, bytes; None where it cannot be told."""
    free = machine.free_memory_bytes()
    return None if free is None else int(SHARE * free / workers)
