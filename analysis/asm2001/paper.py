"""Section 5 of the 2001 paper as a report: its numbers, our bounds, and both in one document.

Everything here reads the record that `analysis/adaptive_shadow_maps_2001.py` writes step by step;
what a step did not measure is left out of the tables, and its bounds are skipped.
"""

from collections.abc import Iterator, Mapping

from asmjax.experiment.bounds import Bound
from asmjax.report.table import MB, significant, texels_a_side

PAPER = {
    "source": "Fernando, Fernandez, Bala, Greenberg: Adaptive Shadow Maps, SIGGRAPH 2001, 5",
    "machine": "1 GHz Pentium III, NVIDIA GeForce2 Ultra",
    "size": [512, 512],
    "memory_bytes": 16 * MB,
    "uniform_fps": 8.5,
    "adaptive_fps": 4.9,
    "uniform_seconds": 0.117,
    "adaptive_seconds": 0.203,
    "extra_seconds": {
        "cost-benefit analysis": 0.030,
        "node creation": 0.005,
        "queries through the hierarchy": 0.035,
        "identity pass": 0.016,
    },
    "effective_resolution": {"figure 2": 65_536, "figure 3": 524_288},
}
"""What the paper measured; the extra seconds are what its adaptive frame took beyond the other."""

STAGES = {
    "analysis": "cost-benefit analysis",
    "build": "node creation",
    "query": "queries through the hierarchy",
    "id_pass": "identity pass",
}
"""Our stages by the paper's names for them."""

FLAT = 0.05
"""Largest exponent of a time that counts as not growing: 19 % over 32 times the size."""

_ERRORS = {"overview": 1 / 5, "closeup": 1 / 20, "macro": 1 / 50}
_LARGE = {
    # Walkthrough, bound and aim of the warm frame against the rays, and in words.
    "victorian_house": (2.0, 1.0, "victorian_house (1 M triangles): warm frame / one ray a pixel"),
    "surface:12m": (0.5, None, "surface of 12 M triangles: warm frame / one ray a pixel"),
    "victorian_house, 16 samples": (
        1.0, None, "victorian_house, 16 eye samples a pixel: warm frame / 16 rays a pixel",
    ),
}  # fmt: skip


def bounds_of(record: Mapping) -> list[Bound]:
    """Every requirement, with the figure that the record has for it."""
    return [*_time_bounds(record), *_error_bounds(record), *_growth_bounds(record),
            *_other_bounds(record)]  # fmt: skip


def _time_bounds(record: Mapping) -> Iterator[Bound]:
    yield Bound(
        "warm frame",
        "paper_room, warm walkthrough frame without the eye pass: ASM / "
        f"{_flat(record)} drawn anew",
        time_ratio(record, "paper_room", "uniform"),
        0.35,
        0.2,
        f"the paper's is {PAPER['adaptive_seconds'] / PAPER['uniform_seconds']:.1f}",
    )
    view = record.get("views", {}).get("overview", {})
    adaptive, uniform = (method_of(view, kind) for kind in (_adaptive_of(record), "uniform"))
    yield Bound(
        "cold start",
        f"paper_room, overview: ASM from nothing to convergence / one frame of {_flat(record)}",
        adaptive["seconds"]["total"] / uniform["seconds"]["total"]
        if adaptive and uniform
        else None,
        4.0,
        2.5,
        f"ended: {adaptive['status'].replace('_', ' ')}" if adaptive else "",
    )
    for name, (limit, aim, words) in _LARGE.items():
        yield Bound(name, words, time_ratio(record, name, "rays"), limit, aim,
                    record.get("skipped", {}).get(name, ""))  # fmt: skip


def _error_bounds(record: Mapping) -> Iterator[Bound]:
    for view, limit in _ERRORS.items():
        found = record.get("views", {}).get(view, {})
        adaptive, uniform = (method_of(found, kind) for kind in (_adaptive_of(record), "uniform"))
        ratio = None
        if adaptive and uniform:
            wrong = uniform["error"]["misclassified_fraction"]
            ratio = adaptive["error"]["misclassified_fraction"] / wrong if wrong else None
        yield Bound(
            f"error, {view}",
            f"wrong pixels, ASM / {_flat(record)}: paper_room, {view}",
            ratio,
            limit,
        )


