"""Settings as data: a TOML file for any algorithm of the registry, read strictly, written whole.

A file names the algorithm and says what differs from its defaults::

    algorithm = "adaptive"

    [settings]
    memory_mb = 4
    node_resolution = 32

Names are those of the algorithm's fields (docs/settings.md lists them). TOML has no None: a setting
that may be None is None where it is left out. A setting that is an algorithm itself, the
`inner` one of a filter, is a table of these two again.
"""

import math
import os
import re
import textwrap
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from inspect import cleandoc
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from asmjax.errors import UseError, file_errors, require, unknown_name
from asmjax.paths import write_atomic
from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.registry import ALGORITHMS
from asmjax.toml_files import read_toml

MOST_MEMORY = 2**50
"""Largest memory limit in bytes; what has to fit is checked where it is known."""

MEASURED = ("cost_model",)
"""Fields that are measured on each machine, not set."""

INFINITE = {("perspective", "slide"), ("logarithmic", "ratio")}
"""(family, setting) that may be infinite, which is their end of the scale."""


class Unit(NamedTuple):
    """Another name for a setting, in another unit: `field` is `of(value)`."""

    field: str
    of: Callable[[float], float]
    words: str


UNITS = {
    "memory_mb": Unit(
        "memory_bytes", lambda mb: math.floor(min(mb * 2**20, MOST_MEMORY + 1)), "MB (2^20 bytes)"
    ),
    "time_limit_ms": Unit("time_limit", lambda ms: ms / 1000, "milliseconds"),
}
"""Names that the command line uses: a file has one of the two."""

KINDS = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    ShadowAlgorithm: "a table with algorithm and settings, as of a file",
}
"""What the annotations of settings are called."""

SHADOW_TEST = {
    "compare": "what decides: the depth of the nearest surface, its primitive's id, or lit if "
    "either says so.",
    "bias": "distance along the receiver's normal by which a caster must be nearer, in parts of "
    "the distance to the light; under parallel light, of the receiver's depth.",
}
"""What the settings mean that all algorithms share."""


def read_settings(path: str | os.PathLike) -> ShadowAlgorithm:
    """The algorithm that a settings file describes.

    Raises:
        UseError: the file cannot be read, is no TOML (with the line), or is not as `algorithm_of`
            wants it; the message names the file.
    """
    mapping = read_toml(path, "settings file")
    try:
        return algorithm_of(mapping)
    except UseError as problem:
        raise UseError(f"settings file '{path}': {problem}") from problem
    except (ValueError, RecursionError) as problem:
        raise UseError(
            f"settings file '{path}' has a number too long or tables too deep to read; mend it."
        ) from problem


def algorithm_of(mapping: Mapping[str, Any]) -> ShadowAlgorithm:
    """The algorithm of a mapping as a settings file has it: `algorithm`, and a table `settings`.

    Values are not converted: "16" and true are no numbers, 16.0 is no whole one; 16 is a number.

    Raises:
        UseError: an unknown key or algorithm (the nearest one is suggested), a value of another
            kind, NaN, an infinity where `INFINITE` has none, a name and its other unit at once, or
            settings that the algorithm refuses.
    """
    _check_keys(mapping)
    family = _family_in(mapping)
    algorithm = ALGORITHMS[family]
    given = mapping.get("settings", {})
    names = allowed_names(algorithm)
    require(
        isinstance(given, Mapping),
        f"settings is {_shown(given)}; allowed: a table, that is lines below one that says "
        "[settings].",
    )
    for name in given:
        require(
            name not in MEASURED,
            f"{name} is measured on each machine, not set; leave it out.",
        )
        if name not in names:
            raise unknown_name(f"{family} setting", name, names)
    try:
        checked = _model(family, algorithm).model_validate(dict(given))
    except ValidationError as problem:
        raise UseError(_told(problem, algorithm)) from problem
    return algorithm(**_with_inner(_in_field_units(checked.model_dump(exclude_unset=True))))


