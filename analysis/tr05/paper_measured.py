"""Section 5 of TR05-024 as measured: its numbers, our bounds and tables beside them.

Reads the record as `tr05.paper` does; what a step did not measure is left out.
"""

from collections.abc import Iterator, Mapping, Sequence

from asmjax.experiment.bounds import Bound
from asmjax.report.table import MB, significant

PAPER_MEASURED = {
    "figure 1": "TSM at 4K does not reach SSM at 1K, small angle between light and view (5.2)",
    "figure 9": {"alpha": 100, "gain": "nearly 5 times", "section": "caption"},
    "figure 10": {"words": "total frame time roughly twice that of a warping algorithm (5.2)",
                  "ratio": 2.0},
    "error": "maximum aliasing reduced by a factor of 10 or more (conclusion)",
    "overdraw": {"section": "table 2", "SSM": {"St. Matthew": 1.16, "Power plant": 1.67},
                 "SSM*": {"St. Matthew": 1.25, "Power plant": 2.48}},
}  # fmt: skip
"""What the paper measured, with the place; SSM* is with face subdivision (the caption of table 2
names the two the other way round)."""

POWER_PLANT = {"SSM": 1.67, "SSM*": 2.48}
"""Overdraw of the paper's model of many separate objects."""

WORDS = {
    "SSM": "frustum subdivisions",
    "SSM*": "frustum and face subdivisions",
}


def measured_bounds(record: Mapping) -> Iterator[Bound]:
    """The requirements on what was measured."""
    yield from _aliasing_bounds(record)
    yield _time_bound(record)
    yield from _overdraw_bounds(record)
    for scene in record.get("equal_bytes", {}):
        yield _equal_bound(record, scene)
    if not record.get("equal_bytes"):
        yield Bound("equal bytes", "wrong pixels, ASM / best of SSM* and SDSM", None, 1.0)
    yield from _explained_bounds(record)


def _aliasing_bounds(record: Mapping) -> Iterator[Bound]:
    along = _by_label(record, "along")
    small, large, subdivided = _labels(along)
    words = "light 10° off the view: largest perspective error"
    yield Bound(
        "along the view",
        f"{words}, {subdivided} / {small}",
        _ratio(along, subdivided, small),
        0.1,
        reason=_reason(along, subdivided, small),
    )
    yield Bound(
        "figure 1",
        f"{words}, {subdivided} / {large}",
        _ratio(along, subdivided, large),
        1.0,
        reason=_reason(along, subdivided, large),
    )


def _reason(rows: Mapping, one: str, other: str) -> str:
    if not rows:
        return ""
    return " / ".join(f"{rows[name]['max_perspective']:.3g}" for name in (one, other))


def _time_bound(record: Mapping) -> Bound:
    rows = record.get("figure_10", {}).get("rows", ())
    ratios = {row["label"]: ratio for row, ratio in _time_ratios(rows)}
    return Bound(
        "figure 10",
        "time of a frame, SSM / TSM of as many texels: the largest; SSM* beside it",
        max(
            (ratio for label, ratio in ratios.items() if not label.startswith("SSM*")), default=None
        ),
        PAPER_MEASURED["figure 10"]["ratio"],
        reason="; ".join(f"{label} {ratio:.2f}" for label, ratio in ratios.items()),
    )


def _time_ratios(rows: Sequence[Mapping]) -> Iterator[tuple[Mapping, float]]:
    """Every row but the trapezoidal maps', with its time over that of the one of its size."""
    base = {row["side"]: row["total"] for row in rows if row["name"] == "TSM"}
    yield from ((row, row["total"] / base[row["side"]]) for row in rows if row["name"] != "TSM")


def _overdraw_bounds(record: Mapping) -> Iterator[Bound]:
    rows = record.get("overdraw", ())
    for name, limit in POWER_PLANT.items():
        row = next((row for row in rows if row["map"] == name), None)
        about = "" if row is None else f"{row['scene']}, {row['objects']} {row['objects_are']}"
        yield Bound(
            f"overdraw {name}",
            f"overdraw of {WORDS[name]} on separate objects, against the paper's power plant",
            None if row is None else row["factor"],
            limit,
            reason=about,
        )


