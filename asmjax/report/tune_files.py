"""From tuning to its files: report.json, settings, what was tried, figures."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from asmjax.errors import require
from asmjax.report.figures.board import drawing
from asmjax.report.figures.sensitivity import Slope, Way, draw_sensitivity
from asmjax.report.figures.surrogate import draw_surrogate
from asmjax.report.figures.tuning import Asked, Dot, Rival, TriedPanel, draw_tried
from asmjax.report.outputs import Outputs
from asmjax.report.table import MB
from asmjax.report.tune_result import TuningResult
from asmjax.report.tune_table import tried_csv
from asmjax.report.tune_words import RIVAL_WORDS
from asmjax.shadow import settings_text
from asmjax.tuning.result import Candidate
from asmjax.writing import text_writer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SETTINGS = "tuned.toml"
"""File of the tuned settings, for `--settings`."""


def write_tuning(result: TuningResult, report: dict, outputs: Outputs) -> None:
    """Write report.json, tuned.toml, tried.csv and the figures.

    The numbers come first: a figure that fails cannot lose them.

    Args:
        report: as of `report_of_tuning`.

    Raises:
        WriteError: some of it cannot be written.
    """
    outputs.keep(report)
    outputs.add(
        {
            SETTINGS: text_writer(lambda: settings_text(result.algorithm)),
            "tried.csv": text_writer(lambda: tried_csv(result)),
        }
    )
    kinds = ("tried", "surrogate", *(["sensitivity"] if result.found.sensitivity else []))
    outputs.add({f"{kind}.png": drawing(partial(draw_tuning, result, kind)) for kind in kinds})
    outputs.finish()


def draw_tuning(result: TuningResult, what: str) -> "Figure":
    """The figure of that name, as of `TuningResult.plot`.

    Raises:
        UseError: there is no sensitivity, as a goal without a price has none.
    """
    if what == "tried":
        return _tried(result)
    if what == "surrogate":
        return _surrogate(result)
    require(
        result.found.sensitivity is not None,
        "no sensitivity to a price is known: the goal was a limit, or time ended; give a price.",
    )
    return _sensitivity(result)


def _tried(result: TuningResult) -> "Figure":
    found, goal = result.found, result.found.goal
    curve = np.array([[1e3 * p.seconds, p.edge_px] for p in found.front]).T if found.front else None
    tried = TriedPanel(
        f"Tried on the views tuned on: {len(found.tried)} settings",
        "each measured once; the surrogate proposes, measurements decide",
        [_dot(one) for one in found.tried],
        1e3 * _yardstick(found.tried),
        curve=curve,
        levels=[("best tried", min(one.objective(goal) for one in found.tried))],
    )
    levels = [("default", found.default.objective(goal))]
    if found.tuned is not found.default:
        levels.append(("tuned", found.tuned.objective(goal)))
    chosen = TriedPanel(
        f"The best {result.where}",
        f"medians of {min(t.total.runs for t in found.default.trials)} turns with the rays",
        [_dot(one) for one in found.finalists],
        1e3 * result.yardstick,
        _rivals(result),
        levels=levels,
    )
    asked = Asked(
        goal.price, None if goal.seconds is None else 1e3 * goal.seconds, goal.error
    )  # fmt: skip
    return draw_tried([tried, chosen], asked, result.title, found.tuned.whole.total.words)


def _rivals(result: TuningResult) -> list[Rival]:
    """Those that stand on the held-out views; of equal settings only the first, with all names."""
    names: dict[int, list[str]] = {}
    for name, one in result.found.rivals.items():
        names.setdefault(id(one), []).append(RIVAL_WORDS[name])
    drawn = []
    for one in {id(one): one for one in result.found.rivals.values()}.values():
        time = one.whole.total
        words = " = ".join(names[id(one)])
        drawn.append(Rival(words, _dot(one), 1e3 * time.low, 1e3 * time.high))
    return drawn


def _dot(one: Candidate) -> Dot:
    return Dot(one.role, 1e3 * one.seconds, one.edge_px)


def _yardstick(candidates: Sequence[Candidate]) -> float:
    """Seconds of a ray per pixel: over views the mean of the median over all turns."""
    by_view = zip(*([trial.yardstick for trial in one.trials] for one in candidates), strict=True)
    return float(np.mean([np.median(np.concatenate(turns)) for turns in by_view]))


def _surrogate(result: TuningResult) -> "Figure":
    found = result.found
    return draw_surrogate(
        [one.role for one in found.tried],
        np.array([[one.edge_px for one in found.tried], [one.seconds for one in found.tried]]),
        found.said,
        found.rank_correlation if np.isfinite(found.rank_correlation) else None,
        result.title,
    )


def _sensitivity(result: TuningResult) -> "Figure":
    found, bending = result.found, result.found.sensitivity
    assert bending is not None
    slopes = [
        *(Slope(knob.words, bending.log_settings[knob.name]) for knob in found.space.knobs),
        Slope("error", bending.log_edge),
        Slope("time", bending.log_seconds),
    ]
    chosen = found.tuned.settings
    ways = []
    for knob in found.space.knobs:
        words, scale = _SCALED.get(knob.name, (knob.words, 1.0))
        values = np.array([point.settings[knob.name] for point in found.front])
        mark = _mark(chosen[knob.name], (knob.low, knob.high))
        ways.append(
            Way(
                words, scale * values, (scale * knob.low, scale * knob.high),
                None if mark is None else scale * mark,
            )
        )  # fmt: skip
    prices = np.array([point.price for point in found.front])
    restless = "" if bending.settled else " Not of an optimum that is at rest: read with care."
    return draw_sensitivity(slopes, ways, prices, bending.price, f"{result.title}.{restless}")


_SCALED = {
    "memory_bytes": ("memory limit, MB", 1 / MB),
    "time_limit": ("time limit, milliseconds", 1e3),
}
"""Settings that figures show in another unit."""


def _mark(value: Any, ends: tuple[float, float]) -> float | None:
    """Where a setting stands on an axis of its range; None where it is off."""
    return None if value is None or value <= 0 else float(np.clip(value, *ends))
