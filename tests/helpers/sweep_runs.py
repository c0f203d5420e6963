"""Sweeps of fake trials, by a driver of this process or by one that is killed."""

import os
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from asmjax.sweep.driver import SweepProgress, SweepResult, run_sweep
from asmjax.sweep.results import results
from asmjax.sweep.store import Store
from helpers.sweep_processes import MARK, marked, victims
from helpers.sweep_trials import FakeTrial, run

TESTS = Path(__file__).parents[1]


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder, whose name marks all processes that are started meanwhile."""
    folder = Path(tempfile.mkdtemp(prefix="asmjax-sweep-"))
    os.environ[MARK] = str(folder)
    try:
        yield folder
    finally:
        del os.environ[MARK]
        for one in marked(str(folder)):
            one.kill()
        shutil.rmtree(folder, ignore_errors=True)


def environment() -> dict[str, str]:
    """For programs of the helpers."""
    return os.environ | {"PYTHONPATH": str(TESTS)}


def swept(
    folder: Path, trials: list[FakeTrial], kept: dict[str, float] | None = None, **options
) -> SweepResult:
    """A sweep into `folder` with two workers; `kept` gets the time at which each key was."""

    def tell(now: SweepProgress) -> None:
        if kept is not None and now.last is not None:
            kept[now.last] = time.time()

    options = {"run": run, "workers": 2, "deadline_s": 60.0} | options
    with Store.open(folder) as store:
        return run_sweep(trials, store, progress=tell, **options)


def driver(folder: Path, count: int, seconds: float, *more: str) -> list[str]:
    """The command line of a driver with two workers, whose starts stand in `folder`/log."""
    words = [str(folder / "s"), str(folder / "log"), str(count), "2", str(seconds)]
    return [sys.executable, "-m", "helpers.sweep_trials", *words, *more]


def driven(
    words: list[str],
    kept: dict[str, float],
    kill_after: float | None = None,
    kill_at: int | None = None,
) -> str:
    """Run a driver, kill it at some point, and say how it ended; empty where it did not.

    Args:
        kept: gets the keys that it tells of, with the time.
        kill_after: so many seconds from its start, or from `kill_at` on.
        kill_at: when that many are in `kept`.
    """
    last = ""
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        timer = threading.Timer(kill_after or 0, process.kill)
        if kill_after is not None and kill_at is None:
            timer.start()
        for line in process.stdout:
            word, *rest = line.split()
            if word == "kept" and len(rest) == 2:
                kept[rest[0]] = float(rest[1])
                if kill_at is not None and len(kept) >= kill_at and process.poll() is None:
                    time.sleep(kill_after or 0)
                    process.kill()
            elif line.endswith("\n"):
                last = line.strip()
        timer.cancel()
        said = process.stderr.read()
    assert last or kill_after is not None or kill_at is not None, said
    return last


@contextmanager
def killing(folder: Path, kills: Counter[str], most: int, chance: random.Random) -> Iterator[None]:
    """Inside, the process of a trial and a worker are killed in turns, at random moments."""
    over = threading.Event()

    def kill() -> None:
        while kills.total() < most and not over.wait(chance.uniform(0.2, 1.5)):
            kind = ("trial", "worker")[kills.total() % 2]
            for victim in victims(str(folder))[kind][:1]:
                victim.kill()
                kills[kind] += 1

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        yield
    finally:
        over.set()
        killer.join()


def statuses(folder: Path) -> Counter[str]:
    """How many trials ended in which way."""
    return Counter(row.status for row in results(folder).stored)


def rate(times: list[float], skipped: int) -> float:
    """Trials a second, from the end of one to that of the last; the first are left out."""
    rest = times[skipped:]
    return (len(rest) - 1) / (rest[-1] - rest[0])


def median_rate(sweep: Callable[[Path], list[float]], rounds: int, skipped: int) -> float:
    """The median `rate` of a sweep that is run so many times."""
    rates = []
    for _ in range(rounds):
        with scratch() as folder:
            rates.append(rate(sweep(folder), skipped))
    return statistics.median(rates)
