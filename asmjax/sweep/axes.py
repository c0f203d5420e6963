"""The axes of a sweep: tables of its file, each of which multiplies the trials.

A point of an axis says some things of a trial: values by path, each with the place in the file that
says it. Four kinds of tables make axes:

    [grid]              every key an axis of its own, its values a list
    [zip.NAME]          keys that step together: lists of one length, one axis
    [random.NAME]       `count` points, each key drawn from a range or a choice
    [[list.NAME]]       points written out, one table each
"""

import hashlib
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from asmjax.errors import UseError, require, unknown_name
from asmjax.sweep.fields import FIELDS, check_setting, check_value, is_amount, is_whole, shown

Path = tuple[str, ...]
"""Of a value: ("size",), or ("settings", "node_resolution")."""

MOST_POINTS = 100_000
"""Of an axis."""

MOST_DEPTH = 8
"""Names in a path: three filters around each other."""

DIGITS = 6
"""Significant ones of a number that is drawn: the same on machines whose last bits differ."""

RANGE, CHOICE = ("from", "to", "scale", "whole"), ("choice",)
"""Keys of what is drawn."""

SCALES = ("linear", "log")


class Said(NamedTuple):
    """A value, and where the file says it, as "grid.size[1]"."""

    value: Any
    where: str


Point = Mapping[Path, Said]


@dataclass(frozen=True)
class Axis:
    """Alternatives, of which a trial has one.

    Attributes:
        name: where the file has it, as "grid.scene" or "list.maps".
        points: one or more.
    """

    name: str
    points: tuple[Point, ...]

    @property
    def paths(self) -> set[Path]:
        """All that any of its points says."""
        return {path for point in self.points for path in point}


def said_of(table: object, where: str) -> Point:
    """What a table says of a trial, every value checked as far as it can be alone.

    Raises:
        UseError: as `leaves`, or a value that its key may not have.
    """
    point = {path: Said(value, place) for path, value, place in leaves(table, where)}
    for path, said in point.items():
        _check(path, said.value, said.where)
    return point


def axes_of(tables: Mapping[str, Any], prefix: str, seed: int) -> dict[str, Axis]:
    """The axes of the tables grid, zip, random and list, by name.

    Args:
        prefix: before every place: "" or "smoke.".
        seed: of random points.

    Raises:
        UseError: anything that is not as those tables have it, with its place.
    """
    axes: list[Axis] = []
    for path, values, where in leaves(tables.get("grid", {}), f"{prefix}grid"):
        axes.append(Axis(f"grid.{'.'.join(path)}", _each(path, values, where)))
    for name, table, where in _groups(tables, "zip", prefix):
        axes.append(Axis(f"zip.{name}", _zipped(table, where)))
    for name, table, where in _groups(tables, "random", prefix):
        axes.append(Axis(f"random.{name}", _drawn(name, table, where, seed)))
    for name, entries, where in _groups(tables, "list", prefix):
        axes.append(Axis(f"list.{name}", _listed(entries, where)))
    return {axis.name: axis for axis in axes}


def check_apart(axes: Iterable[Axis]) -> None:
    """Raise `UseError` where two axes say the same: each trial has one value of it."""
    owner: dict[Path, str] = {}
    for axis in axes:
        for path in sorted(axis.paths):
            require(
                path not in owner,
                f"{'.'.join(path)} is said by {owner.get(path)} and by {axis.name}; leave it out "
                "of one of them.",
            )
            owner[path] = axis.name


def combined(trial: Point, axes: Sequence[Axis]) -> Iterator[Point]:
    """Every combination of one point of each axis, over what is said of all trials."""
    for points in product(*(axis.points for axis in axes)):
        whole = dict(trial)
        for point in points:
            whole.update(point)
        yield whole


def combinations(axes: Iterable[Axis]) -> int:
    """How many `combined` gives."""
    return math.prod(len(axis.points) for axis in axes)


def leaves(table: object, where: str) -> Iterator[tuple[Path, Any, str]]:
    """Path, value and place of all that a table of trial keys holds, tables of settings opened.

    Raises:
        UseError: no table, or an unknown key.
    """
    yield from _leaves((), table, where)


def _leaves(path: Path, value: Any, where: str) -> Iterator[tuple[Path, Any, str]]:
    if not _is_table(path):
        yield path, value, where
        return
    require(isinstance(value, Mapping), f"{where} is {shown(value)}; allowed: a table.")
    require(
        len(path) < MOST_DEPTH, f"{where} lies deeper than {MOST_DEPTH} names; write less inside."
    )
    for name, item in value.items():
        if not path and name not in FIELDS and name != "settings":
            raise UseError(f"{where}: {unknown_name('key', name, (*FIELDS, 'settings'))}")
        yield from _leaves((*path, name), item, placed(where, name))


def _is_table(path: Path) -> bool:
    """Whether the value of a path is a table again: settings, and those of an inner algorithm."""
    return all(name == ("settings", "inner")[k % 2] for k, name in enumerate(path))


def placed(where: str, name: str) -> str:
    """The place of a key in the table at `where`."""
    short = name if re.fullmatch(r"[\w-]{1,40}", name) else shown(name)
    return f"{where}.{short}" if where else short


def _check(path: Path, value: object, where: str) -> None:
    if path[0] == "settings":
        check_setting(value, where)
    else:
        check_value(path[0], value, where)


def _listed_values(values: object, where: str) -> list:
    """The list `values`. Raises `UseError` where it is none, empty or too long."""
    if not isinstance(values, list):
        raise UseError(
            f"{where} is {shown(values)}; allowed: a list of values, each of which is tried; what "
            "all trials have stands below [trial]."
        )
    require(
        1 <= len(values) <= MOST_POINTS,
        f"{where} has {len(values)} values; allowed: 1 to {MOST_POINTS}.",
    )
    return values


