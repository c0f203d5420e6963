"""What tuning found: settings beside their rivals, all as measured, and what the surrogate says."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from asmjax.experiment.clock import Median
from asmjax.experiment.trial import Trial
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.calibrate import Calibration
from asmjax.tuning.goal import Goal
from asmjax.tuning.space import NAMES, Space


class Outcome(Enum):
    """How tuning ended."""

    FOUND = "the tuned settings are the best that were measured"
    DEFAULT_STANDS = "no settings were better than the default: keep it, or change the price"
    NOT_MET = "no settings met the limit: see the nearest ones, and loosen the limit"
    TIME_SPENT = "the time given was spent: the best so far; give more `minutes`, or run it again"
    UNSETTLED = (
        "the surrogate's fit or search did not come to rest: the settings are measured all the "
        "same; give more `evaluations`"
    )
    INTERRUPTED = (
        "interrupted: the best so far, by one measurement on the views tuned on, was not measured "
        "on others; run it again to go on"
    )


@dataclass(frozen=True)
class Candidate:
    """Settings, as measured.

    Attributes:
        role: "default", "single" (one setting changed), "sample" or "random" (drawn), "grid",
            "surrogate" or "neighbour".
        point: (knobs,) in the unit box.
        algorithm: with the settings.
        trials: one for each view.
        whole: of all views together, as `asmjax.experiment.comparison.pooled`.
    """

    role: str
    point: np.ndarray
    algorithm: AdaptiveShadowMap
    trials: tuple[Trial, ...]
    whole: Trial

    @property
    def settings(self) -> dict[str, Any]:
        """Those of its settings that are tuned, by name."""
        return {name: getattr(self.algorithm, name) for name in NAMES}

    @property
    def edge_px(self) -> float:
        """Wrong pixels per pixel of edge."""
        return self.whole.edge_px

    @property
    def seconds(self) -> float:
        """From nothing: the median over turns, each the mean of its views."""
        return self.whole.total.value

    @property
    def ratio(self) -> Median:
        """Its time / the yardstick's, turn by turn."""
        return self.whole.ratio

    def objective(self, goal: Goal) -> float:
        """As measured; infinite where a limit is not met."""
        return goal.objective(self.edge_px, self.seconds)

    def rank(self, goal: Goal) -> tuple[float, float]:
        """By which candidates are put in order."""
        return goal.rank(self.edge_px, self.seconds)


@dataclass(frozen=True)
class FrontPoint:
    """A point of the front that the surrogate traces: the best that is known for its price.

    Attributes:
        price: of a second, pixels of edge displacement.
        settings: continuous, by name.
        edge_px, seconds: by the surrogate.
        loss: log objective of the curve by continuation.
        loss_again: log objective of tuning's own search; where it is less, this point is its.
    """

    price: float
    settings: dict[str, float]
    edge_px: float
    seconds: float
    loss: float
    loss_again: float

    @property
    def gap(self) -> float:
        """By how much the curve's objective is above that of the other search, a fraction."""
        return float(np.expm1(self.loss - self.loss_again))

    @property
    def taken_over(self) -> bool:
        """Whether the other search was better, so that the curve has missed a fold."""
        return self.loss_again < self.loss


@dataclass(frozen=True)
class Sensitivity:
    """How the best settings move with the price, by implicit differentiation of the surrogate.

    Attributes:
        price: where.
        log_settings: d log(setting) / d log(price) by name; 0 at an end of its range.
        log_edge, log_seconds: the same of error and time.
        settled: whether the point is a least one: the objective is at rest there and bends upwards.
            Elsewhere the derivatives mean little.
    """

    price: float
    log_settings: dict[str, float]
    log_edge: float
    log_seconds: float
    settled: bool


@dataclass(frozen=True, eq=False)
class TuneResult:
    """Everything that tuning measured and found.

    Attributes:
        scene: its name.
        goal, space: what was asked, and where it was searched.
        views, held_out: names of the views that were tuned on, and of those that choose.
        outcome, advice: how it ended, and what to do about it in words ("" for nothing).
        default, tuned, grid_best, random_best: on the views that chose. The last three are each
            the best of `finalists` of their kind; None where nothing of a kind was measured.
        finalists: all that were measured on the views that chose.
        tried: all that were measured on the views tuned on, in order.
        calibrations: of the surrogate, by view.
        said: (2, tried) edge_px and seconds by the surrogate's last fit, for each of `tried`.
        rank_correlation: Spearman's, of the surrogate's objective with the real one over those of
            `tried` that it was not fitted to; not a number where they are all equal or too few.
        sensitivity, front: of the surrogate; None and empty where the goal has no price.
        evaluations: real maps that the search could spend, the samples among them.
        reused: trials that an earlier run had measured.
        seconds: of wall time.
    """

    scene: str
    goal: Goal
    space: Space
    views: tuple[str, ...]
    held_out: tuple[str, ...]
    outcome: Outcome
    advice: str
    default: Candidate
    tuned: Candidate
    grid_best: Candidate | None
    random_best: Candidate | None
    finalists: tuple[Candidate, ...]
    tried: tuple[Candidate, ...]
    calibrations: tuple[Calibration, ...]
    said: np.ndarray
    rank_correlation: float
    sensitivity: Sensitivity | None
    front: tuple[FrontPoint, ...]
    evaluations: int
    reused: int
    seconds: float

    @property
    def settings(self) -> dict[str, Any]:
        """The tuned settings by name."""
        return self.tuned.settings

    @property
    def chosen_on(self) -> tuple[str, ...]:
        """Names of the views by which was chosen: those held out, unless they were not got to."""
        return tuple(trial.view for trial in self.tuned.trials)

    @property
    def rivals(self) -> dict[str, Candidate]:
        """`default`, `tuned`, `grid_best`, `random_best`: those that there are."""
        named = {
            "default": self.default,
            "tuned": self.tuned,
            "grid_best": self.grid_best,
            "random_best": self.random_best,
        }
        return {name: one for name, one in named.items() if one is not None}


def best_of(candidates: Sequence[Candidate], goal: Goal) -> Candidate | None:
    """The first in rank; None of none."""
    return min(candidates, key=lambda one: one.rank(goal), default=None)
