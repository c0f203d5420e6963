"""In what the trials of a sweep differ: its axes, found in the trials themselves.

Scenes and algorithms say what a sweep file does not, and the file may have changed since: so axes
are read from the configurations. Settings that step together are one axis.
"""

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from asmjax.sweep.words import value_words

SEEN = ("scene", "view", "light", "light_angle_deg", "size", "samples")
"""Settings that say what is looked at, and how; others say by which map."""

_SAID_OTHERWISE = ("content", "settings.memory_bytes")
"""By the scene, and by `memory_mb`."""

_TABLE = "settings."
"""How the names of an algorithm's settings begin."""

_SAID_BY = (("scene", ("view", "light")), ("algorithm", (_TABLE,)))
"""What scene and algorithm say by themselves, and how its names begin: where each scene has one
view nobody chose it, and so it is with the defaults of algorithms."""

_STEPS = 12
"""Up to so many values, settings that step together are one axis: what is drawn at random always
steps together."""

_ABSENT = object()


@dataclass(frozen=True)
class SweptAxis:
    """Settings in which trials differ.

    Attributes:
        names: of the settings, which step together.
        title: these names for people, without the table that they stand in.
        values: that occur, a tuple each: numbers by size, others as they come.
    """

    names: tuple[str, ...]
    title: str
    values: tuple[tuple[Any, ...], ...] = ()

    @property
    def is_number(self) -> bool:
        """Whether all of its values are single numbers."""
        return len(self.names) == 1 and all(_is_number(value) for (value,) in self.values)

    @cached_property
    def value_words(self) -> tuple[str, ...]:
        """Its values, for people."""
        return tuple(_words(value) for value in self.values)

    def says(self, names: Collection[str]) -> bool:
        """Whether one of those settings is its own."""
        return any(name in names for name in self.names)

    def of(self, settings: Mapping[str, Any]) -> tuple[Any, ...] | None:
        """The value of a trial; None where it has no such setting."""
        if all(name in settings for name in self.names):
            return tuple(settings[name] for name in self.names)
        return None

    def words(self, settings: Mapping[str, Any]) -> str | None:
        """The value of a trial, for people."""
        value = self.of(settings)
        return None if value is None else _words(value)


def axes_in(trials: Sequence[Mapping[str, Any]]) -> list[SweptAxis]:
    """The axes of trials, whose settings have names with dots.

    A setting that only some trials have, as those of one algorithm, is one where these differ.
    """
    patterns: dict[str, tuple[int, ...]] = {}
    columns = dict.fromkeys(name for trial in trials for name in trial)
    for name in columns:
        pattern = _pattern(trials, name)
        if name not in _SAID_OTHERWISE and max(pattern) > 0:
            patterns[name] = pattern
    for what, begins in _SAID_BY:
        for name in [name for name in patterns if what in patterns and name.startswith(begins)]:
            if _tells(patterns[what], patterns[name]):
                del patterns[name]
    together: dict[Hashable, list[str]] = {}
    for name, pattern in patterns.items():
        few = max(pattern) < _STEPS
        together.setdefault(pattern if few else (name, pattern), []).append(name)
    return [_axis(trials, names, columns) for names in together.values()]


def _pattern(trials: Sequence[Mapping[str, Any]], name: str) -> tuple[int, ...]:
    """Which trials have equal values: numbers from 0 on as values first occur; -1 for none."""
    seen: dict[Hashable, int] = {}
    found = []
    for trial in trials:
        value = trial.get(name, _ABSENT)
        found.append(-1 if value is _ABSENT else seen.setdefault(value, len(seen)))
    return tuple(found)


def _tells(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether the value of one setting tells that of the other."""
    return len(set(zip(one, other, strict=True))) == len(set(one))


def _axis(
    trials: Sequence[Mapping[str, Any]], names: Sequence[str], columns: Collection[str]
) -> SweptAxis:
    short = {name: name.removeprefix(_TABLE) for name in names}
    title = ", ".join(name if short[name] in columns else short[name] for name in names)
    axis = SweptAxis(tuple(names), title)
    values = dict.fromkeys(value for trial in trials if (value := axis.of(trial)) is not None)
    return replace(axis, values=tuple(sorted(values, key=_order)))


def _order(value: tuple[Any, ...]) -> tuple[bool, float]:
    """Numbers by size, before others, which stay as they come."""
    first = value[0]
    return (False, first) if _is_number(first) else (True, 0.0)


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and value == value


def _words(value: Sequence[Any]) -> str:
    return ", ".join(value_words(one) for one in value)
