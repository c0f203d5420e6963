"""`python -m asmjax` is the `asmjax` command."""

import signal
import sys

from asmjax.cli import main


def run() -> int:
    """The command, which nothing interrupts any more once it has told how it ended: while Python
    shuts down, Ctrl-C would end a process that is done as if it were not."""
    code = main()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return code


if __name__ == "__main__":
    sys.exit(run())
