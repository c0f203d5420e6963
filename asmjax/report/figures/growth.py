"""How time grows with pixels, triangles and memory: one panel each, both axes logarithmic."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from asmjax.experiment.growth import Growth
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.style import FAINT, KIND_COLOURS, styled
from asmjax.report.table import MB, short_count

_WIDTH, _HEIGHT = 560, 470
"""Size in pixels of a panel, axis labels not included."""

_LEFT, _BELOW = 84, 62
_LEGEND = 34

_LOOKS = {
    "cold": ("adaptive", "adaptive, from nothing", "o", "white", (4, 2)),
    "warm": ("adaptive", "adaptive, next frame", "o", None, ()),
    "query": ("adaptive", "its query alone", ".", None, (1, 2)),
    "uniform": ("uniform", "uniform, drawn anew", "s", None, ()),
    "rays": ("rays", "one shadow ray per pixel", "D", None, ()),
}
"""Of each series: kind (its colour), label, marker, marker face and dashes."""

_ADAPTIVE = [name for name, look in _LOOKS.items() if look[0] == "adaptive"]

_AXES = {
    "pixels": ("eye pixels", lambda size: f"{round(size**0.5)}²"),
    "triangles": ("triangles of the scene", lambda size: short_count(round(size))),
    "memory": ("memory limit, MB", lambda size: f"{size / MB:g}"),
}


@styled
def draw_growth(growths: Sequence[Growth], title: str = "") -> Figure:
    """A panel per axis: milliseconds of each series, with the exponent of its fitted power law.

    An exponent of 1 is a time that is proportional to the size. Squares mark points at which the
    adaptive map wanted more than its memory limit. Along the memory axis its exponents are fitted
    to the others, and left out where fewer than two are left.
    """
    count = max(len(growths), 1)
    board = Board(
        2 * EDGE + count * (_LEFT + _WIDTH) + (count - 1) * GAP,
        EDGE + HEAD + _HEIGHT + _BELOW + _LEGEND + CAPTION + EDGE,
    )
    for i, growth in enumerate(growths):
        x = EDGE + i * (_LEFT + _WIDTH + GAP)
        name, _ = _AXES[growth.axis]
        small = "numbers: exponent of the fitted power law"
        if growth.axis == "memory":
            small = "numbers: exponent; adaptive: of the converged points"
        board.heading(x + _LEFT, EDGE, _WIDTH, f"Time against {name}", small)
        axes = board.axes(x + _LEFT, EDGE + HEAD, _WIDTH, _HEIGHT)
        _draw(axes, growth)
        if i == 0:
            axes.set_ylabel("time, milliseconds")
    _legend(board, {name for growth in growths for name in growth.series})
    limited = any(len(growth.converged()) < len(growth.points) for growth in growths)
    end = "Squares: with more memory there would be more nodes." if limited else ""
    board.caption(". ".join(part for part in (title, end) if part))
    return board.figure


def _draw(axes: Axes, growth: Growth) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    label, written = _AXES[growth.axis]
    axes.set_xlabel(label)
    ends = []
    for name in growth.series:
        kind, _, marker, face, dashes = _LOOKS[name]
        sizes, seconds = growth.times(name)
        axes.plot(
            sizes,
            1e3 * seconds,
            marker=marker,
            color=KIND_COLOURS[kind],
            markerfacecolor=face or KIND_COLOURS[kind],
            markersize=5,
            linewidth=1.3,
            dashes=dashes,
        )
        held = name in _ADAPTIVE
        slope = growth.slope(name, converged_only=held and growth.axis == "memory")
        text = "" if slope is None else f"{slope:+.2f}".replace("-", "−")
        ends.append((1e3 * seconds[-1], text, kind))
        converged = growth.converged()
        short = [p for p in growth.points if held and p not in converged and name in p.seconds]
        axes.plot(
            [p.size for p in short],
            [1e3 * p.seconds[name] for p in short],
            "s",
            markersize=10,
            markerfacecolor="none",
            markeredgecolor=FAINT,
            markeredgewidth=0.7,
        )
    sizes = [point.size for point in growth.points]
    if sizes:
        axes.set_xlim(min(sizes) / 1.25, max(sizes) * (max(sizes) / min(sizes)) ** 0.14 * 1.2)
    axes.xaxis.set_major_locator(FixedLocator(sizes))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: written(value)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(which="major", color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    _write_slopes(axes, max(sizes, default=1.0), ends)


def _write_slopes(axes: Axes, last: float, ends: list[tuple[float, str, str]]) -> None:
    """Each series' exponent right of its last point, moved apart where they would overlap."""
    low, high = np.log10(axes.get_ylim())
    least = 0.045 * (high - low)
    taken = -np.inf
    for value, text, kind in sorted(ends):
        if not text:
            continue
        taken = max(np.log10(value), taken + least)
        axes.annotate(
            text,
            (last, 10.0**taken),
            xytext=(9, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            color=KIND_COLOURS[kind],
        )


def _legend(board: Board, drawn: set[str]) -> None:
    axes = board.axes(0, 0, 1, 1)
    axes.set_axis_off()
    handles = []
    for name, (kind, label, marker, face, dashes) in _LOOKS.items():
        if name in drawn:
            (line,) = axes.plot(
                [], [], marker=marker, color=KIND_COLOURS[kind], dashes=dashes, label=label,
                markerfacecolor=face or KIND_COLOURS[kind], markersize=5, linewidth=1.3,
            )  # fmt: skip
            handles.append(line)
    board.figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=((EDGE - 8) / board.width, (EDGE + CAPTION - 12) / board.height),
        ncols=len(_LOOKS),
        columnspacing=1.8,
        handlelength=2.4,
    )
