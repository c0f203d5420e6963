"""The section of `asmjax plan`, and the plan that a run followed."""

from collections.abc import Mapping

from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.pictures import figures
from asmjax.report.page.provenance import provenance_block
from asmjax.report.page.tables import bullets, table
from asmjax.report.page.words import milliseconds, percent
from asmjax.report.table import Column, short_count, significant

_FIGURES = {
    "plan.png": (
        "Of each light its hard shadow as the probe sees it, and the widest penumbra that each "
        "pixel may lie in.",
        "Panels of each light's shadow and of the widths of its penumbrae",
    ),
}


def _width(which: str) -> Column:
    return Column(
        "penumbra, px", which, lambda row: row[f"width_{which}"] or None, significant, which
    )


_COLUMNS = (
    Column("", "light", lambda row: row["light"], str, "light"),
    Column("", "kind", lambda row: row["kind"], str, "kind"),
    Column("", "by", lambda row: _methods(row), str, "methods"),
    _width("p50"),
    _width("p95"),
    Column("ignored, %", "of light", lambda row: 100 * row["error"], significant, "error"),
    Column("estimated", "rays", lambda row: row["rays"] or None, short_count, "rays"),
    Column("estimated", "time", lambda row: row["seconds"] or None, milliseconds, "seconds"),
)


def plan_part(results: Results) -> Part:
    """The section of a plan.

    Raises:
        UseError: a picture in the folder is damaged.
    """
    report = results.report
    plan = report["plan"]
    said = tuple(_decision_words(row) for row in plan["decisions"])
    body = joined(
        [
            plan_block(plan),
            figures(results, _FIGURES),
            provenance_block(results),
        ]
    )
    title = f"Plan: {report['scene']}, {report['view']}"
    return Part(title, (*said, *missing_words(plan)), body)


def plan_block(plan: Mapping) -> Markup:
    """The decisions as a table, with their reasons, and what is skipped."""
    reasons = [
        f"{row['light']}: {row['reason']}" + _number(row)
        for row in plan["decisions"]
        if row["reason"]
    ]
    skipped = [f"{item['effect']}{_whose(item)}: {item['reason']}" for item in plan["skipped"]]
    told = bullets(skipped)
    tolerance = percent(plan["tolerance"])
    return joined(
        [
            tag("h3", "Which shadow effects the view calls for"),
            table(_COLUMNS, plan["decisions"], "The plan, light by light"),
            bullets([*reasons, *plan["notes"]]),
            tag("p", f"Skipped, as it changes less than {tolerance} of the light or is not there:")
            if told
            else None,
            told,
        ]
    )


def missing_words(plan: Mapping) -> list[str]:
    """Sentences about what is called for and not simulated."""
    return [
        f"Not simulated: {item['effect']}{_whose(item)}, {percent(item['error'])} of the light: "
        f"{item['reason']}."
        for item in plan["not_simulated"]
    ]


def _decision_words(row: Mapping) -> str:
    by = _methods(row)
    return f"{row['light']}: {row['kind']}{f' by {by}' if by else ''}, as {row['reason']}."


def _methods(row: Mapping) -> str | None:
    if not row["simulated"]:
        return "not simulated"
    return " + ".join(row["methods"]) or None


def _number(row: Mapping) -> str:
    if row["forced"]:
        return " (as was asked for)"
    if not row["quantity"]:
        return ""
    other = f", threshold {row['threshold']:.3g}" if row["threshold"] else ""
    return f" ({row['quantity']} = {row['number']:.3g}{other})"


def _whose(item: Mapping) -> str:
    return f" of {item['light']}" if item["light"] else ""
