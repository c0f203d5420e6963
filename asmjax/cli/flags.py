"""Messages name fields in backticks; the command line says them as its options."""

import dataclasses
import functools
import logging
import re

FLAGS = {
    "memory_bytes": "--memory-mb",
    "bytes_limit": "--memory-mb",
    "time_limit": "--time-limit-ms",
    "max_memory_mb": "--max-memory",
    "trust=True": "--trust-scene",
}
"""Fields that are options by another name. All others that an options class has are called alike,
and a setting that is no option keeps its name."""

_NAMED = re.compile(r"`([a-z]\w*(?:=True)?)`")


def in_flags(text: str) -> str:
    """`text` with options where it names fields in backticks."""
    return _NAMED.sub(lambda named: _flag(named[1]), text)


def _flag(field: str) -> str:
    if field in FLAGS:
        return FLAGS[field]
    return f"--{field.replace('_', '-')}" if field in _option_names() else field


@functools.cache
def _option_names() -> frozenset[str]:
    from asmjax import options

    kinds = (kind for kind in vars(options).values() if isinstance(kind, type))
    return frozenset(
        field.name
        for kind in kinds
        if dataclasses.is_dataclass(kind)
        for field in dataclasses.fields(kind)
    )


class FlagFormatter(logging.Formatter):
    """Warnings in the words of the command line."""

    def format(self, record: logging.LogRecord) -> str:
        return in_flags(super().format(record))
