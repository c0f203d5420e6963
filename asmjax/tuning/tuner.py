"""Tuning on the real map: a surrogate proposes, measurements decide.

1. The default with one setting at an end of its range, and settings drawn at random, are measured
   on the views, and the surrogate is fitted to them.
2. The surrogate is minimised from several starts; what it proposes is measured, the fit is made
   again with that, and once more.
3. Neighbours of the best so far are measured, plainer settings first and then those that the
   surrogate prefers.
4. The best few are measured on other views, in turns, beside the best of a grid and of a random
   search with as many measurements; what is best there is chosen.

The grid and the rest of the random search are measured after step 3, which knows nothing of them.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import spearmanr

from asmjax.errors import require
from asmjax.experiment.bench import Bench
from asmjax.experiment.ledger import Ledger
from asmjax.options.search import LEAST_EVALUATIONS, PROPOSALS, ROUNDS, SAMPLES, SINGLES
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.calibrate import Calibration, calibrated_fit
from asmjax.tuning.evidence import Evidence, evidence_of
from asmjax.tuning.finals import finalists, measured_finals
from asmjax.tuning.front import trace_front
from asmjax.tuning.goal import LEAST_PX, Goal
from asmjax.tuning.proposals import (
    STARTS,
    around,
    at_ends,
    distinct,
    extremes,
    fresh_search,
    plainer,
    preferred,
)
from asmjax.tuning.result import Candidate, FrontPoint, Outcome, Sensitivity, TuneResult, best_of
from asmjax.tuning.rivals import drawn, grid, grid_size
from asmjax.tuning.search import Model, model_of, said_of
from asmjax.tuning.space import space_of
from asmjax.tuning.tried import RIVALS, Tried

LEAST_WEIGHT = 0.3
"""Of a trial in the fit, however far from the best."""


def steps_of(evaluations: int, held_out: int) -> int:
    """Steps of progress that `Tuner.run` announces at most: default, everything that is measured,
    two surrogates, the front, and the held-out views."""
    return 2 * evaluations - SAMPLES + grid_size() + 4 + held_out


class Tuner:
    """One search for the settings of an adaptive map.

    Args:
        scene: its name.
        benches: the views that are tuned on.
        held_out: the views by which is chosen.
        base: the default settings, with a cost model; its memory is the most that may be used.
        ledger: holds every measurement as soon as it is made.
        seed: of the settings drawn at random.
        evaluations: real maps that the search may spend, the samples among them.
        rounds: of the measurements on the held-out views.
        deadline: `time.perf_counter()` after which nothing new is tried; None for no limit. The
            default, the samples and the held-out views are measured all the same.
        progress: hears of each step, see `steps_of`.

    Raises:
        UseError: too few evaluations, no view, or a view in which no shadow has an edge.
    """

    def __init__(
        self,
        scene: str,
        benches: Sequence[Bench],
        held_out: Sequence[Bench],
        base: AdaptiveShadowMap,
        goal: Goal,
        *,
        ledger: Ledger,
        seed: int = 0,
        evaluations: int = 70,
        rounds: int = 3,
        deadline: float | None = None,
        progress: Callable[[str], None] = lambda _: None,
    ):
        require(
            evaluations >= LEAST_EVALUATIONS,
            f"{evaluations} evaluations are too few to tune; allowed: {LEAST_EVALUATIONS} or more.",
        )
        require(
            len(benches) > 0 and len(held_out) > 0,
            "tuning needs a view to tune on and another one to choose by; name them.",
        )
        for bench in (*benches, *held_out):
            require(
                bench.edge_length > 0,
                f"view '{bench.view}' sees no edge of a shadow, so no setting changes what it "
                "shows; choose another view or light.",
            )
        self.scene, self.goal, self.seed = scene, goal, seed
        self.benches, self.held_out = tuple(benches), tuple(held_out)
        self.base, self.ledger = base, ledger
        self.evaluations, self.rounds, self.deadline = evaluations, rounds, deadline
        self._progress, self._doing = progress, ""
        self._cut = False
        self._settled = True
        self._evidence: list[Evidence] = []
        self._kinds: dict[str, list[Candidate]] = {}
        self._said = np.zeros((2, 0))
        self._sensitivity: Sensitivity | None = None
        self._front: tuple[FrontPoint, ...] = ()
        self.calibrations: tuple[Calibration, ...] = ()

    def run(self) -> TuneResult:
        """Search, measure, choose. Trouble on the way is the result's `outcome`, an interruption
        among it once the default has been measured.

        Raises:
            UseError: as the constructor, or the memory limit holds no map.
            KeyboardInterrupt: before there is a result.
        """
        self._began, self._reused = time.perf_counter(), self.ledger.taken
        self._progress("default settings")
        faces = max(bench.frame.faces for bench in (*self.benches, *self.held_out))
        self.base.tree_shape(faces)
        self.space = space_of(self.base, faces, self._default_seconds())
        self.tried = Tried(self.benches, self.space, self.goal, self.ledger, self._heard)
        default = self.tried.measure(self.space.point(self.base), "default", self.base)
        try:
            self._search()
            return self._result(default, stopped=False)
        except KeyboardInterrupt:
            return self._result(default, stopped=True)

    def _search(self) -> None:
        """All that is measured on the views tuned on, and what the surrogate says of it."""
        measure = self.tried.measure
        # As many as there are evaluations; the first `SAMPLES` are the surrogate's.
        at_random = drawn(self.space, self.evaluations, self.seed)
        self._doing = "one setting at a time"
        alone = extremes(self.space, self.space.point(self.base))[:SINGLES]
        for point in alone:
            measure(point, "single")
        self._doing = "settings at random"
        samples = [measure(point, "sample") for point in at_random[:SAMPLES]]
        self._progress("surrogate")
        self._evidence = [evidence_of(bench, self.base, self.seed) for bench in self.benches]
        model = self._propose()
        self._doing = "neighbours of the best"
        self._neighbours(model)
        model = self._fit()
        self._kinds["tuned"] = [one for one in self.tried.all if one.role != "default"]
        if self.goal.price is not None and not self._late():
            self._progress("front")
            points = np.stack([one.point for one in self.tried.all])
            self._sensitivity, self._front = trace_front(model, self.goal.price, points, self.seed)
        self._doing = "random search"
        rest = [measure(point, "random") for point in at_random[SAMPLES:] if not self._late()]
        self._kinds["random"] = [*samples, *rest]
        self._doing = "grid"
        self._kinds["grid"] = [
            measure(point, "grid") for point in grid(self.space, self.base) if not self._late()
        ]
        self._said = said_of(model, np.stack([one.point for one in self.tried.all]))

    def _late(self) -> bool:
        """Whether the time given is spent; whoever asks leaves something out then."""
        late = self.deadline is not None and time.perf_counter() > self.deadline
        self._cut |= late
        return late

    def _heard(self) -> None:
        if self._doing:
            self._progress(f"{self._doing}, {len(self.tried.all)} tried")

    def _default_seconds(self) -> float:
        """Of a frame with the default settings, the mean over the views."""
        trials = [bench.try_all([self.base], 3, self.ledger)[0] for bench in self.benches]
        return sum(trial.total.value for trial in trials) / len(trials)

    def _fit(self) -> Model:
        """The surrogate fitted to all that the search has measured."""
        use = self.tried.own
        points, weight = np.stack([one.point for one in use]), self._weights(use)
        fits: list[Calibration] = []
        for number, evidence in enumerate(self._evidence):
            trials = [one.trials[number] for one in use]
            edge = np.array([trial.edge_px for trial in trials])
            seconds = np.array([trial.total.value for trial in trials])
            start = self.calibrations[number].fit if self.calibrations else None
            fits.append(
                calibrated_fit(evidence, self.space, points, edge, seconds, start, weight)
            )  # fmt: skip
        self.calibrations = tuple(fits)
        return model_of(self._evidence, fits, self.space)

    def _weights(self, use: Sequence[Candidate]) -> np.ndarray:
        """(k,) of trials: near the best the fit must be right, far from it about right."""
        logs = np.log([(one.edge_px + LEAST_PX, one.seconds) for one in use])
        best = min(range(len(use)), key=lambda k: use[k].rank(self.goal))
        off = np.abs(logs - logs[best]).sum(axis=1)
        return np.clip(np.exp(-off / 2), LEAST_WEIGHT, 1.0)

    def _propose(self) -> Model:
        """Rounds of fitting, searching and measuring; the last fit."""
        model = self._fit()
        for number in range(ROUNDS):
            if self._late():
                break
            self._doing = "surrogate's proposals"
            for point in self._proposals(model, number):
                if self._late():
                    break
                self.tried.measure(point, "surrogate")
            self._doing = ""
            self._progress("surrogate")
            model = self._fit()
        return model

    def _proposals(self, model: Model, number: int) -> list[np.ndarray]:
        """What the surrogate prefers of the ends of a search, of the best of them with all other
        steps, of ends of the box, and of what is beside the best so far."""
        space, goal = self.space, self.goal
        best = [one.point for one in self.tried.first(self.tried.own, STARTS)]
        found = fresh_search(model, goal, best, self.seed + number)
        self._settled = bool(found.settled[0])
        ends = [at_ends(space, end) for end in found.points]
        default = space.point(self.base)
        points = [
            *ends, *space.other_steps(ends[0]), *around(space, best[0]), *extremes(space, ends[0]),
            *extremes(space, default),
        ]  # fmt: skip
        ordered = preferred(model, goal, points)
        return distinct(space, ordered, self.tried.knows, PROPOSALS)

    def _neighbours(self, model: Model) -> None:
        """Measure what is plainer than the best, and its neighbours, and those of the new best, as
        long as evaluations are left."""
        left = self.evaluations - len(self.tried.own) + 1
        while left > 0:
            best = self.tried.first(self.tried.own, 1)[0]
            beside = preferred(model, self.goal, around(self.space, best.point))
            default = self.space.point(self.base)
            plain = plainer(self.space, model, self.goal, best.point, default)
            for point in (plain, *beside):
                if left <= 0 or self.tried.knows(point):
                    continue
                if self._late():
                    return
                one = self.tried.measure(point, "neighbour")
                left -= 1
                if one.rank(self.goal) < best.rank(self.goal):
                    break
            else:
                return

    def _finals(self, default: Candidate) -> dict[str, list[Candidate]]:
        """The default and the best few of each kind on the held-out views."""
        plain = self.space.point(self.base)
        chosen = {
            kind: finalists(self.tried.first(some, len(some)), plain)
            for kind, some in self._kinds.items()
        }
        return measured_finals(
            {"default": [default], **chosen},
            self.held_out, self.rounds, self.ledger, self._progress,
        )  # fmt: skip

    def _unfinished(self, default: Candidate) -> dict[str, list[Candidate]]:
        """What stands in for the finals where they were not got to: all on the views tuned on."""
        return {"default": [default], "tuned": self.tried.own[1:], **self._kinds}

    def _result(self, default: Candidate, stopped: bool) -> TuneResult:
        finals = self._unfinished(default) if stopped else self._finals(default)
        best = {kind: best_of(some, self.goal) for kind, some in finals.items()}
        (standing,) = finals["default"]
        tuned = best_of([one for one in (best["tuned"], standing) if one is not None], self.goal)
        assert tuned is not None
        outcome = self._outcome(tuned, standing, stopped)
        finalists = {id(one): one for some in finals.values() for one in some}
        # Known of all, or of none: what came after it was said is not among it.
        known = self._said.shape[1] == len(self.tried.all)
        unsaid = np.full((2, len(self.tried.all)), np.nan)
        return TuneResult(
            scene=self.scene,
            goal=self.goal,
            space=self.space,
            views=tuple(bench.view for bench in self.benches),
            held_out=tuple(bench.view for bench in self.held_out),
            outcome=outcome,
            advice=self._advice(outcome, tuned),
            default=standing,
            tuned=tuned,
            grid_best=best.get("grid"),
            random_best=best.get("random"),
            finalists=tuple(finalists.values()),
            tried=tuple(self.tried.all),
            calibrations=self.calibrations,
            said=self._said if known else unsaid,
            rank_correlation=self._correlation() if known else float("nan"),
            sensitivity=self._sensitivity,
            front=self._front,
            evaluations=self.evaluations,
            reused=self.ledger.taken - self._reused,
            seconds=time.perf_counter() - self._began,
        )

    def _correlation(self) -> float:
        """Spearman's rank correlation of what the surrogate says with what was measured, of those
        that it was not fitted to."""
        others = [k for k, one in enumerate(self.tried.all) if one.role in RIVALS]
        guessed = [self.goal.rank(*self._said[:, k].tolist()) for k in others]
        real = [self.tried.all[k].rank(self.goal) for k in others]
        if len(set(guessed)) < 2 or len(set(real)) < 2:
            return float("nan")
        return float(np.asarray(spearmanr(_places(guessed), _places(real)))[0])

    def _outcome(self, tuned: Candidate, default: Candidate, stopped: bool) -> Outcome:
        if stopped:
            return Outcome.INTERRUPTED
        if not self.goal.met(tuned.edge_px, tuned.seconds):
            return Outcome.NOT_MET
        if self._cut:
            return Outcome.TIME_SPENT
        if tuned is default:
            return Outcome.DEFAULT_STANDS
        settled = self._settled and all(one.settled for one in self.calibrations)
        return Outcome.FOUND if settled else Outcome.UNSETTLED

    def _advice(self, outcome: Outcome, tuned: Candidate) -> str:
        """What to do, with the numbers that say so; "" where all is well."""
        if outcome is Outcome.FOUND:
            return ""
        if outcome is Outcome.NOT_MET:
            return (
                f"{outcome.value}. The nearest have {tuned.edge_px:.3g} px in "
                f"{1e3 * tuned.seconds:.3g} ms; asked was {self.goal.words}."
            )
        return f"{outcome.value}."


def _places(ranks: Sequence[tuple[float, float]]) -> list[int]:
    """The place of each in order; equal ones share theirs."""
    order = {rank: place for place, rank in enumerate(sorted(set(ranks)))}
    return [order[rank] for rank in ranks]