def settings_text(algorithm: ShadowAlgorithm, *, every: bool = False) -> str:
    """A settings file for an algorithm: what differs from its defaults, or with `every` all of its
    settings, each below a comment that explains it.

    `cost_model` is left out: it is this machine's.

    Raises:
        UseError: it is not of the registry, or has a setting that no file may hold.
    """
    family = family_of(algorithm)
    values = _values(algorithm)
    defaults = {field.name: _plain(field.default) for field in fields(algorithm)}
    given = {
        name: value
        for name, value in values.items()
        if value is not None and (every or value != defaults[name])
    }
    again = algorithm_of({"algorithm": family, "settings": given})
    changed = [name for name, value in _values(again).items() if value != values[name]]
    require(
        not changed, f"{', '.join(changed)} of {algorithm.name} cannot be kept in a settings file."
    )
    if not every:
        return tomli_w.dumps({"algorithm": family, "settings": given})
    explained = meanings(type(algorithm))
    parts = [f"{tomli_w.dumps({'algorithm': family})}\n[settings]"]
    for name in values:
        lines = textwrap.wrap(explained[name], 96, break_on_hyphens=False)
        if name in given:
            setting = _setting(name, given[name])
        else:
            setting = f"# {name} is left out: None"
        parts.append("\n".join([*(f"# {line}" for line in lines), setting]))
    return "\n\n".join(parts) + "\n"


def write_settings(
    path: str | os.PathLike, algorithm: ShadowAlgorithm, *, every: bool = False
) -> None:
    """Write `settings_text` to `path`, whole or not at all.

    Raises:
        UseError: as `settings_text`, or the file cannot be written.
    """
    text = settings_text(algorithm, every=every)
    with file_errors(f"cannot write settings to '{path}'", "choose another file"):
        write_atomic(path, text)


def family_of(algorithm: ShadowAlgorithm) -> str:
    """The name in the registry of an algorithm's class.

    Raises:
        UseError: it has none.
    """
    for family, kind in ALGORITHMS.items():
        if type(algorithm) is kind:
            return family
    raise unknown_name("algorithm", type(algorithm).__name__, ALGORITHMS)


def setting_types(algorithm: type[ShadowAlgorithm]) -> dict[str, Any]:
    """Name to annotation of every field that a file may set, in their order."""
    hints = get_type_hints(algorithm)
    names = (field.name for field in fields(algorithm))
    return {name: hints[name] for name in names if name not in MEASURED}


def allowed_names(algorithm: type[ShadowAlgorithm]) -> list[str]:
    """The names that a file may use: those of the fields, and of their other units."""
    names = list(setting_types(algorithm))
    return [*names, *(name for name, unit in UNITS.items() if unit.field in names)]


def meanings(algorithm: type[ShadowAlgorithm]) -> dict[str, str]:
    """What each setting means, from the "Attributes" of the algorithm's docstring."""
    _, _, part = cleandoc(algorithm.__doc__ or "").partition("Attributes:\n")
    entries = re.split(r"^    (?=\S)", part.partition("\n\n")[0], flags=re.MULTILINE)
    found = {}
    for entry in entries:
        names, _, words = entry.partition(":")
        for name in names.split(","):
            found[name.strip()] = " ".join(words.split())
    return {name: found.get(name, "") for name in setting_types(algorithm)} | SHADOW_TEST


def _setting(name: str, value: Any) -> str:
    """A setting as a file has it, below its line [settings]; tables come last there."""
    of = {"settings": {name: value}} if isinstance(value, Mapping) else {name: value}
    return tomli_w.dumps(of).rstrip()


def kind_words(annotation: Any) -> str:
    """An annotation in words: "whole number", or the values that it may have."""
    bare = _bare(annotation)
    if get_origin(bare) is Literal:
        return ", ".join(get_args(bare))
    return KINDS[bare]


