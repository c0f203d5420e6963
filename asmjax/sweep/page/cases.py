"""What trials may be compared on, and which are best there."""

from collections.abc import Sequence
from dataclasses import dataclass

from asmjax.fronts import front
from asmjax.sweep.page.measured import Measured
from asmjax.sweep.page.varied import SEEN, SweptAxis


@dataclass(frozen=True)
class Case:
    """Trials of one scene, view and light, with one size of image and number of samples.

    Attributes:
        words: which, empty where there is no other.
        trials: of it.
        best: those of `trials` than which none is faster and errs as little, the fastest first.
    """

    words: str
    trials: tuple[Measured, ...]
    best: tuple[Measured, ...]

    @property
    def prefix(self) -> str:
        """Of a sentence."""
        return f"{self.words}: " if self.words else ""


def cases_of(done: Sequence[Measured], axes: Sequence[SweptAxis]) -> list[Case]:
    """The trials by what they were measured on."""
    seen = [axis for axis in axes if axis.says(SEEN)]
    found: dict[tuple, list[Measured]] = {}
    for trial in done:
        found.setdefault(tuple(axis.of(trial.settings) for axis in seen), []).append(trial)
    return [_case(trials, seen) for trials in found.values()]


def _case(trials: Sequence[Measured], seen: Sequence[SweptAxis]) -> Case:
    words = ", ".join(filter(None, (axis.words(trials[0].settings) for axis in seen)))
    order = front([trial.seconds for trial in trials], [trial.error for trial in trials])
    return Case(words, tuple(trials), tuple(trials[i] for i in order))
