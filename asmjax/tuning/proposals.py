"""What a search tries next: ends of the surrogate's own search, ends of the box, and neighbours."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import qmc

from asmjax.tuning.goal import Goal, smooth_objective
from asmjax.tuning.search import Found, Model, said_of, search
from asmjax.tuning.space import Space

STEP = (0.12, 0.3)
"""Of the range of a setting, to its neighbours."""

STARTS = 2
"""Of each search: of the best known, and of the best by the surrogate."""

SCREENED = 256
"""Random points of which a search of the surrogate starts from the best."""

NEW_SIZES = 2
"""Of the proposals of a round, those that come first for their size of nodes or memory, the best
of all among them."""

HARMLESS = 0.01
"""Part of the objective that plainer settings may cost."""

OFF, END = 0.05, 0.03
"""As near to an end of its range a setting is tried at it: off, where it can be, or just there."""


def preferred(model: Model, goal: Goal, points: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Points (knobs,) in the order that the surrogate prefers."""
    edge, seconds = said_of(model, np.stack(points)).tolist()
    order = sorted(range(len(points)), key=lambda k: goal.rank(edge[k], seconds[k]))
    return [points[k] for k in order]


def promising(model: Model, goal: Goal, count: int, seed: int) -> list[np.ndarray]:
    """The best by the surrogate of points spread over the whole box."""
    # By its old name: SciPy's stubs know `rng` only, SciPy 1.14 `seed` only.
    drawn = qmc.Sobol(len(model.low), seed=seed)  # pyright: ignore[reportCallIssue]
    return preferred(model, goal, [*drawn.random(SCREENED)])[:count]


def fresh_search(model: Model, goal: Goal, best: Sequence[np.ndarray], seed: int) -> Found:
    """Search the surrogate from the first of `best`, points (knobs,), and from its own best of
    random ones."""
    return search(model, goal, [*best[:STARTS], *promising(model, goal, STARTS, seed)])


def at_ends(space: Space, point: np.ndarray) -> np.ndarray:
    """The point with what is near an end of its range at it: a search of the surrogate never gets
    quite there, and a setting that is off costs nothing."""
    found = point.copy()
    for k, knob in enumerate(space.knobs):
        if knob.off is not None and abs(point[k] - knob.off[0]) < OFF:
            found[k] = knob.off[0]
        elif min(point[k], 1 - point[k]) < END:
            found[k] = round(point[k])
    return found


def extremes(space: Space, point: np.ndarray) -> list[np.ndarray]:
    """The points that differ from one in one setting, which is at an end of its range."""
    found = []
    for k, knob in enumerate(space.knobs):
        for end in (0.0, 1.0):
            if not knob.fixed and abs(point[k] - end) > 1e-9:
                found.append(np.r_[point[:k], end, point[k + 1 :]])
    return found


def around(space: Space, point: np.ndarray) -> list[np.ndarray]:
    """Neighbours of a point, near and far."""
    near = [other for step in STEP for other in space.neighbours(point, step)]
    return [*near, *extremes(space, point)]


def plainer(
    space: Space, model: Model, goal: Goal, point: np.ndarray, default: np.ndarray
) -> np.ndarray:
    """The point with settings back at the default's, what matters least first, as long as by the
    surrogate the objective is no worse than `HARMLESS` in all. What does nothing in this view is
    where a search happened to leave it, and may do harm in another."""
    most = _log_objective(model, goal, [point])[0] + HARMLESS
    while True:
        back = [
            np.r_[point[:k], default[k], point[k + 1 :]]
            for k in range(len(space.knobs))
            if abs(point[k] - default[k]) > 1e-9
        ]
        worse = _log_objective(model, goal, back) if back else np.array([np.inf])
        if not worse.min() <= most:
            return point
        point = back[int(worse.argmin())]


def _log_objective(model: Model, goal: Goal, points: Sequence[np.ndarray]) -> np.ndarray:
    said = said_of(model, np.stack(points))
    return np.asarray(smooth_objective(goal.kind, np.log(goal.value), *said))


def distinct(
    space: Space, points: Sequence[np.ndarray], known: Callable[[np.ndarray], bool], count: int
) -> list[np.ndarray]:
    """The first of those in order that are not known and differ from one another, `count` at most.
    First come those of another size of nodes or memory: of these the surrogate knows the least."""
    new: dict[tuple, np.ndarray] = {}
    for point in points:
        snapped = space.snapped(point)
        if not known(snapped):
            new.setdefault(tuple(np.round(snapped, 6)), snapped)
    seen, first, rest = set(), [], []
    for point in new.values():
        kind = space.algorithm(point)
        size = kind.node_resolution, kind.memory_bytes
        (rest if size in seen else first).append(point)
        seen.add(size)
    chosen = [*first[:NEW_SIZES], *rest, *first[NEW_SIZES:]]
    return chosen[:count]
