"""What tuning found: settings beside their rivals, all as measured, and what the surrogate says."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from asmjax.experiment.clock import Median, median_of
from asmjax.experiment.trial import Trial
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.calibrate import Calibration
from asmjax.tuning.goal import Goal
from asmjax.tuning.space import Space


class Outcome(Enum):
    """How tuning ended."""

    FOUND = "the tuned settings are the best that were measured"
    DEFAULT_STANDS = "no settings were better than the default: keep it, or change the price"
    NOT_MET = "no settings met the limit: see the nearest ones, and loosen the limit"
    TIME_SPENT = "the time given was spent: the best so far; give more --minutes, or run it again"
    UNSETTLED = (
        "the search did not come to rest: the settings are measured all the same; give more "
        "--evaluations"
    )


@dataclass(frozen=True)
class Candidate:
    """Settings, as measured.

    Attributes:
        role: "default", "sample" (drawn at random), "grid", "surrogate" or "neighbour".
        point: (knobs,) in the unit box.
        algorithm: with the settings.
        trials: one for each view.
    """

    role: str
    point: np.ndarray
    algorithm: AdaptiveShadowMap
    trials: tuple[Trial, ...]

    @property
    def edge_px(self) -> float:
        """Wrong pixels per pixel of edge, the mean over the views."""
        return sum(trial.edge_px for trial in self.trials) / len(self.trials)

    @property
    def seconds(self) -> float:
        """From nothing, the mean of the views' medians."""
        return sum(trial.total.value for trial in self.trials) / len(self.trials)

    @property
    def ratio(self) -> Median:
        """Its time / the yardstick's, over all turns of all views."""
        return median_of([
            mine / ray
            for trial in self.trials
            for mine, ray in zip(trial.totals, trial.yardstick, strict=True)
        ])  # fmt: skip

    def objective(self, goal: Goal) -> float:
        """As measured; infinite where a limit is not met."""
        return goal.objective(self.edge_px, self.seconds)

    def rank(self, goal: Goal) -> tuple[float, float]:
        """By which candidates are put in order."""
        return goal.rank(self.edge_px, self.seconds)


@dataclass(frozen=True)
class FrontPoint:
    """A point of the front that the surrogate traces.

    Attributes:
        price: of a second, pixels of edge displacement.
        settings: continuous, by name.
        edge_px, seconds: by the surrogate, along the curve.
        loss, loss_again: log objective of the curve, and of a search from other starts.
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


@dataclass(frozen=True)
class Sensitivity:
    """How the best settings move with the price, by implicit differentiation of the surrogate.

    Attributes:
        price: where.
        log_settings: d log(setting) / d log(price) by name; 0 at an end of its range.
        log_edge, log_seconds: the same of error and time.
    """

    price: float
    log_settings: dict[str, float]
    log_edge: float
    log_seconds: float


@dataclass(frozen=True, eq=False)
class TuneResult:
    """Everything that tuning measured and found.

    Attributes:
        scene: its name.
        goal, space: what was asked, and where it was searched.
        views, held_out: names of the views that were tuned on, and of those that chose.
        outcome, advice: how it ended, and what to do about it in words ("" for nothing).
        default, tuned, grid_best, random_best: on the held-out views. The last three are each the
            best of `finalists` of their kind; None where nothing of a kind was measured.
        finalists: all that were measured on the held-out views.
        tried: all that were measured on the views tuned on, in order.
        calibrations: of the surrogate, by view.
        said: (2, tried) edge_px and seconds by the surrogate's last fit, for each of `tried`.
        rank_correlation: Spearman's, of the surrogate's objective with the real one over `tried`.
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
    notices: tuple[str, ...] = field(default=())

    @property
    def settings(self) -> dict[str, Any]:
        """The tuned settings by name."""
        return self.space.settings(self.tuned.point)

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
