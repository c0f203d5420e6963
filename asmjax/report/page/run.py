"""The section of `asmjax run`: one view, its maps beside truth."""

from collections.abc import Mapping

from asmjax.report.figures.families import FAMILY_LOOKS
from asmjax.report.figures.seen import TRUTH, seen_name, wrong_name
from asmjax.report.figures.style import KIND_COLOURS
from asmjax.report.page.chart import Chart, Mark, Point, charts
from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.pictures import figures, read_picture
from asmjax.report.page.plan import missing_words, plan_block
from asmjax.report.page.provenance import provenance_block
from asmjax.report.page.slider import Layer, slider
from asmjax.report.page.tables import table
from asmjax.report.page.words import megabytes, milliseconds, of_kind, percent, times
from asmjax.report.table import (
    METHOD_COLUMNS,
    SOFT_COLUMNS,
    Column,
    has_penumbrae,
    significant,
)

LOOKS = {**FAMILY_LOOKS, "rays": (KIND_COLOURS["rays"], "D")}
"""Colour and marker by what a method's name begins with."""

_FIGURES = {
    "shadows.png": (
        "Truth and the maps, and below them the places where shadow edges went wrong most.",
        "The scene under ray-traced shadows and under each map's, with enlarged squares",
    ),
    "errors.png": (
        "Where pixels are wrong: false lit orange, false dark blue.",
        "Wrong pixels of each map over a pale picture of the true shadow",
    ),
    "maps.png": (
        "What each pixel needs: area ratio, m, side of the flat map, benefit of refining.",
        "Four maps over the eye's image, in false colours",
    ),
    "levels.png": (
        "The resolution that answered each pixel of the adaptive map, and the one it needs.",
        "Two maps of resolution over the eye's image",
    ),
    "tree.png": (
        "The nodes of the adaptive map over a relief of what the light sees.",
        "Squares of the quadtree, small ones along shadow edges",
    ),
}

_MAPS = {
    "area_ratio": "area of a texel / of a pixel",
    "linear_ratio": "its square root",
    "m": "m: texel / pixel width, worst direction",
    "n_required": "texels of a flat map that matches",
    "benefit": "pixels that refining would help",
}


def run_part(results: Results) -> Part:
    """The section of a run.

    Raises:
        UseError: a picture in the folder is damaged.
    """
    report = results.report
    methods = report["methods"]
    columns = METHOD_COLUMNS
    tables = [table(columns, methods, "Methods: memory, rays, time and errors")]
    if has_penumbrae(methods):
        tables.append(table(SOFT_COLUMNS, methods, "Errors of penumbrae against soft truth"))
    body = joined(
        [
            _slider(results),
            tag("h3", "What accuracy costs"),
            charts([_chart(report)]),
            *tables,
            tag("h3", "What each pixel needs, and gets"),
            _map_table(report["maps"]),
            figures(results, _FIGURES),
            plan_block(report["plan"]) if "plan" in report else None,
            provenance_block(results),
        ]
    )
    return Part(f"Run: {report['scene']}, {report['view']}", _summary(report), body)


def _summary(report: Mapping) -> tuple[str, ...]:
    methods = report["methods"]
    uniform, adaptive, rays = (of_kind(methods, kind) for kind in ("uniform", "adaptive", "rays"))
    said = []
    if uniform and adaptive:
        said += [_errors(uniform, adaptive), _costs(uniform, adaptive)]
    said += [
        f"{method['name']} gets {percent(_wrong(method))} wrong in {_time(method)} and "
        f"{megabytes(method['bytes'])}."
        for method in methods
        if method not in (uniform, adaptive) and not method["name"].startswith("rays")
    ]
    if rays:
        exact = "is exact and " if _wrong(rays) == 0 else ""
        said.append(
            f"{rays['name']}, the yardstick, traces {rays['rays']:,} shadow rays, {exact}takes "
            f"{_time(rays)}."
        )
    if "plan" in report:
        said += missing_words(report["plan"])
    return tuple(said)


