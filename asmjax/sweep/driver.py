"""Runs the trials of a sweep that are not known yet, and keeps each as soon as it ends.

The driver is the only process that writes. Whatever happens to it or to workers: a trial that is
kept is never run again, and one that is not is run when the sweep is started again.
"""

import enum
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from asmjax.errors import require
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.pool import Alone, Here, Lost, Pool, Run, Runnable
from asmjax.sweep.store import Store
from asmjax.sweep.watched import Limits
from asmjax.sweep.words import in_words


class SweepStatus(enum.Enum):
    """How a sweep ended, or that it did not yet. Unless it is complete trials are left, and the
    same command goes on."""

    RUNNING = "running"
    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    LOST = "lost the scheduler"
    ALONE = "without workers"
    FAILED = "failed"


@dataclass(frozen=True)
class SweepProgress:
    """Where a sweep is: told when it starts, when a trial is kept, and at least each second.

    Attributes:
        total: trials of the sweep.
        skipped: trials that were known.
        done, failed: trials that this run kept, ended well or not.
        running: trials that a worker has, or that are on their way to one.
        workers: that run trials now; 0 while the sweep waits for some.
        alone_s: seconds since the last one was seen; 0 while some are there.
        seconds: since the start.
        last: key of the trial that was just kept; None where none was.
        cause: why that one failed; empty otherwise.
    """

    total: int
    skipped: int
    done: int = 0
    failed: int = 0
    running: int = 0
    workers: int = 0
    alone_s: float = 0.0
    seconds: float = 0.0
    last: str | None = None
    cause: str = ""


@dataclass(frozen=True)
class SweepResult:
    """What a run of a sweep did, by keys.

    Attributes:
        status: how it ended.
        done: trials that it ran and that ended well.
        skipped: trials that were known and not run again, ended well or not.
        failed: trials that did not end well, in this run or before, and why.
        left: trials that are still to be run.
        cause: why no worker was there, where it ended without, or what it failed by; else empty.
    """

    status: SweepStatus
    done: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ()
    failed: dict[str, str] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    cause: str = ""


def run_sweep(
    trials: Sequence[Runnable],
    store: Store,
    *,
    run: Run,
    workers: int,
    scheduler: str | None = None,
    scheduler_file: Path | None = None,
    deadline_s: float,
    progress: Callable[[SweepProgress], None],
    memory_bytes: int | None = None,
    alone_s: float = 600.0,
    again: bool = False,
) -> SweepResult:
    """Run all trials that `store` does not know, and keep each with its outcome or its cause.

    A trial that raises, that ends its process, or that takes too long or too much is kept as such,
    and the others go on. Ctrl-C ends the sweep; what is kept stays kept.

    Args:
        run: what is done with a configuration; workers must be able to import it.
        workers: processes on this machine, one CPU each; 0 runs trials in this process, which one
            of them may then end, and where a deadline waits until Python runs.
        scheduler, scheduler_file: of a dask cluster, whose workers are taken instead.
        deadline_s: seconds that a trial may take.
        progress: called in this thread.
        memory_bytes: main memory that the process of a worker may hold; None for no limit.
        alone_s: seconds that may pass without any worker.
        again: trials that were kept and did not end well are run once more.

    Raises:
        UseError: a scheduler that may not be used or does not answer, or a number that makes no
            sense.
        StoreError: a trial cannot be kept; those of before are.
    """
    require(workers >= 0, f"{workers} workers cannot run a sweep; allowed: 0 or more.")
    require(deadline_s > 0, f"a deadline of {deadline_s:g} s ends every trial; allowed: above 0.")
    wanted = {trial.key: trial for trial in trials}
    known = store.statuses()
    settled = {key for key, status in known.items() if not again or status == End.DONE}
    waiting = deque(trial for key, trial in wanted.items() if key not in settled)
    fresh = [trial.key for trial in waiting]
    start = SweepProgress(len(wanted), len(wanted) - len(fresh))
    sweep = _Sweep(store, progress, start, alone_s)
    status, cause = SweepStatus.COMPLETE, ""
    if waiting:
        limits = Limits(deadline_s, memory_bytes)
        try:
            with _pool(run, limits, workers, scheduler, scheduler_file) as pool:
                sweep.run(pool, waiting)
        except Lost:
            status = SweepStatus.LOST
        except Alone as problem:
            status, cause = SweepStatus.ALONE, str(problem)
        except KeyboardInterrupt:
            status = SweepStatus.INTERRUPTED
    # The store knows best: an interruption may have come between keeping and counting.
    now, causes = store.statuses(), store.causes()
    kept = {key for key in fresh if now.get(key) != known.get(key)} | sweep.failed
    left = dict.fromkeys(key for key in fresh if key not in kept)
    return SweepResult(
        status if left else SweepStatus.COMPLETE,
        done=tuple(key for key in fresh if key in kept and key not in causes),
        skipped=tuple(key for key in wanted if key in settled),
        failed={key: causes[key] for key in wanted if key in causes and key not in left},
        left=tuple(left),
        cause=cause,
    )


class _Sweep:
    """Trials on their way from those that wait into the store."""

    def __init__(
        self,
        store: Store,
        progress: Callable[[SweepProgress], None],
        now: SweepProgress,
        alone_s: float,
    ):
        self._store, self._progress, self._now = store, progress, now
        self._alone_s = alone_s
        self._start = self._seen = time.monotonic()
        self.failed: set[str] = set()

    def run(self, pool: Pool, waiting: deque[Runnable]) -> None:
        """Run all. Raises `Alone`, and what `pool` and the store do."""
        self._seen = time.monotonic()
        self._tell(pool)
        while waiting or pool.running:
            for _ in range(min(pool.room, len(waiting))):
                pool.start(waiting.popleft())
            found = pool.next()
            if found is not None:
                self._keep(*found)
            self._tell(pool, found)

    def _keep(self, trial: Runnable, ended: Ended) -> None:
        self._store.add(trial.key, trial.config, ended)
        if ended.status == End.DONE:
            self._now = replace(self._now, done=self._now.done + 1)
        else:
            self.failed.add(trial.key)
            self._now = replace(self._now, failed=self._now.failed + 1)

    def _tell(self, pool: Pool, found: tuple[Runnable, Ended] | None = None) -> None:
        workers, now = pool.workers, time.monotonic()
        if workers:
            self._seen = now
        self._progress(
            replace(
                self._now,
                running=pool.running,
                workers=workers,
                alone_s=now - self._seen,
                seconds=now - self._start,
                last=found[0].key if found else None,
                cause=found[1].error if found else "",
            )
        )
        if now - self._seen > self._alone_s:
            raise Alone(f"no worker was there for {in_words(self._alone_s)} (--wait-minutes)")


def _pool(
    run: Run, limits: Limits, workers: int, scheduler: str | None, scheduler_file: Path | None
) -> Pool:
    if workers == 0 and scheduler is None and scheduler_file is None:
        return Here(run, limits.deadline_s)
    from asmjax.sweep.cluster import Workers  # dask takes half a second, which only these need

    return Workers(run, limits, workers, scheduler, scheduler_file)
