"""Settings that are measured on the views tuned on: each once, and remembered."""

from collections.abc import Callable, Sequence

import numpy as np

from asmjax.experiment.bench import Bench
from asmjax.experiment.comparison import pooled
from asmjax.experiment.ledger import Ledger
from asmjax.experiment.methods import settings_of
from asmjax.experiment.trial import Trial
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Candidate
from asmjax.tuning.space import Space

RIVALS = ("random", "grid")
"""Roles of what the search is compared with, which it must not learn from."""


class Tried:
    """Candidates in the order in which they were measured.

    Args:
        ledger: holds every measurement as soon as it is made.
        heard: hears of each candidate before it is measured.
    """

    def __init__(
        self,
        benches: Sequence[Bench],
        space: Space,
        goal: Goal,
        ledger: Ledger,
        heard: Callable[[], None],
    ):
        self.benches, self.space, self.goal, self.ledger = benches, space, goal, ledger
        self._heard = heard
        self.all: list[Candidate] = []
        self._known: dict[tuple, Candidate] = {}

    @property
    def own(self) -> list[Candidate]:
        """All that the search may learn from: the default, its samples, and what it proposed."""
        return [one for one in self.all if one.role not in RIVALS]

    def knows(self, point: np.ndarray) -> bool:
        """Whether the settings of a point were measured."""
        return settings_key(self.space.algorithm(point)) in self._known

    def measure(
        self, point: np.ndarray, role: str, algorithm: AdaptiveShadowMap | None = None
    ) -> Candidate:
        """Settings measured once on each view; as they are known if they were measured before."""
        self._heard()
        algorithm = self.space.algorithm(point) if algorithm is None else algorithm
        name = settings_key(algorithm)
        if name not in self._known:
            trials = [
                bench.try_all([algorithm], 1, self.ledger, warm_ups=0)[0] for bench in self.benches
            ]
            one = candidate(role, self.space.snapped(point), algorithm, trials, self.benches)
            self._known[name] = one
            self.all.append(one)
        return self._known[name]

    def first(self, some: Sequence[Candidate], count: int) -> list[Candidate]:
        """The best of some by what was measured."""
        return sorted(some, key=lambda one: one.rank(self.goal))[:count]


def candidate(
    role: str,
    point: np.ndarray,
    algorithm: AdaptiveShadowMap,
    trials: Sequence[Trial],
    benches: Sequence[Bench],
) -> Candidate:
    """A candidate of one trial for each bench."""
    edges = [bench.edge_length for bench in benches]
    pixels = [int(bench.eyes[0].valid.sum()) for bench in benches]
    return Candidate(role, point, algorithm, tuple(trials), pooled(trials, edges, pixels))


def settings_key(algorithm: AdaptiveShadowMap) -> tuple:
    """Equal for equal settings."""
    return tuple(sorted((name, repr(value)) for name, value in settings_of(algorithm).items()))
