"""What a sweep keeps is whole, there when `add` returns, and readable whatever happens next."""

import errno
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.sweep_trials import FakeOutcome, fake_trials, outcome

from asmjax.errors import UseError
from asmjax.sweep import store as module
from asmjax.sweep.ended import End, Ended, attempt
from asmjax.sweep.results import results
from asmjax.sweep.store import BASE, Store, StoreError, journal_of, stored_rows

KEYS = [trial.key for trial in fake_trials(8)]


def ended(number: int) -> Ended:
    """How trial `number` ends."""
    return attempt(outcome, {"number": number})


def filled(folder: Path, count: int) -> None:
    """Keep the first trials."""
    with Store.open(folder) as store:
        for number in range(count):
            store.add(KEYS[number], {"number": number, "view": "ab"[number % 2]}, ended(number))


def test_what_is_added_is_there(tmp_path):
    with Store.open(tmp_path / "new" / "sweep") as store:
        store.add(KEYS[3], {"number": 3}, ended(3))
        # Another reader, while the writer is open.
        (row,) = stored_rows(store.folder)
        assert len(store) == 1
    assert (row.key, row.status, row.attempts, row.error) == (KEYS[3], "done", 1, "")
    assert row.record == {"error": {"wrong": 0.75}, "ratio": float("inf"), "name": "no. 3"}
    assert row.config == {"number": 3}
    assert row.versions["numpy"] == np.__version__ and row.machine["process"] == os.getpid()
    assert 0 <= row.seconds < 10 and abs(row.started - time.time()) < 60
    found = results(tmp_path / "new" / "sweep")
    assert found.arrays(KEYS[3])["lit"].tolist() == [[3, 3, 3], [3, 3, 3]]
    names = sorted(path.name for path in store.folder.iterdir())
    assert names == ["arrays", "sweep.lock", BASE], "a closed store is one plain file"
    assert row.arrays is not None
    row.arrays.write_bytes(row.arrays.read_bytes()[:-30])
    with pytest.raises(UseError, match="cannot read .*npz.*restore it"):
        found.arrays(KEYS[3])


def test_what_is_done_stays_and_what_is_not_may_be_tried_again(tmp_path):
    crash = Ended(End.CRASHED, error="its process ended by SIGSEGV", attempts=3)
    with Store.open(tmp_path) as store:
        store.add(KEYS[0], {"number": 0}, crash)
        assert store.causes() == {KEYS[0]: "its process ended by SIGSEGV"}
        store.add(KEYS[0], {"number": 0}, ended(0))
        store.add(KEYS[0], {"number": 0}, crash)
        assert store.statuses() == {KEYS[0]: "done"} and store.causes() == {}
    (row,) = stored_rows(tmp_path)
    assert row.attempts == 4 and row.error == "" and row.record["name"] == "no. 0"


def test_one_process_writes(tmp_path):
    with Store.open(tmp_path):
        with pytest.raises(UseError, match="another sweep writes to .* choose another --out"):
            Store.open(tmp_path)
    with Store.open(tmp_path) as store:
        assert store.statuses() == {}


def test_only_keys_become_names_of_files(tmp_path):
    with Store.open(tmp_path) as store, pytest.raises(UseError, match="is no key of a trial"):
        store.add("../../outside", {}, ended(1))


def test_something_else_in_its_place_is_told(tmp_path):
    (tmp_path / BASE).write_bytes(b"no database " * 100)
    with pytest.raises(StoreError, match=f"{BASE}.*not a database"):
        Store.open(tmp_path)
    with pytest.raises(UseError, match="cannot read .* not a database"):
        stored_rows(tmp_path)
    # And the lock is free again.
    (tmp_path / BASE).unlink()
    Store.open(tmp_path).close()


@pytest.mark.parametrize("journal", [None, "WAL", "DELETE"])
def test_a_process_that_ended_before_its_table_leaves_no_rows(tmp_path, journal):
    """The file is there before its table and version are: an empty one, or one with a header."""
    begun = sqlite3.connect(tmp_path / BASE)
    begun.execute("PRAGMA user_version")
    if journal:
        begun.execute(f"PRAGMA journal_mode = {journal}")
    begun.close()
    assert (tmp_path / BASE).exists() and stored_rows(tmp_path) == []
    filled(tmp_path, 2)
    assert len(stored_rows(tmp_path)) == 2


def test_another_version_is_told(tmp_path):
    filled(tmp_path, 1)
    with sqlite3.connect(tmp_path / BASE) as base:
        base.execute("PRAGMA user_version = 7")
    base.close()
    for call in (Store.open, stored_rows):
        with pytest.raises(UseError, match="is of version 7; this asmjax reads version 1"):
            call(tmp_path)


def test_a_folder_without_sweep_is_told(tmp_path):
    with pytest.raises(UseError, match="holds no sweep .* run one with `asmjax sweep`"):
        results(tmp_path)


