"""The schema of `report.json`, as data: the keys, their kinds, units and meanings.

The validator, the documentation test and the CSV header all read this one table. Version 1 of
`asmjax run` is "asmjax/run/1"; a change that could break a reader raises the number.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from asmjax.errors import UseError

RUN_SCHEMA = "asmjax/run/1"

METHOD_KINDS = ("uniform", "adaptive", "rays")
"""What the name of a method begins with."""

MAP_NAMES = ("area_ratio", "linear_ratio", "m", "n_required", "benefit")
"""Maps of one value per eye pixel, summarised in the report and stored by `--save-arrays`."""


class InvalidReport(UseError):
    """A report that does not follow its schema; the message begins with the JSON path."""


@dataclass(frozen=True)
class Key:
    """One key of the report.

    Attributes:
        kind: "text", "count" (integer >= 0), "integer", "number", "amount" (number >= 0),
            "fraction" (0 to 1), "text list", "size" (two positive integers), "any object",
            "text object" (text to text), or a mapping of further keys.
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


_SUMMARY = {
    "p50": Key("number", "median over the valid pixels whose value is finite"),
    "p95": Key("number", "95th percentile of them"),
    "max": Key("number", "largest of them"),
    "count": Key("count", "how many pixels these are; with 0 the three above are 0", False),
}

_ERROR = {
    "misclassified_fraction": Key("fraction", "wrong pixels / valid pixels"),
    "false_lit_fraction": Key("fraction", "shadowed in truth, lit by the method"),
    "false_dark_fraction": Key("fraction", "lit in truth, shadowed by the method"),
    "boundary_displacement_px": Key(
        {
            "mean": Key("amount", "mean distance between shadow boundaries, pixels"),
            "p95": Key("amount", "95th percentile, pixels"),
            "hausdorff": Key("amount", "largest distance, pixels", False),
            "unmatched_fraction": Key("fraction", "share of edges with no partner", False),
            "per_edge_length": Key(
                "amount", "wrong pixels per pixel of true boundary, pixels", False
            ),
        },
        "how far shadow edges move in the image",
    ),
}

_METHOD = {
    "name": Key("text", "begins with uniform, adaptive or rays; unique in the report"),
    "settings": Key("any object", "all settings that the method ran with"),
    "effective_resolution": Key(
        "count", "texels per side of a flat map as fine as its finest part", nullable=True
    ),
    "bytes": Key("count", "memory of all arrays that the method keeps, bytes"),
    "rays": Key("count", "rays cast"),
    "seconds": Key(
        {
            "build": Key("amount", "casting and storing texels, seconds"),
            "analysis": Key("amount", "deciding what to refine, seconds"),
            "query": Key("amount", "visibility of all eye pixels, seconds"),
            "total": Key("amount", "all of it, seconds"),
        },
        "wall time by stage",
    ),
    "error": Key(_ERROR, "errors against truth"),
    "nodes": Key("count", "nodes of the tree that hold texels", False),
    "passes": Key("count", "launches of light rays, the starting resolution included", False),
    "max_level": Key("count", "level of the deepest node, 0 for the root", False),
    "status": Key("text", "why refinement ended", False),
}

ADAPTIVE_KEYS = ("nodes", "passes", "max_level", "status")
"""Keys that an adaptive method must have."""

