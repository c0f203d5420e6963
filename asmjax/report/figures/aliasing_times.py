"""What a frame costs with each map: stages as stacked bars, and tracing every pixel beside them."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from asmjax.report.figures.board import EDGE, HEAD, Board
from asmjax.report.figures.style import KIND_COLOURS, styled
from asmjax.report.table import significant

STAGES = {"fit": "#CC79A7", "cast": "#0072B2", "query": "#E69F00"}
"""Colours of the stages, in the order in which they happen."""

_BAR = 34
"""Height in pixels that one map takes."""

_BELOW = 140
"""Height in pixels of ticks, label, legend and caption."""


@styled
def draw_frame_times(rows: Sequence[Mapping], rays: float, title: str) -> Figure:
    """Milliseconds of a frame (figure 10 of TR05-024), one panel for each number of texels.

    Args:
        rows: each with `label`, `side`, `seconds` by stage, and `total`.
        rays: seconds of tracing a shadow ray from every pixel.
        title: scene and size.
    """
    sides = list(dict.fromkeys(row["side"] for row in rows))
    width, left = 560, 120
    each = len(rows) // len(sides)
    height = _BAR * (each + 1)
    board = Board(2 * EDGE + len(sides) * (left + width) + 40, EDGE + HEAD + height + _BELOW + EDGE)
    for i, side in enumerate(sides):
        x = EDGE + i * (left + width) + left
        shown = [row for row in rows if row["side"] == side]
        board.heading(x, EDGE, width, f"{side:,}² texels in all", "median of a frame from nothing")
        axes = board.axes(x, EDGE + HEAD, width, height)
        longest = max([*(1e3 * row["total"] for row in shown), 1e3 * rays])
        for k, row in enumerate(shown):
            start = 0.0
            for stage, colour in STAGES.items():
                time = 1e3 * row["seconds"][stage]
                axes.barh(k, time, left=start, color=colour, height=0.68, label=stage)
                start += time
            axes.text(start + 0.012 * longest, k, significant(start), va="center", fontsize=8)
        axes.barh(each, 1e3 * rays, color=KIND_COLOURS["uniform"], height=0.68)
        axes.text(
            1e3 * rays + 0.012 * longest, each, significant(1e3 * rays), va="center", fontsize=8
        )
        axes.set_yticks(range(each + 1), [*(row["label"] for row in shown), "rays"])
        axes.set_ylim(each + 0.6, -0.6)
        axes.set_xlim(0, 1.16 * longest)
        axes.set_xlabel("milliseconds")
        for spine in ("top", "right"):
            axes.spines[spine].set_visible(False)
        if i == 0:
            handles, labels = axes.get_legend_handles_labels()
            board.figure.legend(
                handles[: len(STAGES)], labels[: len(STAGES)], loc="lower left", ncols=len(STAGES),
                bbox_to_anchor=((EDGE + left - 8) / board.width, (EDGE + 22) / board.height),
                handlelength=1.0, handleheight=1.0, columnspacing=1.6,
            )  # fmt: skip
    board.caption(f"{title}. Scales differ. Rays: a shadow ray from every pixel, which is exact.")
    return board.figure
