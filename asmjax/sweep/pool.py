"""Where trials run: what a driver asks of such a place, and the simplest one, this process.

A pool is told to start trials, as many as it has room for, and gives back how they ended, in any
order. `asmjax.sweep.cluster` is the pool of many processes.
"""

import contextlib
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from asmjax.interruption import interruption_waits
from asmjax.sweep.ended import End, Ended, attempt_within


@runtime_checkable
class Runnable(Protocol):
    """A trial as the driver sees it, as `asmjax.sweep.config.Trial` is one."""

    @property
    def key(self) -> str:
        """Hexadecimal digits of all that the trial depends on."""
        ...

    @property
    def config(self) -> dict[str, Any]:
        """Plain values that say all of it."""
        ...


Run = Callable[[dict], Any]
"""What is done with a configuration: it gives a `record` and `arrays`, as
`asmjax.sweep.trial.Outcome` has them."""


class Lost(Exception):
    """The scheduler is gone, and with it the trials that ran."""


class Alone(Exception):
    """No worker is there that can run trials; says why."""


@runtime_checkable
class Pool(Protocol):
    """What runs trials; a context, whose end stops what still runs."""

    @property
    def workers(self) -> int:
        """How many run trials now. Raises `Lost`."""
        ...

    @property
    def room(self) -> int:
        """How many trials may be started now. Raises `Lost`."""
        ...

    @property
    def running(self) -> int:
        """How many were started and did not end yet."""
        ...

    def start(self, trial: Runnable) -> None:
        """Take a trial. Raises `Lost`."""
        ...

    def next(self) -> tuple[Runnable, Ended] | None:
        """A trial that ended; None where none does for about a second. Raises `Lost`, `Alone`."""
        ...

    def __enter__(self) -> "Pool": ...

    def __exit__(self, *_) -> None: ...


class Here:
    """This process as a pool: one trial at a time, of which it may die.

    Args:
        deadline_s: seconds for a trial; one that is in foreign code then goes on until it is not.
    """

    workers = 1

    def __init__(self, run: Run, deadline_s: float):
        self._run, self._deadline_s = run, deadline_s
        self._trial: Runnable | None = None

    def __enter__(self) -> "Here":
        self._open = contextlib.ExitStack()
        self._raise_if_interrupted = self._open.enter_context(interruption_waits(0))
        return self

    def __exit__(self, *_) -> None:
        with self._open:
            self._trial = None

    @property
    def running(self) -> int:
        return int(self._trial is not None)

    @property
    def room(self) -> int:
        return 1 - self.running

    def start(self, trial: Runnable) -> None:
        self._trial = trial

    def next(self) -> tuple[Runnable, Ended] | None:
        self._raise_if_interrupted()
        trial, self._trial = self._trial, None
        assert trial is not None
        ended = attempt_within(self._deadline_s, self._run, trial.config)
        if ended.status != End.DONE:
            # A library may have made another error of it.
            self._raise_if_interrupted()
        return trial, ended
