"""`asmjax run`: the main job or a walkthrough."""

from asmjax.options import RunOptions


def run(options: RunOptions) -> None:
    """Measure one view, or with `--frames` a walkthrough; see `asmjax.main_job`."""
    if options.frames is None:
        from asmjax.main_job import run_main_job

        run_main_job(options)
    else:
        from asmjax.walkthrough_job import run_walkthrough

        run_walkthrough(options)