RUN_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{RUN_SCHEMA}"'),
    "command": Key("text", "the command line, quoted for a shell"),
    "versions": Key("text object", "package name to version"),
    "machine": Key(
        {
            "cpu": Key("text", "processor model"),
            "cores": Key("count", "cores that this process may use"),
            "memory_bytes": Key("count", "main memory, bytes; 0 where it cannot be told"),
            "device": Key("text", "where the JAX kernels ran"),
            "variant": Key("text", "Mitsuba variant that cast the rays"),
        },
        "the machine",
    ),
    "seed": Key("integer", "the seed of everything random"),
    "scene": Key("text", "built-in name or path of the scene"),
    "view": Key("text", "name of the view or sensor"),
    "light": Key("text", "which light, and its type"),
    "size": Key("size", "[width, height] of the eye's image, pixels"),
    "truth": Key(
        {
            "samples": Key("count", "shadow rays per pixel"),
            "rays": Key("count", "shadow rays cast"),
            "seconds": Key("amount", "wall time, seconds"),
            "valid_pixels": Key("count", "pixels that see a surface"),
            "lit_fraction": Key("fraction", "mean visibility of the valid pixels"),
        },
        "the ray-traced truth",
    ),
    "cost_model": Key(
        {
            "a_seconds_per_texel": Key("amount", "slope of the cost of a node, seconds/texel"),
            "b_seconds": Key("amount", "cost of a node of no texels, seconds"),
            "residual": Key("amount", "root-mean-square relative residual of the fit"),
        },
        "seconds to cast N texels: a N + b, measured on this machine",
    ),
    "maps": Key(
        {
            "area_ratio": Key(_SUMMARY, "world area of a texel / of an eye pixel"),
            "linear_ratio": Key(_SUMMARY, "square root of area_ratio"),
            "m": Key(_SUMMARY, "texel width / pixel width in the worst direction"),
            "n_required": Key(_SUMMARY, "texels of a flat map that matches the pixel"),
            "benefit": Key(_SUMMARY, "eye pixels that refining the pixel's cell would help"),
        },
        "summary of each map over the eye's image",
    ),
    "methods": Key(_METHOD, "one entry per method, in the order of the table", each=True),
    "notices": Key("text list", "what the run left out or approximated, one line each"),
}


def key_paths(keys: Mapping[str, Key] = RUN_KEYS, prefix: str = "") -> Iterator[tuple[str, Key]]:
    """All keys as (JSON path, Key), parents first; list items are written `methods[]`."""
    for name, key in keys.items():
        path = f"{prefix}{name}" + ("[]" if key.each else "")
        yield path, key
        if not isinstance(key.kind, str):
            yield from key_paths(key.kind, f"{path}.")


def validate_report(report: object) -> None:
    """Check a report of `asmjax run` against `RUN_KEYS`.

    Beyond kinds: the schema is this version's, no key is unknown, numbers are finite, method
    names are unique and of a known kind, an adaptive method has `ADAPTIVE_KEYS`, and false lit
    and false dark add up to the misclassified.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    if not isinstance(report, dict):
        raise InvalidReport(f"report: expected an object, got {type(report).__name__}")
    if report.get("schema") != RUN_SCHEMA:
        raise InvalidReport(f"schema: expected '{RUN_SCHEMA}', got {report.get('schema')!r}")
    _check_keys(report, RUN_KEYS, "")
    seen = set()
    for i, method in enumerate(report["methods"]):
        path, name = f"methods[{i}]", method["name"]
        if not name.startswith(METHOD_KINDS):
            raise InvalidReport(
                f"{path}.name: '{name}' must begin with one of {', '.join(METHOD_KINDS)}"
            )
        if name in seen:
            raise InvalidReport(f"{path}.name: '{name}' occurs twice")
        seen.add(name)
        if name.startswith("adaptive"):
            for key in ADAPTIVE_KEYS:
                if key not in method:
                    raise InvalidReport(f"{path}.{key}: missing, needed for an adaptive method")
        error = method["error"]
        parts = error["false_lit_fraction"] + error["false_dark_fraction"]
        if abs(parts - error["misclassified_fraction"]) > 1e-9:
            raise InvalidReport(
                f"{path}.error.misclassified_fraction: {error['misclassified_fraction']} is not "
                f"false lit + false dark = {parts}"
            )


def _check_keys(value: object, keys: Mapping[str, Key], path: str) -> None:
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
            _check_keys(item, key.kind, f"{path}[{i}]")
    else:
        _check_keys(value, key.kind, path)


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
