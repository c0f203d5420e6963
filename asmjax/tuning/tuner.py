"""Tuning on the real map: a surrogate proposes, measurements decide.

1. Settings drawn at random are measured on the views; the surrogate is fitted to some of them.
2. The surrogate is minimised from several starts; what it proposes is measured, the fit is made
   again with that, and once more.
3. Neighbours of the best so far are measured, those first that the surrogate prefers.
4. The best few are measured on other views, in turns, beside the best of a grid and of a random
   search with as many measurements; what is best there is chosen.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import qmc, spearmanr

from asmjax.errors import require
from asmjax.experiment.bench import Bench
from asmjax.experiment.ledger import Ledger
from asmjax.experiment.methods import settings_of
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.calibrate import Calibration, calibrated_fit
from asmjax.tuning.evidence import Evidence, evidence_of
from asmjax.tuning.front import trace_front
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Candidate, Outcome, TuneResult, best_of
from asmjax.tuning.search import Model, model_of, said_of, search
from asmjax.tuning.space import NAMES, node_cost, space_of, values_at

SAMPLES = 20
"""Of the evaluations, those drawn at random that the surrogate is fitted to."""

SAMPLED_STEPS = 8
"""Combinations of steps that are drawn, balanced: each has programs of its own to compile."""

PROPOSALS = 4
"""Settings that the surrogate proposes and that are measured, in each of two rounds."""

LEAST_EVALUATIONS = SAMPLES + 2 * PROPOSALS
"""Fewer leave nothing for neighbours."""

STARTS = 4
"""Of each search on the surrogate: the best measured so far."""

FINALISTS = {"tuned": 4, "grid": 2, "random": 2}
"""Of each kind, how many are measured on the held-out views."""

STEP = (0.12, 0.3)
"""Of the range of a setting, to its neighbours."""

LEAST_WEIGHT = 0.25
"""Of a trial in the fit, however far from the best."""

STEPS = 7
"""Steps of progress that `Tuner.run` announces."""

GRID = {
    "finest_ratio": (1 / 64, 1 / 16, 1 / 4, 1.0),
    "ratio_target": (1.0, 4.0),
    "least_profit": (0.0, None),
    "node_resolution": (16, 32),
}
"""The grid of 32 points that tuned settings are compared with; None is the middle of the range. All
other settings are the default's."""


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
        deadline: `time.perf_counter()` after which nothing new is tried; None for no limit.
        progress: hears of each of `STEPS` steps.

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
        evaluations: int = 36,
        rounds: int = 4,
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
        self.progress = progress
        self.tried: list[Candidate] = []
        self._known: dict[tuple, Candidate] = {}
        self.calibrations: tuple[Calibration, ...] = ()

    @property
    def late(self) -> bool:
        """Whether the time given is spent."""
        return self.deadline is not None and time.perf_counter() > self.deadline

    def run(self) -> TuneResult:
        """Search, measure, choose. Trouble on the way is the result's `outcome`.

        Raises:
            UseError: as the constructor, or the memory limit holds no map.
        """
        began, reused = time.perf_counter(), self.ledger.taken
        self.progress("default settings")
        faces = max(bench.frame.faces for bench in (*self.benches, *self.held_out))
        self.base.tree_shape(faces)
        seconds = self._default_seconds()
        self.space = space = space_of(self.base, faces, seconds)
        default = self._measure(space.point(self.base), "default", self.base)
        self.progress("settings at random")
        samples = self._at_random()
        self.progress("surrogate")
        evidence = [evidence_of(bench, self.base, self.seed) for bench in self.benches]
        model, settled = self._propose(evidence)
        self.progress("neighbours")
        self._neighbours(model)
        mine = [c for c in self.tried if c.role != "random"]
        model = self._fit(evidence)
        self.progress("front")
        bending, front = self._front(model)
        self.progress("grid")
        grid = self._grid()
        said = said_of(model, np.stack([one.point for one in self.tried]))
        self.progress("held-out views")
        chosen = {
            "tuned": self._first(mine, FINALISTS["tuned"]),
            "grid": self._first(grid, FINALISTS["grid"]),
            "random": self._first([*samples], FINALISTS["random"]),
        }
        finals = self._finals([default, *(c for some in chosen.values() for c in some)])
        best = {
            kind: best_of([finals[_settings_key(c.algorithm)] for c in some], self.goal)
            for kind, some in chosen.items()
        }
        standing = finals[_settings_key(default.algorithm)]
        tuned = best_of([c for c in (best["tuned"], standing) if c is not None], self.goal)
        assert tuned is not None
        outcome = self._outcome(tuned, standing, settled)
        return TuneResult(
            scene=self.scene,
            goal=self.goal,
            space=space,
            views=tuple(bench.view for bench in self.benches),
            held_out=tuple(bench.view for bench in self.held_out),
            outcome=outcome,
            advice=self._advice(outcome, tuned),
            default=standing,
            tuned=tuned,
            grid_best=best["grid"],
            random_best=best["random"],
            finalists=tuple(finals.values()),
            tried=tuple(self.tried),
            calibrations=self.calibrations,
            said=said,
            rank_correlation=self._correlation(said),
            sensitivity=bending,
            front=front,
            evaluations=self.evaluations,
            reused=self.ledger.taken - reused,
            seconds=time.perf_counter() - began,
        )

    def _default_seconds(self) -> float:
        """Of a frame with the default settings, the mean over the views."""
        trials = [bench.try_all([self.base], 3, self.ledger)[0] for bench in self.benches]
        return sum(trial.total.value for trial in trials) / len(trials)

    def _measure(
        self, point: np.ndarray, role: str, algorithm: AdaptiveShadowMap | None = None
    ) -> Candidate:
        """Settings measured once on each view that is tuned on."""
        algorithm = self.space.algorithm(point) if algorithm is None else algorithm
        name = _settings_key(algorithm)
        if name not in self._known:
            trials = tuple(
                bench.try_all([algorithm], 1, self.ledger, warm_ups=0)[0] for bench in self.benches
            )
            candidate = Candidate(role, self.space.snapped(point), algorithm, trials)
            self._known[name] = candidate
            self.tried.append(candidate)
        return self._known[name]

    def _at_random(self) -> list[Candidate]:
        """A random search with all evaluations; its first `SAMPLES` are the surrogate's."""
        # By its old name: SciPy's stubs know `rng` only, SciPy 1.14 `seed` only.
        drawn = qmc.Sobol(len(self.space.knobs), seed=self.seed)  # pyright: ignore[reportCallIssue]
        points = drawn.random(1 << (self.evaluations - 1).bit_length())[: self.evaluations]
        found = []
        for number, point in enumerate(points):
            if self.late and number >= SAMPLES:
                break
            point = self.space.with_steps(point, number % SAMPLED_STEPS)
            found.append(self._measure(point, "sample" if number < SAMPLES else "random"))
        return found

    def _fit(self, evidence: Sequence[Evidence]) -> Model:
        """The surrogate fitted to all that was proposed or drawn for it."""
        use = [one for one in self.tried if one.role != "random"]
        points = np.stack([one.point for one in use], axis=1)
        low, high = (end[:, None] for end in self.space.ends)
        values = {name: np.asarray(value) for name, value in values_at(points, low, high).items()}
        fits: list[Calibration] = []
        # Near the best it must be right; far from it, about right.
        ranks = np.array([one.rank(self.goal)[1] for one in use])
        weight = np.clip(np.sqrt(ranks.min() / np.maximum(ranks, 1e-12)), LEAST_WEIGHT, 1)
        for number, some in enumerate(evidence):
            trials = [one.trials[number] for one in use]
            edge = np.array([trial.edge_px for trial in trials])
            seconds = np.array([trial.total.value for trial in trials])
            start = self.calibrations[number].fit if self.calibrations else None
            cost = node_cost(self.space.base)
            fits.append(calibrated_fit(some, values, edge, seconds, cost, start, weight))
        self.calibrations = tuple(fits)
        return model_of(evidence, [one.fit for one in fits], self.space)

    def _propose(self, evidence: Sequence[Evidence]) -> tuple[Model, bool]:
        """Two rounds of fitting, searching and measuring; the last fit, and whether its search came
        to rest."""
        settled = False
        model = self._fit(evidence)
        for _ in range(2):
            if self.late:
                break
            found = search(model, self.goal, self._starts())
            settled = bool(found.settled[:1].any())
            for point in self._proposals(model, found.points):
                if not self.late:
                    self._measure(point, "surrogate")
            model = self._fit(evidence)
        return model, settled

    def _proposals(self, model: Model, ends: np.ndarray) -> list[np.ndarray]:
        """What the surrogate prefers of the ends of a search (k, knobs), of the first one with all
        other steps, and of what is beside the best so far. Each has another size of nodes or
        memory, as far as there are: of these the surrogate knows the least."""
        best = self._starts()[0]
        around = [point for step in STEP for point in self.space.neighbours(best, step)]
        points = [*ends, *self.space.other_steps(ends[0]), *around]
        ordered = [self.space.snapped(point) for point in self._by_surrogate(model, points)]
        new = [p for p in ordered if _settings_key(self.space.algorithm(p)) not in self._known]
        kinds = [self.space.algorithm(point) for point in new]
        seen, first, rest = set(), [], []
        for point, kind in zip(new, kinds, strict=True):
            size = kind.node_resolution, kind.memory_bytes
            (rest if size in seen else first).append(point)
            seen.add(size)
        return [*first[:PROPOSALS], *rest][:PROPOSALS]

    def _starts(self) -> list[np.ndarray]:
        """The best points so far."""
        return [one.point for one in self._first(self.tried, STARTS)]

    def _by_surrogate(self, model: Model, points: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Points in the order that the surrogate prefers."""
        edge, seconds = said_of(model, np.stack(points)).tolist()
        order = sorted(range(len(points)), key=lambda k: self.goal.rank(edge[k], seconds[k]))
        return [points[k] for k in order]

    def _neighbours(self, model: Model) -> None:
        """Measure neighbours of the best, and of the new best, as long as evaluations are left."""
        spent = [one for one in self.tried if one.role != "random"]
        left = self.evaluations - len(spent) + 1
        while left > 0 and not self.late:
            best = self._first(spent, 1)[0]
            around = [p for step in STEP for p in self.space.neighbours(best.point, step)]
            for point in self._by_surrogate(model, around):
                if left <= 0 or self.late:
                    break
                if _settings_key(self.space.algorithm(point)) in self._known:
                    continue
                one = self._measure(point, "neighbour")
                spent.append(one)
                left -= 1
                if one.rank(self.goal) < best.rank(self.goal):
                    break
            else:
                break

    def _correlation(self, said: np.ndarray) -> float:
        """Spearman's rank correlation of what the surrogate said (2, k) with what was measured."""
        guessed = [self.goal.rank(*pair) for pair in said.T.tolist()]
        real = [one.rank(self.goal) for one in self.tried]
        return float(np.asarray(spearmanr(_places(guessed), _places(real)))[0])

    def _front(self, model: Model):
        """Sensitivity and front about the price; nothing for goals without one."""
        starts = self._starts()
        if self.goal.price is None or self.late:
            return None, ()
        point = search(model, self.goal, starts).points[0]
        return trace_front(model, self.goal.price, point, starts[:2])

    def _grid(self) -> list[Candidate]:
        """The grid's points, each measured."""
        start = self.space.point(self.base)
        points = [start]
        for name, values in GRID.items():
            k = NAMES.index(name)
            knob = self.space.knobs[k]
            points = [
                np.concatenate([point[:k], [0.5 if value is None else knob.place(value)],
                                point[k + 1 :]])
                for point in points
                for value in values
            ]  # fmt: skip
        return [self._measure(point, "grid") for point in points if not self.late]

    def _first(self, some: Sequence[Candidate], count: int) -> list[Candidate]:
        """The best of some by what was measured on the views tuned on."""
        return sorted(some, key=lambda one: one.rank(self.goal))[:count]

    def _finals(self, candidates: Sequence[Candidate]) -> dict[tuple, Candidate]:
        """The candidates measured on the held-out views, in turns, by their settings."""
        unique = {_settings_key(one.algorithm): one for one in candidates}
        algorithms = [one.algorithm for one in unique.values()]
        columns = [
            bench.try_all(algorithms, self.rounds, self.ledger, warm_ups=0, together=True)
            for bench in self.held_out
        ]
        return {
            name: Candidate(one.role, one.point, one.algorithm, trials)
            for (name, one), trials in zip(unique.items(), zip(*columns, strict=True), strict=True)
        }

    def _outcome(self, tuned: Candidate, default: Candidate, settled: bool) -> Outcome:
        if not self.goal.met(tuned.edge_px, tuned.seconds):
            return Outcome.NOT_MET
        if self.late:
            return Outcome.TIME_SPENT
        if tuned is default:
            return Outcome.DEFAULT_STANDS
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


def _settings_key(algorithm: AdaptiveShadowMap) -> tuple:
    """Equal for equal settings."""
    return tuple(sorted((name, repr(value)) for name, value in settings_of(algorithm).items()))


def _places(ranks: Sequence[tuple[float, float]]) -> list[int]:
    """The place of each in order; equal ones share theirs."""
    order = {rank: place for place, rank in enumerate(sorted(set(ranks)))}
    return [order[rank] for rank in ranks]
