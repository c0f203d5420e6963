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


def in_flags(text: str, command: type | None = None) -> str:
    """`text` with options where it names fields in backticks.

    Args:
        command: whose options there are; of all commands if None. What is no option of it keeps its
            name: a remedy that the command line does not take would be none.
    """
    names = _option_names(command)
    return _NAMED.sub(lambda named: _flag(named[1], names), text)


def _flag(field: str, names: frozenset[str]) -> str:
    flag = FLAGS.get(field, f"--{field.replace('_', '-')}")
    stem = flag[2:].replace("-", "_")
    # Units may be left out of an option's name.
    there = any(name.startswith(stem) for name in names) if field in FLAGS else field in names
    return flag if there else field


@functools.cache
def _option_names(command: type | None) -> frozenset[str]:
    from asmjax import options

    kinds = [command] if command else [
        kind for kind in vars(options).values()
        if isinstance(kind, type) and dataclasses.is_dataclass(kind)
    ]  # fmt: skip
    return frozenset(field.name for kind in kinds for field in dataclasses.fields(kind))


class FlagFormatter(logging.Formatter):
    """Warnings in the words of the command line.

    Attributes:
        command: the class of its options, once they are known.
    """

    command: type | None = None

    def format(self, record: logging.LogRecord) -> str:
        return in_flags(super().format(record), self.command)