def test_network_file_systems_get_no_shared_log(tmp_path):
    """Rationale: a write-ahead log needs memory that all readers share; the mount with the longest
    name above the folder counts, and of two on one place the later."""
    mounts = tmp_path / "mountinfo"
    mounts.write_text(
        "21 1 8:1 / / rw - ext4 /dev/sda1 rw\n"
        f"22 21 0:40 / {tmp_path} rw,relatime shared:5 - nfs4 server:/home rw\n"
        f"23 22 8:2 / {tmp_path}/a\\040disk rw - xfs /dev/sdb1 rw\n"
        f"24 23 8:3 / {tmp_path}/over rw - xfs /dev/sdb2 rw\n"
        f"25 24 0:41 / {tmp_path}/over rw - fuse.sshfs host:/ rw\n"
    )
    assert journal_of(tmp_path / "sweep", mounts) == "DELETE"
    assert journal_of(tmp_path / "a disk" / "sweep", mounts) == "WAL"
    assert journal_of(tmp_path / "over", mounts) == "DELETE"
    assert journal_of(Path("/nowhere"), mounts) == "WAL"
    assert journal_of(tmp_path, tmp_path / "absent") == "DELETE"


def test_a_store_without_log_keeps_as_much(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "journal_of", lambda folder: "DELETE")
    filled(tmp_path, 3)
    assert [row.config["number"] for row in stored_rows(tmp_path)] == [0, 1, 2]


def full_disk(*_, **__):
    """What writing on a full disk does."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


SITES = {
    "folder": (Path, "mkdir", "arrays|sweep"),
    "lock": (Path, "open", "sweep.lock"),
    "arrays": (os, "fsync", r"arrays/\w+\.npz"),
    "rename": (os, "replace", r"arrays/\w+\.npz"),
}


@pytest.mark.parametrize("site", SITES)
def test_a_full_disk_is_told_with_the_path_and_loses_nothing(tmp_path, monkeypatch, site):
    """Expected: one line that names what cannot be written, rows of before readable, and the same
    calls again go on."""
    filled(tmp_path / "sweep", 2)
    owner, name, where = SITES[site]
    with monkeypatch.context() as patch:
        if site in ("folder", "lock"):
            patch.setattr(owner, name, full_disk)
            with pytest.raises(StoreError, match=f"cannot write '.*({where})' .No space left"):
                Store.open(tmp_path / "sweep")
        else:
            with Store.open(tmp_path / "sweep") as store:
                patch.setattr(owner, name, full_disk)
                with pytest.raises(StoreError, match=f"cannot write '.*({where})' .No space left"):
                    store.add(KEYS[2], {"number": 2}, ended(2))
    assert {row.key for row in stored_rows(tmp_path / "sweep")} == set(KEYS[:2])
    filled(tmp_path / "sweep", 4)
    assert {row.key for row in stored_rows(tmp_path / "sweep")} == set(KEYS[:4])
    leftovers = list((tmp_path / "sweep" / "arrays").glob(".*"))
    assert leftovers == []


def test_a_full_database_is_told_with_the_path_and_loses_nothing(tmp_path):
    filled(tmp_path, 2)
    long = Ended(End.FAILED, error="x", details="y" * 10**6)
    with Store.open(tmp_path) as store:
        store._base.execute("PRAGMA max_page_count = 8")
        with pytest.raises(StoreError, match=f"cannot write '.*{BASE}' .database or disk is full"):
            store.add(KEYS[2], {}, long)
        assert set(store.statuses()) == set(KEYS[:2])
        store._base.execute("PRAGMA max_page_count = 1000000")
        store.add(KEYS[2], {}, long)
    assert {row.key for row in stored_rows(tmp_path)} == set(KEYS[:3])


ADDS = """
import sys
from helpers.sweep_trials import fake_trials, run
from asmjax.sweep.ended import attempt
from asmjax.sweep.store import Store
with Store.open(sys.argv[1]) as store:
    for trial in fake_trials(1000, first=int(sys.argv[2]), arrays=True):
        store.add(trial.key, trial.config, attempt(run, trial.config))
        print(trial.config["number"], flush=True)
"""


def test_killing_the_writer_loses_nothing_that_was_added(tmp_path, monkeypatch):
    """A writer is killed at four moments; each time every row that it told of is there, with its
    arrays, and the next one goes on."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    told = 0
    for round in range(4):
        command = [sys.executable, "-c", ADDS, str(tmp_path), str(told)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for line in process.stdout:
                told = int(line) + 1
                if told % 17 == 3 + round:
                    process.send_signal(signal.SIGKILL)
        rows = stored_rows(tmp_path)
        numbers = {row.config["number"] for row in rows}
        assert numbers >= set(range(told))
        assert all(row.arrays is not None and row.arrays.exists() for row in rows)
        told = len(numbers)
    with Store.open(tmp_path) as store:
        assert store._base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert list((tmp_path / "arrays").glob(".*")) == []


def test_a_record_that_json_has_no_word_for_is_a_failure():
    made = attempt(lambda config: FakeOutcome({"made": {1, 2}}, {}), {})
    assert made.status == End.FAILED and "its record holds a set" in made.error
    made = attempt(lambda config: FakeOutcome({}, {"a": np.array([None])}), {})
    assert made.status == End.FAILED and "object" in made.error.lower()
