"""The section of `asmjax analyze`: perspective aliasing of all maps at equal memory."""

from collections.abc import Mapping

from asmjax.report.analyze_table import ANALYSIS_COLUMNS
from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.pictures import figures
from asmjax.report.page.provenance import provenance_block
from asmjax.report.page.tables import table
from asmjax.report.page.words import megabytes, percent
from asmjax.report.table import significant

_FIGURES = {
    "aliasing.png": (
        "m of all maps on one scale: above 1 a texel is wider than the pixel that asks for it.",
        "A map of m over the eye's image for each algorithm",
    ),
    "displacement.png": (
        "Displacement of shadow edges, measured against predicted.",
        "Points along the diagonal, one for each map",
    ),
}

_ANGLES = {
    "light_angles.png": (
        "Errors and storage factor against the angle between light and view; lines are theory.",
        "Three plots over the angle of the light, one line for each algorithm",
    ),
}


def analysis_part(results: Results) -> Part:
    """The section of an analysis.

    Raises:
        UseError: a picture in the folder is damaged.
    """
    report = results.report
    drawn = _FIGURES | (_ANGLES if report["light_angles"] else {})
    body = joined(
        [
            table(ANALYSIS_COLUMNS, report["methods"], "All maps at equal memory"),
            figures(results, drawn),
            _theory(report),
            provenance_block(results),
        ]
    )
    return Part(f"Analysis: {report['scene']}, {report['view']}", _summary(report), body)


def _summary(report: Mapping) -> tuple[str, ...]:
    maps = [method for method in report["methods"] if "aliasing" in method]
    if not maps:
        return ()
    by_m = sorted(maps, key=lambda method: method["aliasing"]["p95_m"])
    by_wrong = min(maps, key=lambda method: method["error"]["misclassified_fraction"])
    best, worst = by_m[0], by_m[-1]
    return (
        f"Of {len(maps)} maps of {megabytes(report['memory_limit_bytes'])}, 95 % of the pixels "
        f"have m of at most {_p95(best)} under {best['name']} and {_p95(worst)} under "
        f"{worst['name']}.",
        f"{by_wrong['name']} gets the fewest pixels wrong: "
        f"{percent(by_wrong['error']['misclassified_fraction'])}.",
    )


def _p95(method: Mapping) -> str:
    return significant(method["aliasing"]["p95_m"])


def _theory(report: Mapping) -> Markup | None:
    angles = report["light_angles"]
    if not angles:
        return None
    words = (
        f"Under {len(angles['angles'])} other directions of light; seen depths reach from 1 to "
        f"{significant(angles['alpha'])}, half the field of view is "
        f"{significant(angles['half_view_deg'])} degrees."
    )
    return tag("p", words)
