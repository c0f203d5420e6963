"""The last round of tuning: the best few of each kind, measured beside each other on views that
nothing was tuned on."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from asmjax.experiment.bench import Bench
from asmjax.experiment.ledger import Ledger
from asmjax.tuning.result import Candidate
from asmjax.tuning.tried import candidate, settings_key

FINALISTS = 5
"""Of each kind, how many are measured on the held-out views at most: as many draws for each."""

APART = 0.1
"""Distance of finalists of a kind, in sides of the box: of near ones only the noise differs."""


def measured_finals(
    chosen: Mapping[str, Sequence[Candidate]],
    held_out: Sequence[Bench],
    rounds: int,
    ledger: Ledger,
    progress: Callable[[str], None],
) -> dict[str, list[Candidate]]:
    """The candidates of each kind as measured on the views `held_out`, in turns; settings that are
    of two kinds are measured once."""
    unique = {settings_key(one.algorithm): one for some in chosen.values() for one in some}
    algorithms = [one.algorithm for one in unique.values()]
    columns = []
    for bench in held_out:
        progress(f"held-out view: {len(algorithms)} settings in turns")
        columns.append(bench.try_all(algorithms, rounds, ledger, warm_ups=0, together=True))
    measured = {
        name: candidate(one.role, one.point, one.algorithm, trials, held_out)
        for (name, one), trials in zip(unique.items(), zip(*columns, strict=True), strict=True)
    }
    return {
        kind: [measured[settings_key(one.algorithm)] for one in some]
        for kind, some in chosen.items()
    }


def finalists(ordered: Sequence[Candidate], default: np.ndarray) -> list[Candidate]:
    """The first of those in order, `FINALISTS` at most, each `APART` from the ones before it.

    Of those with the same error on every view, which differ in what does nothing, the one stands
    that has most settings of `default` (knobs,).
    """
    plainest: dict[tuple[float, ...], Candidate] = {}
    for one in ordered:
        errors = tuple(trial.edge_px for trial in one.trials)
        other = plainest.setdefault(errors, one)
        if _changed(one, default) < _changed(other, default):
            plainest[errors] = one
    chosen: list[Candidate] = []
    for one in plainest.values():
        if len(chosen) == FINALISTS:
            break
        if all(np.linalg.norm(one.point - other.point) >= APART for other in chosen):
            chosen.append(one)
    return chosen


def _changed(one: Candidate, default: np.ndarray) -> int:
    """How many settings differ from the default's."""
    return int((np.abs(one.point - default) > 1e-9).sum())
