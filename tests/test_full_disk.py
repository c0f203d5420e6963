"""Disks that are full and folders that are read-only: one line, and nothing computed is lost."""

import contextlib
import errno
import io
import json
import os
import resource
from pathlib import Path

import numpy as np
import pytest
from helpers.figures import run_pictures
from helpers.page_folders import report_of
from tqdm import tqdm

from asmjax import cli
from asmjax.delivery import deliver
from asmjax.report.figures import figure_files, save
from asmjax.report.figures.seen import seen_files
from asmjax.report.outputs import Outputs
from asmjax.report.schema import RUN_SCHEMA
from asmjax.report.table import write_csv
from asmjax.writing import WriteError, write_file


@pytest.fixture
def full(monkeypatch):
    """Makes the disk full for files whose names contain one of some words."""

    def begin(*words: str, number: int = errno.ENOSPC) -> None:
        def fsync(descriptor):
            name = Path(os.readlink(f"/proc/self/fd/{descriptor}")).name
            if any(word in name for word in words):
                raise OSError(number, os.strerror(number))

        monkeypatch.setattr("os.fsync", fsync)

    return begin


@contextlib.contextmanager
def no_file_above(size: int):
    """Writes beyond that many bytes fail, in the middle of a file, as on a disk that fills up."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def files_of(pictures) -> dict:
    noise = np.random.default_rng(0).random((64, 64))
    return {
        "arrays.npz": lambda file: np.savez_compressed(file, noise=noise),
        **seen_files(pictures),
        "shadows.png": figure_files(pictures)["shadows.png"],
    }


def test_a_file_that_does_not_fit_leaves_nothing(tmp_path):
    """Arrays and pictures, cut off by the kernel at their hundredth byte."""
    for name, write in files_of(run_pictures()).items():
        (tmp_path / name).write_bytes(b"before")
        with no_file_above(100), pytest.raises(WriteError, match=f"{name}.*File too large"):
            write_file(tmp_path / name, write)
        assert (tmp_path / name).read_bytes() == b"before"
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.ENOSPC, "make room there, or choose another --out"),
        (errno.EROFS, "make it writable, or choose another --out"),
        (errno.EACCES, "make it writable, or choose another --out"),
        (errno.EIO, r"\); choose another --out"),
    ],
)
def test_the_line_says_what_to_do(number, remedy, tmp_path, full):
    full("methods.csv", "a.png", number=number)
    for write in (
        lambda: write_csv(tmp_path / "methods.csv", []),
        lambda: save(_figure(), tmp_path / "a.png"),
    ):
        with pytest.raises(WriteError, match=f"cannot write .*{os.strerror(number)}.*{remedy}"):
            write()
    assert list(tmp_path.iterdir()) == []


def _figure():
    from matplotlib.figure import Figure

    return Figure(figsize=(1, 1))


def test_what_fits_is_written_and_one_line_tells_of_the_rest(tmp_path, full):
    """Two of the files do not fit: the others are there, and so is the report that lists them."""
    full("arrays.npz", "seen_truth")
    outputs = Outputs(tmp_path, "run")
    outputs.keep(report_of(RUN_SCHEMA))
    files = files_of(run_pictures())
    outputs.add(files)
    with pytest.raises(WriteError) as told:
        outputs.finish()
    line = str(told.value)
    assert line.startswith(f"cannot write '{tmp_path}/arrays.npz' (No space left on device); make")
    assert "1 more could not be written. report.json and whatever else" in line
    there = {path.name for path in tmp_path.iterdir()}
    assert there == {"report.json", *files} - {"arrays.npz", "seen_truth.png"}
    assert set(files) == set(json.loads((tmp_path / "report.json").read_text())["files"])
    # With room again, the same command goes through.
    again = Outputs(tmp_path, "run")
    again.keep(report_of(RUN_SCHEMA))


def test_without_room_for_the_report_the_run_before_stays(tmp_path, full):
    outputs = Outputs(tmp_path, "run")
    outputs.keep(report_of(RUN_SCHEMA))
    outputs.add({"methods.csv": lambda file: file.write(b"old")})
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    full("report.json")
    with pytest.raises(WriteError, match="report.json"):
        Outputs(tmp_path, "plan").keep({"schema": "asmjax/plan/1"})
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("quiet", [False, True])
def test_the_table_is_printed_whatever_becomes_of_the_files(quiet, tmp_path, full, capsys):
    """Before they are written; where nobody asked for it, only if they cannot be."""
    outputs, bar = Outputs(tmp_path, "plan"), tqdm(disable=True)
    deliver("a table", lambda: outputs.keep({}), outputs, bar, quiet=quiet)
    assert ("a table" in capsys.readouterr().out) is not quiet
    full("report.json")
    with pytest.raises(WriteError):
        deliver("a table", lambda: outputs.keep({}), outputs, bar, quiet=quiet)
    assert capsys.readouterr().out == "a table\n"


def test_files_are_written_for_somebody_who_does_not_read_the_table(tmp_path, monkeypatch):
    """As with `| head`: the pipe breaks as the table is printed."""

    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    outputs = Outputs(tmp_path / "out", "plan")
    monkeypatch.setattr("sys.stdout", Gone())
    with pytest.raises(BrokenPipeError):
        deliver("a table", lambda: outputs.keep({}), outputs, tqdm(disable=True), quiet=False)
    assert (tmp_path / "out/report.json").is_file()


@pytest.mark.mitsuba
def test_a_command_on_a_full_disk_prints_what_it_found(tmp_path, full, capsys):
    full("report.json")
    words = ["plan", "letter_f", "--size", "16", "16", "--out", str(tmp_path / "out")]
    assert cli.main(words) == 2
    said = capsys.readouterr()
    assert said.err.splitlines()[-1].startswith("asmjax: error: cannot write '")
    assert "No space left on device" in said.err and "Traceback" not in said.err
    assert "point" in said.out and "report and figure" not in said.out
    assert list((tmp_path / "out").iterdir()) == []
