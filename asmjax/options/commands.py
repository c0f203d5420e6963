"""The options of each command: a class that inherits the groups it needs."""

import dataclasses
from typing import ClassVar

from asmjax.errors import require
from asmjax.options.checks import (
    above,
    at_least,
    check_effects,
    check_limits,
    check_machine,
    check_measured,
    check_patience,
    check_walk,
)
from asmjax.options.groups import (
    ComparisonOptions,
    EffectOptions,
    FolderOptions,
    GoalOptions,
    LimitOptions,
    MachineOptions,
    MapOptions,
    MeasureOptions,
    MethodOptions,
    OutputOptions,
    PageOptions,
    PatienceOptions,
    PlanningOptions,
    RepeatOptions,
    SceneOptions,
    SearchOptions,
    TrialOptions,
    TunedMapOptions,
    ViewOptions,
    WalkOptions,
)
from asmjax.options.search import LEAST_EVALUATIONS


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunOptions(
    SceneOptions,
    WalkOptions,
    EffectOptions,
    LimitOptions,
    MapOptions,
    MeasureOptions,
    MachineOptions,
    OutputOptions,
):
    """Options of `asmjax run`.

    Raises:
        UseError: a number outside its range. Names, files and sizes are checked by those who
            look them up.
    """

    command: ClassVar[str] = "run"
    """The command's name, with which the default folder of its results begins."""

    def __post_init__(self):
        check_effects(self)
        check_measured(self)
        check_walk(self)


@dataclasses.dataclass(frozen=True, kw_only=True)
class AnalyzeOptions(
    SceneOptions,
    ComparisonOptions,
    LimitOptions,
    MapOptions,
    MeasureOptions,
    MachineOptions,
    OutputOptions,
):
    """Options of `asmjax analyze`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "analyze"

    def __post_init__(self):
        check_measured(self)
        at_least(0, "--angles", self.angles, "directions")


@dataclasses.dataclass(frozen=True, kw_only=True)
class CompareOptions(
    SceneOptions,
    TrialOptions,
    PatienceOptions,
    MethodOptions,
    LimitOptions,
    MapOptions,
    RepeatOptions,
    MachineOptions,
    FolderOptions,
):
    """Options of `asmjax compare`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "compare"

    def __post_init__(self):
        check_limits(self)
        require(len(self.samples) > 0, "--samples names no number of samples; give 1 or more.")
        for samples in self.samples:
            at_least(1, "--samples", samples, "sample per pixel")
        check_patience(self)
        require(
            not self.views or (self.view is None and self.sensor is None),
            "--views and --view or --sensor both say what is looked at; give one of them.",
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class TuneOptions(
    SceneOptions,
    GoalOptions,
    SearchOptions,
    PatienceOptions,
    TunedMapOptions,
    MachineOptions,
    FolderOptions,
):
    """Options of `asmjax tune`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "tune"

    def __post_init__(self):
        goals = {"--price": self.price, "--within-ms": self.within_ms, "--error": self.error}
        given = [name for name, value in goals.items() if value is not None]
        require(
            len(given) <= 1,
            f"{' and '.join(given)} are different goals; give one of them.",
        )
        for name in given:
            above(0, name, goals[name])
        check_patience(self)
        if self.memory_mb is not None:
            at_least(1e-6, "--memory-mb", self.memory_mb, "MB")
        at_least(LEAST_EVALUATIONS, "--evaluations", self.evaluations, "settings")
        at_least(1, "--repeats", self.repeats, "timed run")
        at_least(0, "--seed", self.seed, "")
        check_machine(self)
        require(
            bool(self.views) == bool(self.held_out),
            "--views says what is tuned on, --held-out what chooses; give both, or neither.",
        )
        both = [name for name in self.views if name in self.held_out]
        require(
            not both,
            f"view '{' and '.join(both)}' is named by --views and by --held-out; views that choose "
            "must not be tuned on: leave it out of one.",
        )
        require(
            not self.views or (self.view is None and self.sensor is None),
            "--views and --view or --sensor both say what is looked at; give one of them.",
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlanOptions(ViewOptions, PlanningOptions, EffectOptions, MachineOptions, FolderOptions):
    """Options of `asmjax plan`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "plan"

    def __post_init__(self):
        check_effects(self)
        at_least(0, "--seed", self.seed, "")
        check_machine(self)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReportOptions(PageOptions):
    """Options of `asmjax report`.

    Raises:
        UseError: no folder is named.
    """

    def __post_init__(self):
        require(
            bool(self.folders),
            "no folder is named; name one or more that asmjax run, analyze, compare, tune, plan or "
            "sweep wrote.",
        )


MapJobOptions = RunOptions | AnalyzeOptions | CompareOptions
"""Options of the commands that measure maps with settings that are given."""

JobOptions = MapJobOptions | TuneOptions
"""Options of the commands that measure a scene."""

ViewJobOptions = JobOptions | PlanOptions
"""Options of the commands that look at a scene."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ScenesOptions:
    """Output."""

    json: bool = False
    """Print JSON instead of text."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class InfoOptions:
    """Output."""

    json: bool = False
    """Print JSON instead of text."""
