"""The two kinds of error: wrong use raises, trouble at run time is a status in the result."""

import contextlib
import difflib
from collections.abc import Iterable, Iterator
from typing import Any, get_args


class UseError(ValueError):
    """Wrong use: one line that says what is wrong, what is allowed, and what to do.

    Line breaks become spaces, and what cannot be printed its escape: messages quote files and words
    of any origin, and end in terminals.
    """

    def __init__(self, message: str):
        super().__init__(
            "".join(
                char if char.isprintable() else " " if char.isspace() else ascii(char)[1:-1]
                for char in message
            )
        )


def unknown_name(kind: str, got: object, allowed: Iterable[str], remedy: str = "") -> UseError:
    """A `UseError` for a name that is not in a list, with the nearest allowed name suggested."""
    names = sorted(allowed)
    near = difflib.get_close_matches(str(got), names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    known = ", ".join(names) if names else "none here"
    return UseError(f"unknown {kind} '{got}'; known: {known}.{hint} {remedy}".rstrip())


def check_choice(kind: str, got: object, choices: Any) -> None:
    """Raise what `unknown_name` says unless `got` is one of `choices`, a `Literal`."""
    names = get_args(choices)
    if got not in names:
        raise unknown_name(kind, got, names)


def missing_extra(module: str, extra: str) -> UseError:
    """A `UseError` for a library that is not here, which an extra of asmjax installs."""
    return UseError(
        f"this needs {module}, which is not installed; in the project's folder `make extras "
        f"EXTRA={extra}` installs it, or, in an environment of your own, pip install '.[{extra}]'."
    )


def require(condition: bool, message: str) -> None:
    """Raise `UseError(message)` unless `condition` holds."""
    if not condition:
        raise UseError(message)


@contextlib.contextmanager
def file_errors(failed: str, remedy: str) -> Iterator[None]:
    """An `OSError` inside becomes a `UseError`: what failed, the system's reason, the remedy. So
    does a path that cannot be the name of a file."""
    try:
        yield
    except OSError as problem:
        raise UseError(f"{failed} ({problem.strerror or problem}); {remedy}.") from problem
    except ValueError as problem:
        reason = _why_no_name(problem)
        if reason is None:
            raise
        raise UseError(f"{failed} ({reason}); {remedy}.") from problem


def _why_no_name(problem: ValueError) -> str | None:
    """What Python found in a text that it was to pass to the system as a path; None where the error
    is about something else."""
    if type(problem) is ValueError and "embedded null" in str(problem):
        return "no file's name has a NUL"
    if isinstance(problem, UnicodeEncodeError) and "surrogates" in problem.reason:
        return "no file's name has half a character"
    return None
