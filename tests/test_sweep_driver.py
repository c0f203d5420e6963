"""Sweeps end whatever their trials do, and run nothing twice that is kept: the driver alone."""

import signal
import time
from pathlib import Path
from typing import Any

import pytest
from helpers.sweep_trials import FakeTrial, fake_trials, run

from asmjax.errors import UseError
from asmjax.memory import MemoryShort
from asmjax.sweep import driver, ended, telling
from asmjax.sweep.driver import SweepProgress, SweepResult, SweepStatus, run_sweep
from asmjax.sweep.pool import Here, Lost
from asmjax.sweep.results import results
from asmjax.sweep.store import Store, StoreError

LONG = 60.0
"""A deadline that no trial meets, seconds."""


def swept(folder: Path, trials: list[FakeTrial], **options) -> tuple[SweepResult, list]:
    """A sweep in this process into `folder`, and what it told on the way."""
    told: list[SweepProgress] = []
    options = {"run": run, "workers": 0, "deadline_s": LONG} | options
    with Store.open(folder) as store:
        found = run_sweep(trials, store, progress=told.append, **options)
    return found, told


def keys(trials: list[FakeTrial]) -> tuple[str, ...]:
    """Of all of them."""
    return tuple(trial.key for trial in trials)


def test_every_trial_is_run_once_and_known_ones_never_again(tmp_path):
    log = tmp_path / "log"
    trials = fake_trials(5, log=str(log))
    found, told = swept(tmp_path / "s", trials[:3] + trials[:2])
    assert found == SweepResult(SweepStatus.COMPLETE, done=keys(trials[:3]))
    assert [now.done for now in told] == [0, 1, 2, 3]
    assert told[-1].total == 3 and told[-1].last == trials[2].key
    found, told = swept(tmp_path / "s", trials)
    assert (found.done, found.skipped) == (keys(trials[3:]), keys(trials[:3]))
    assert (told[0].total, told[0].skipped) == (5, 3)
    assert [line.split()[0] for line in log.read_text().splitlines()] == list("01234")
    assert {row["square"] for row in results(tmp_path / "s").rows()} == {0, 1, 4, 9, 16}


def test_one_that_fails_is_kept_with_its_cause_and_run_again_only_where_asked(tmp_path):
    trials = fake_trials(2) + fake_trials(1, do="raise") + fake_trials(1, do="sys.exit")
    found, told = swept(tmp_path, trials)
    causes = {trials[2].key: "ValueError: number 0 is wrong", trials[3].key: "SystemExit: 3"}
    assert found == SweepResult(SweepStatus.COMPLETE, done=keys(trials[:2]), failed=causes)
    assert [now.cause for now in told if now.cause] == list(causes.values())
    row = next(row for row in results(tmp_path).stored if row.key == trials[2].key)
    assert row.status == "failed" and "Traceback" in row.details and "is wrong" in row.details
    found, _ = swept(tmp_path, trials)
    assert found.skipped == keys(trials) and found.failed == causes
    found, _ = swept(tmp_path, trials, again=True)
    assert found.skipped == keys(trials[:2]) and found.failed == causes


def test_an_interruption_is_a_status_and_the_same_call_goes_on(tmp_path):
    trials = fake_trials(5)

    def interrupted(config):
        if config["number"] == 3:
            raise KeyboardInterrupt
        return run(config)

    found, _ = swept(tmp_path, trials, run=interrupted)
    assert found.status == SweepStatus.INTERRUPTED
    assert (found.done, found.left) == (keys(trials[:3]), keys(trials[3:]))
    found, _ = swept(tmp_path, trials)
    assert found.status == SweepStatus.COMPLETE
    assert (found.done, found.skipped) == (keys(trials[3:]), keys(trials[:3]))


def test_a_lost_scheduler_is_a_status(tmp_path, monkeypatch):
    trials = fake_trials(4)
    following = Here.next

    def lost(pool):
        if pool._trial.config["number"] == 2:
            raise Lost
        return following(pool)

    monkeypatch.setattr(Here, "next", lost)
    found, _ = swept(tmp_path, trials)
    assert found.status == SweepStatus.LOST
    assert (found.done, found.left) == (keys(trials[:2]), keys(trials[2:]))


def test_what_cannot_be_kept_ends_the_sweep(tmp_path, monkeypatch):
    """Rationale: every trial that follows would be lost as well."""
    trials = fake_trials(3)
    adding = Store.add

    def full(store, key, config, ended):
        if config["number"] == 1:
            raise StoreError("no space left")
        adding(store, key, config, ended)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "add", full)
        with pytest.raises(StoreError, match="no space left"):
            swept(tmp_path, trials)
    found, _ = swept(tmp_path, trials)
    assert (found.done, found.skipped) == (keys(trials[1:]), keys(trials[:1]))


