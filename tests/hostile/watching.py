"""Which files this process opens: an audit hook of Python, which sees every `open`."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_watchers: list[list[str]] = []


def _hear(event: str, arguments: tuple) -> None:
    # A hook stays for the life of the process.
    if _watchers and event == "open" and isinstance(arguments[0], str | bytes):
        for opened in _watchers:
            opened.append(os.path.abspath(os.fsdecode(arguments[0])))


sys.addaudithook(_hear)


@contextmanager
def opened_files() -> Iterator[list[str]]:
    """The paths that are opened within."""
    opened: list[str] = []
    _watchers.append(opened)
    try:
        yield opened
    finally:
        _watchers.remove(opened)
