"""A walkthrough over its frames: time by stage, nodes, errors, resolution and memory."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.scales import power_of_two
from asmjax.report.figures.style import FAINT, KIND_COLOURS, styled
from asmjax.report.table import MB, significant

_WIDTH, _LEFT, _RIGHT = 1320, 96, 300
"""Pixels: of the figure, and left and right of its panels."""

_STAGES = {
    "query": ("#00513B", "query"),
    "id_pass": ("#0B3B60", "id copy"),
    "analysis": ("#009E73", "analysis"),
    "build": ("#8FD9BF", "node creation"),
    "rest": ("#D9D9D9", "rest"),
}
"""Stages of the adaptive map from below, with their colours and names; `rest` is what the stages
leave of the total."""

_KEPT = "#A8A8A8"
"""Colour of a uniform map that is kept: its dashes show where they lie on the other's line."""

_BETWEEN = 14
"""Space in pixels between the panels, beyond `GAP`."""

_NODES = {
    "reused": ("#1A1A1A", "reused"),
    "made": ("#009E73", "made"),
    "evicted": ("#D55E00", "evicted"),
    "recast": ("#0072B2", "cast again"),
    "dropped": ("#CC79A7", "dropped"),
}

_MOST_MARKED = 40
"""Frames above which points are no longer marked on their lines."""

_ROOM, _COMMON = 1.3, 95
"""Height of the time axis over the slowest method's percentile of that many frames, the first one
left out."""


@styled
def draw_walkthrough(report: Mapping, missing: str = "") -> Figure:
    """Five panels over the frames of a walkthrough's report.

    From above: milliseconds of each method, the adaptive map's by stage; nodes made, reused and
    given up; wrong pixels; effective resolution; memory. What lies above the time axis, as the
    first frame may, which builds everything, is written there.
    """
    frames = report["frames"]
    lists = [[frame["methods"][i] for frame in frames] for i in range(len(frames[0]["methods"]))]
    heights = {"time": 330, "nodes": 190, "wrong": 220, "resolution": 130, "memory": 110}
    counts = _node_counts(lists)
    if not counts:
        del heights["nodes"]
    top = EDGE
    height = sum(h + HEAD + GAP + _BETWEEN for h in heights.values())
    board = Board(_WIDTH, top + height + 3 * CAPTION)
    panels: dict[str, Axes] = {}
    for name, height in heights.items():
        panels[name] = board.axes(_LEFT, top + HEAD, _WIDTH - _LEFT - _RIGHT, height)
        board.heading(EDGE, top, _WIDTH - 2 * EDGE, *_TITLES[name])
        _frame_axis(panels[name], frames, last=name == "memory")
        top += HEAD + height + GAP + _BETWEEN
    _draw_time(panels["time"], lists)
    if counts:
        _draw_counts(panels["nodes"], counts)
    _draw_wrong(panels["wrong"], lists)
    _draw_resolution(panels["resolution"], lists)
    _draw_memory(panels["memory"], lists, report["memory_limit_bytes"])
    for axes in panels.values():
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.03), borderaxespad=0.0)
        axes.grid(which="major", color="#E6E6E6", linewidth=0.6)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    refitted = sum(frame["light_frame_refitted"] for frame in frames)
    lines = f" Grey lines: the kept light frame was fitted anew ({refitted})." if refitted else ""
    ended = "" if report["ended"] == "complete" else f" Ended early: {report['ended']}."
    title = f"{report['scene']}, {report['view']}; moving: {report['motion']}{missing}"
    board.caption(f"{title}.{lines}{ended}")
    return board.figure


_TITLES = {
    "time": ("Time per frame, milliseconds", "the eye's image is in nobody's time"),
    "nodes": ("Nodes of the adaptive map", "axis linear from 0 to 1, then logarithmic"),
    "wrong": ("Wrong pixels, %", "against the traced rays of the same frame"),
    "resolution": ("Effective resolution, texels a side", "where a map is finest"),
    "memory": ("Memory, MB", "all arrays that a map keeps"),
}


def _kind(methods: Sequence[Mapping]) -> str:
    return next(kind for kind in KIND_COLOURS if methods[0]["name"].startswith(kind))


def _look(methods: Sequence[Mapping]) -> dict:
    """Colour, dashes, marks and name of a method's line; a map that is kept is dashed."""
    name = methods[0]["name"]
    return {
        "color": _KEPT if name.endswith("kept") else KIND_COLOURS[_kind(methods)],
        "linestyle": (0, (4, 2)) if name.endswith("kept") else "-",
        "label": name,
        **_marks(len(methods)),
    }


def _marks(count: int) -> dict:
    return {"linewidth": 1.3} | ({"marker": "o", "markersize": 3} if count <= _MOST_MARKED else {})


def _frame_axis(axes: Axes, frames: Sequence[Mapping], last: bool) -> None:
    axes.set_xlim(-0.5, max(len(frames) - 0.5, 0.5))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=12))
    axes.tick_params(labelbottom=last)
    if last:
        axes.set_xlabel("frame")
    for frame in frames:
        if frame["light_frame_refitted"]:
            axes.axvline(frame["frame"], color="#BDBDBD", linewidth=0.9, zorder=0.5)


