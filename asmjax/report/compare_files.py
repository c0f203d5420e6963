"""From a comparison to its files: report.json, trials.csv and charts."""

from functools import partial
from typing import TYPE_CHECKING

from asmjax.experiment.comparison import Compared, front_of
from asmjax.report.compare_result import ComparisonResult
from asmjax.report.compare_table import trials_csv
from asmjax.report.figures.board import drawing
from asmjax.report.figures.fronts import BARS, FrontPanel, FrontPoint, Mark, draw_fronts
from asmjax.report.outputs import Outputs
from asmjax.report.table import MB, significant
from asmjax.writing import text_writer

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_comparison(result: ComparisonResult, report: dict, outputs: Outputs) -> None:
    """Write report.json, the trials as CSV, and a chart for each number of samples.

    The numbers come first: a figure that fails cannot lose them.

    Args:
        report: as of `report_of_comparison`.

    Raises:
        WriteError: some of it cannot be written.
    """
    outputs.keep(report)
    outputs.add({"trials.csv": text_writer(lambda: trials_csv(result))})
    outputs.add(
        {
            f"costs_{samples}.png": drawing(partial(draw_comparison, result, samples))
            for samples in result.samples
        }
    )
    outputs.finish()


def draw_comparison(result: ComparisonResult, samples: int) -> "Figure":
    """Error against time and against memory, with that many samples per pixel."""
    items = result.of(samples)
    time = FrontPanel(
        "What accuracy costs in time",
        "build + analysis + query from nothing; lower left is better",
        "time, milliseconds",
        [_point(item, "seconds") for item in items],
        [item.name for item in front_of(items, "seconds")],
        [
            Mark(f"{item.trial.samples} ray{'s'[: item.trial.samples > 1]} per pixel",
                 1e3 * item.seconds.value)
            for item in result.yardsticks
        ],
    )  # fmt: skip
    memory = FrontPanel(
        "What accuracy costs in memory",
        f"all arrays; rays keep none: {_exact(result)}",
        "memory, MB",
        [_point(item, "bytes") for item in items],
        [item.name for item in front_of(items, "bytes")],
    )
    end = "" if result.ended == "complete" else f" Not all was tried: {result.ended}."
    plural = "samples" if samples > 1 else "sample"
    title = f"{result.title}; {samples} {plural} per pixel.{end}"
    return draw_fronts([time, memory], title, items[0].seconds.words if items else BARS)


def _exact(result: ComparisonResult) -> str:
    """What the yardsticks take: 1 ray in 6 ms, 16 rays in 95 ms."""
    return ", ".join(
        f"{item.trial.samples} ray{'s'[: item.trial.samples > 1]} in "
        f"{significant(1e3 * item.seconds.value)} ms"
        for item in result.yardsticks
    )


def _point(item: Compared, kind: str) -> FrontPoint:
    trial = item.trial
    if kind == "seconds":
        time = item.seconds.scaled(1e3)
        cost, low, high = time.value, time.low, time.high
    else:
        cost = low = high = trial.bytes / MB
    return FrontPoint(trial.family, item.label, item.name, cost, trial.edge_px, low, high)
