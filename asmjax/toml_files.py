"""TOML files, read with one line for whatever is wrong with them."""

import os
import tomllib
from pathlib import Path
from typing import Any

from asmjax.errors import UseError, file_errors, require

LARGEST_FILE = 2**20
"""Bytes of the largest file that is read."""


def read_toml(path: str | os.PathLike, kind: str) -> dict[str, Any]:
    """What a TOML file holds.

    Args:
        kind: what it should be, for messages: "settings file".

    Raises:
        UseError: it cannot be read, is too large, not in UTF-8, or no TOML (with the line); the
            message names the file.
    """
    text = _text_of(Path(path), kind)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        last = len(text.splitlines())
        said = str(problem).replace("(at end of document)", f"(at the end, line {last})")
        raise UseError(f"{kind} '{path}' is no TOML: {said}; mend it there.") from problem
    except (ValueError, RecursionError) as problem:
        raise UseError(
            f"{kind} '{path}' has a number too long or brackets too deep to read; mend it."
        ) from problem


def _text_of(path: Path, kind: str) -> str:
    with (
        file_errors(f"cannot read the {kind} '{str(path)[:80]}'", "name another"),
        path.open("rb") as file,
    ):
        data = file.read(LARGEST_FILE + 1)
    require(
        len(data) <= LARGEST_FILE,
        f"'{path}' is larger than {LARGEST_FILE} bytes; that is no {kind}.",
    )
    try:
        # Some editors begin a file with a byte-order mark.
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = data[: problem.start].count(b"\n") + 1
        raise UseError(
            f"{kind} '{path}' is not in UTF-8 (line {line}); save it as UTF-8 text."
        ) from problem
