"""`asmjax sweep`: counts and estimates first, runs what is not finished, reports what happened."""

import json
import sqlite3
from pathlib import Path

import pytest

from asmjax import cli, sweep_job
from asmjax.cli.parse import parse
from asmjax.errors import UseError
from asmjax.options import SweepOptions
from asmjax.report.keys import key_paths
from asmjax.report.provenance import provenance
from asmjax.sweep.driver import SweepResult, SweepStatus
from asmjax.sweep.schema import SWEEP_KEYS
from asmjax.sweep.store import BASE, Store, StoreError, stored_rows
from asmjax.sweep.summary import causes
from asmjax.sweep.trial import Outcome
from asmjax.sweep_job import run_sweep_job

DOCS = Path(__file__).parents[1] / "docs"

TEXT = """
[trial]
scene = "letter_f"
algorithm = "uniform"
size = [16, 16]
[grid]
settings.resolution = [8, 16, 32]
"""


@pytest.fixture
def asked(tmp_path):
    """Options of a sweep of three trials in this process, with results in a scratch folder."""
    file = tmp_path / "mine.toml"
    file.write_text(TEXT, encoding="utf-8")

    def options(**more) -> SweepOptions:
        return SweepOptions(config=str(file), workers=0, out=str(tmp_path / "out"), **more)

    return options


@pytest.fixture
def trials(monkeypatch) -> list[int]:
    """Resolutions of the trials that ran, none of which measures anything; 16 fails."""
    ran: list[int] = []

    def run(config: dict) -> Outcome:
        ran.append(config["settings"]["resolution"])
        if ran[-1] == 16:
            raise UseError("not today")
        return Outcome({"code": "another"})

    monkeypatch.setattr(sweep_job, "run_trial", run)
    return ran


def test_a_sweep_runs_and_goes_on(asked, trials, capsys, caplog, tmp_path):
    """A finished trial is never run again, a failed one where that is asked for; the report follows
    its schema."""
    summary = run_sweep_job(asked())
    assert summary is not None
    assert sorted(trials) == [8, 16, 32] and len(summary.result.done) == 2
    out = capsys.readouterr().out
    assert "sweep mine: 3 trials, 3 to run, about " in out
    assert "3 trials: 2 run in " in out and "1 failed" in out and "UseError: not today" in out
    report = json.loads((tmp_path / "out/report.json").read_text(encoding="utf-8"))
    assert report["status"] == "complete" and report["trials"] == 3 and report["done"] == 2
    assert list(report["failed"].values()) == ["UseError: not today"]
    assert len(stored_rows(tmp_path / "out")) == 3

    again = run_sweep_job(asked())
    assert again is not None and len(again.result.skipped) == 3 and len(trials) == 3
    out = capsys.readouterr().out
    assert "sweep mine: 3 trials, 3 are finished\n" in out and "3 were finished before" in out
    assert "2 of the finished trials were measured by other code" in caplog.text

    run_sweep_job(asked(retry=True))
    assert trials[3:] == [16]


@pytest.mark.parametrize("journal", ["DELETE", "WAL"])
def test_the_command_goes_on_after_one_that_ended_as_it_began(
    asked, trials, tmp_path, capsys, journal
):  # fmt: skip
    """Killed, or out of disk, after it made the file and before that had its table."""
    (tmp_path / "out").mkdir()
    base = sqlite3.connect(tmp_path / "out" / BASE)
    base.execute(f"PRAGMA journal_mode = {journal}")
    base.close()
    words = [asked().config, "--workers", "0", "--out", str(tmp_path / "out")]
    assert cli.main(["sweep", *words]) == 0
    assert len(trials) == 3 and "3 trials: 2 run in" in capsys.readouterr().out


def test_trials_of_other_libraries_are_told(asked, trials, caplog, monkeypatch):
    run_sweep_job(asked())
    caplog.clear()
    here = provenance("")["versions"]
    other = {"versions": here | {"jax": "9.9", "python": "4.0"}, "machine": {}}
    monkeypatch.setattr(sweep_job, "provenance", lambda variant: other)
    run_sweep_job(asked(count=True))
    told = f"2 of the finished trials were measured with other libraries (jax {here['jax']} there "
    assert told + "and 9.9 here); choose another --out" in caplog.text