def _equal_bound(record: Mapping, scene: str) -> Bound:
    rows = {row["label"]: row for row in record["equal_bytes"][scene]["rows"]}
    others = min(rows[name]["wrong"] for name in rows if name != "ASM")
    wrong = rows["ASM"]["wrong"]
    return Bound(
        f"equal bytes, {scene}",
        f"wrong pixels on {scene}, ASM / best of SSM* and SDSM of as many bytes",
        wrong / others if others else (0.0 if wrong == 0 else float("inf")),
        1.0,
        reason=f"{significant(100 * wrong)} % / {significant(100 * others)} %",
    )


def _explained_bounds(record: Mapping) -> Iterator[Bound]:
    found = record.get("explained", {})
    for axes in ("log-log", "linear"):
        identity, fitted = (found.get(f"{axes}, {line}") for line in ("identity", "fitted line"))
        yield Bound(
            f"displacement, {axes}",
            f"measured displacement not explained by the predicted one, 1 − R², {axes} axes, "
            "against the identity",
            None if identity is None else 1 - identity,
            0.02,
            reason="" if fitted is None else f"fitted line {1 - fitted:.4f}",
        )


def _by_label(record: Mapping, key: str) -> dict[str, Mapping]:
    rows = record.get("alley", {}).get(key, {}).get("rows", ())
    return {row["label"]: row for row in rows}


def _labels(rows: Mapping) -> tuple[str, str, str]:
    """Names of the small and the large trapezoidal map and of the subdivided one."""
    names = list(rows) or ["TSM 1K", "TSM 4K", "SSM 1K"]
    return names[0], names[1], names[2]


def _ratio(rows: Mapping, one: str, other: str) -> float | None:
    if not rows:
        return None
    return rows[one]["max_perspective"] / rows[other]["max_perspective"]


def measured_sections(record: Mapping) -> Iterator[tuple[str, str, str, tuple[str, ...]]]:
    """Title, words, table and names of figures of each part of the document."""
    yield (
        "Figures 1 and 9: aliasing in an alley",
        "m is texel width / pixel width on the surface, its perspective factor that of the beams "
        "alone. " + _gain_words(record),
        _alley_table(record),
        ("alley_sun", "alley_along"),
    )
    yield (
        "Figure 10: time of a frame",
        "Medians; every map is fitted, cast and queried from nothing. The paper: "
        f"{PAPER_MEASURED['figure 10']['words']}.",
        _time_table(record),
        ("figure_10",),
    )
    yield (
        "Table 2: overdraw",
        "What a rasteriser would draw: objects whose bounds, as the light sees them, meet a "
        "subdivision and do not lie behind all its receivers. Factor: renderings / objects drawn "
        "at least once, as in the paper (St. Matthew 1.16 and 1.25, power plant 1.67 and 2.48 for "
        "SSM and SSM*). A map that is cast ray by ray has no overdraw: every texel is one ray.",
        _overdraw_table(record),
        (),
    )
    yield (
        "Maps of equal bytes",
        "Wrong pixels / pixel of edge is the mean distance by which edges moved.",
        _equal_table(record),
        (),
    )
    yield (
        "Predicted and measured displacement",
        "Predicted from the texels' sizes alone (M4), counted as wrong pixels per pixel of edge.",
        _explained_table(record),
        ("displacements",),
    )


def _gain_words(record: Mapping) -> str:
    rows = _by_label(record, "sun")
    if len(rows) < 4:
        return ""
    without, parted = list(rows.values())[2:4]
    gain = without["max_perspective"] / parted["max_perspective"]
    return (
        f"Face subdivision divides the largest perspective error by {gain:.2f} under the plant's "
        f"sun (the paper's figure 9, on a scene of its own: {PAPER_MEASURED['figure 9']['gain']})."
    )


