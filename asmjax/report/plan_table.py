"""A plan as a table: a row for each decision."""

from collections.abc import Callable, Mapping

from asmjax.effects import Plan
from asmjax.report.table import Column, short_count, significant, table_text


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
