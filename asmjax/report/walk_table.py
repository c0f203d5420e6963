"""A walkthrough as tables: medians for the terminal, every frame as CSV."""

from collections.abc import Mapping, Sequence

from asmjax.report.table import (
    METHOD_COLUMNS,
    Column,
    csv_text,
    milliseconds,
    short_count,
    significant,
    table_text,
)

NODE_COUNTS = ("made", "reused", "evicted", "recast", "dropped")
"""What became of an adaptive map's nodes in a frame; keys of a report begin with `nodes_`."""

_PLAIN = {column.head: column for column in METHOD_COLUMNS}


def _nodes(which: str) -> Column:
    return Column(
        "nodes",
        which,
        lambda method: method.get(f"nodes_{which}"),
        lambda count: short_count(round(count)),
        f"nodes_{which}",
    )


MEDIAN_COLUMNS = (
    *(_PLAIN[head] for head in ("method", "per side", "MB")),
    *(milliseconds(stage) for stage in ("build", "analysis", "query", "total")),
    Column("ASM/", "this", lambda method: method["time_ratio"], significant, ""),
    Column("wrong", "%", lambda method: 100 * method["misclassified_fraction"], significant, ""),
    Column(
        "edge",
        "px",
        lambda method: method["boundary_displacement_px"],
        lambda value: f"{value:.2f}",
        "",
    ),
    *(_nodes(which) for which in NODE_COUNTS[:3]),
)

_FRAME_COLUMNS = (
    Column("", "frame", lambda method: method["frame"], str, "frame"),
    *METHOD_COLUMNS,
    milliseconds("id_pass"),
    Column("nodes", "held", lambda method: method.get("nodes"), short_count, "nodes"),
    *(_nodes(which) for which in NODE_COUNTS),
    Column("", "status", lambda method: method.get("status"), str, "status"),
)


def walkthrough_table(summary: Mapping) -> str:
    """The medians of a report's `summary` as text, without a last newline.

    `ASM/this` is the adaptive map's total time in parts of the method's, the median of the
    frames' own ratios.
    """
    return table_text(MEDIAN_COLUMNS, summary["methods"])


def frames_csv(frames: Sequence[Mapping]) -> str:
    """A row for each frame and method, unrounded."""
    rows = [{**method, "frame": frame["frame"]} for frame in frames for method in frame["methods"]]
    return csv_text(rows, _FRAME_COLUMNS)
