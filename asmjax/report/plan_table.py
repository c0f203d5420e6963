"""A plan as a table: a row for each decision."""

import textwrap
from collections.abc import Callable, Mapping

from asmjax.effects import Plan
from asmjax.effects.records import percent
from asmjax.report.table import MAX_WIDTH, Column, short_count, significant, table_text


def _number(group: str, head: str, key: str, scale: float = 1.0) -> Column:
    """A number of a decision, "-" where there is no map, or for 0 widths."""

    def value(row: Mapping) -> float | None:
        return scale * row[key] if row[key] else None

    text: Callable[[float], str] = significant
    return Column(group, head, value, text, key)


_COLUMNS = (
    Column("", "light", lambda row: row["light"], str, "light"),
    Column("", "kind", lambda row: row["kind"] + ("!" * row["forced"]), str, "kind"),
    Column("", "by", lambda row: _methods(row), str, "methods"),
    Column("", "faces", lambda row: row["faces"] or None, str, "faces"),
    _number("penumbra, px", "p50", "width_p50"),
    _number("penumbra, px", "p95", "width_p95"),
    Column("", "samples", lambda row: row["samples"] if row["faces"] else None, str, "samples"),
    Column("ignored, %", "of light", lambda row: 100 * row["error"], significant, "error_percent"),
    Column("estimated", "rays", lambda row: row["rays"] or None, short_count, "rays"),
    _number("estimated", "ms", "seconds", 1e3),
)


def _methods(row: Mapping) -> str | None:
    if not row["simulated"]:
        return "not simulated"
    return "+".join(row["methods"]) or None


def plan_table(plan: Plan) -> str:
    """The decisions as text, without a last newline.

    "!" marks what was asked for; `ignored` is what leaving the effect out would change, of the
    picture's light, mean over its pixels.
    """
    return table_text(_COLUMNS, plan.record()["decisions"])


def plan_summary(plan: Mapping) -> str:
    """A plan's record in a few lines, without a last newline: what is done about each light and
    why, and what is missing."""
    said = []
    for row in plan["decisions"]:
        by = f" by {_methods(row)}" if _methods(row) else ""
        said.append(f"plan, {row['light']}: {row['kind']}{by}; {row['reason']}")
    for item in plan["not_simulated"]:
        much = f" ({percent(item['error'])} of the light)" if item["error"] else ""
        said.append(f"not simulated: {item['effect']}{much}: {item['reason']}")
    wrapped = (textwrap.wrap(line, MAX_WIDTH, subsequent_indent="  ") for line in said)
    return "\n".join(line for lines in wrapped for line in lines)