def _each(path: Path, values: object, where: str) -> tuple[Point, ...]:
    """A point for each value of a list."""
    points = []
    for k, value in enumerate(_listed_values(values, where)):
        place = f"{where}[{k}]"
        _check(path, value, place)
        points.append({path: Said(value, place)})
    return tuple(points)


def _groups(
    tables: Mapping[str, Any], kind: str, prefix: str
) -> Iterator[tuple[str, Any, str]]:  # fmt: skip
    """Name, content and place of the groups of a kind."""
    groups = tables.get(kind, {})
    where = f"{prefix}{kind}"
    brackets = f"[[{kind}.NAME]]" if kind == "list" else f"[{kind}.NAME]"
    wanted = list if kind == "list" else Mapping
    require(
        isinstance(groups, Mapping),
        f"{where} is {shown(groups)}; allowed: groups {brackets} with names of your choice.",
    )
    for name, group in groups.items():
        place = placed(where, name)
        require(
            isinstance(group, wanted),
            f"{place} is {shown(group)}; allowed: a group, with a name of your choice: {brackets}.",
        )
        yield name, group, place


def _zipped(table: object, where: str) -> tuple[Point, ...]:
    columns = [_each(path, values, place) for path, values, place in leaves(table, where)]
    require(len(columns) > 0, f"{where} is empty; give lists of one length.")
    lengths = [len(column) for column in columns]
    require(
        len(set(lengths)) == 1,
        f"{where} has lists of {', '.join(map(str, lengths))} values, which cannot step together; "
        "give them one length.",
    )
    return tuple(
        {path: said for point in row for path, said in point.items()}
        for row in zip(*columns, strict=True)
    )


def _listed(entries: object, where: str) -> tuple[Point, ...]:
    values = _listed_values(entries, where)
    return tuple(said_of(entry, f"{where}[{k}]") for k, entry in enumerate(values))


def _drawn(name: str, table: Mapping[str, Any], where: str, seed: int) -> tuple[Point, ...]:
    count = table.get("count")
    if not is_whole(count, 1, MOST_POINTS):
        raise UseError(
            f"{where}.count is {'missing' if count is None else shown(count)}; allowed: how many "
            f"points to draw, 1 to {MOST_POINTS}."
        )
    asked = {key: value for key, value in table.items() if key != "count"}
    found = list(leaves(asked, where))
    require(len(found) > 0, f"{where} draws nothing; give keys with a range or a choice.")
    for path, spread, place in found:
        _check_spread(path, spread, place)
    points = []
    for k in range(count):
        point = {}
        for path, spread, place in found:
            value = _value_at(spread, _chance(seed, name, path, k))
            _check(path, value, place)
            point[path] = Said(value, place)
        points.append(point)
    return tuple(points)


def _chance(seed: int, name: str, path: Path, k: int) -> float:
    """A number in [0, 1) that only depends on its arguments: as more points are drawn, the first
    ones stay, in every version of every library."""
    text = repr((seed, name, path, k))
    return (int.from_bytes(hashlib.sha256(text.encode()).digest()[:8]) >> 11) / 2**53


def _check_spread(path: Path, spread: object, where: str) -> None:
    """Raise `UseError` for what nothing can be drawn from."""
    example = '{from = 1, to = 8}, with scale = "log" or whole = true, or {choice = [1, 2]}'
    if not isinstance(spread, Mapping):
        raise UseError(f"{where} is {shown(spread)}; allowed: {example}.")
    known = CHOICE if "choice" in spread else RANGE
    for key in spread:
        if key not in known:
            raise UseError(f"{where}: {unknown_name('key', key, known)}")
    if "choice" in spread:
        for k, value in enumerate(_listed_values(spread["choice"], f"{where}.choice")):
            _check(path, value, f"{where}.choice[{k}]")
        return
    for key in ("from", "to"):
        end = spread.get(key)
        require(
            is_amount(end, -1e300, 1e300),
            f"{where}.{key} is {'missing' if end is None else shown(end)}; allowed: a finite "
            f"number, as in {example}.",
        )
    low, high, scale = spread["from"], spread["to"], spread.get("scale", "linear")
    require(low <= high, f"{where} is from {low} to {high}; give the smaller number first.")
    if scale not in SCALES:
        raise UseError(f"{where}.scale: {unknown_name('scale', str(scale), SCALES)}")
    require(
        scale != "log" or low > 0,
        f'{where}.from is {low}; allowed with scale = "log": more than 0.',
    )
    whole = spread.get("whole", False)
    require(isinstance(whole, bool), f"{where}.whole is {shown(whole)}; allowed: true or false.")
    require(
        not whole or (type(low) is int and type(high) is int),
        f"{where} is from {low} to {high}; allowed with whole = true: whole numbers.",
    )


def _value_at(spread: Mapping[str, Any], chance: float) -> Any:
    """What is drawn where `chance`, in [0, 1), falls."""
    if "choice" in spread:
        return spread["choice"][int(chance * len(spread["choice"]))]
    low, high = spread["from"], spread["to"]
    # Each whole number has a stretch of length 1.
    end = high + 1 if spread.get("whole") else high
    if spread.get("scale") == "log":
        value = math.exp(math.log(low) + chance * (math.log(end) - math.log(low)))
    else:
        value = low + chance * (end - low)
    if spread.get("whole"):
        return min(max(math.floor(value), low), high)
    return min(max(float(f"{value:.{DIGITS}g}"), float(low)), float(high))
