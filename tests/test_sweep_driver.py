"""Sweeps end whatever their trials do, and run nothing twice that is kept: the driver alone."""

import signal
from pathlib import Path

import pytest
from helpers.sweep_trials import FakeTrial, fake_trials, run

from asmjax.errors import UseError
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


@pytest.mark.parametrize(("name", "value"), [("workers", -1), ("deadline_s", 0.0)])
def test_numbers_that_make_no_sense_are_told(tmp_path, name, value):
    with pytest.raises(UseError, match="allowed"):
        swept(tmp_path, fake_trials(1), **{name: value})