def test_a_deadline_ends_a_trial_in_this_process(tmp_path):
    trials = fake_trials(1, do="sleep", seconds=30) + fake_trials(1)
    found, _ = swept(tmp_path, trials, deadline_s=0.2)
    assert found.done == (trials[1].key,)
    assert found.failed == {trials[0].key: "it took longer than its deadline"}
    assert signal.getitimer(signal.ITIMER_REAL)[0] > 0, "the alarm of the tests goes on"


def test_a_deadline_that_passes_as_a_trial_ends_is_no_traceback(tmp_path, monkeypatch):
    """The alarm rings after what the trial does, while its end is written down."""
    facts, rings = ended.facts, [LONG]

    def slow():
        if rings:
            time.sleep(rings.pop())
        return facts()

    monkeypatch.setattr(ended, "facts", slow)
    trials = fake_trials(2)
    found, _ = swept(tmp_path, trials, deadline_s=1.0)
    assert found.failed == {trials[0].key: "it took longer than its deadline"}
    assert found.done == (trials[1].key,)


def test_an_alarm_at_any_step_leaves_things_as_they_were():
    """Deadlines of every length around what the work takes."""

    def rung(*_) -> None:
        raise AssertionError("of somebody else")

    def work() -> int:
        return sum(range(300))

    before = signal.signal(signal.SIGALRM, rung)
    theirs, _ = signal.setitimer(signal.ITIMER_REAL, 50)
    late = 0
    try:
        for step in range(1, 400):
            try:
                assert ended.within(step * 1e-7, work) == work()
            except ended.Overdue:
                late += 1
            assert signal.getsignal(signal.SIGALRM) is rung
            assert 0 < signal.getitimer(signal.ITIMER_REAL)[0] < 51
    finally:
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, theirs)
    assert late > 0


def test_too_little_memory_is_an_end_of_its_own(tmp_path):
    def short(config):
        raise MemoryShort("this would take more")

    found, _ = swept(tmp_path, fake_trials(1), run=short)
    (row,) = results(tmp_path).stored
    assert (row.status, row.error) == ("out of memory", "this would take more")
    assert found.status == SweepStatus.COMPLETE


class Deserted(Here):
    """A place whose workers are gone after so many trials."""

    def __init__(self, after: int):
        super().__init__(run, LONG)
        self._left = after

    @property
    def room(self) -> int:
        return super().room if self._left else 0

    @property
    def workers(self) -> int:  # type: ignore[override]
        return int(self._left > 0)

    def next(self):
        if not self._left:
            time.sleep(0.01)
            return None
        self._left -= 1
        return super().next()


def test_a_sweep_ends_where_no_worker_is_there(tmp_path, monkeypatch):
    """After as long as it may wait, and it tells before."""
    monkeypatch.setattr(driver, "_pool", lambda *_: Deserted(2))
    trials = fake_trials(4)
    found, told = swept(tmp_path, trials, alone_s=0.1)
    cause = "no worker was there for 1 s (--wait-minutes)"
    left = keys(trials[2:])
    assert found == SweepResult(SweepStatus.ALONE, keys(trials[:2]), left=left, cause=cause)
    assert told[1].alone_s == 0 and told[-1].alone_s > 0.1
    assert told[-1].workers == 0


def fake_progress(done: int, seconds: float, **more) -> SweepProgress:
    """Of ten trials, two of which were known."""
    values: dict[str, Any] = {"total": 10, "skipped": 2, "workers": 3} | more
    return SweepProgress(**values, done=done, seconds=seconds)


def heard(capsys, quiet: bool, steps: list[SweepProgress]) -> list[str]:
    """What is told of them where there is no terminal."""
    with telling.telling(quiet, 600.0) as tell:
        for now in steps:
            tell(now)
    return capsys.readouterr().err.splitlines()


def test_without_a_terminal_a_line_now_and_then(capsys):
    steps = [fake_progress(0, 0.0), fake_progress(2, 59.0), fake_progress(2, 61.0)]
    steps += [fake_progress(3, 70.0, failed=1, last="ab", cause="it was bad")]
    steps += [fake_progress(3, 122.0, failed=1)]
    assert heard(capsys, False, steps) == [
        "2 of 8 trials, 3 workers, 2 known, about 3 min left",
        "trial ab failed: it was bad",
        "4 of 8 trials, 3 workers, 1 failed, 2 known, about 2 min left",
    ]
    assert heard(capsys, True, steps) == ["trial ab failed: it was bad"]


def test_missing_workers_are_told_once_each_time(capsys):
    gone = [
        fake_progress(1, s, workers=0, alone_s=a) for s, a in ((9, 9.0), (11, 11.0), (12, 12.0))
    ]
    again = [fake_progress(2, 20), fake_progress(2, 31, workers=0, alone_s=11.0)]
    lines = heard(capsys, True, gone + again)
    assert lines == ["no worker is there; the sweep waits 10 min for one (--wait-minutes)"] * 2


@pytest.mark.parametrize(("name", "value"), [("workers", -1), ("deadline_s", 0.0)])
def test_numbers_that_make_no_sense_are_told(tmp_path, name, value):
    with pytest.raises(UseError, match="allowed"):
        swept(tmp_path, fake_trials(1), **{name: value})
