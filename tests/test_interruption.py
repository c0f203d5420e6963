"""Ctrl-C: it waits where it may, and whenever it comes in a sweep one line is all that is told."""

import math
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time

import pytest
from helpers.sweep_processes import MARK, seconds_until_gone

from asmjax import cli
from asmjax.interruption import interruption_waits
from asmjax.sweep.store import stored_rows

SWEEP = """
[trial]
scene = "letter_f"
algorithm = "uniform"
size = [16, 16]
repeats = 1
[grid]
seed = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19]
settings.resolution = [8, 16, 32, 64]
"""


@pytest.fixture
def heard():
    """An interruption is heard here, whoever runs these tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interruption_waits_until_it_is_asked_for(heard):
    reached = []
    with pytest.raises(KeyboardInterrupt), interruption_waits() as raise_if_heard:
        raise_if_heard()
        signal.raise_signal(signal.SIGINT)
        reached.append("after it")
        raise_if_heard()
        reached.append("never")
    assert reached == ["after it"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interruption_comes_at_the_end_and_a_second_one_at_once(heard):
    reached = []
    with pytest.raises(KeyboardInterrupt), interruption_waits():
        signal.raise_signal(signal.SIGINT)
        reached.append("after the first")
    with pytest.raises(KeyboardInterrupt), interruption_waits():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        reached.append("never")
    with pytest.raises(ValueError, match="its own"), interruption_waits():
        signal.raise_signal(signal.SIGINT)
        raise ValueError("its own")
    assert reached == ["after the first"]


def test_an_interruption_that_a_library_lost_is_not_lost(heard, capfd):
    """As those are that come in a destructor, or in a callback of the garbage collector."""

    class Library:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    reached = []
    with pytest.raises(KeyboardInterrupt), interruption_waits(0) as raise_if_heard:
        Library()
        reached.append("after it")
        raise_if_heard()
        reached.append("never")
    assert reached == ["after it"] and capfd.readouterr().err == ""


def test_an_interruption_that_is_ignored_stays_so(heard):
    """As of a job in the background."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interruption_waits() as raise_if_heard:
        signal.raise_signal(signal.SIGINT)
        raise_if_heard()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_a_command_that_is_interrupted_while_it_is_loaded_says_so(heard, monkeypatch, capsys):
    """Nothing of it is called, and no library sees the interruption."""
    loading, loaded = cli.load, []

    def load(reference: str):
        if not reference.endswith("print_scenes"):
            return loading(reference)
        signal.raise_signal(signal.SIGINT)
        loaded.append(reference)
        return loaded.append

    monkeypatch.setattr(cli, "load", load)
    assert cli.main(["scenes"]) == 130
    assert loaded == ["asmjax.cli.scenes:print_scenes"]
    assert capsys.readouterr().err == "asmjax: interrupted\n"


AT_TERMINAL = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
"""A command that becomes another one, after its input has become what Ctrl-C is typed at."""


def interrupted(words: list[str], seconds: float) -> tuple[int, list[str]]:
    """Exit code and lines of a command at a terminal, where Ctrl-C is typed so many seconds after
    its first line; at `inf` it is not."""
    terminal, end = pty.openpty()
    # A fork here would copy the threads of JAX, where another test has started some.
    process = subprocess.Popen(
        [sys.executable, "-c", AT_TERMINAL, *words], stdin=end, stdout=end, stderr=end,
        start_new_session=True,
    )  # fmt: skip
    os.close(end)
    said, due = b"", None
    while True:
        if select.select([terminal], [], [], 0.05)[0]:
            try:
                said += os.read(terminal, 1 << 16)
            except OSError:
                break
        if due is None and b"\n" in said:
            due = time.monotonic() + seconds
        if due is not None and time.monotonic() > due:
            os.write(terminal, b"\x03")
            due = float("inf")
    code = process.wait()
    os.close(terminal)
    # A bar is drawn over itself.
    lines = [re.sub(r".*\r", "", line) for line in said.decode().replace("\r\n", "\n").split("\n")]
    return code, [line for line in lines if line.strip()]


@pytest.mark.slow
@pytest.mark.mitsuba
@pytest.mark.parametrize("workers", ["2", "0"])
def test_an_interruption_of_a_sweep_is_one_line_whenever_it_comes(workers, tmp_path, monkeypatch):
    """While workers are started, while they load, and while trials run: no traceback and no log of
    a library; what is finished is kept, and the next run does the rest alone."""
    monkeypatch.setenv(MARK, str(tmp_path))
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text(SWEEP, encoding="utf-8")
    words = [sys.executable, "-m", "asmjax", "sweep", str(file), "--workers", workers]
    words += ["--out", str(out)]
    kept: set[str] = set()
    for seconds in (0.0, 1.0, 2.0, 4.0, 8.0, 12.0, math.inf):
        code, lines = interrupted(words, seconds)
        rows = stored_rows(out) if out.exists() else []
        if code == 0:
            break
        assert code == 130 and len(lines) == 2, lines
        assert lines[0].startswith("sweep mine: 80 trials, "), lines
        told = re.search(r"asmjax: interrupted(; (\d+) trials are left; .*)?$", lines[1])
        assert told is not None, lines
        assert told[2] is None or int(told[2]) == 80 - len(rows)
        assert kept <= {row.key for row in rows} and all(row.attempts == 1 for row in rows)
        kept = {row.key for row in rows}
        assert seconds_until_gone(str(tmp_path), 20) < 20
    assert code == 0 and len(rows) == 80
