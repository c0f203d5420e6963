"""What tuning gave, for notebooks, tables, figures and the report."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from asmjax.errors import require
from asmjax.memory import Forecast
from asmjax.report.compare_result import SeenView
from asmjax.shadow import AdaptiveShadowMap, CostModel
from asmjax.tuning.result import Candidate, Outcome, TuneResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS_OF_PLOT = ("tried", "surrogate", "sensitivity")
"""What `TuningResult.plot` draws."""


@dataclass(frozen=True, eq=False)
class TuningResult:
    """All that tuning measured, and where.

    Attributes:
        found: settings, rivals, surrogate, outcome.
        variant: the Mitsuba variant that cast the rays.
        light: which light, its type, and how many faces its maps have.
        lit_by: which light, and its type.
        seen: the views that were tuned on, then those held out.
        notices: what is simulated differently from what the scene says, and how tuning ended if
            not as it should, one line each.
        cost_model: of casting texels, by which the map decides.
        made: trials that this run measured.
        memory: what it was estimated to take; None where nobody asked.
        told: how many of the notices, the last ones, are about the tuning.
    """

    found: TuneResult
    variant: str
    light: str
    lit_by: str
    seen: Sequence[SeenView]
    notices: Sequence[str]
    cost_model: CostModel
    made: int
    memory: Forecast | None = None
    told: int = 0

    @property
    def settings(self) -> dict[str, Any]:
        """The tuned settings by name."""
        return self.found.settings

    @property
    def algorithm(self) -> AdaptiveShadowMap:
        """The map with the tuned settings."""
        return self.found.tuned.algorithm

    @property
    def where(self) -> str:
        """On which views numbers were measured, for sentences."""
        if self.outcome is Outcome.INTERRUPTED:
            return "measured once, on views that were tuned on"
        return "on views that were not tuned on"

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        return self.found.outcome

    @property
    def title(self) -> str:
        """Scene, light, size and goal, for figures."""
        width, height = self.seen[0].size
        return (
            f"{self.found.scene}, {self.lit_by}, {width} x {height} pixels; {self.found.goal.words}"
        )

    @property
    def yardstick(self) -> float:
        """Seconds of one shadow ray per pixel, the mean over the held-out views."""
        medians = [float(np.median(trial.yardstick)) for trial in self.found.default.trials]
        return sum(medians) / len(medians)

    def gain_over(self, rival: str) -> float | None:
        """By what part of a rival's objective the tuned settings are better on the held-out views;
        below 0 where they are worse. None without that rival, or where either breaks the limit.

        Args:
            rival: "default", "grid_best" or "random_best".
        """
        goal, other = self.found.goal, self.found.rivals.get(rival)
        if other is None:
            return None
        mine, its = self.found.tuned.objective(goal), other.objective(goal)
        if not math.isfinite(mine) or not math.isfinite(its):
            return None
        if its == 0:
            return 0.0 if mine == 0 else None
        return 1 - mine / its

    def best(self, error: float | None = None, seconds: float | None = None) -> Candidate:
        """Of all that were measured on the held-out views: within a limit of the error the one that
        takes the least time, else within a limit of time the one that errs least; without limits
        the tuned settings.

        Args:
            error: wrong pixels per pixel of truth's shadow edge.

        Raises:
            UseError: none keeps to them; says what the best is.
        """
        if error is None and seconds is None:
            return self.found.tuned
        most_error = math.inf if error is None else error
        most_seconds = math.inf if seconds is None else seconds
        able = [
            one
            for one in self.found.finalists
            if one.edge_px <= most_error and one.seconds <= most_seconds
        ]
        least_error = min(self.found.finalists, key=lambda one: one.edge_px)
        least_time = min(self.found.finalists, key=lambda one: one.seconds)
        require(
            len(able) > 0,
            "nothing that was measured on the held-out views keeps to that: the least error was "
            f"{least_error.edge_px:.3g} px (in {1e3 * least_error.seconds:.3g} ms), the least time "
            f"{1e3 * least_time.seconds:.3g} ms (with {least_time.edge_px:.3g} px); allow more, or "
            "tune for that limit.",
        )
        if error is None:
            return min(able, key=lambda one: (one.edge_px, one.seconds))
        return min(able, key=lambda one: (one.seconds, one.edge_px))

    def table(self) -> str:
        """The rivals on the held-out views, their settings, and what came of it, as text."""
        from asmjax.report.tune_table import tuning_text

        return tuning_text(self)

    def plot(self, what: str = "tried") -> "Figure":
        """A figure: what was tried, the surrogate against measurements, or the sensitivity.

        Raises:
            UseError: another name, or no sensitivity, as a goal without a price has none.
        """
        from asmjax.report.tune_files import draw_tuning

        require(
            what in KINDS_OF_PLOT,
            f"a plot of '{what}' is not known; allowed: {', '.join(KINDS_OF_PLOT)}.",
        )
        return draw_tuning(self, what)

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(self.table())}</pre>"