def test_counting_runs_and_writes_nothing(asked, trials, capsys, tmp_path):
    assert run_sweep_job(asked(count=True)) is None
    assert "3 trials, 3 to run, about " in capsys.readouterr().out
    assert not trials and not (tmp_path / "out").exists()


def test_quiet_says_nothing(asked, trials, capsys):
    run_sweep_job(asked(quiet=True))
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("status", "raised", "said"),
    [
        (SweepStatus.INTERRUPTED, KeyboardInterrupt, "2 trials are left; .*goes on from there"),
        (SweepStatus.LOST, UseError, "the scheduler was lost, 2 trials are left; .*goes on"),
        (SweepStatus.ALONE, UseError, "nobody is there, 2 trials are left; .*goes on"),
    ],
)
def test_what_is_left_is_told(status, raised, said, asked, monkeypatch, tmp_path):
    """After the report was written."""
    cause = "nobody is there" if status is SweepStatus.ALONE else ""
    result = SweepResult(status, done=("a" * 32,), left=("b" * 32, "c" * 32), cause=cause)
    monkeypatch.setattr(sweep_job, "run_sweep", lambda *args, **named: result)
    with pytest.raises(raised, match=said):
        run_sweep_job(asked(quiet=True))
    assert json.loads((tmp_path / "out/report.json").read_text())["left"] == 2


def test_a_sweep_that_fails_is_not_said_to_run(asked, trials, monkeypatch, tmp_path):
    """An error that no trial is to blame for: the report counts what was kept, and says why."""
    add, kept = Store.add, []

    def full(*row, **named):
        if kept:
            raise StoreError("the disk is full")
        kept.append(add(*row, **named))

    monkeypatch.setattr(Store, "add", full)
    with pytest.raises(UseError, match="the disk is full"):
        run_sweep_job(asked(quiet=True))
    report = json.loads((tmp_path / "out/report.json").read_text(encoding="utf-8"))
    assert report["status"] == "failed" and report["cause"] == "the disk is full"
    assert report["done"] == 1 and report["left"] == 2 and not report["skipped"]


def test_many_failures_are_told_by_their_causes():
    """The most frequent first, each with a trial that has it."""
    failed = {f"{k:032x}": f"cause {k % 7}" for k in range(20)}
    lines = causes(failed)
    assert lines[0] == f"failed, 3 times: cause 0 (such as {0:032x})" and len(lines) == 6
    assert lines[-1] == "failed for 2 other causes: see report.json"
    assert causes({}) == []


def test_options():
    """Every one arrives; where trials run is said once; a file must be named."""
    words: str = (
        "sweep a.toml --smoke --count --trust-scene --workers 2 --variant scalar_rgb --out there "
        "--retry --quiet --max-memory 900 --wait-minutes 3"
    )
    wanted = SweepOptions(
        config="a.toml", smoke=True, count=True, trust_scene=True, workers=2, variant="scalar_rgb",
        out="there", retry=True, quiet=True, max_memory_mb=900.0, wait_minutes=3.0,
    )  # fmt: skip
    assert parse([*words.split()], cli.COMMANDS) == ("sweep", wanted)
    there = parse(["sweep", "a.toml", "--scheduler", "tls://a:1"], cli.COMMANDS)[1]
    assert there.scheduler == "tls://a:1" and there.workers is None
    for words, said in (
        ("sweep", "name a sweep file"),
        ("sweep a.toml --workers -1", "--workers is -1; allowed"),
        ("sweep a.toml --max-memory 0", "--max-memory is 0.0; allowed"),
        ("sweep a.toml --wait-minutes -1", "--wait-minutes is -1.0; allowed"),
        ("sweep a.toml --workers 1 --scheduler x:1", "--scheduler and --workers both say where"),
        ("sweep a.toml --scheduler x:1 --scheduler-file f", "both say where trials run"),
    ):
        with pytest.raises(UseError, match=said):
            parse([*words.split()], cli.COMMANDS)


def test_the_page_explains_every_key_of_the_report():
    page = (DOCS / "sweeps.md").read_text(encoding="utf-8").partition("`report.json`")[2]
    for path, _ in key_paths(SWEEP_KEYS):
        assert f"`{path}`" in page, path