def _growth_bounds(record: Mapping) -> Iterator[Bound]:
    growth = record.get("growth", {})

    def slope(axis: str, series: str, which: str = "slopes"):
        return growth.get(axis, {}).get(which, {}).get(series)

    for series, words in (("warm", "warm frame"), ("cold", "cold start")):
        yield Bound(
            f"growth with pixels, {words}",
            f"{words} against eye pixels, exponent: at most linear",
            slope("pixels", series),
            1.0,
        )
    for series, words in (("warm", "warm frame"), ("cold", "cold start")):
        mine, flat = slope("triangles", series), slope("triangles", "uniform")
        yield Bound(
            f"growth with triangles, {words}",
            f"{words} against triangles, exponent minus the uniform map's: not above 0",
            None if mine is None or flat is None else mine - flat,
            0.0,
            reason="" if flat is None else f"the uniform map's exponent is {flat:.2f}",
        )
    held = [size / MB for size in growth.get("memory", {}).get("converged", ())]
    reached = ", ".join(f"{size:g}" for size in held) + " MB" if held else "no limit"
    for series, words in (("warm", "warm frame"), ("cold", "cold start")):
        yield Bound(
            f"growth with memory, {words}",
            f"{words} against the memory limit, exponent where the map has converged: flat",
            slope("memory", series, "slopes_converged"),
            FLAT,
            reason=f"converged at {reached}" if "memory" in growth else "",
        )


def _other_bounds(record: Mapping) -> Iterator[Bound]:
    retraces = record.get("retraces")
    yield Bound(
        "retraces",
        f"functions traced in {retraces['frames'] if retraces else 200} frames after warm-up",
        None if retraces is None else float(retraces["count"]),
        0.0,
        reason=", ".join(sorted(set(retraces["names"]))) if retraces else "",
    )
    shares = [
        method["bytes"] / method["settings"]["memory_bytes"]
        for view in record.get("views", {}).values()
        for method in view["methods"]
        if method["name"].startswith("adaptive")
    ]
    for walk in record.get("walkthroughs", {}).values():
        method = method_of(walk["summary"], "adaptive")
        if method:
            shares.append(method["bytes"] / walk["memory_limit_bytes"])
    for axis, growth in record.get("growth", {}).items():
        for point in growth["points"]:
            limit = point["size"] if axis == "memory" else growth["memory_bytes"]
            shares.append(point["bytes"] / limit)
    yield Bound(
        "memory", "most memory of any adaptive map / its limit", max(shares, default=None), 1.0
    )


def method_of(holder: Mapping, kind: str) -> Mapping | None:
    """The first of its `methods` whose name begins with `kind`."""
    methods = holder.get("methods", ())
    return next((m for m in methods if m["name"].startswith(kind)), None)


def time_ratio(record: Mapping, walk: str, kind: str) -> float | None:
    """The adaptive map's time / that of the first method of that kind: median over warm frames."""
    method = method_of(record.get("walkthroughs", {}).get(walk, {}).get("summary", {}), kind)
    return None if method is None else method["time_ratio"]


def _adaptive_of(record: Mapping) -> str:
    memory = record.get("settings", {}).get("memory_mb", 16)
    return f"adaptive-{memory:g}MB"


def _flat(record: Mapping) -> str:
    """The uniform map that the adaptive one is compared with, in words."""
    side = int((record.get("settings", {}).get("memory_mb", 16) * MB / 4) ** 0.5)
    return f"uniform {side}²"


def bounds_table(bounds: list[Bound]) -> str:
    """The requirements as a Markdown table."""
    rows = ["| requirement | measured | bound | aim | |", "| --- | ---: | ---: | ---: | --- |"]
    for bound in bounds:
        measured = "–" if bound.verdict == "skipped" else figure(bound.measured)
        aim = "" if bound.aim is None else figure(bound.aim)
        aim += " ✓" if bound.reaches_aim else ""
        verdict = {"pass": "pass", "fail": "**fail**", "skipped": "not measured"}[bound.verdict]
        note = f" ({bound.reason})" if bound.reason else ""
        rows.append(
            f"| {bound.what}{note} | {measured} | {figure(bound.limit)} | {aim} | {verdict} |"
        )
    return "\n".join(rows)


def figure(value: float | None) -> str:
    """Three digits, with its sign where it is negative."""
    if value is None:
        return "–"
    return f"−{significant(-value)}" if value < 0 else significant(value)


def timing_table(record: Mapping) -> str:
    """The paper's frame times beside those of the walkthrough; empty before it was measured."""
    summary = record.get("walkthroughs", {}).get("paper_room", {}).get("summary")
    if summary is None:
        return ""
    uniform, adaptive, rays = (method_of(summary, k) for k in ("uniform", "adaptive", "rays"))
    assert uniform and adaptive and rays
    ratio = PAPER["adaptive_seconds"] / PAPER["uniform_seconds"]
    lines = [
        "| per frame, milliseconds | 2001 | here |",
        "| --- | ---: | ---: |",
        _frame_line(f"{_flat(record)}, drawn anew", PAPER["uniform_seconds"], uniform),
        _frame_line("ASM of the same memory", PAPER["adaptive_seconds"], adaptive),
        f"| ASM / uniform | {ratio:.2f} | {figure(uniform['time_ratio'])} |",
    ]
    for stage, words in STAGES.items():
        extra = 1e3 * PAPER["extra_seconds"][words]
        lines.append(f"| – {words} | {extra:.0f} | {figure(1e3 * adaptive['seconds'][stage])} |")
    kept = next((m for m in summary["methods"] if m["name"].endswith("-kept")), None)
    if kept:
        lines.append(_frame_line(f"{_flat(record)}, kept while light and casters rest", None, kept))
    lines.append(_frame_line("one shadow ray per pixel (exact)", None, rays))
    return "\n".join(lines)


