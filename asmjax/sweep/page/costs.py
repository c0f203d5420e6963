"""The charts of error against each cost: all trials of a sweep, and those of each case."""

import math
from collections.abc import Callable, Collection, Sequence

from asmjax.report.figures.families import FAMILY_LOOKS, look_of
from asmjax.report.page.chart import Chart, Point, charts
from asmjax.report.page.markup import Markup
from asmjax.report.page.words import EDGE, megabytes, milliseconds
from asmjax.report.table import MB, significant
from asmjax.sweep.page.cases import Case
from asmjax.sweep.page.measured import Measured
from asmjax.sweep.page.varied import SEEN, SweptAxis

MOST_POINTS = 2000
"""Of a chart: of more trials some are left out."""

_MOST_GROUPS = 8
"""Values of an axis that may have a colour each."""

_MOST_CASES = 6
"""That have a chart each."""

_TIME = "time from nothing, milliseconds"

Cost = Callable[[Measured], tuple[float, float, float]]
"""What a trial costs, and its interval."""


class _Colours:
    """Which trials have the same colour: those with one value of an axis, as of the algorithm."""

    def __init__(self, done: Sequence[Measured], axes: Sequence[SweptAxis]):
        by_family = [axis for axis in axes if axis.names == ("algorithm",)]
        few = [axis for axis in axes if len(axis.values) <= _MOST_GROUPS]
        self.by = next(iter([*by_family, *few]), None)
        looks = list(FAMILY_LOOKS.values())
        groups = dict.fromkeys(self.group(trial) for trial in done)
        self.looks = {
            group: look_of(group) if by_family else looks[k % len(looks)]
            for k, group in enumerate(sorted(groups, key=self._place))
        }

    def group(self, trial: Measured) -> str:
        """The entry of the legend."""
        return (self.by and self.by.words(trial.settings)) or "others"

    def _place(self, group: str) -> int:
        """Groups in the order of their axis."""
        values = [] if self.by is None else self.by.value_words
        return values.index(group) if group in values else len(values)


class CostCharts:
    """What the charts of a sweep share: all trials, and what is said of each.

    Args:
        known: keys of trials that were finished before the last run.
    """

    def __init__(self, cases: Sequence[Case], axes: Sequence[SweptAxis], known: Collection[str]):
        self._cases, self._axes, self._known = cases, axes, known
        self._done = [trial for case in cases for trial in case.trials]

    def of_all(self) -> Markup:
        """All trials: error against time, time in rays, and memory."""
        best = self._cases[0].best if len(self._cases) == 1 else ()
        colours = _Colours(self._done, self._axes)
        across = "time in shadow rays: times that of one for each sample"
        return charts(
            [
                self._chart("time", _TIME, _milliseconds, colours, self._done, best),
                self._chart("time in rays", across, _rays, colours, self._done),
                self._chart("memory", "memory, MB", _megabytes, colours, self._done),
            ]
        )

    def of_cases(self) -> Markup | None:
        """A chart with its front for each case; None where there is one, or too many for that."""
        if not 1 < len(self._cases) <= _MOST_CASES:
            return None
        colours = _Colours(self._done, [axis for axis in self._axes if not axis.says(SEEN)])
        return charts(
            [
                self._chart(case.words, _TIME, _milliseconds, colours, case.trials, case.best)
                for case in self._cases
            ]
        )

    def _chart(
        self,
        title: str,
        across: str,
        cost: Cost,
        colours: _Colours,
        trials: Sequence[Measured],
        best: Sequence[Measured] = (),
    ) -> Chart:
        numbers = {trial.row.key: k for k, trial in enumerate(best, start=1)}
        others = [trial for trial in trials if trial.row.key not in numbers]
        step = max(1, math.ceil(len(others) / MOST_POINTS))
        points = [
            self._point(trial, cost, colours.group(trial), numbers.get(trial.row.key))
            for trial in (*best, *others[::step])
        ]
        note = self._note(colours.by, bool(best), step)
        return Chart(title, across, EDGE, points, colours.looks, note=note)

    @staticmethod
    def _note(by: SweptAxis | None, numbered: bool, step: int) -> str:
        said = [] if by is None else [f"A colour for each value of {by.title}."]
        if numbered:
            said.append(
                "Grey staircase: nothing that was measured is faster and as accurate; its trials "
                "are numbered as in the table of the best."
            )
        said.append("Open markers on the line of 0: no wrong pixel. Bars: range of the runs.")
        if step > 1:
            said.append(f"Of the trials that are not numbered one in {step} is drawn.")
        return " ".join(said)

    def _point(self, trial: Measured, cost: Cost, group: str, number: int | None) -> Point:
        x, low, high = cost(trial)
        said = [
            f"{axis.title}: {words}"
            for axis in self._axes
            if (words := axis.words(trial.settings)) is not None
        ]
        ratio = "" if trial.ratio is None else f", {significant(trial.ratio)} times the rays"
        before = ", finished before the last run" if trial.row.key in self._known else ""
        return Point(
            group=group,
            name=trial.name,
            x=x,
            y=trial.error,
            low=low,
            high=high,
            facts=(
                *said,
                f"{significant(trial.error)} {EDGE}",
                f"{milliseconds(trial.seconds)}{ratio}",
                megabytes(trial.bytes),
                f"trial {trial.row.key[:8]}{before}",
            ),
            number=number,
        )


def _milliseconds(trial: Measured) -> tuple[float, float, float]:
    return 1e3 * trial.seconds, 1e3 * trial.low, 1e3 * trial.high


def _rays(trial: Measured) -> tuple[float, float, float]:
    # A chart leaves out what costs nothing, and with it what has no yardstick.
    ratio = trial.ratio or 0.0
    return ratio, ratio, ratio


def _megabytes(trial: Measured) -> tuple[float, float, float]:
    size = trial.bytes / MB
    return size, size, size