def _alley_table(record: Mapping) -> str:
    lines = []
    for key in ("sun", "along"):
        entry = record.get("alley", {}).get(key)
        if not entry:
            continue
        for row in entry["rows"]:
            lines.append(
                f"| {entry['light']} ({entry['angle_deg']:.0f}°) | {row['label']} "
                f"| {significant(row['max_perspective'])} | {significant(row['worst_depth'])} "
                f"| {significant(row['p95_perspective'])} "
                f"| {significant(row['max_m'])} | {significant(row['p95_m'])} "
                f"| {significant(100 * row['wasted'])} | {significant(100 * row['wrong'])} |"
            )
    return _table(
        "light (to the view) | map | perspective factor, max | at depth / near | p95 "
        "| m, max | p95 | texels wasted, % | wrong pixels, %", 2, lines,
    )  # fmt: skip


def _time_table(record: Mapping) -> str:
    entry = record.get("figure_10")
    if not entry:
        return ""
    ratios = {row["label"]: f"{ratio:.2f}" for row, ratio in _time_ratios(entry["rows"])}
    lines = [
        f"| {row['label']} | "
        + " | ".join(significant(1e3 * row["seconds"][name]) for name in ("fit", "cast", "query"))
        + f" | {significant(1e3 * row['total'])} | {ratios.get(row['label'], '1')} |"
        for row in entry["rows"]
    ]
    lines.append(f"| rays | – | – | {significant(1e3 * entry['rays'])} "
                 f"| {significant(1e3 * entry['rays'])} | – |")  # fmt: skip
    return _table("map | fit, ms | cast, ms | query, ms | frame, ms | / TSM", 1, lines)


def _overdraw_table(record: Mapping) -> str:
    lines = [
        f"| {row['scene']} | {row['objects']} {row['objects_are']} | {row['map']} | {row['parts']} "
        f"| {row['renderings']} | {row['drawn']} | {row['one_map']} | {row['factor']:.2f} "
        f"| {row['against_one_map']:.2f} |"
        for row in record.get("overdraw", ())
    ]
    return _table(
        "scene | objects | map | subdivisions | renderings | drawn at least once | drawn for one "
        "map | factor | renderings / one map", 3, lines,
    )  # fmt: skip


def _equal_table(record: Mapping) -> str:
    lines = [
        f"| {scene} | {row['label']} | {significant(row['bytes'] / MB)} "
        f"| {significant(100 * row['wrong'])} | {significant(row['wrong_per_edge_pixel'])} "
        f"| {significant(row['p95_m'])} | {significant(row['max_m'])} "
        f"| {significant(100 * row['wasted'])} |"
        for scene, entry in record.get("equal_bytes", {}).items()
        for row in entry["rows"]
    ]
    return _table(
        "scene | map | MB | wrong pixels, % | wrong / pixel of edge | m, p95 | m, max "
        "| texels wasted, %", 2, lines,
    )  # fmt: skip


def _explained_table(record: Mapping) -> str:
    found = record.get("explained", {})
    lines = [
        f"| {axes} | {found[f'{axes}, identity']:.4f} | {found[f'{axes}, fitted line']:.4f} "
        f"| {found[f'{axes}, slope']:.3f} |"
        for axes in ("log-log", "linear")
        if f"{axes}, identity" in found
    ]
    text = _table("axes | R², identity | R², fitted line | its slope", 1, lines)
    maps = len(record.get("displacements", ()))
    if not text or maps == found["points"]:
        return text
    return f"{text}\n\n{found['points']} of {maps} maps; of the others too few edges stand alone."


def _table(head: str, texts: int, lines: Sequence[str]) -> str:
    """A Markdown table whose first columns, `texts` of them, are words; empty without lines."""
    if not lines:
        return ""
    columns = head.count("|") + 1
    rule = "| " + " | ".join(["---"] * texts + ["---:"] * (columns - texts)) + " |"
    return "\n".join([f"| {head} |", rule, *lines])
