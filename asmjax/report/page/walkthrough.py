"""The section of a walkthrough: `asmjax run --frames`."""

from collections.abc import Mapping

from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.pictures import MOST_BYTES, figures, read_picture
from asmjax.report.page.provenance import provenance_block
from asmjax.report.page.tables import table
from asmjax.report.page.words import megabytes, milliseconds, of_kind, percent, plural
from asmjax.report.table import significant
from asmjax.report.walk_table import MEDIAN_COLUMNS

_ANIMATION = "walkthrough.gif"

_FIGURES = {
    "walkthrough.png": (
        "Over the frames: time by stage, nodes of the adaptive map, wrong pixels, effective "
        "resolution, memory.",
        "Five plots over the frames, one line for each method",
    ),
    "frames.png": (
        "Frames under the adaptive map, and enlarged the square where it errs most.",
        "A strip of frames with an enlarged square below each",
    ),
}


def walkthrough_part(results: Results) -> Part:
    """The section of a walkthrough.

    Raises:
        UseError: a picture in the folder is damaged.
    """
    report = results.report
    summary = report["summary"]
    body = joined(
        [
            table(
                MEDIAN_COLUMNS,
                summary["methods"],
                f"Medians over {plural(summary['frames'], 'frame')}",
            ),
            figures(results, _FIGURES),
            _animation(results),
            provenance_block(results),
        ]
    )
    title = f"Walkthrough: {report['scene']}, {report['view']}, moving: {report['motion']}"
    return Part(title, _summary(report), body)


def _summary(report: Mapping) -> tuple[str, ...]:
    methods = report["summary"]["methods"]
    adaptive = of_kind(methods, "adaptive")
    frames = len(report["frames"])
    measured = f"{plural(frames, 'frame')} measured"
    if report["ended"] != "complete":
        measured += f" of {report['frames_asked']}: {report['ended']}"
    said = [f"{measured}."]
    if adaptive is None:
        return tuple(said)
    said.append(
        f"{adaptive['name']} follows in {_time(adaptive)} a frame (median; at most "
        f"{milliseconds(adaptive['slowest_seconds'])}), with "
        f"{percent(adaptive['misclassified_fraction'])} of the pixels wrong and "
        f"{megabytes(adaptive['bytes'])}."
    )
    for method in methods:
        if method is not adaptive:
            ratio = method["time_ratio"]
            beside = (
                "" if ratio is None else f"; the adaptive map takes {significant(ratio)} times that"
            )
            said.append(
                f"{method['name']}: {_time(method)} a frame{beside}; "
                f"{percent(method['misclassified_fraction'])} wrong."
            )
    return tuple(said)


def _time(method: Mapping) -> str:
    return milliseconds(method["seconds"]["total"])


def _animation(results: Results) -> Markup | None:
    """The animation behind a button, as nothing should move unasked; on screen only."""
    path = results.file(_ANIMATION)
    if path is None:
        return None
    if path.stat().st_size > 2 * MOST_BYTES:
        return tag("p", f"The animation is large: see {path}.", class_="note")
    image = read_picture(path).image("All frames under the adaptive map, one after the other")
    return tag("details", tag("summary", "All frames as an animation"), image, class_="screen")
