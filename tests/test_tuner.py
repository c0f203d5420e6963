"""Tuning from end to end on analytic benches, without a renderer: two views of a disc's shadow."""

import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.tuning import BASE, bench_of_shapes, disc_bench

from asmjax.errors import UseError
from asmjax.experiment.ledger import Ledger
from asmjax.scene.spec import LightSpec, Rectangle, ViewSpec
from asmjax.tuning import evidence as evidence_module
from asmjax.tuning import rivals as rivals_module
from asmjax.tuning import space as space_module
from asmjax.tuning import tuner as tuner_module
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Outcome
from asmjax.tuning.tried import RIVALS, Tried
from asmjax.tuning.tuner import Tuner, steps_of

SIDE = 48
"""Pixels a side."""

SAMPLES, SINGLES, EVALUATIONS = 16, 4, 28
"""As few as there may be here."""

LIMIT = Goal(error=0.2)
"""Pixels of edge: coarse maps break it. A front, which a price asks for, takes a minute to compile:
`test_tuning_search` traces one."""

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True, scope="module")
def small():
    """Few sizes of nodes, which each are compiled; a grid of two; the samples of other tests."""
    patch = pytest.MonkeyPatch()
    patch.setattr(space_module, "NODES", (8, 16))
    patch.setattr(space_module, "CELLS", (2, 4))
    patch.setattr(space_module, "MEMORY_PARTS", (1,))
    patch.setattr(evidence_module, "SAMPLES", 24)
    patch.setattr(rivals_module, "GRID", {"finest_ratio": (1 / 16, 1.0)})
    patch.setattr(tuner_module, "SAMPLES", SAMPLES)
    patch.setattr(tuner_module, "SINGLES", SINGLES)
    patch.setattr(tuner_module, "PROPOSALS", 3)
    patch.setattr(tuner_module, "LEAST_EVALUATIONS", EVALUATIONS)
    yield
    patch.undo()


@pytest.fixture(scope="module")
def benches():
    """A view to tune on and one to choose by."""
    return disc_bench(SIDE, "tuned on"), disc_bench(SIDE, "held out", aside=0.4)


def tuner(benches, ledger: Ledger, goal: Goal = LIMIT, **options) -> Tuner:
    on, out = benches
    options = {"evaluations": EVALUATIONS, "rounds": 2, **options}
    return Tuner("disc", [on], [out], BASE, goal, ledger=ledger, **options)


@pytest.fixture(scope="module")
def first(benches, tmp_path_factory):
    """A run to the end, and the file of its measurements."""
    path: Path = tmp_path_factory.mktemp("tuner") / "m.jsonl"
    steps: list[str] = []
    found = tuner(benches, Ledger(path), progress=steps.append).run()
    return found, path, steps


def test_the_result_agrees_with_itself(first):
    """Every field says what the others do."""
    found, _, steps = first
    assert EVALUATIONS < len(steps) <= steps_of(EVALUATIONS, 1)
    assert (found.scene, found.views, found.held_out) == ("disc", ("tuned on",), ("held out",))
    assert found.outcome in (Outcome.FOUND, Outcome.DEFAULT_STANDS, Outcome.UNSETTLED)
    assert (found.advice == "") == (found.outcome is Outcome.FOUND)
    assert set(found.rivals) == {"default", "tuned", "grid_best", "random_best"}
    assert {trial.view for one in found.finalists for trial in one.trials} == {"held out"}
    assert {trial.view for one in found.tried for trial in one.trials} == {"tuned on"}
    finalists = {id(one) for one in found.finalists}
    assert {id(one) for one in found.rivals.values()} <= finalists
    roles = Counter(one.role for one in found.tried)
    assert roles["default"] == 1 and roles["sample"] + roles["random"] == EVALUATIONS
    assert 1 <= roles["surrogate"] <= 2 * 3 and roles["grid"] <= 2
    # The search's own measurements are as many as random search had.
    own = sum(roles[role] for role in ("single", "sample", "surrogate", "neighbour"))
    assert own <= found.evaluations == EVALUATIONS
    assert found.settings == pytest.approx(
        {name: getattr(found.tuned.algorithm, name) for name in found.settings}
    )
    (calibration,) = found.calibrations
    assert calibration.trials == 1 + own
    assert -1 <= found.rank_correlation <= 1
    assert found.front == () and found.sensitivity is None


def test_tuned_settings_are_not_beaten(first):
    """On views other than those tuned on: within the noise of two turns of milliseconds as good as
    the grid and a random search; all three are the least of as many numbers."""
    found, _, _ = first
    for rival in (found.grid_best, found.random_best):
        assert rival is not None and np.isfinite(rival.objective(LIMIT))
        assert found.tuned.objective(LIMIT) <= 1.5 * rival.objective(LIMIT)
    trial = found.tuned.trials[0]
    assert found.tuned.edge_px == trial.edge_px and found.tuned.seconds == trial.total.value


