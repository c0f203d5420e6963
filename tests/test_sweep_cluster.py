"""Sweeps in workers of dask: a crash costs one trial, kills cost nothing, and nobody is left."""

import http.client
import queue
import random
import socket
import ssl
import sys
import threading
import time
from collections import Counter
from typing import Any
from unittest.mock import Mock

import pytest
from distributed import Future, LocalCluster
from helpers import sweep_runs
from helpers.sweep_disk import NoDisks, on_full_disks
from helpers.sweep_processes import MARK, seconds_until_gone, starts_after_kept, victims
from helpers.sweep_runs import driven, driver, killing, statuses
from helpers.sweep_trials import FakeTrial, fake_trials, run, sleepers
from test_sweep_driver import LONG, keys, swept

from asmjax.errors import UseError
from asmjax.sweep import cluster, watched
from asmjax.sweep.cluster import Workers
from asmjax.sweep.driver import SweepProgress, SweepStatus, run_sweep
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.pool import Alone
from asmjax.sweep.results import results
from asmjax.sweep.store import Store
from asmjax.sweep.watched import Limits


def test_a_crash_is_one_trials_and_workers_have_a_cpu_each(tmp_path, monkeypatch):
    """Two workers, a trial that ends its process among twelve: the others are done, each worker
    keeps to one CPU, and all processes are gone afterwards."""
    monkeypatch.setenv(MARK, str(tmp_path))
    trials = fake_trials(6) + fake_trials(1, do="segv") + fake_trials(6, first=6, arrays=True)
    found, told = swept(tmp_path, trials, workers=2)
    assert found.status == SweepStatus.COMPLETE and not found.left
    assert set(found.done) == {*keys(trials)} - {trials[6].key}
    assert "SIGSEGV" in found.failed[trials[6].key]
    rows = [row for row in results(tmp_path).stored if row.status == "done"]
    assert all(len(row.record["cpus"]) == 1 for row in rows)
    assert max(now.workers for now in told) == 2 and told[-1].running == 0
    assert seconds_until_gone(str(tmp_path)) < 10


def carried_out(pool: Workers, trials: list[FakeTrial]) -> dict[str, Ended]:
    """How each of them ended."""
    for trial in trials:
        pool.start(trial)
    found = {}
    while pool.running:
        if (one := pool.next()) is not None:
            found[one[0].key] = one[1]
    return found


def test_workers_that_cannot_run_trials_are_sent_away(caplog):
    """One of two cannot start processes: the other does all. Where it cannot either, though it
    raises what a lost connection would, that is told, and nothing is tried for ever."""

    def no_pipe() -> None:
        watched.Pipe = full  # type: ignore[assignment]

    def full():
        raise OSError(24, "Too many open files")

    trials = fake_trials(8)
    with Workers(run, Limits(LONG), 2) as pool:
        client: Any = pool._client
        client.wait_for_workers(2, timeout=LONG)
        assert refused_without_certificate(client.scheduler.address)
        assert nothing_is_served(client.cluster.scheduler.http_server.port)
        first, second = client.nthreads()
        client.run(lambda: setattr(sys, "executable", "/bin/false"), workers=[first])
        found = carried_out(pool, trials)
        assert set(found) == set(keys(trials))
        assert all(one.status == "done" and one.attempts == 1 for one in found.values())
        assert [*client.nthreads()] == [second]
        assert f"worker {first} cannot run trials, which others get now (CannotRun: " in caplog.text
        client.run(no_pipe, workers=[second])
        client.run(lambda: watched._all[0]._end(), workers=[second])
        with pytest.raises(Alone, match="no worker is left .*OSError.*Too many open files.*same"):
            carried_out(pool, trials[:1])


def refused_without_certificate(address: str) -> bool:
    """Whether a scheduler hangs up on somebody of this machine who has none."""
    host, _, port = address.removeprefix("tls://").partition(":")
    stranger = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    stranger.check_hostname, stranger.verify_mode = False, ssl.CERT_NONE
    with socket.create_connection((host, int(port))) as plain:
        try:
            with stranger.wrap_socket(plain) as connection:
                return not connection.recv(1)
        except (ssl.SSLError, ConnectionError):
            return True


def nothing_is_served(port: int) -> bool:
    """Whether all pages of a server are missing."""
    answers = set()
    for page in ("/", "/health", "/info/main/workers.html", "/json/identity.json", "/metrics"):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        connection.request("GET", page)
        answers.add(connection.getresponse().status)
        connection.close()
    return answers == {404}


@pytest.mark.parametrize(("losses", "status"), [(0, "done"), (4, "done"), (99, "crashed")])
def test_an_answer_that_is_lost_again_and_again_is_not_waited_for_ever(losses, status):
    (trial,) = fake_trials(1)
    pool = Workers.__new__(Workers)
    pool._ended, pool._rounds = queue.SimpleQueue(), Counter()
    pool._raise_if_interrupted = lambda: None
    future = Mock(spec=Future, key="k", status="finished")
    future.cancelled.return_value = False
    future.result.side_effect = [TimeoutError] * losses + [Ended(End.DONE, trial=trial.key)]
    future.add_done_callback.side_effect = lambda call: call(future)
    pool._running = {"k": (trial, future)}
    pool._ended.put(future)
    found = [one for _ in range(10) if pool.running and (one := pool.next()) is not None]
    assert [(one[0].key, one[1].status) for one in found] == [(trial.key, status)]


