"""Sweeps by TLS, after kills, on full disks and with bad trials: short forms for every day.

`experiments/reliability.py` and the slow tests of test_sweep_cluster.py have the long ones.
"""

import json
import random
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import dask.config
import pytest
from helpers.sweep_disk import NoDisks, on_full_disks
from helpers.sweep_processes import MARK, seconds_until_gone, starts_after_kept
from helpers.sweep_runs import driven, driver, killing, statuses, swept
from helpers.sweep_tls import certified, configured, program
from helpers.sweep_trials import fake_trials, sleepers

from asmjax.errors import UseError
from asmjax.sweep import cluster
from asmjax.sweep.driver import SweepStatus
from asmjax.sweep.results import results

PATIENCE = 60.0
"""Seconds in which a scheduler must be there."""


def test_a_killed_driver_and_killed_workers_lose_nothing(tmp_path, monkeypatch):
    """A driver is killed, nobody of it stays; of the sweep that goes on the process of a trial and
    a worker are killed. What was told is there, it completes, and nothing kept is run again."""
    monkeypatch.setenv(MARK, str(tmp_path))
    log, kept, kills = tmp_path / "log", {}, Counter()
    trials = sleepers(40, 0.1, str(log))
    assert driven(driver(tmp_path, 40, 0.1), kept, kill_at=8) == ""
    assert seconds_until_gone(str(tmp_path)) < 10
    assert {row.key for row in results(tmp_path / "s").stored} >= set(kept)
    with killing(tmp_path, kills, 2, random.Random(1)):
        found = swept(tmp_path / "s", trials, kept)
    assert found.status == SweepStatus.COMPLETE and dict(kills) == {"trial": 1, "worker": 1}
    assert statuses(tmp_path / "s") == Counter(done=40)
    assert starts_after_kept(log, trials, kept) == 0
    assert seconds_until_gone(str(tmp_path)) < 10


def test_disks_that_get_full_lose_nothing(tmp_path):
    """Every ninth size and number of files up to what the sweep needs."""
    try:
        disks = on_full_disks(tmp_path, 9)
    except NoDisks as problem:
        pytest.skip(f"disks cannot be mounted: {problem}")
    full = [one["told"] for one in disks if one["told"] is not None]
    assert {name for one in disks for name in one["limit"]} == {"size", "nr_inodes"}
    assert len(full) > 3 and all(f"cannot write '{tmp_path}/sweep" in told for told in full)
    assert {one["lost"] for one in disks} == {one["left"] for one in disks} == {0}


def test_bad_trials_cost_only_themselves(tmp_path):
    """One that crashes and one that takes all memory among twelve, with two workers. None is short
    of time: that a deadline ends a trial whatever it does, test_sweep_watched.py has."""
    bad = {"abort": "crashed", "hog": "out of memory"}
    trials = fake_trials(12)
    for place, do in enumerate(bad):
        trials[6 * place : 6 * place] = fake_trials(1, first=12, do=do)
    found = swept(tmp_path, trials, deadline_s=600.0, memory_bytes=2**29)
    assert found.status == SweepStatus.COMPLETE and len(found.done) == 12
    rows = {row.key: row for row in results(tmp_path).stored}
    ended = {one.config["do"]: rows[one.key].status for one in trials if one.key in found.failed}
    assert ended == bad


def test_a_sweep_by_tls_and_a_stranger_who_may_not(tmp_path, monkeypatch):
    """A scheduler and a worker with certificates: a sweep with theirs completes; one with those of
    another authority is not let in."""
    monkeypatch.setenv(MARK, str(tmp_path))
    for name in ("own", "strange"):
        (tmp_path / name).mkdir()
    own, strange = certified(tmp_path / "own"), certified(tmp_path / "strange")
    file = tmp_path / "scheduler.json"
    common = ["--scheduler-file", str(file), "--protocol", "tls", "--no-dashboard"]
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    work = [sys.executable, "-m", "distributed.cli.dask_worker", "--host", "127.0.0.1"]
    work += ["--no-nanny", "--nthreads", "1", "--memory-limit", "0"]
    work += ["--local-directory", str(tmp_path)]
    with program([*start, "--port", "0", *common], own, tmp_path) as scheduler:
        address = address_in(file, scheduler, tmp_path / "said")
        assert address.startswith("tls://127.0.0.1:")
        with program([*work, *common], own, tmp_path):
            with dask.config.set(configured(own)):
                found = swept(tmp_path / "s", fake_trials(6), scheduler=address)
            assert found.status == SweepStatus.COMPLETE and len(found.done) == 6
        monkeypatch.setattr(cluster, "CONNECT", 2.0)
        with dask.config.set(configured(strange)):
            with pytest.raises(UseError, match=f"no scheduler answers at '{address}'"):
                swept(tmp_path / "t", fake_trials(1), scheduler=address)
    assert seconds_until_gone(str(tmp_path)) < 10


def address_in(file: Path, scheduler: subprocess.Popen, said: Path) -> str:
    """What a scheduler writes once it listens."""
    patience = time.monotonic() + PATIENCE
    while time.monotonic() < patience and scheduler.poll() is None:
        if file.exists() and file.read_text().endswith("}"):
            return json.loads(file.read_text())["address"]
        time.sleep(0.05)
    raise AssertionError(said.read_text())
