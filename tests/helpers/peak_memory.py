"""The main memory that a job takes at its peak, beside the estimate of it; run as a program.

`python -m helpers.peak_memory run '{"scene": "paper_room", "size": [1024, 1024]}'` prints both in
bytes. What the process holds after a small job of the same kind does not count: programs, compiled
code, caches.
"""

import gc
import json
import resource
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from asmjax.cli import prepare_to_measure
from asmjax.experiment.ledger import Ledger
from asmjax.machine import process_bytes
from asmjax.memory import Forecast
from asmjax.options import AnalyzeOptions, CompareOptions, RunOptions
from asmjax.report.outputs import Outputs

SMALL = {"size": (96, 96), "memory_mb": 1.0, "settings": None}
"""Of the job that comes first."""


def run(options: RunOptions) -> Forecast | None:
    """`asmjax run`, files included."""
    from asmjax.main_job import measure_scene
    from asmjax.report.run_files import report_of, write_results

    result = measure_scene(options)
    with tempfile.TemporaryDirectory() as folder:
        outputs, report = Outputs(folder, "run"), report_of(result, 0)
        write_results(result, report, outputs, save_arrays=options.save_arrays)
    return result.memory


def walk(options: RunOptions) -> Forecast | None:
    """A walkthrough, files included."""
    from asmjax.report.walk_files import WalkFiles
    from asmjax.walkthrough_job import Walk

    walk = Walk(options)
    with tempfile.TemporaryDirectory() as folder:
        outputs = Outputs(folder, "walkthrough")
        files = WalkFiles(walk.setting, outputs, save_arrays=options.save_arrays)
        for result in walk.frames():
            files.add(result)
        files.finish(files.record.report())
    return walk.setting.memory


def analyze(options: AnalyzeOptions) -> Forecast | None:
    """`asmjax analyze`, files included."""
    from asmjax.analyze_job import analyse_scene
    from asmjax.report.analyze_files import write_analysis
    from asmjax.report.analyze_record import report_of_analysis

    result = analyse_scene(options)
    with tempfile.TemporaryDirectory() as folder:
        outputs, report = Outputs(folder, "aliasing"), report_of_analysis(result, 0)
        write_analysis(result, report, outputs, save_arrays=options.save_arrays)
    return result.memory


def compare(options: CompareOptions) -> Forecast | None:
    """`asmjax compare` without its files."""
    from tqdm import tqdm

    from asmjax.compare_job import Comparing

    return Comparing(options).measured(Ledger(), tqdm(disable=True)).memory


JOBS: dict[str, tuple[type, Callable[[Any], Forecast | None]]] = {
    "run": (RunOptions, run),
    "walk": (RunOptions, walk),
    "analyze": (AnalyzeOptions, analyze),
    "compare": (CompareOptions, compare),
}


def main(command: str, words: str) -> None:
    """Measure one job, and print what was estimated and what was measured."""
    prepare_to_measure()
    options, job = JOBS[command]
    wanted = options(**json.loads(words), repeats=1, quiet=True)
    job(replace(wanted, **SMALL))
    gc.collect()
    before = process_bytes()
    forget_peak()
    forecast = job(wanted)
    assert forecast is not None
    told = {"estimate": forecast.peak.bytes, "measured": peak_bytes() - before}
    print(json.dumps(told))


def forget_peak() -> None:
    """Let the peak be counted anew, from what is held now."""
    Path("/proc/self/clear_refs").write_text("5")


def peak_bytes() -> int:
    """The most that was held since."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) << 10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10


if __name__ == "__main__":
    main(*sys.argv[1:])