def _errors(uniform: Mapping, adaptive: Mapping) -> str:
    ours, theirs = _wrong(adaptive), _wrong(uniform)
    compared = ", as many as"
    if ours == 0 < theirs:
        compared = ", unlike"
    elif ours < theirs:
        compared = f", {times(theirs, ours)} fewer than"
    elif theirs < ours:
        more = f"{times(ours, theirs)} " if theirs else ""
        compared = f", {more}more than"
    off = [
        significant(method["error"]["boundary_displacement_px"]["mean"])
        for method in (adaptive, uniform)
    ]
    return (
        f"{adaptive['name']} gets {percent(ours)} of the pixels wrong{compared} {uniform['name']} "
        f"with {percent(theirs)}; their shadow edges lie {off[0]} and {off[1]} pixels off in the "
        "mean."
    )


def _costs(uniform: Mapping, adaptive: Mapping) -> str:
    return (
        f"From nothing the adaptive map takes {_time(adaptive)} and "
        f"{megabytes(adaptive['bytes'])}, the uniform one {_time(uniform)} and "
        f"{megabytes(uniform['bytes'])}."
    )


def _wrong(method: Mapping) -> float:
    return method["error"]["misclassified_fraction"]


def _time(method: Mapping) -> str:
    return milliseconds(method["seconds"]["total"])


def _slider(results: Results) -> Markup:
    """Truth, the maps and their wrong pixels, as far as the run wrote pictures of them."""
    names = [method["name"] for method in results.report["methods"]]
    wanted = [(TRUTH, "Truth: traced shadow rays", "The scene under its true shadow")]
    wanted += [(seen_name(n), n, f"The scene under the shadow of {n}") for n in names]
    wanted += [
        (wrong_name(n), f"Wrong pixels of {n}", f"Where {n} and truth differ, in colour")
        for n in names
    ]
    layers = [
        Layer(words, alt, read_picture(path))
        for file, words, alt in wanted
        if (path := results.file(file)) is not None
    ]
    head = tag("h3", "Truth and shadow maps")
    if len(layers) < 2:
        note = "The folder has no pictures to compare (seen_*.png): a run writes them."
        return joined([head, tag("p", note, class_="note")])
    first = 1 if len(layers) > 2 else 0
    return joined([head, slider(layers, first, first + 1)])


def _chart(report: Mapping) -> Chart:
    points = []
    # Soft truth is cast once and cold: its time is none to compare with.
    traced = [method for method in report["methods"] if method["name"].startswith("rays")]
    shown = [m for m in report["methods"] if len(traced) < 2 or m is not traced[-1]]
    for method in shown:
        time = max(1e3 * method["seconds"]["total"], 1e-3)
        points.append(
            Point(
                group=method["name"],
                name=method["name"],
                x=time,
                y=100 * _wrong(method),
                low=time,
                high=time,
                facts=(
                    f"{percent(_wrong(method))} of the pixels wrong",
                    _time(method),
                    f"{megabytes(method['bytes'])}, {method['rays']:,} rays",
                ),
            )
        )
    marks = [Mark("tracing every pixel", points[i].x) for i, m in enumerate(shown) if m in traced]
    return Chart(
        title="wrong pixels against time",
        x_axis="time from nothing, milliseconds",
        y_axis="wrong pixels, %",
        points=points,
        looks={method["name"]: _look(method["name"]) for method in shown},
        marks=marks[:1],
        note="Lower left is better. Open markers on the line of 0: no wrong pixel.",
    )


def _look(name: str) -> tuple[str, str]:
    return next((look for kind, look in LOOKS.items() if name.startswith(kind)), ("#000000", "h"))


def _map_table(maps: Mapping) -> Markup:
    def column(head: str) -> Column:
        return Column("", head, lambda row: row[head], _amount, head)

    columns = [Column("", "map", lambda row: row["map"], str, "map")]
    columns += [column(head) for head in ("p50", "p95", "max")]
    rows = [{"map": words, **maps[name]} for name, words in _MAPS.items()]
    return table(columns, rows, "Maps over the pixels that the light shines on")


def _amount(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else significant(value)