def _draw_time(axes: Axes, lists: Sequence[Sequence[Mapping]]) -> None:
    at = np.arange(len(lists[0]))
    tops = []
    for methods in lists:
        total = np.array([1e3 * method["seconds"]["total"] for method in methods])
        tops.append(total)
        if _kind(methods) != "adaptive":
            axes.plot(at, total, zorder=4, **_look(methods))
            continue
        known = [stage for stage in _STAGES if stage != "rest"]
        stages = np.array([[1e3 * m["seconds"][stage] for m in methods] for stage in known])
        rest = np.maximum(total - stages.sum(axis=0), 0.0)
        stages = np.concatenate([stages, rest[None]])
        # Steps, one a frame: a slope between frames would show times that nobody took.
        axes.stackplot(
            np.append(at, at.size) - 0.5,
            np.concatenate([stages, stages[:, -1:]], axis=1),
            colors=[colour for colour, _ in _STAGES.values()],
            labels=[f"adaptive: {name}" for _, name in _STAGES.values()],
            zorder=2,
            linewidth=0,
            step="post",
        )
    totals = np.stack(tops)
    warm = totals[:, 1:] if at.size > 1 else totals
    limit = max(_ROOM * float(np.percentile(warm, _COMMON, axis=1).max()), 1e-3)
    axes.set_ylim(0, limit)
    beyond = [
        f"{methods[0]['name']} {significant(total.max())} ms in frame {total.argmax()}"
        for methods, total in zip(lists, tops, strict=True)
        if total.max() > limit
    ]
    if beyond:
        axes.annotate(
            f"above: {', '.join(beyond)}",
            (0.5, 1),
            xycoords=axes.get_xaxis_transform(),
            xytext=(8, -4),
            textcoords="offset points",
            va="top",
            fontsize=8,
            color=FAINT,
            zorder=6,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 2.0},
        )
    axes.yaxis.set_major_locator(MaxNLocator(nbins=6))


def _node_counts(lists: Sequence[Sequence[Mapping]]) -> dict[str, np.ndarray]:
    """The adaptive map's node counts by kind; kinds that never occur are left out."""
    adaptive = next(methods for methods in lists if _kind(methods) == "adaptive")
    counts = {}
    for kind in _NODES:
        key = f"nodes_{kind}"
        if all(key in method for method in adaptive):
            values = np.array([method[key] for method in adaptive])
            if kind in ("reused", "made", "evicted") or values.any():
                counts[kind] = values
    return counts


def _draw_counts(axes: Axes, counts: Mapping[str, np.ndarray]) -> None:
    for kind, values in counts.items():
        colour, label = _NODES[kind]
        # A full map gives up as many as it makes: dashes, so that both lines show.
        dashes = {"evicted": (0, (3, 3)), "dropped": (0, (1, 2))}.get(kind, "-")
        axes.plot(
            np.arange(values.size),
            values,
            color=colour,
            linestyle=dashes,
            label=label,
            **_marks(values.size),
        )
    axes.set_yscale("symlog", linthresh=1.0, linscale=0.5)
    most = max(values.max() for values in counts.values())
    axes.set_ylim(-0.15, max(3.0 * most, 10.0))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_wrong(axes: Axes, lists: Sequence[Sequence[Mapping]]) -> None:
    """Percent of wrong pixels on a logarithmic axis; frames without any stand at its foot."""
    maps = [methods for methods in lists if _kind(methods) != "rays"]
    shares = np.array([[100 * m["error"]["misclassified_fraction"] for m in ms] for ms in maps])
    positive = shares[shares > 0]
    if positive.size:
        axes.set_yscale("log")
        floor = positive.min() / 2
        axes.set_ylim(floor, 2 * positive.max())
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        shares = np.maximum(shares, floor)
    for methods, share in zip(maps, shares, strict=True):
        axes.plot(np.arange(share.size), share, clip_on=False, **_look(methods))


def _draw_resolution(axes: Axes, lists: Sequence[Sequence[Mapping]]) -> None:
    for methods in lists:
        if methods[0]["effective_resolution"] is not None:
            sides = [np.log2(max(method["effective_resolution"], 1)) for method in methods]
            axes.plot(np.arange(len(sides)), sides, **_look(methods))
    low, high = axes.get_ylim()
    axes.set_ylim(np.floor(low) - 0.5, np.ceil(high) + 0.5)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=5))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: power_of_two(value)))


def _draw_memory(axes: Axes, lists: Sequence[Sequence[Mapping]], limit: int) -> None:
    for methods in lists:
        if _kind(methods) != "rays":
            held = [method["bytes"] / MB for method in methods]
            axes.plot(np.arange(len(held)), held, **_look(methods))
    axes.axhline(limit / MB, color="#D55E00", linewidth=1.0, dashes=(1, 1.5), label="limit")
    axes.set_ylim(0, 1.25 * limit / MB)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4))
