"""What may be said of a trial: every key, what it means, and the values that it may have."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeGuard

from asmjax.errors import UseError
from asmjax.options import LARGEST
from asmjax.scene.spec import MAX_SIDE
from asmjax.shadow.pages import between_markers, write_pages

BEGIN = "<!-- begin: written by `python -m asmjax.sweep.fields docs/sweeps.md` -->"
END = "<!-- end -->"

KEEPS = ("visibility",)
"""Arrays that a trial may keep."""

LONGEST_TEXT = 4096
"""Characters of a name or path."""

MOST_SAMPLES = 4096
"""Of a pixel."""

MOST_MEMORY_MB = 2.0**30
"""As of settings files."""

_SHOWN = 40


class Field(NamedTuple):
    """One key of a trial.

    Attributes:
        means: what it is, for docs/sweeps.md.
        allowed: its values in words.
        fits: whether a value is one of them.
        default: where nobody says it; None for what the scene or the machine says.
    """

    means: str
    allowed: str
    fits: Callable[[Any], bool]
    default: Any = None


def is_whole(value: object, least: int, most: int = LARGEST) -> TypeGuard[int]:
    """Whether it is a whole number in a range: 16.0 is none, true is none."""
    return type(value) is int and least <= value <= most


def is_amount(value: object, least: float, most: float, above: bool = False) -> TypeGuard[float]:
    """Whether it is a number in a range, without its lower end if it must be `above` that."""
    # Compared, not converted: a whole number may have more digits than any float.
    if type(value) is int or type(value) is float:
        return (least < value if above else least <= value) and value <= most
    return False


def _is_name(value: object) -> bool:
    return isinstance(value, str) and 0 < len(value) <= LONGEST_TEXT and "\0" not in value


def _is_pick(value: object) -> bool:
    return _is_name(value) or is_whole(value, 0)


def _is_size(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(is_whole(side, 1, MAX_SIDE) for side in value)
    )


def _is_cost(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(is_amount(cost, 0, 1e3) for cost in value)
        and any(cost > 0 for cost in value)
    )


def _keeps(value: object) -> bool:
    return isinstance(value, list) and all(name in KEEPS for name in value)


FIELDS: dict[str, Field] = {
    "scene": Field(
        "built-in name, or path of a Mitsuba scene file from the sweep file's folder on",
        "a name or path in quotes",
        _is_name,
        "paper_room",
    ),
    "view": Field(
        "named view, or sensor of a scene file: its id, or its index from 0; the first one",
        "a name in quotes, or a whole number",
        _is_pick,
    ),
    "light": Field(
        "light that casts the shadow: its name or id, or its index from 0; the first one",
        "a name in quotes, or a whole number",
        _is_pick,
    ),
    "light_angle_deg": Field(
        "in the light's place a parallel one at this angle to the view: 0 is along it, 90 from "
        "above; as `asmjax analyze` turns it",
        "a number from 0 to 180",
        lambda value: is_amount(value, 0, 180),
    ),
    "size": Field(
        "[width, height] of the image in pixels; as the view says",
        f"a list of two whole numbers from 1 to {MAX_SIDE}",
        _is_size,
    ),
    "samples": Field(
        "samples per pixel: shadow rays of the truth, and queries of the map",
        f"a whole number from 1 to {MOST_SAMPLES}",
        lambda value: is_whole(value, 1, MOST_SAMPLES),
        1,
    ),
    "algorithm": Field(
        "family of the shadow algorithm, as in a settings file",
        "its name in quotes",
        _is_name,
        "adaptive",
    ),
    "memory_mb": Field(
        "memory in MB (2^20 bytes): the adaptive map's limit; of any other map, or of the uniform "
        "one that a filter is of, its texels fill it. Instead of `settings.memory_mb` and "
        "`settings.resolution`",
        "a number above 0, at most 2^30",
        lambda value: is_amount(value, 0, MOST_MEMORY_MB, above=True),
    ),
    "cost_model": Field(
        "[seconds per texel, seconds per launch] that an adaptive map decides by: the same numbers "
        "on every machine; otherwise calibrated where the trial runs",
        "a list of two numbers from 0 to 1000, not both 0",
        _is_cost,
    ),
    "seed": Field(
        "of the places of samples in their pixels, and of rays to a light with a size",
        "a whole number from 0 to 2^53",
        lambda value: is_whole(value, 0),
        0,
    ),
    "repeats": Field(
        "timed builds and queries; medians are reported",
        "a whole number from 1 to 1000",
        lambda value: is_whole(value, 1, 1000),
        3,
    ),
    "warm_ups": Field(
        "such runs before them; whatever compiles is compiled before all of them",
        "a whole number from 0 to 1000",
        lambda value: is_whole(value, 0, 1000),
        1,
    ),
    "predicted": Field(
        "whether the displacement of edges is predicted from the texels' sizes too",
        "true or false",
        lambda value: isinstance(value, bool),
        False,
    ),
    "keep": Field(
        "arrays that are kept with the trial",
        f"a list of names in quotes: {', '.join(KEEPS)}",
        _keeps,
        [],
    ),
}
"""Every key of a trial but the table `settings`."""


def check_value(name: str, value: object, where: str) -> None:
    """Raise `UseError` unless `value` may be that of the key `name`; `where` says where it is."""
    field = FIELDS[name]
    if not field.fits(value):
        raise UseError(f"{where} is {shown(value)}; allowed: {field.allowed}.")


def check_setting(value: object, where: str) -> None:
    """Raise `UseError` for what can be no setting of any algorithm; which may have which value is
    for the algorithm to say."""
    fits = isinstance(value, bool | str) or (
        isinstance(value, int) and -(2**63) <= value < 2**63
    ) or (isinstance(value, float) and not math.isnan(value))  # fmt: skip
    if not fits or (isinstance(value, str) and len(value) > LONGEST_TEXT):
        raise UseError(
            f"{where} is {shown(value)}; allowed: a number, but not nan, true or false, or a text "
            "in quotes."
        )


def shown(value: object) -> str:
    """A value of a file for a message: not long."""
    if isinstance(value, bool):
        return "true" if value else "false"
    try:
        text = f'"{value}"' if isinstance(value, str) else str(value)
    except ValueError:
        # Python writes out no more than some thousand digits.
        return "a number of thousands of digits"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def table() -> str:
    """The keys of a trial in Markdown, a row for each."""
    rows = [("key", "values", "default", "meaning"), ("---",) * 4]
    for name, field in FIELDS.items():
        default = field.default
        written = "" if default is None else shown(default)
        rows.append((f"`{name}`", field.allowed, written, field.means))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def written_into(page: str) -> str:
    """`page` with the table between its markers.

    Raises:
        UseError: the page has not one line of each marker, in their order.
    """
    return between_markers(page, BEGIN, END, table())


if __name__ == "__main__":
    write_pages(written_into)
