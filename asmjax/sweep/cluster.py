"""Trials in workers of dask: on this machine by default, or on a cluster that somebody started.

Dask brings trials to workers, and gives those of a worker that is gone to another one. One that
cannot run trials at all is sent away, and its trials go to others. Everything else about a trial is
known where it runs (`asmjax.sweep.watched`).
"""

import contextlib
import logging
import queue
import signal
import time
import uuid
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import cloudpickle
import dask.config
from distributed import Client, KilledWorker, LocalCluster, Security
from distributed.client import Future
from distributed.core import Status
from distributed.utils import silence_logging_cmgr

from asmjax.errors import UseError
from asmjax.interruption import interruption_waits
from asmjax.sweep.addresses import check_certificates, scheduler_address
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.pool import Alone, Lost, Run, Runnable
from asmjax.sweep.watched import Limits, carry_out, stop_now

_log = logging.getLogger("asmjax")

CONNECT = 20.0
"""Seconds in which a scheduler must answer."""

ROUNDS = 5
"""Times that a trial, or its answer, may be lost: each time dask gave up because every worker was
lost that it gave it to, or the one that had the answer was."""

COUNT = 1.0
"""Seconds between looks at which workers there are."""

FETCH = 60.0
"""Seconds in which what a worker answered must be here."""

REMEDY = "give workers the environment of this process, with the same asmjax"


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
            limits: of a trial.
            workers: of a cluster of our own.

        Raises:
            UseError: the scheduler's address may not be used, or nobody answers there.
        """
        address = scheduler_address(scheduler, scheduler_file)
        self._run, self._limits, self._name = cloudpickle.dumps(run), limits, uuid.uuid4().hex
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._running: dict[str, tuple[Runnable, Future]] = {}
        self._rounds: Counter[str] = Counter()
        self._retired: set[str] = set()
        self._threads, self._counted = 0, -COUNT
        self._wanted = workers
        with contextlib.ExitStack() as opening:
            # It is looked at between trials: in the middle of what dask does it could be lost.
            self._raise_if_interrupted = opening.enter_context(interruption_waits())
            self._client, self._refill = opening.enter_context(
                _own_cluster(workers) if address is None else _connected(address)
            )
            self._open = opening.pop_all()

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
                self._threads = sum(self._usable().values())
                # Those that were sent away would fail again.
                if self._threads < self._wanted and not self._retired:
                    self._refill()
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
                carry_out, trial.key, self._run, trial.config, self._limits, self._name, pure=False
            )
        self._running[str(future.key)] = trial, future
        future.add_done_callback(self._ended.put)

    def next(self) -> tuple[Runnable, Ended] | None:
        """A trial that ended; None where none does for about a second.

        Raises:
            KeyboardInterrupt: there was an interruption.
            Lost: the scheduler is gone.
            Alone: no worker is left that can run trials.
            UseError: one answers for another trial than it was given.
        """
        self._raise_if_interrupted()
        try:
            future = self._ended.get(timeout=COUNT)
        except queue.Empty:
            return None
        trial, _ = self._running[str(future.key)]
        try:
            ended = future.result(timeout=FETCH)
        except Exception as problem:
            return self._without_answer(trial, future, problem)
        del self._running[str(future.key)]
        if ended.trial != trial.key:
            raise UseError(f"a worker answered for another trial than it was given; {REMEDY}.")
        return trial, ended

    def _without_answer(
        self, trial: Runnable, future: Future, problem: Exception
    ) -> tuple[Runnable, Ended] | None:
        """Let a trial be run again, by others if it was its worker that failed."""
        key = str(future.key)
        if future.cancelled():
            raise Lost from problem
        if future.status == "error":
            # `problem` may be of fetching an answer that was lost before this one failed.
            with self._lost_when_closed():
                raised: Any = future.exception(timeout=FETCH)
            if not isinstance(raised, KilledWorker):
                self._retire(key, raised)
                del self._running[key]
                self.start(trial)
                return None
        self._rounds[trial.key] += 1
        if self._rounds[trial.key] == ROUNDS:
            del self._running[key]
            return trial, Ended(End.CRASHED, error="worker after worker was lost that ran it")
        if future.status == "error":
            del self._running[key]
            self.start(trial)
        else:
            # The answer was lost, and dask has the trial run again.
            future.add_done_callback(self._ended.put)
        return None

    def _retire(self, key: str, problem: Exception) -> None:
        """Send away the worker that could not run a trial.

        Raises:
            Alone: none is left, or it is not known which one it was.
        """
        cause = f"{type(problem).__name__}: {problem}"
        with self._lost_when_closed():
            told: Any = self._client.run_on_scheduler(
                lambda dask_scheduler: [*(dask_scheduler.tasks[key].erred_on or ())]
            )
            for place in {*told} - self._retired:
                _log.warning(
                    "worker %s cannot run trials, which others get now (%s)", place, cause
                )  # fmt: skip
                self._retired.add(place)
                self._client.retire_workers(workers=[place], close_workers=True)
            left = self._usable()
        if not told or not left:
            raise Alone(f"no worker is left that can run trials ({cause}): {REMEDY}") from problem

    def _usable(self) -> dict[str, int]:
        """Threads of each worker that was not sent away, by address."""
        threads: Any = self._client.nthreads()
        return {place: count for place, count in threads.items() if place not in self._retired}

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
def _own_cluster(workers: int) -> Iterator[tuple[Client, Callable[[], None]]]:
    """A client of a cluster on this machine, and what starts workers that are missing there: no
    dashboard, one thread a worker, and only on the loopback, where nobody else of this machine has
    the certificates."""
    settings = dask.config.set(
        {
            # Dask would set variables of this process, and so of all that it starts later.
            "distributed.nanny.pre-spawn-environ": {},
            # Without a dashboard it would serve pages all the same.
            "distributed.scheduler.http.routes": [],
            "distributed.worker.http.routes": [],
        }
    )
    with settings, warnings.catch_warnings():
        # On a busy machine it takes a second, which says nothing about its disk.
        warnings.filterwarnings("ignore", "Creating scratch directories")
        with _deaf():
            cluster = _cluster()
        with cluster, Client(cluster, set_as_default=False) as client:
            loop = cluster.loop
            assert loop is not None  # it runs since the cluster was made
            cluster.scale(workers)
            yield client, lambda: loop.add_callback(_refill, cluster, workers)


def _refill(cluster: LocalCluster, workers: int) -> None:
    """Have workers started that nobody starts again, in the thread of `cluster`.

    Dask starts one that is killed, but gives it up if that was as it started, or if it then takes
    long to come back. Those that are about to start are left alone.
    """
    for name, worker in [*cluster.workers.items()]:
        if worker.status in (Status.closed, Status.failed):
            del cluster.workers[name]
    cluster.scale(workers)


def _cluster() -> LocalCluster:
    """Without any worker yet."""
    return LocalCluster(
        n_workers=0,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        security=Security.temporary(),
        # What is left of its server takes any port of the loopback.
        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
        # Trials have processes and limits of their own.
        memory_limit=0,
        # Workers that come and go are the driver's to tell.
        silence_logs=logging.CRITICAL,
    )


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """Threads that are started inside, and whatever processes they start later, do not hear an
    interruption at the terminal, which is the driver's to handle."""
    # Once it runs, starting a process leaves the signals of the thread that does it as they are.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _connected(address: str) -> Iterator[tuple[Client, Callable[[], None]]]:
    """A client of somebody's scheduler, whose workers are theirs to start."""
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
        yield client, lambda: None