def _frame_line(words: str, paper: float | None, method: Mapping) -> str:
    """A line of the timing table: milliseconds, and frames per second in brackets."""
    theirs = "–" if paper is None else f"{1e3 * paper:.0f} ({1 / paper:.1f} fps)"
    ours = method["seconds"]["total"]
    return f"| {words} | {theirs} | {figure(1e3 * ours)} ({1 / max(ours, 1e-9):.0f} fps) |"


def view_table(record: Mapping) -> str:
    """Each view's maps from nothing: resolution, memory, time and wrong pixels."""
    lines = [
        "| view | map | finest texels a side | median | MB | from nothing, ms | wrong pixels, % |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for view, found in record.get("views", {}).items():
        for method in found["methods"]:
            texels = method["effective_resolution"]
            answered = found.get("answered_texels_p50", {}).get(method["name"], texels)
            sides = ["–" if n is None else texels_a_side(round(n)) for n in (texels, answered)]
            lines.append(
                f"| {view} | {method['name']} | {sides[0]} | {sides[1]} "
                f"| {method['bytes'] / MB:.1f} | {figure(1e3 * method['seconds']['total'])} "
                f"| {figure(100 * method['error']['misclassified_fraction'])} |"
            )
    return "\n".join(lines) if len(lines) > 2 else ""


def growth_table(record: Mapping) -> str:
    """Fitted exponents by axis and series."""
    lines = [
        "| against | ASM cold | ASM warm | ASM query | uniform | rays |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for axis, growth in record.get("growth", {}).items():
        cells = [figure(growth["slopes"].get(name)) for name in
                 ("cold", "warm", "query", "uniform", "rays")]  # fmt: skip
        first, last = (growth["points"][k]["size"] for k in (0, -1))
        words = f"{first / MB:g} to {last / MB:g} MB" if axis == "memory" else f"{first} to {last}"
        lines.append(f"| {axis}, {words} | " + " | ".join(cells) + " |")
    return "\n".join(lines) if len(lines) > 2 else ""


def document(record: Mapping) -> str:
    """The record as Markdown, with the figures of its folder."""
    parts = [f"# {record['title']}", _setting(record)]
    parts += ["## Bounds", "Ratios of medians of one run; smaller is better.",
              bounds_table(bounds_of(record))]  # fmt: skip
    for title, words, table, figures in (
        ("Frames of the walkthrough",
         "The paper's split says what its adaptive frame took beyond the uniform one's; ours says "
         "what each stage took. Neither counts the eye's image.",
         timing_table(record), ()),
        ("Pictures and effective resolutions",
         "Figure 2 of the paper shows 65,536² and figure 3 524,288² texels: `closeup` and `macro` "
         "here. Texels a side are those of a flat map as fine as the finest part, and as fine as "
         "the texel that answered the median pixel.",
         view_table(record), ("overview", "closeup", "macro")),
        ("Memory: figure 4",
         "The same map with half the memory and with all of it; marked where the smaller one errs "
         "most.",
         "", ("overview_memory", "closeup_memory", "macro_memory")),
        ("Growth",
         "Exponents of fitted power laws: 1 is proportional, 0 does not grow.",
         growth_table(record), ("growth",)),
    ):  # fmt: skip
        shown = [f"![{record['figures'][name]}]({name}.png)" for name in figures
                 if name in record["figures"]]  # fmt: skip
        if table or shown:
            parts += [f"## {title}", words, *([table] if table else []), *shown]
    parts += ["## Steps", _steps(record)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _setting(record: Mapping) -> str:
    settings = record["settings"]
    lines = [
        f"{settings['pixels']} × {settings['pixels']} eye pixels, {settings['memory_mb']:g} MB; "
        f"medians of warm, blocked runs, each beside the yardstick of the same run.",
        f"`{record['command']}`",
    ]
    if "machine" in record:
        machine, versions = record["machine"], record["versions"]
        named = ", ".join(f"{name} {version}" for name, version in versions.items())
        lines.append(
            f"Machine: {machine['cpu']}, {machine['cores']} core(s), "
            f"{machine['memory_bytes'] / 2**30:.0f} GB, kernels on {machine['device']}, rays by "
            f"{machine['variant']}; {named}. The paper's: {PAPER['machine']}."
        )
    return "\n\n".join(lines)


def _steps(record: Mapping) -> str:
    lines = ["| step | ended | seconds |", "| --- | --- | ---: |"]
    for name, step in record["steps"].items():
        reason = f": {step['reason']}" if step.get("reason") else ""
        lines.append(f"| {name} | {step['status']}{reason} | {step['seconds']:.0f} |")
    return "\n".join(lines)
