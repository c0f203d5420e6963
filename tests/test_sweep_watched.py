"""The process of trials: warm, on one CPU, ended whatever it does, and its end has a cause."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cloudpickle
import pytest
from helpers.sweep_processes import MARK, seconds_until_gone
from helpers.sweep_trials import fake_trials, run

from asmjax.sweep import watched
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.watched import Limits, WatchedProcess

LONG = 60.0
"""A deadline that no trial meets, seconds."""


@pytest.fixture(scope="module")
def process():
    """A process for trials; each start takes a quarter of a second."""
    watching = WatchedProcess()
    yield watching
    watching.close()


def ended(process: WatchedProcess, limits: Limits | None = None, **config) -> Ended:
    """One trial in it."""
    (trial,) = fake_trials(1, **config)
    return process.carry_out(cloudpickle.dumps(run), trial.config, limits or Limits(LONG))


def test_trials_share_a_warm_process_on_one_cpu(process):
    first, second = ended(process), ended(process, arrays=True)
    failed = ended(process, do="raise")
    third = ended(process)
    assert [one.status for one in (first, second, third)] == [End.DONE] * 3
    assert failed.status == End.FAILED and failed.error == "ValueError: number 0 is wrong"
    assert first.machine == second.machine == third.machine
    assert first.machine["process"] != os.getpid() and '"cpus": [' in first.record
    assert len(json.loads(first.record)["cpus"]) == 1
    assert second.arrays.startswith(b"PK")


def test_what_ends_the_process_is_told_and_the_next_trial_has_a_new_one(process, monkeypatch):
    monkeypatch.setattr(watched, "ATTEMPTS", 1)
    first = ended(process)
    causes = {do: ended(process, do=do).error for do in ("exit", "abort", "segv")}
    assert causes["exit"] == "it ended its process with exit code 3"
    assert causes["abort"].startswith("its process ended by SIGABRT; it said: ")
    assert causes["segv"].startswith("its process ended by SIGSEGV")
    last = ended(process)
    assert last.status == End.DONE and last.machine["process"] != first.machine["process"]


def test_a_trial_is_tried_again_where_its_process_ended(process, tmp_path):
    """Rationale: an earlier trial may have spoilt the process, or somebody ended it."""
    found = ended(process, do="spoil", flag=str(tmp_path / "once"))
    assert (found.status, found.attempts) == (End.DONE, 2)


def test_deadline_and_memory_end_a_trial_whatever_it_does(process):
    """A trial that never returns to Python is ended too, and neither is tried again."""
    start = time.monotonic()
    late = ended(process, Limits(0.3), do="endless")
    assert time.monotonic() - start < 10
    assert (late.status, late.attempts) == (End.TIMEOUT, 1)
    assert late.error == "it took longer than its deadline of 0.3 s"
    large = ended(process, Limits(LONG, 2**28), do="hog")
    assert (large.status, large.attempts) == (End.MEMORY, 1)
    assert large.error == "it held more main memory than the 256 MB that it may"
    assert ended(process).status == End.DONE


def test_a_trial_can_be_stopped(process, tmp_path):
    log = tmp_path / "log"

    def stop() -> None:
        while not log.exists():
            time.sleep(0.01)
        process.stop("another sweep")
        process.stop()

    stopping = threading.Thread(target=stop)
    stopping.start()
    start = time.monotonic()
    found = ended(process, do="sleep", seconds=LONG, log=str(log))
    stopping.join()
    assert time.monotonic() - start < LONG
    assert (found.status, found.attempts) == (End.CRASHED, 1) and "SIGKILL" in found.error


ORPHAN = """
import cloudpickle, os, pathlib, sys, threading, time
from helpers.sweep_trials import fake_trials, run
from asmjax.sweep.watched import Limits, WatchedProcess

def die():
    while not pathlib.Path(sys.argv[1]).exists():
        time.sleep(0.01)
    os.kill(os.getpid(), 9)

threading.Thread(target=die).start()
(trial,) = fake_trials(1, do="endless", log=sys.argv[1])
WatchedProcess().carry_out(cloudpickle.dumps(run), trial.config, Limits(60))
"""


def test_a_process_ends_with_its_worker(tmp_path, monkeypatch):
    """It is in foreign code that never returns, so that only the system can end it."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setenv(MARK, str(tmp_path))
    log = tmp_path / "log"
    done = subprocess.run([sys.executable, "-c", ORPHAN, str(log)])
    assert done.returncode == -signal.SIGKILL and log.read_text().count("\n") == 1
    assert seconds_until_gone(str(tmp_path)) < 10
