"""What options may say: ranges of numbers, and which exclude each other."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, get_args

from asmjax.errors import require, unknown_name
from asmjax.options.groups import (
    EffectOptions,
    Force,
    MachineOptions,
    Motion,
    PatienceOptions,
)

if TYPE_CHECKING:
    from asmjax.options.commands import AnalyzeOptions, MapJobOptions, RunOptions

LARGEST = 2**53
"""Of numbers that are counts or amounts: up to here a float holds every whole one."""


def force_of(words: Sequence[str]) -> dict[str, str]:
    """The words of --force by light: "soft" is of all ("*"), "lamp=soft" of one.

    Raises:
        UseError: a word that is none of `Force`, or two for the same.
    """
    force: dict[str, str] = {}
    for word in words:
        light, _, kind = word.rpartition("=")
        if kind not in get_args(Force):
            raise unknown_name("effect to force", kind, get_args(Force))
        require(
            (light or "*") not in force,
            f"--force says two things of {f'light {light!r}' if light else 'all lights'}: "
            f"{force.get(light or '*')} and {kind}; leave one of them out.",
        )
        force[light or "*"] = kind
    return force


def check_effects(options: EffectOptions) -> None:
    at_least(0, "--tolerance", options.tolerance, "")
    force_of(options.force)


def check_measured(options: "RunOptions | AnalyzeOptions") -> None:
    """What commands that measure one view ask of their numbers."""
    check_limits(options)
    at_least(1, "--samples", options.samples, "ray per pixel")


def check_limits(options: "MapJobOptions") -> None:
    """What all commands that measure a scene ask of their numbers."""
    if options.memory_mb is not None:
        at_least(1e-6, "--memory-mb", options.memory_mb, "MB")
    if options.time_limit_ms is not None:
        at_least(1e-3, "--time-limit-ms", options.time_limit_ms, "milliseconds")
    if options.node_resolution is not None:
        at_least(1, "--node-resolution", options.node_resolution, "texels")
    if options.cells is not None:
        at_least(1, "--cells", options.cells, "cell per side")
    at_least(1, "--repeats", options.repeats, "timed run")
    at_least(0, "--seed", options.seed, "")
    check_machine(options)


def check_machine(options: MachineOptions) -> None:
    if options.max_memory_mb is not None:
        at_least(1, "--max-memory", options.max_memory_mb, "MB")


def check_walk(options: "RunOptions") -> None:
    if options.motion not in get_args(Motion):
        raise unknown_name("--motion", options.motion, get_args(Motion))
    if options.frames is None:
        for option, given in (
            (f"--motion {options.motion}", options.motion != "camera"),
            ("--keys", bool(options.keys)),
            ("--object", options.object is not None),
        ):
            require(not given, f"{option} is for walkthroughs; say how many --frames to walk.")
        return
    at_least(1, "--frames", options.frames, "frame")
    require(
        not options.force,
        "--force chooses what is simulated, but walkthroughs have hard shadows only; leave out "
        "--force, or --frames.",
    )
    require(
        options.object is None or options.motion == "object",
        f"--object names what moves, but --motion is {options.motion}; add --motion object.",
    )
    if not options.keys:
        return
    require(
        options.motion == "camera",
        f"--keys are the camera's, but --motion is {options.motion}; leave one of them out.",
    )
    require(len(options.keys) > 1, "--keys needs two views or more to walk between; name another.")
    require(
        options.view is None and options.sensor is None,
        "--keys and --view or --sensor both say where the camera is; give one of them.",
    )


def check_patience(options: PatienceOptions) -> None:
    if options.minutes is not None:
        at_least(1e-3, "--minutes", options.minutes, "minutes")


def above(least: float, option: str, got: float | None) -> None:
    require(
        got is not None and math.isfinite(got) and got > least,
        f"{option} is {got}; allowed: a finite number above {least:g}; choose another {option}",
    )


def at_least(least: float, option: str, got: float, unit: str) -> None:
    unit = f" {unit}" if unit else ""
    # Compared, not converted: a whole number may have more digits than any float.
    require(
        least <= got <= LARGEST,
        f"{option} is {str(got)[:40]}; allowed: a finite number, at least {least:g}{unit}, and at "
        f"most 2^53; choose another {option}",
    )
