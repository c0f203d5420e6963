"""The `asmjax` command: a table of subcommands, and one way to end for each kind of trouble.

Exit codes: 0 success; 2 wrong use or bad input, told in one line on stderr; 130 interrupted.
Anything else that goes wrong is a bug and keeps its traceback. A command's code is imported when
it runs, so `asmjax --help` loads neither JAX nor Mitsuba.
"""

import dataclasses
import importlib
import logging
import os
import sys

from asmjax.cli.flags import FlagFormatter, in_flags
from asmjax.errors import UseError
from asmjax.interruption import interruption_waits


@dataclasses.dataclass(frozen=True)
class Command:
    """One subcommand: `options` and `action` are "module:name", imported when needed.

    `action` takes the options object; what it returns is ignored. Of a command that `measures`,
    compiled code is remembered between calls.
    """

    summary: str
    options: str
    action: str
    measures: bool = False


COMMANDS = {
    "run": Command(
        "The main job: adaptive and uniform shadow maps of the same memory against ray-traced "
        "truth; maps of footprints, figures, a table and report.json.",
        "asmjax.options:RunOptions",
        "asmjax.cli.run:run",
        measures=True,
    ),
    "analyze": Command(
        "Perspective aliasing of all shadow algorithms at equal memory: maps and numbers of texel "
        "beside pixel width, over light directions beside the theory, predicted and measured "
        "displacement of shadow edges.",
        "asmjax.options:AnalyzeOptions",
        "asmjax.analyze_job:run_analysis",
        measures=True,
    ),
    "compare": Command(
        "What accuracy costs: every shadow algorithm over its range of settings, error against "
        "time and memory beside traced rays, and what each needs for a given error.",
        "asmjax.options:CompareOptions",
        "asmjax.compare_job:run_comparison",
        measures=True,
    ),
    "tune": Command(
        "Settings of the adaptive map for a price of time or within a limit: found on some views, "
        "chosen by measurement on others, beside the best of a grid and of a random search.",
        "asmjax.options:TuneOptions",
        "asmjax.tune_job:run_tuning",
        measures=True,
    ),
    "plan": Command(
        "Which shadow effects a scene calls for: hard, filtered or soft for each light, what is "
        "skipped and why, and what is not simulated, with the numbers that decided.",
        "asmjax.options:PlanOptions",
        "asmjax.plan_job:run_plan",
        measures=True,
    ),
    "report": Command(
        "One HTML page of what the commands above wrote: summary in words, charts, pictures to "
        "slide over each other, tables and provenance, in one file that needs no network.",
        "asmjax.options:ReportOptions",
        "asmjax.report_job:run_report",
    ),
    "sweep": Command(
        "A parameter sweep from a TOML file: axes over scenes, views, lights, algorithms and "
        "settings, on this machine or a cluster; what is finished is never run again.",
        "asmjax.options:SweepOptions",
        "asmjax.sweep_job:run_sweep_job",
        measures=True,
    ),
    "scenes": Command(
        "The built-in scenes, with their views and lights.",
        "asmjax.options:ScenesOptions",
        "asmjax.cli.scenes:print_scenes",
    ),
    "info": Command(
        "Versions, renderer variant, LLVM and how to repair it, devices, caches.",
        "asmjax.options:InfoOptions",
        "asmjax.cli.info:print_info",
    ),
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command line `arguments` (without the program name) and return the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    told = logging.StreamHandler()
    words = FlagFormatter("%(name)s: %(levelname)s: %(message)s")
    told.setFormatter(words)
    logging.basicConfig(handlers=[told], level=logging.WARNING)
    try:
        with interruption_waits():
            action, options = prepared(arguments)
        words.command = type(options)
        action(options)
        sys.stdout.flush()
    except UseError as problem:
        print(
            f"asmjax: error: {in_flags(' '.join(str(problem).split()), words.command)}",
            file=sys.stderr,
        )
        return 2
    except KeyboardInterrupt as stop:
        # A command that could save something says what and where.
        saved = f"; {stop}" if str(stop) else ""
        print(f"asmjax: interrupted{saved}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader left, as `| head` does; Python would complain again when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return 0


def prepared(arguments: list[str]):
    """What a command line asks to be called, with which options; all that it needs is loaded."""
    from asmjax.cli.parse import parse

    name, options = parse(arguments, COMMANDS)
    if COMMANDS[name].measures:
        prepare_to_measure()
    return load(COMMANDS[name].action), options


def prepare_to_measure() -> None:
    """Keep compiled code between calls, and freed memory within this one; seldom pause."""
    from asmjax.cli.caches import enable_compilation_cache
    from asmjax.machine import collect_rarely, keep_freed_memory

    enable_compilation_cache()
    keep_freed_memory()
    collect_rarely()


def load(reference: str):
    """The object that "module:name" refers to."""
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)
