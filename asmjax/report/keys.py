"""What a schema is made of: keys with their kinds and meanings, and how a report is checked."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from asmjax.errors import UseError


class InvalidReport(UseError):
    """A report that does not follow its schema; the message begins with the JSON path."""


@dataclass(frozen=True)
class Key:
    """One key of the report.

    Attributes:
        kind: "text", "count" (integer >= 0), "integer", "number", "amount" (number >= 0),
            "fraction" (0 to 1), "flag" (true or false), "text list", "size" (two positive
            integers), "vector" (three numbers), "any object", "text object" (text to text), or a
            mapping of further keys.
        means: the unit and meaning, one line.
        required: whether it must be there.
        each: the value is a list of such mappings.
        nullable: whether null is allowed.
    """

    kind: "str | Mapping[str, Key]"
    means: str
    required: bool = True
    each: bool = False
    nullable: bool = False


def key_paths(keys: Mapping[str, Key], prefix: str = "") -> Iterator[tuple[str, Key]]:
    """All keys as (JSON path, Key), parents first; list items are written `methods[]`."""
    for name, key in keys.items():
        path = f"{prefix}{name}" + ("[]" if key.each else "")
        yield path, key
        if not isinstance(key.kind, str):
            yield from key_paths(key.kind, f"{path}.")


def check_keys(value: object, keys: Mapping[str, Key], path: str = "") -> None:
    """Check that an object has the keys of a schema, and nothing else.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    if not isinstance(value, dict):
        raise InvalidReport(f"{path}: expected an object, got {_shown(value)}")
    dot = f"{path}." if path else ""
    for name in value:
        if name not in keys:
            raise InvalidReport(f"{dot}{name}: unknown key; known: {', '.join(keys)}")
    for name, key in keys.items():
        if name in value:
            _check(value[name], key, f"{dot}{name}")
        elif key.required:
            raise InvalidReport(f"{dot}{name}: missing ({key.means})")


def _check(value: object, key: Key, path: str) -> None:
    if value is None and key.nullable:
        return
    if isinstance(key.kind, str):
        problem = _problem(value, key.kind, path)
        if problem:
            raise InvalidReport(problem)
    elif key.each:
        if not isinstance(value, list):
            raise InvalidReport(f"{path}: expected a list, got {_shown(value)}")
        for i, item in enumerate(value):
            check_keys(item, key.kind, f"{path}[{i}]")
    else:
        check_keys(value, key.kind, path)


def _is_integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    return _is_integer(value) or (isinstance(value, float) and math.isfinite(value))


_KINDS = {
    "text": ("text", lambda v: isinstance(v, str)),
    "integer": ("an integer", _is_integer),
    "count": ("an integer of at least 0", lambda v: _is_integer(v) and v >= 0),
    "number": ("a finite number", _is_number),
    "amount": ("a finite number of at least 0", lambda v: _is_number(v) and v >= 0),
    "fraction": ("a number from 0 to 1", lambda v: _is_number(v) and 0 <= v <= 1),
    "flag": ("true or false", lambda v: isinstance(v, bool)),
    "vector": (
        "three finite numbers",
        lambda v: isinstance(v, list) and len(v) == 3 and all(_is_number(x) for x in v),
    ),
    "text list": (
        "a list of texts",
        lambda v: isinstance(v, list) and all(isinstance(x, str) for x in v),
    ),
    "size": (
        "two positive integers",
        lambda v: isinstance(v, list) and len(v) == 2 and all(_is_integer(x) and x > 0 for x in v),
    ),
    "text object": (
        "an object of texts",
        lambda v: isinstance(v, dict) and all(isinstance(x, str) for x in v.values()),
    ),
    "any object": ("an object", lambda v: isinstance(v, dict)),
}


def _problem(value: object, kind: str, path: str) -> str | None:
    expected, fits = _KINDS[kind]
    if not fits(value):
        return f"{path}: expected {expected}, got {_shown(value)}"
    return first_unstorable(value, path)


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def first_unstorable(value: object, path: str = "") -> str | None:
    """What JSON cannot hold (NaN, an infinity, another type), with its path; None if nothing."""
    if value is None or isinstance(value, str | bool) or _is_integer(value):
        return None
    if isinstance(value, float):
        return None if math.isfinite(value) else f"{path}: {value} cannot be stored in JSON"
    if isinstance(value, dict):
        for name, item in value.items():
            if not isinstance(name, str):
                return f"{path}: the key {name!r} is no text"
            problem = first_unstorable(item, _joined(path, name))
            if problem:
                return problem
        return None
    if isinstance(value, list | tuple):
        for i, item in enumerate(value):
            problem = first_unstorable(item, f"{path}[{i}]")
            if problem:
                return problem
        return None
    return f"{path}: a {type(value).__name__} cannot be stored in JSON"


def _joined(path: str, name: str) -> str:
    step = name if re.fullmatch(r"\w+", name) else repr(name)
    return f"{path}.{step}" if path else step
