"""The tables of docs/settings.md: every setting of every algorithm, as a settings file has it.

All is read from the code: `python -m asmjax.shadow.settings_page docs/settings.md` writes the
tables between the page's two markers.
"""

import math
from dataclasses import fields
from typing import Any

from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.pages import between_markers, write_pages
from asmjax.shadow.registry import ALGORITHMS
from asmjax.shadow.settings import INFINITE, UNITS, kind_words, meanings, setting_types

BEGIN = "<!-- begin: written by `python -m asmjax.shadow.settings_page docs/settings.md` -->"
END = "<!-- end -->"

COLUMNS = ("setting", "value", "default", "meaning")


def table_of(family: str) -> str:
    """The table in Markdown of one algorithm: a row for each name that its file may use."""
    algorithm = ALGORITHMS[family]
    meaning, defaults = meanings(algorithm), _defaults(algorithm)
    rows = [COLUMNS, ("---",) * len(COLUMNS)]
    for name, annotation in setting_types(algorithm).items():
        infinite = ", inf too" if (family, name) in INFINITE else ""
        value = f"{kind_words(annotation)}{infinite}"
        rows.append((f"`{name}`", value, _shown(defaults[name]), meaning[name]))
        for other, unit in UNITS.items():
            if unit.field == name:
                instead = f"instead of `{name}`: the same in {unit.words}."
                rows.append((f"`{other}`", "a number", "", instead))
    cells = ([cell.replace("|", "\\|") for cell in row] for row in rows)
    return "".join(f"| {' | '.join(row)} |\n" for row in cells)


def tables() -> str:
    """A heading and a table for each algorithm of the registry."""
    return "\n".join(
        f"### `{family}`\n\n`{algorithm.__name__}`: {algorithm.reference}.\n\n{table_of(family)}"
        for family, algorithm in ALGORITHMS.items()
    )


def written_into(page: str) -> str:
    """`page` with the tables between its markers.

    Raises:
        UseError: the page has not one line of each marker, in their order.
    """
    return between_markers(page, BEGIN, END, tables())


def _defaults(algorithm: type[ShadowAlgorithm]) -> dict[str, Any]:
    return {field.name: field.default for field in fields(algorithm)}


def _shown(value: Any) -> str:
    """A default as a settings file has it."""
    if value is None:
        return "left out"
    if isinstance(value, ShadowAlgorithm):
        return value.name
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:g}"
    return str(value)


if __name__ == "__main__":
    write_pages(written_into)
