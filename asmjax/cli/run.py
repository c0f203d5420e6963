"""`asmjax run`: the main job with compiled code remembered between calls."""

from asmjax.cli.caches import enable_compilation_cache
from asmjax.options import RunOptions


def run(options: RunOptions) -> None:
    """Do the main job; see `asmjax.main_job`."""
    enable_compilation_cache()
    from asmjax.main_job import run_main_job

    run_main_job(options)