@pytest.mark.slow
def test_a_worker_with_threads_mixes_nothing_up(tmp_path):
    """Somebody's worker with three of them: each result is of its own trial."""
    trials = fake_trials(60, do="sleep", seconds=0.02)
    there: Any = LocalCluster(n_workers=1, threads_per_worker=3, dashboard_address="127.0.0.1:0")
    with there:
        found, told = swept(tmp_path, trials, scheduler=there.scheduler_address)
    assert len(found.done) == 60 and max(now.workers for now in told) == 3
    rows = results(tmp_path).stored
    assert {row.record["square"] - row.config["number"] ** 2 for row in rows} == {0}
    assert len({row.machine["process"] for row in rows}) == 3


@pytest.mark.slow
def test_an_interruption_stops_workers_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv(MARK, str(tmp_path))
    trials = fake_trials(2) + fake_trials(4, do="sleep", seconds=LONG)

    interrupted: list[float] = []

    def interrupt(now: SweepProgress) -> None:
        if now.done == 2:
            interrupted.append(time.monotonic())
            raise KeyboardInterrupt

    with Store.open(tmp_path) as store:
        found = run_sweep(
            trials, store, run=run, workers=2, deadline_s=LONG, progress=interrupt
        )  # fmt: skip
    assert time.monotonic() - interrupted[0] < 30
    assert found.status == SweepStatus.INTERRUPTED
    assert (found.done, found.left) == (keys(trials[:2]), keys(trials[2:]))
    assert seconds_until_gone(str(tmp_path)) < 10


@pytest.mark.slow
def test_killed_drivers_leave_nobody_and_lose_nothing(tmp_path, monkeypatch):
    """Three drivers are killed while they sweep: what they told of is there, no process of theirs
    is left after 10 s, the last one completes, and no trial starts after it was kept."""
    monkeypatch.setenv(MARK, str(tmp_path))
    words, kept = driver(tmp_path, 60, 0.1), {}
    for kill_at in (12, 24, 36):
        assert driven(words, kept, kill_at=kill_at) == ""
        assert seconds_until_gone(str(tmp_path)) < 10
        assert {row.key for row in results(tmp_path / "s").stored} >= set(kept)
    assert driven(words, kept) == "complete 0 0"
    assert statuses(tmp_path / "s") == Counter(done=60)
    log = tmp_path / "log"
    assert starts_after_kept(log, sleepers(60, 0.1, str(log)), kept) == 0


@pytest.mark.slow
def test_killed_workers_lose_nothing(tmp_path, monkeypatch):
    """Of a sweep with two workers, workers and processes of trials are killed at random moments."""
    monkeypatch.setenv(MARK, str(tmp_path))
    log, kills = tmp_path / "log", Counter()
    trials = sleepers(200, 0.1, str(log))
    kept: dict[str, float] = {}
    with killing(tmp_path, kills, 8, random.Random(1)):
        found = sweep_runs.swept(tmp_path / "s", trials, kept)
    assert found.status == SweepStatus.COMPLETE and set(found.done) == set(keys(trials))
    assert min(kills["trial"], kills["worker"]) >= 2
    assert starts_after_kept(log, trials, kept) == 0


def test_workers_that_are_killed_as_they_start_are_started_again(tmp_path, monkeypatch):
    """The first eight, which are hardly processes yet: dask gives up each of them."""
    monkeypatch.setenv(MARK, str(tmp_path))
    killed, over = set(), threading.Event()

    def kill() -> None:
        while len(killed) < 8 and not over.wait(0.02):
            for worker in victims(str(tmp_path))["worker"]:
                if worker.pid not in killed and len(killed) < 8:
                    worker.kill()
                    killed.add(worker.pid)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        trials = sleepers(6, 0.1, str(tmp_path / "log"))
        found = sweep_runs.swept(tmp_path / "s", trials, alone_s=60.0)
    finally:
        over.set()
        killer.join()
    assert len(killed) == 8 and found.status == SweepStatus.COMPLETE
    assert statuses(tmp_path / "s") == Counter(done=6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("do", "status"),
    [("abort", "crashed"), ("segv", "crashed"), ("hog", "out of memory"), ("endless", "timeout")],
)
def test_a_poison_costs_only_itself(tmp_path, do, status):
    """40 trials, one of which ends as badly as it can."""
    trials = fake_trials(39) + fake_trials(1, do=do)
    # Elsewhere the deadline must not come first on a busy machine.
    deadline = 3.0 if do == "endless" else LONG
    found, _ = swept(tmp_path, trials, workers=2, deadline_s=deadline, memory_bytes=2**29)
    assert set(found.done) == set(keys(trials[:39])) and list(found.failed) == [trials[39].key]
    (bad,) = (row for row in results(tmp_path).stored if row.status != "done")
    assert bad.status == status and bad.seconds < deadline + 10


@pytest.mark.slow
def test_a_disk_of_any_size_that_gets_full_loses_nothing(tmp_path):
    """Every place where a sweep writes is one where some of these disks are full."""
    try:
        disks = on_full_disks(tmp_path)
    except NoDisks as problem:
        pytest.skip(f"disks cannot be mounted: {problem}")
    full = [one["told"] for one in disks if one["told"] is not None]
    assert len(full) > 20
    assert all(f"cannot write '{tmp_path}/sweep" in told for told in full)
    assert {one["lost"] for one in disks} == {one["left"] for one in disks} == {0}


def test_a_scheduler_that_does_not_answer_is_told(tmp_path, monkeypatch):
    """Nothing is kept, and the store can be opened again."""
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(
            UseError, match=f"no scheduler answers at '{address}' .* dask scheduler"
        ):
            swept(tmp_path, fake_trials(1), scheduler=address)
    assert len(results(tmp_path)) == 0
