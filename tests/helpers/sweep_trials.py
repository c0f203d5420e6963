"""Trials of sweeps that take nothing, or that end as badly as they can; and a driver to be killed.

`python -m helpers.sweep_trials FOLDER LOG COUNT WORKERS SECONDS [SCHEDULER]` sweeps COUNT trials of
so many seconds. It prints a line for each trial that it kept, with its key and the time, and at
last the status, how many are left, and how many failed.
"""

import ctypes
import hashlib
import itertools
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from asmjax.memory import MemoryShort
from asmjax.sweep.driver import SweepProgress, run_sweep
from asmjax.sweep.store import Store


class FakeTrial(NamedTuple):
    """What a driver asks of a trial."""

    key: str
    config: dict[str, Any]


class FakeOutcome(NamedTuple):
    """What a driver asks of an outcome."""

    record: dict[str, Any]
    arrays: dict[str, np.ndarray]


def outcome(config: dict) -> FakeOutcome:
    """A record with tables, NumPy's numbers and one that is not finite, and an array."""
    number = config["number"]
    record = {"error": {"wrong": np.float32(number) / 4}, "ratio": np.inf, "name": f"no. {number}"}
    return FakeOutcome(record, {"lit": np.full((2, 3), number, np.float32)})


def fake_trials(count: int, first: int = 0, **config: Any) -> list[FakeTrial]:
    """Trials that differ by their number."""
    found = []
    for number in range(first, first + count):
        whole = config | {"number": number}
        text = json.dumps(whole, sort_keys=True)
        found.append(FakeTrial(hashlib.sha256(text.encode()).hexdigest()[:32], whole))
    return found


def sleepers(count: int, seconds: float, log: str) -> list[FakeTrial]:
    """The trials of `main`."""
    return fake_trials(count, do="sleep", seconds=seconds, log=log, arrays=True)


def run(config: dict) -> FakeOutcome:
    """Note the start in the file `log`, if there is one, and do what `do` says."""
    if log := config.get("log"):
        with open(log, "ab", buffering=0) as file:
            # One write of an appended file is not torn, whoever else writes.
            file.write(f"{config['number']} {time.time()}\n".encode())
    ACTIONS[config.get("do", "nothing")](config)
    number = config["number"]
    return FakeOutcome(
        {"square": number**2, "process": os.getpid(), "cpus": sorted(os.sched_getaffinity(0))},
        {"numbers": np.arange(number, number + 4.0)} if config.get("arrays") else {},
    )


def _work(config: dict) -> None:
    """Keep a CPU busy for so long as it would take alone."""
    ends = time.thread_time() + config["seconds"]
    while time.thread_time() < ends:
        pass


def _raise(config: dict) -> None:
    raise ValueError(f"number {config['number']}\nis wrong")


def _abort(config: dict) -> None:
    print("LLVM ERROR: Cannot select", file=sys.stderr, flush=True)
    os.abort()


def _hog(config: dict) -> None:
    """Take memory, and use it, until somebody ends this."""
    held = []
    while True:
        held.append(np.ones(2**22))


def _spoil(config: dict) -> None:
    """End the process that carries out a trial after this one, once."""
    flag = Path(config["flag"])
    if not flag.exists():
        flag.touch()
        os.abort()


def _linger(config: dict) -> None:
    """Close all connections, and end later."""
    os.closerange(3, 256)
    time.sleep(config["seconds"])
    os._exit(3)


def _crowd(config: dict) -> None:
    """Leave something in the process, with which the same is too much."""
    _left.append(config)
    if len(_left) > 1:
        raise MemoryShort("too little is left")


_left: list[dict] = []


ACTIONS: dict[str, Callable[[dict], Any]] = {
    "nothing": lambda config: None,
    "sleep": lambda config: time.sleep(config["seconds"]),
    "work": _work,
    "raise": _raise,
    "sys.exit": lambda config: sys.exit(3),
    "exit": lambda config: os._exit(3),
    "abort": _abort,
    "segv": lambda config: ctypes.string_at(0),
    "hog": _hog,
    # Never returns to Python: no thread and no signal handler of the process runs again.
    "endless": lambda config: sum(itertools.repeat(0)),
    "spoil": _spoil,
    "linger": _linger,
    "crowd": _crowd,
}


def main(
    folder: str, log: str, count: str, workers: str, seconds: str, scheduler: str | None = None
) -> None:
    """Sweep, and tell."""

    def tell(now: SweepProgress) -> None:
        if now.last is not None:
            print("kept", now.last, time.time(), flush=True)

    trials = sleepers(int(count), float(seconds), log)
    with Store.open(folder) as store:
        found = run_sweep(
            trials,
            store,
            run=run,
            workers=int(workers),
            scheduler=scheduler,
            deadline_s=60.0,
            progress=tell,
        )
    print(found.status.value, len(found.left), len(found.failed), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
