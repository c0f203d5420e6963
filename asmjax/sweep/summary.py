"""What a sweep came to: its report.json, and a few lines for people."""

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asmjax.report.provenance import provenance
from asmjax.report.record import write_json
from asmjax.sweep.config import Sweep
from asmjax.sweep.driver import SweepResult
from asmjax.sweep.estimate import Estimate
from asmjax.sweep.schema import SWEEP_SCHEMA, check_sweep
from asmjax.sweep.words import in_words

MOST_CAUSES = 5
"""That are printed; all are in the report."""


@dataclass(frozen=True)
class SweepSummary:
    """A run of a sweep.

    Attributes:
        file: the sweep file.
        workers: on this machine; 0 for this process, or where there is a scheduler.
        scheduler: its address or file.
        estimate: of what was to be run.
        seconds: wall time.
    """

    file: str
    sweep: Sweep
    result: SweepResult
    workers: int
    scheduler: str | None
    estimate: Estimate
    seconds: float

    def record(self, argv: Sequence[str]) -> dict[str, Any]:
        """The report, checked; `argv` is the command line, program first."""
        here, result = provenance(""), self.result
        report = {
            "schema": SWEEP_SCHEMA,
            "command": shlex.join(argv),
            "versions": here["versions"],
            "machine": {name: here["machine"][name] for name in ("cpu", "cores", "memory_bytes")},
            "file": self.file,
            "name": self.sweep.name,
            "status": result.status.value,
            "cause": result.cause,
            "trials": len(self.sweep.trials),
            "keys": [trial.key for trial in self.sweep.trials],
            "merged": self.sweep.merged,
            "skipped": list(result.skipped),
            "done": len(result.done),
            "failed": result.failed,
            "left": len(result.left),
            "workers": self.workers,
            "scheduler": self.scheduler,
            "estimated_seconds": self.estimate.seconds,
            "seconds": self.seconds,
        }
        check_sweep(report)
        return report

    def text(self, folder: Path) -> str:
        """What happened, what failed and why, and where the results are."""
        result = self.result
        parts = [
            f"{len(result.done)} run in {in_words(self.seconds)}",
            f"{len(result.skipped)} were finished before",
            f"{len(result.failed)} failed",
            f"{len(result.left)} left",
        ]
        shown = [part for part in parts if not part.startswith("0 ")] or ["none to run"]
        lines = [f"{len(self.sweep.trials)} trials: {', '.join(shown)}", *causes(result.failed)]
        return "\n".join([*lines, f"report and trials: {folder}/"])


def causes(failed: dict[str, str]) -> list[str]:
    """A line for each of the most frequent causes, with the key of a trial that has it."""
    counted = Counter(failed.values()).most_common()
    first = {cause: key for key, cause in reversed(failed.items())}
    lines = [
        f"failed, {count} times: {cause} (such as {first[cause]})"
        for cause, count in counted[:MOST_CAUSES]
    ]
    if len(counted) > MOST_CAUSES:
        lines.append(f"failed for {len(counted) - MOST_CAUSES} other causes: see report.json")
    return lines


def write_summary(summary: SweepSummary, folder: Path, argv: Sequence[str]) -> None:
    """Write report.json, whole or not at all."""
    write_json(folder / "report.json", summary.record(argv))
