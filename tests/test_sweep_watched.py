"""The process of trials: warm, on one CPU, ended whatever it does, and its end has a cause."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cloudpickle
import pytest
from helpers.sweep_processes import MARK, seconds_until_gone
from helpers.sweep_trials import fake_trials, run

from asmjax.sweep import watched
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.watched import CannotRun, Limits, WatchedProcess

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
    return process.carry_out(
        trial.key, cloudpickle.dumps(run), trial.config, limits or Limits(LONG)
    )  # fmt: skip


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
    assert large.error.startswith(
        "it held more main memory than the 256 MB that it may; fewer --wo"
    )
    assert ended(process).status == End.DONE


def test_memory_that_an_earlier_trial_took_costs_none(process):
    """Rationale: what becomes of a trial must not hang on which ones came before it."""
    first, second = ended(process, do="crowd"), ended(process, do="crowd")
    assert (first.status, second.status) == (End.DONE, End.DONE)
    assert second.attempts == 2 and second.machine["process"] != first.machine["process"]


def test_a_process_that_is_slow_to_end_has_its_own_cause(process, monkeypatch):
    """It closed its connection before, as one does that gives back much memory."""
    monkeypatch.setattr(watched, "ATTEMPTS", 1)
    slow = ended(process, do="linger", seconds=0.3)
    assert slow.error == "it ended its process with exit code 3"
    monkeypatch.setattr(watched, "GONE", 0.5)
    never = ended(process, do="linger", seconds=LONG)
    assert never.error == "its process broke its connection off, and did not end within 0.5 s"


def test_threads_take_turns_and_get_their_own_answers(process):
    """A deadline begins with the trial's turn."""
    ended(process)
    with ThreadPoolExecutor(3) as threads:
        trials = fake_trials(3, do="sleep", seconds=1.5)
        found = threads.map(
            lambda trial: process.carry_out(
                trial.key, cloudpickle.dumps(run), trial.config, Limits(4.0)
            ),
            trials,
        )
    assert [json.loads(one.record)["square"] for one in found] == [0, 1, 4]


def test_each_thread_of_a_worker_has_a_process(monkeypatch):
    """Both trials run at once, and each process goes with its thread."""
    monkeypatch.setattr(watched, "_all", [])
    both = threading.Barrier(2)

    def carried_out(trial):
        watched.carry_out(trial.key, cloudpickle.dumps(run), trial.config, Limits(LONG))
        both.wait()
        return watched.carry_out(trial.key, cloudpickle.dumps(run), trial.config, Limits(LONG))

    with ThreadPoolExecutor(2) as threads:
        found = [*threads.map(carried_out, fake_trials(2))]
    assert [json.loads(one.record)["square"] for one in found] == [0, 1]
    assert len({one.machine["process"] for one in found}) == 2 == len(watched._all)
    for process in watched._all:
        process.close()


@pytest.mark.parametrize(
    ("program", "patience", "cause"),
    [
        ("exit 5", LONG, "it ended its process with exit code 5"),
        ("exec sleep 60", 0.3, "it did not answer within 0.3 s"),
    ],
)
def test_a_process_that_does_not_start_is_not_the_trials_fault(
    monkeypatch, tmp_path, program, patience, cause
):  # fmt: skip
    monkeypatch.setattr(watched, "START", patience)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    Path(sys.executable).write_text(f"#!/bin/sh\n{program}\n", encoding="utf-8")
    Path(sys.executable).chmod(0o755)
    watching = WatchedProcess()
    with pytest.raises(CannotRun, match=f"its process for trials does not start: {cause}"):
        ended(watching)
    watching.close()


def test_an_answer_for_another_trial_is_none(process, monkeypatch):
    monkeypatch.setattr(watched, "ATTEMPTS", 1)
    ended(process)
    other = Ended(End.DONE, trial="another")
    monkeypatch.setattr(WatchedProcess, "_heard", lambda *_: other)
    found = ended(process)
    assert (found.status, found.error) == (End.CRASHED, "its process answered for trial another")


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
WatchedProcess().carry_out(trial.key, cloudpickle.dumps(run), trial.config, Limits(60))
"""


def test_a_process_ends_with_its_worker(tmp_path, monkeypatch):
    """It is in foreign code that never returns, so that only the system can end it."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setenv(MARK, str(tmp_path))
    log = tmp_path / "log"
    done = subprocess.run([sys.executable, "-c", ORPHAN, str(log)])
    assert done.returncode == -signal.SIGKILL and log.read_text().count("\n") == 1
    assert seconds_until_gone(str(tmp_path)) < 10
