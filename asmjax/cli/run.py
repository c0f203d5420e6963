"""`asmjax run`: the main job or a walkthrough, with compiled code remembered between calls."""

from asmjax.cli.caches import enable_compilation_cache
from asmjax.machine import keep_freed_memory
from asmjax.options import RunOptions


def run(options: RunOptions) -> None:
    """Measure one view, or with `--frames` a walkthrough; see `asmjax.main_job`."""
    enable_compilation_cache()
    keep_freed_memory()
    if options.frames is None:
        from asmjax.main_job import run_main_job

        run_main_job(options)
    else:
        from asmjax.walkthrough_job import run_walkthrough

        run_walkthrough(options)
