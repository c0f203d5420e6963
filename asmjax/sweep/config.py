"""A sweep file: TOML that says which trials there are (docs/sweeps.md), read strictly.

    [trial]                                   # what all trials have
    scene = "paper_room"
    size = [256, 256]

    [grid]                                    # every combination of these
    memory_mb = [1, 4, 16]
    settings.node_resolution = [16, 32]

That is six trials: every combination of two axes.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from asmjax.errors import UseError, require, unknown_name
from asmjax.sweep.axes import (
    Axis,
    Point,
    axes_of,
    check_apart,
    combinations,
    combined,
    placed,
    said_of,
)
from asmjax.sweep.fields import FIELDS, is_amount, is_whole, shown
from asmjax.sweep.identity import key_of
from asmjax.sweep.resolve import Resolver
from asmjax.toml_files import read_toml

TABLES = ("trial", "grid", "zip", "random", "list")
"""Of a file, and of its table `smoke`."""

HEAD = ("name", "deadline_s", "seed")

DEADLINE_S = 600.0
"""Seconds for a trial where the file says nothing."""

LONGEST_DEADLINE_S = 1e7

MOST_TRIALS = 100_000

NAME = re.compile(r"[A-Za-z0-9][\w.-]{0,63}", re.ASCII)
"""Of a sweep: part of the name of a folder."""

TOGETHER = ("content", "view", "light", "light_angle_deg", "size", "samples")
"""What trials are put in order by: those of one scene and view follow each other, and find it
warm."""


@dataclass(frozen=True)
class Trial:
    """One row of a sweep.

    Attributes:
        key: 32 hexadecimal digits of its configuration and of what its scene consists of.
        config: plain values: every key of `asmjax.sweep.fields.FIELDS`, all `settings`, the scene's
            `content`, `variant` and `trust_scene`.
    """

    key: str
    config: dict[str, Any]


@dataclass(frozen=True)
class Sweep:
    """What a sweep file asks for.

    Attributes:
        name: of the sweep, and of its folder of results.
        trials: each once, those of one scene and view together.
        deadline_s: seconds that a trial may take.
        merged: combinations that said the same as another one.
    """

    name: str
    trials: tuple[Trial, ...]
    deadline_s: float = DEADLINE_S
    merged: int = 0


class _Tables(NamedTuple):
    """What is said of all trials, and the axes."""

    trial: Point
    axes: Mapping[str, Axis]

    def over(self, other: "_Tables") -> "_Tables":
        """This, where it says something, in place of `other`."""
        return _Tables({**other.trial, **self.trial}, {**other.axes, **self.axes})


def sweep_of(
    path: Path, *, smoke: bool = False, trust_scene: bool = False, variant: str | None = None
) -> Sweep:
    """The sweep that a file describes.

    Args:
        smoke: the small size, that of the file's table `smoke`.
        trust_scene: take scene files as they are, see docs/scene_files.md.
        variant: Mitsuba variant of all trials; None for the fastest that works where they run.

    Raises:
        UseError: no such file, no TOML, an unknown key (the nearest one is suggested), a value that
            its key may not have, NaN among them, settings that an algorithm refuses, or too many
            trials; in one line with the place in the file.
    """
    document = read_toml(path, "sweep file")
    try:
        resolver = Resolver(Path(path).parent, trust_scene, variant)
        return _sweep(document, Path(path), smoke, resolver)
    except UseError as problem:
        raise UseError(f"sweep file '{path}': {problem}") from problem
    except (ValueError, RecursionError) as problem:
        raise UseError(
            f"sweep file '{path}' has a number too long or tables too deep to read; mend it."
        ) from problem


def _sweep(document: Mapping[str, Any], path: Path, smoke: bool, resolver: Resolver) -> Sweep:
    _check_keys(document, (*HEAD, *TABLES, "smoke"), "")
    head = _head(document, path, "")
    tables = _tables(document, "", head["seed"])
    require(
        not smoke or "smoke" in document,
        "no table [smoke] says what the small size is; write one, or leave out --smoke.",
    )
    if "smoke" in document:
        small = document["smoke"]
        require(isinstance(small, Mapping), f"smoke is {shown(small)}; allowed: a table.")
        _check_keys(small, ("deadline_s", *TABLES), "smoke")
        smaller = _tables(small, "smoke.", head["seed"]).over(tables)
        check_apart(smaller.axes.values())
        if smoke:
            tables = smaller
            head |= {"name": f"{head['name']}-smoke"}
            head |= {"deadline_s": _deadline(small, "smoke.", head["deadline_s"])}
    count = combinations(tables.axes.values())
    require(
        count <= MOST_TRIALS,
        f"its axes have {count} combinations; allowed: {MOST_TRIALS}; leave out values, or make "
        "several sweeps of it.",
    )
    found: dict[str, dict[str, Any]] = {}
    for said in combined(tables.trial, list(tables.axes.values())):
        config = resolver.config(said)
        found.setdefault(key_of(config), config)
    trials = [Trial(key, config) for key, config in found.items()]
    trials.sort(key=lambda trial: [str(trial.config[name]) for name in TOGETHER])
    return Sweep(head["name"], tuple(trials), head["deadline_s"], count - len(trials))


def _tables(document: Mapping[str, Any], prefix: str, seed: int) -> _Tables:
    axes = axes_of(document, prefix, seed)
    check_apart(axes.values())
    return _Tables(said_of(document.get("trial", {}), f"{prefix}trial"), axes)


def _check_keys(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for name in table:
        require(
            name in known or name not in (*FIELDS, "settings"),
            f"{placed(where, name)} is said of trials; write it below [trial], or its values below "
            "[grid].",
        )
        if name not in known:
            raise UseError(f"{f'{where}: ' if where else ''}{unknown_name('key', name, known)}")


def _head(document: Mapping[str, Any], path: Path, prefix: str) -> dict[str, Any]:
    """Name, deadline and seed of the sweep."""
    name = document.get("name", re.sub(r"[^\w.-]", "-", path.stem, flags=re.ASCII)[:64])
    require(
        isinstance(name, str) and NAME.fullmatch(name) is not None,
        f"name is {shown(name)}; allowed: up to 64 letters, digits, . _ and -, a letter or digit "
        "first.",
    )
    seed = document.get("seed", 0)
    require(is_whole(seed, 0), f"seed is {shown(seed)}; allowed: a whole number from 0 to 2^53.")
    deadline = _deadline(document, prefix, DEADLINE_S)
    return {"name": name, "seed": seed, "deadline_s": deadline}


def _deadline(table: Mapping[str, Any], prefix: str, default: float) -> float:
    value = table.get("deadline_s", default)
    require(
        is_amount(value, 0, LONGEST_DEADLINE_S, above=True),
        f"{prefix}deadline_s is {shown(value)}; allowed: seconds, more than 0 and at most "
        f"{LONGEST_DEADLINE_S:g}.",
    )
    return float(value)
