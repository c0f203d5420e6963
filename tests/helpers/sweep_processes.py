"""Processes of a sweep, found by a mark in their environment, to be killed or to be missed."""

import time
from pathlib import Path

import psutil

from helpers.sweep_trials import FakeTrial

MARK = "ASMJAX_TEST_MARK"
"""The variable; whatever is started with it set passes it on."""


def marked(mark: str) -> list[psutil.Process]:
    """All that were started with that mark, but those that are only waited for and Python's own."""
    found = []
    for one in psutil.process_iter():
        try:
            if one.status() == psutil.STATUS_ZOMBIE or one.environ().get(MARK) != mark:
                continue
            if not any("resource_tracker" in word for word in one.cmdline()):
                found.append(one)
        except psutil.Error:
            continue
    return found


def victims(mark: str) -> dict[str, list[psutil.Process]]:
    """Those of a sweep's processes on this machine that carry out trials, and their workers."""
    kinds: dict[str, list[psutil.Process]] = {"trial": [], "worker": []}
    for one in marked(mark):
        try:
            words = one.cmdline()
        except psutil.Error:
            continue
        if "asmjax.sweep.child" in words:
            kinds["trial"].append(one)
        elif any("spawn_main" in word for word in words):
            kinds["worker"].append(one)
    return kinds


def seconds_until_gone(mark: str, patience: float = 10.0) -> float:
    """How long until no process with that mark is left; infinity where some stay longer."""
    start = time.monotonic()
    while marked(mark):
        if time.monotonic() - start > patience:
            return float("inf")
        time.sleep(0.05)
    return time.monotonic() - start


def starts_after_kept(log: Path, trials: list[FakeTrial], kept: dict[str, float]) -> int:
    """How often a trial was started that had been kept, by the file `log` of all starts.

    Args:
        kept: when each key was told to be kept, seconds since 1970.
    """
    by_number = {trial.config["number"]: trial.key for trial in trials}
    starts = (line.split() for line in log.read_text().splitlines())
    late = (float(at) > kept.get(by_number[int(number)], float("inf")) for number, at in starts)
    return sum(late)
