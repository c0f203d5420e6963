"""The options of `asmjax sweep`."""

import dataclasses
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from asmjax.errors import require
from asmjax.options.checks import at_least


@dataclasses.dataclass(frozen=True, kw_only=True)
class SweptOptions:
    """What is swept."""

    config: Annotated[
        str | None, Positional, arg(metavar="CONFIG.toml", help_behavior_hint="(required)")
    ] = None
    """Sweep file (TOML): axes over scenes, views, lights, algorithms and their settings;
    docs/sweeps.md explains it, and experiments/ has some."""

    smoke: bool = False
    """The small size of the sweep, which the file's table [smoke] says, in a folder of its own."""

    count: bool = False
    """Only check the file, count its trials and estimate their time; run none."""

    trust_scene: bool = False
    """Load scene files as they are; docs/scene_files.md says what is refused otherwise."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class WorkerOptions:
    """Where trials run."""

    workers: Annotated[
        int | None, arg(metavar="COUNT", help_behavior_hint="(default: one per usable core)")
    ] = None
    """Processes on this machine, each kept to a core of its own; 0 runs all trials in this process
    with all its cores. Trials beside each other share caches and memory, so that for times that are
    to be published 0 or 1 is best."""

    scheduler: Annotated[
        str | None,
        arg(metavar="ADDRESS", help_behavior_hint="(default: a cluster on this machine)"),
    ] = None
    """Address of a dask scheduler, such as tls://node1:8786, whose workers run the trials;
    docs/cluster.md explains it."""

    scheduler_file: Annotated[
        str | None, arg(metavar="FILE", help_behavior_hint="(default: none)")
    ] = None
    """The file that `dask scheduler --scheduler-file FILE` writes, in place of an address."""

    max_memory_mb: Annotated[
        float | None,
        arg(
            metavar="MB",
            aliases=("--max-memory",),
            help_behavior_hint="(default: a part of 80 % of what is free; with a scheduler, any)",
        ),
    ] = None
    """Main memory that each process may hold in all, in MB (2^20 bytes). A trial that takes more,
    or by an estimate would, is kept as out of memory."""

    wait_minutes: Annotated[float, arg(metavar="MINUTES")] = 10.0
    """How long a sweep waits where no worker is there; then it ends, and what is finished is
    kept."""

    variant: Annotated[
        str | None,
        arg(metavar="NAME", help_behavior_hint="(default: the fastest that works without CUDA)"),
    ] = None
    """Mitsuba variant of all trials: llvm_ad_rgb, cuda_ad_rgb, or scalar_rgb."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StoreOptions:
    """Where results are kept."""

    out: Annotated[
        str | None, arg(metavar="DIR", help_behavior_hint="(default: out/sweep-<name>)")
    ] = None
    """Folder of the results. A trial that is finished there is not run again."""

    retry: bool = False
    """Run those trials again that failed before; otherwise their causes stand as they are."""

    quiet: bool = False
    """No progress and no summary; warnings and errors still appear."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SweepOptions(SweptOptions, WorkerOptions, StoreOptions):
    """Options of `asmjax sweep`.

    Raises:
        UseError: no sweep file is named, a number outside its range, or options that exclude each
            other.
    """

    command: ClassVar[str] = "sweep"

    def __post_init__(self):
        require(
            self.config is not None,
            "name a sweep file: asmjax sweep CONFIG.toml; docs/sweeps.md explains what it may say.",
        )
        if self.workers is not None:
            at_least(0, "--workers", self.workers, "")
        if self.max_memory_mb is not None:
            at_least(1, "--max-memory", self.max_memory_mb, "MB")
        at_least(0, "--wait-minutes", self.wait_minutes, "")
        named = [
            option
            for option, value in (
                ("--scheduler", self.scheduler),
                ("--scheduler-file", self.scheduler_file),
                ("--workers", self.workers),
            )
            if value is not None
        ]
        require(
            len(named) <= 1,
            f"{' and '.join(named)} both say where trials run; give one of them.",
        )
