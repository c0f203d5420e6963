"""Results of tuning that are made from numbers, without a renderer."""

from collections.abc import Sequence

import numpy as np

from asmjax.experiment.comparison import pooled
from asmjax.experiment.methods import settings_of
from asmjax.experiment.trial import Trial
from asmjax.report.compare_result import SeenView
from asmjax.report.tune_result import TuningResult
from asmjax.shadow import AdaptiveShadowMap, CostModel
from asmjax.tuning.calibrate import Calibration
from asmjax.tuning.correction import no_correction
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import (
    Candidate,
    FrontPoint,
    Outcome,
    Sensitivity,
    TuneResult,
    best_of,
)
from asmjax.tuning.space import NAMES, Space, space_of
from asmjax.tuning.surrogate import Fit

TUNED_ON, HELD_OUT = ("near", "far"), ("aside", "above")
YARDSTICK = 0.004

MODEL = CostModel(1e-8, 1e-4, 0.01)
DEFAULT = AdaptiveShadowMap(cost_model=MODEL)

RULES_FIT = Fit(*np.full(len(Fit._fields), 0.1))


def space() -> Space:
    """The box about the default settings, for a light of one face, and 50 ms a frame."""
    return space_of(DEFAULT, 1, 0.05)


def trial(
    algorithm: AdaptiveShadowMap, view: str, edge_px: float, totals: Sequence[float]
) -> Trial:
    """A trial with that error, whose turns took `totals` seconds."""
    return Trial(
        name=algorithm.name,
        family="adaptive",
        settings=settings_of(algorithm),
        view=view,
        samples=1,
        error={
            "misclassified_fraction": 0.01,
            "false_lit_fraction": 0.004,
            "false_dark_fraction": 0.006,
            "boundary_displacement_px": {
                "mean": edge_px, "p95": 2 * edge_px, "per_edge_length": edge_px,
            },
        },
        predicted_px=None,
        seconds={
            "build": [0.5 * total for total in totals],
            "analysis": [0.25 * total for total in totals],
            "query": [0.25 * total for total in totals],
        },
        yardstick=[YARDSTICK] * len(totals),
        bytes=2**20,
        texels=1000,
        rays=1000,
        status="complete",
        nodes=4,
    )  # fmt: skip


def candidate(
    role: str,
    edge_px: float,
    seconds: float,
    views: Sequence[str] = HELD_OUT,
    point: np.ndarray | None = None,
    turns: int = 3,
) -> Candidate:
    """Settings with that error and time, on views of which one is 1.2 times the mean and the other
    0.8; at a point of the box, or the default's."""
    box = space()
    algorithm = DEFAULT if point is None else box.algorithm(point)
    place = box.point(DEFAULT) if point is None else box.snapped(point)
    spread = np.linspace(0.9, 1.1, turns) if turns > 1 else np.ones(1)
    trials = [
        trial(algorithm, view, part * edge_px, (part * seconds * spread).tolist())
        for view, part in zip(views, (1.2, 0.8), strict=True)
    ]
    return Candidate(role, place, algorithm, tuple(trials), pooled(trials, (1, 1), (1, 1)))


ROLES = ("default", "sample", "random", "grid", "surrogate", "neighbour")


def tuning_result(
    goal: Goal,
    *,
    default: tuple[float, float] = (0.02, 0.06),
    tuned: tuple[float, float] = (0.01, 0.05),
    grid: tuple[float, float] | None = (0.015, 0.05),
    drawn: tuple[float, float] | None = (0.03, 0.04),
    outcome: Outcome = Outcome.FOUND,
    advice: str = "",
) -> TuningResult:
    """A result whose rivals have those (error px, seconds) on the held-out views, with two dozen
    settings tried before, and what a surrogate says of them: 1.1 times the error, half the time."""
    generator = np.random.default_rng(5)
    points = generator.random((24, len(NAMES)))
    tried = [candidate("default", *default, TUNED_ON, turns=1)]
    for k, point in enumerate(points):
        numbers = 10 ** generator.uniform(-3, -1), 10 ** generator.uniform(-2, -1)
        role = ROLES[1 + k % (len(ROLES) - 1)]
        tried.append(candidate(role, *numbers, TUNED_ON, point, turns=1))
    standing, best = candidate("default", *default), candidate("surrogate", *tuned, point=points[0])
    grid_best = None if grid is None else candidate("grid", *grid, point=points[1])
    random_best = None if drawn is None else candidate("sample", *drawn, point=points[2])
    finalists = [one for one in (standing, best, grid_best, random_best) if one is not None]
    if outcome is Outcome.DEFAULT_STANDS:
        best = standing
    box = space()
    front: tuple[FrontPoint, ...] = ()
    bending = None
    if goal.price is not None:
        prices = goal.price * np.geomspace(0.1, 10, 5)
        front = tuple(
            FrontPoint(
                price=float(price),
                settings={knob.name: float(knob.continuous(0.1 + 0.2 * k)) for knob in box.knobs},
                edge_px=0.005 * 2.0**k,
                seconds=0.08 / 1.5**k,
                loss=-3.0 + k,
                loss_again=-3.01 + k,
            )
            for k, price in enumerate(prices)
        )
        bending = Sensitivity(
            goal.price, {n: 0.2 * (k - 4) for k, n in enumerate(NAMES)}, 0.6, -0.4, settled=True
        )
    found = TuneResult(
        scene="hall",
        goal=goal,
        space=box,
        views=TUNED_ON,
        held_out=HELD_OUT,
        outcome=outcome,
        advice=advice,
        default=standing,
        tuned=best,
        grid_best=grid_best,
        random_best=random_best,
        finalists=tuple(finalists),
        tried=tuple(tried),
        calibrations=tuple(
            Calibration(RULES_FIT, no_correction(11, 20), 0.1, 0.05, 20, settled=True)
            for _ in TUNED_ON
        ),
        said=np.array([[1.1 * one.edge_px for one in tried], [0.5 * one.seconds for one in tried]]),
        rank_correlation=0.9,
        sensitivity=bending,
        front=front,
        evaluations=36,
        reused=3,
        seconds=12.5,
    )
    assert best_of(finalists, goal) is not None
    seen = [SeenView(name, (64, 48), 3000, {1: 120.0}) for name in (*TUNED_ON, *HELD_OUT)]
    return TuningResult(
        found=found,
        variant="llvm_ad_rgb",
        light="lamp (spot, 1 face(s))",
        lit_by="light lamp (spot)",
        seen=seen,
        notices=[advice] if advice else [],
        cost_model=MODEL,
        made=50,
    )
