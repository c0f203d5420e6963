"""The process that carries out trials, one after the other: what ends it ends nobody else.

`python -m asmjax.sweep.child DESCRIPTOR PARENT` reads keys of trials, each with a pickled function
and a configuration, from the connection with that file descriptor, and answers each by an `Ended`.
What a trial leaves warm, as compiled code and a loaded scene, the next one finds. The other end is
`asmjax.sweep.watched`.
"""

import contextlib
import ctypes
import os
import pickle
import resource
import signal
import sys
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

from asmjax.machine import keep_freed_memory
from asmjax.sweep.ended import attempt

_SET_PARENT_DEATH_SIGNAL = 1
"""Of prctl(2)."""


def main(descriptor: int, parent: int) -> None:
    """Answer until the other end is closed."""
    end_with(parent)
    # A program that a trial starts must not hold the line open.
    os.set_inheritable(descriptor, False)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Where memory runs out, this process goes first, and neither its parent nor the driver.
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000")
    keep_freed_memory()
    line, functions = Connection(descriptor), {}
    line.send("ready")
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            key, pickled, config = line.recv()
            ended = attempt(lambda of, run=pickled: _function(functions, run)(of), config)
            line.send(replace(ended, trial=key))


def end_with(parent: int) -> None:
    """Let the system end this process when its parent ends, whatever it is doing then."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)  # it ended before


def _function(known: dict, pickled: bytes):
    """Unpickled once; inside of an attempt, as importing it may fail or never end."""
    if pickled not in known:
        known[pickled] = pickle.loads(pickled)
    return known[pickled]


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