def _bare(annotation: Any) -> Any:
    """`annotation` without its None."""
    if isinstance(annotation, UnionType):
        return next(part for part in get_args(annotation) if part is not type(None))
    return annotation


def _check_keys(mapping: Mapping[str, Any]) -> None:
    for key in mapping:
        if key in ("algorithm", "settings"):
            continue
        require(
            not any(key in allowed_names(algorithm) for algorithm in ALGORITHMS.values()),
            f"{key} is a setting; write it below a line that says [settings].",
        )
        raise unknown_name("key", key, ("algorithm", "settings"))


def _family_in(mapping: Mapping[str, Any]) -> str:
    family = mapping.get("algorithm")
    require(
        family is not None,
        'no algorithm is named; begin with a line such as algorithm = "adaptive"; known: '
        f"{', '.join(ALGORITHMS)}.",
    )
    require(isinstance(family, str), f"algorithm is {_shown(family)}; allowed: its name in quotes.")
    if family not in ALGORITHMS:
        raise unknown_name("algorithm", str(family), ALGORITHMS)
    return str(family)


@cache
def _model(family: str, algorithm: type[ShadowAlgorithm]) -> type[BaseModel]:
    """What pydantic checks a table of settings with."""
    parts: dict[str, Any] = {}
    for name, annotation in setting_types(algorithm).items():
        if (family, name) in INFINITE:
            annotation = Annotated[annotation, Field(allow_inf_nan=True)]
        if annotation is ShadowAlgorithm:
            annotation = dict[str, Any]
        parts[name] = (annotation, None)
    for name, unit in UNITS.items():
        if unit.field in parts:
            parts[name] = (float, None)
    config = ConfigDict(strict=True, allow_inf_nan=False)
    return create_model(algorithm.__name__, __config__=config, **parts)


def _told(problem: ValidationError, algorithm: type[ShadowAlgorithm]) -> str:
    """What pydantic found wrong, in one line: each value, and what is allowed instead."""
    types = setting_types(algorithm) | {name: float for name in UNITS}
    said = {}
    for error in problem.errors(include_url=False):
        name, got = str(error["loc"][0]), error["input"]
        annotation = types[name]
        if isinstance(got, str) and get_origin(_bare(annotation)) is Literal:
            said[name] = str(unknown_name(name, got, get_args(_bare(annotation))))
            continue
        kind = kind_words(annotation)
        if error["type"] == "finite_number" or (_bare(annotation) is float and type(got) is int):
            kind = "a finite number"
        quotes = ", without quotes" if isinstance(got, str) else ""
        left_out = "; or leave it out" if annotation != _bare(annotation) else ""
        said[name] = f"{name} is {_shown(got)}; allowed: {kind}{quotes}{left_out}."
    return " ".join(said.values())


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _in_field_units(values: dict[str, Any]) -> dict[str, Any]:
    """`values` with every other unit turned into the field's own."""
    for name, unit in UNITS.items():
        if name in values:
            require(
                unit.field not in values,
                f"{name} and {unit.field} both say the same; give one of them.",
            )
            values[unit.field] = unit.of(values.pop(name))
    memory = values.get("memory_bytes", 1)
    require(
        1 <= memory <= MOST_MEMORY,
        f"a memory limit of {_shown(memory)} bytes is not possible; allowed: 1 to 2^50.",
    )
    return values


def _with_inner(values: dict[str, Any]) -> dict[str, Any]:
    """`values` with tables that describe algorithms turned into these."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            try:
                values[name] = algorithm_of(value)
            except UseError as problem:
                raise UseError(f"{name}: {problem}") from problem
    return values


def _values(algorithm: ShadowAlgorithm) -> dict[str, Any]:
    """All that a file may set, as plain Python values."""
    return {name: _plain(getattr(algorithm, name)) for name in setting_types(type(algorithm))}


def _plain(value: Any) -> Any:
    if isinstance(value, ShadowAlgorithm):
        return tomllib.loads(settings_text(value))
    return value.item() if hasattr(value, "item") else value
