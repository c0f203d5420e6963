"""Files of results: whole or not at all, and what cannot be written is told in one line."""

import contextlib
import errno
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from asmjax.errors import UseError
from asmjax.paths import atomic_file

Writer = Callable[[BinaryIO], object]
"""Writes the content of a file into it."""

_REMEDIES = {
    errno.ENOSPC: "make room there",
    errno.EDQUOT: "make room there",
    errno.EROFS: "make it writable",
    errno.EACCES: "make it writable",
    errno.EPERM: "make it writable",
}


class WriteError(UseError):
    """A file cannot be written; the message names it, and says what to do."""


@contextlib.contextmanager
def written(path: str | os.PathLike, instead: str = "choose another --out") -> Iterator[None]:
    """Whatever ends a write inside becomes a `WriteError` that names `path`.

    Args:
        instead: what else can be done than to make room.
    """
    try:
        yield
    except OSError as problem:
        raise WriteError(f"cannot write '{path}' {why(problem, instead)}") from problem


def why(problem: OSError, instead: str = "choose another --out") -> str:
    """What stopped a write, and what to do: the end of a message."""
    remedy = _REMEDIES.get(problem.errno or 0)
    either = f"{remedy}, or {instead}" if remedy else instead
    return f"({problem.strerror or problem}); {either}."


def write_file(path: str | os.PathLike, write: Writer) -> None:
    """Replace the file at `path`, whole or not at all, even by a power cut.

    Raises:
        WriteError: it cannot be written.
    """
    with written(path), atomic_file(path) as file:
        write(file)


def write_files(folder: str | os.PathLike, files: Mapping[str, Writer]) -> list[Path]:
    """Write files by name into a folder that exists, and return their paths. Raises `WriteError` as
    `write_file`."""
    paths = [Path(folder) / name for name in files]
    for path, write in zip(paths, files.values(), strict=True):
        write_file(path, write)
    return paths


def text_writer(make: Callable[[], str]) -> Writer:
    """Writes a text, made when it is wanted, as UTF-8."""
    return lambda file: file.write(make().encode())
