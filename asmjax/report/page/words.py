"""Numbers within sentences."""

from collections.abc import Mapping, Sequence

from asmjax.report.table import MB, significant

EDGE = "wrong pixels per pixel of shadow edge"
"""The error that charts of accuracy against cost show."""


def percent(part: float) -> str:
    """0.0072 as "0.722 %"; "none" stays to the sentence."""
    return f"{significant(100 * part)} %"


def milliseconds(seconds: float) -> str:
    """0.0251 as "25.1 ms"."""
    return f"{significant(1e3 * seconds)} ms"


def megabytes(count: float) -> str:
    """2**24 as "16.0 MB"."""
    return f"{significant(count / MB)} MB"


def times(more: float, less: float) -> str:
    """How many times as much, where that can be said: "38.0 times"."""
    return f"{significant(more / less)} times"


def listed(items: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def of_kind(methods: Sequence[Mapping], kind: str) -> Mapping | None:
    """The first method whose name begins so."""
    return next((method for method in methods if method["name"].startswith(kind)), None)


def plural(count: int, one: str) -> str:
    """1 setting, 12 settings."""
    return f"{count:,} {one}{'' if count == 1 else 's'}"
