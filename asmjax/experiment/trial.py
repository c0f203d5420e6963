"""A shadow algorithm with its settings, tried on a view: errors, times, memory, as plain values."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from asmjax.experiment.clock import Median, median_of, ratio_of

STAGES = ("build", "analysis", "query")
"""Stages of a frame from nothing; their sum is its time."""


@dataclass(frozen=True)
class Trial:
    """What one algorithm did to one view, from nothing.

    Attributes:
        name, family: of the algorithm; "rays" for traced shadows.
        settings: all of them but its cost model.
        view: name of the view.
        samples: of each pixel.
        error: as `asmjax.metrics.error_summary`; the mean over the runs, which only differ where a
            time limit ended them.
        predicted_px: wrong pixels per pixel of edge by its texels' sizes (M4), where edges stand
            alone; None for rays, and where it was not asked for. The mean like `error`.
        seconds: runs (rounds,) by stage, `STAGES`.
        yardstick: seconds (rounds,) of one shadow ray for each sample, taken in turns.
        bytes, texels, rays: memory of all arrays, texels stored, light rays cast; like `status` and
            `nodes` those of the last run.
        status: how the build ended.
        nodes: held by an adaptive map; None for others.
    """

    name: str
    family: str
    settings: dict[str, Any]
    view: str
    samples: int
    error: dict[str, Any]
    predicted_px: float | None
    seconds: dict[str, list[float]]
    yardstick: list[float]
    bytes: int
    texels: int
    rays: int
    status: str
    nodes: int | None = None

    @property
    def totals(self) -> list[float]:
        """Seconds of each run, all stages together."""
        return [sum(run) for run in zip(*self.seconds.values(), strict=True)]

    @property
    def total(self) -> Median:
        """Seconds from nothing to the visibility of all samples."""
        return median_of(self.totals)

    @property
    def ratio(self) -> Median:
        """Times the yardstick's time."""
        return ratio_of(self.totals, self.yardstick)

    @property
    def wrong(self) -> float:
        """Misclassified part of the valid pixels (M1)."""
        return self.error["misclassified_fraction"]

    @property
    def edge_px(self) -> float:
        """Wrong pixels per pixel of truth's edge (M2): the error that is tuned."""
        return self.error["boundary_displacement_px"]["per_edge_length"]

    @property
    def p95_px(self) -> float:
        """95th percentile of the distance between shadow boundaries, pixels (M3)."""
        return self.error["boundary_displacement_px"]["p95"]

    def record(self) -> dict:
        """As plain values, from which `trial_of` makes it again."""
        return asdict(self)


def trial_of(record: Mapping[str, Any]) -> Trial:
    """The trial of a `Trial.record`."""
    return Trial(**record)