def test_the_search_knows_nothing_of_its_rivals(first, benches):
    """Rationale: it would be compared with what it learned from. Whatever a grid and the rest of a
    random search find, here that the whole grid is perfect, the search tries the same."""
    found, path, _ = first
    search = tuner(benches, Ledger(path))
    own = [one.point for one in found.tried if one.role not in RIVALS]
    rivals = [k for k, one in enumerate(found.tried) if one.role in RIVALS]
    assert rivals and min(rivals) > max(
        k for k, one in enumerate(found.tried) if one.role not in RIVALS
    )
    measured = Tried.measure

    def perfect(self, point, role, algorithm=None):
        before = len(self.all)
        one = measured(self, point, role, algorithm)
        # What was tried before is answered from there.
        if role in RIVALS and len(self.all) > before:
            flawless = {"boundary_displacement_px": {"per_edge_length": 0.0}}
            whole = replace(one.whole, error=one.whole.error | flawless)
            one = replace(one, whole=whole)
            self.all[-1] = one
        return one

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tried, "measure", perfect)
        again = search.run()
    np.testing.assert_array_equal([one.point for one in again.tried if one.role not in RIVALS], own)


def test_a_replay_chooses_the_same(first, benches):
    """From the record nothing is measured, and three times the same settings are chosen."""
    found, path, _ = first
    for _ in range(3):
        ledger = Ledger(path)
        again = tuner(benches, ledger).run()
        assert ledger.added == 0 and again.reused == ledger.taken > len(found.tried)
        assert again.settings == found.settings
        assert again.tuned.objective(LIMIT) == found.tuned.objective(LIMIT)
        assert [one.role for one in again.tried] == [one.role for one in found.tried]


@pytest.mark.parametrize("where", ["settings at random, 5 tried", "held-out view"])
def test_an_interrupted_run_gives_the_best_so_far_and_goes_on(first, benches, tmp_path, where):
    """The best on the views tuned on, marked as such; the next run measures none of it again."""
    path = tmp_path / "m.jsonl"
    path.write_bytes(first[1].read_bytes() if where == "held-out view" else b"")

    def stop(step: str) -> None:
        if step.startswith(where):
            raise KeyboardInterrupt

    stopped = tuner(benches, Ledger(path), progress=stop).run()
    assert stopped.outcome is Outcome.INTERRUPTED and "not measured on others" in stopped.advice
    assert stopped.chosen_on == ("tuned on",) and stopped.held_out == ("held out",)
    least = min(one.rank(LIMIT) for one in stopped.tried if one.role not in RIVALS)
    assert stopped.tuned.rank(LIMIT) == least
    assert stopped.said.shape == (2, len(stopped.tried))
    # What the surrogate says of all is known once all are measured.
    assert np.isnan(stopped.said).all() == (where != "held-out view")
    known = len(Ledger(path))
    ledger = Ledger(path)
    found = tuner(benches, ledger).run()
    assert found.reused >= known
    assert ledger.added + known == len(Ledger(path))


def test_a_deadline_that_is_over_gives_the_best_so_far(first, benches, tmp_path):
    """The samples are measured, nothing after them, and it is said."""
    ledger = Ledger(tmp_path / "m.jsonl")
    found = tuner(benches, ledger, deadline=time.perf_counter() - 1).run()
    assert found.outcome is Outcome.TIME_SPENT and "time" in found.advice
    roles = Counter(one.role for one in found.tried)
    assert set(roles) == {"default", "single", "sample"}
    assert (roles["single"], roles["sample"]) == (SINGLES, SAMPLES)
    assert found.grid_best is None
    assert found.tuned.objective(LIMIT) <= found.default.objective(LIMIT)


def test_a_limit_that_nothing_meets_names_the_nearest(first, benches):
    """No exception: a status, and the numbers of what came nearest, though the time is over too."""
    goal = Goal(seconds=1e-9)
    found = tuner(benches, Ledger(first[1]), goal, deadline=time.perf_counter() - 1).run()
    assert found.outcome is Outcome.NOT_MET
    for words in (f"{found.tuned.edge_px:.3g} px", f"{1e3 * found.tuned.seconds:.3g} ms"):
        assert words in found.advice
    assert goal.words in found.advice
    assert found.tuned.objective(goal) == np.inf
    assert found.tuned.rank(goal) <= found.default.rank(goal)


def test_wrong_use_is_refused(benches):
    on, out = benches
    ground = Rectangle("ground", (0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    view = ViewSpec("bare", (0.0, -4.0, 3.0), (0.0, 0.0, 0.0), width=16, height=16)
    lamp = LightSpec("lamp", "point", position=(0.0, 0.0, 5.0))
    bare = bench_of_shapes([ground], view, lamp, "bare")
    with pytest.raises(UseError, match="'bare' sees no edge of a shadow"):
        tuner((on, bare), Ledger())
    with pytest.raises(UseError, match="too few to tune"):
        tuner(benches, Ledger(), evaluations=EVALUATIONS - 1)
    with pytest.raises(UseError, match="needs a view"):
        Tuner("disc", [on], [], BASE, LIMIT, ledger=Ledger())
