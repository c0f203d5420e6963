"""A record that grows step by step: written after each, so that nothing done is ever lost."""

import gc
import logging
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure
from tqdm import tqdm

from asmjax.experiment.bounds import Bound
from asmjax.plain import NonFinite, plain
from asmjax.report.figures import save
from asmjax.report.record import write_json
from asmjax.writing import text_writer, write_file

ANALYSIS_SCHEMA = "asmjax/analysis/1"

_log = logging.getLogger("asmjax")


class StepwiseRecord:
    """The record of a long analysis, and the folder with its report.json, report.md and figures.

    Args:
        folder: made here.
        title: of the document.
        settings: what the analysis runs with, as plain values.
        bounds: reads the requirements off the record, complete or not.
        document: the record as Markdown.
        quiet: no progress bars.

    Attributes:
        record: what is known so far; steps add to it.
    """

    def __init__(
        self,
        folder: Path,
        title: str,
        settings: Mapping,
        bounds: Callable[[Mapping], Sequence[Bound]],
        document: Callable[[Mapping], str],
        quiet: bool = False,
    ):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self._quiet = folder, quiet
        self._bounds, self._document = bounds, document
        self.record: dict = {
            "schema": ANALYSIS_SCHEMA,
            "title": title,
            "command": shlex.join(["python", *sys.argv]),
            "settings": dict(settings),
            "steps": {},
            "figures": {},
        }

    def write(self) -> None:
        """Write the record with the bounds that it decides, and the document made of it."""
        self.record["bounds"] = [bound.record() for bound in self._bounds(self.record)]
        record = plain(self.record, NonFinite.KEPT)
        assert isinstance(record, dict)
        write_json(self.folder / "report.json", record)
        words = text_writer(lambda: self._document(self.record))
        write_file(self.folder / "report.md", words)

    def figure(self, name: str, drawn: Figure, words: str) -> None:
        """Save a figure as `name`.png; `words` stand for it where it is not seen."""
        save(drawn, self.folder / f"{name}.png")
        self.record["figures"][name] = words

    def bar(self, items: Iterable, words: str, total: int | None = None) -> tqdm:
        """`items` with a progress bar that leaves no trace."""
        return tqdm(items, desc=words, total=total, leave=False, disable=self._quiet or None)

    def run(self, steps: Mapping[str, Callable[[], None]]) -> None:
        """Run all steps in order, and write the record after each.

        One that fails is noted, and the next one goes on; an interruption is noted and raised.
        """
        for name, step in self.bar(steps.items(), "steps"):
            start, status, reason = time.perf_counter(), "interrupted", ""
            try:
                step()
                status = "done"
            # Whatever fails: the other steps' numbers must not be lost with this one.
            except Exception as problem:
                status, reason = "failed", f"{type(problem).__name__}: {problem}".split("\n")[0]
                _log.exception("step '%s' failed; going on with the next one.", name)
            finally:
                self.record["steps"][name] = {
                    "status": status,
                    "seconds": time.perf_counter() - start,
                    "reason": reason,
                }
                self.write()
            gc.collect()


def failed_steps(record: Mapping) -> dict[str, str]:
    """Why, by step, of the steps of a record that failed."""
    steps = record["steps"].items()
    return {name: step["reason"] for name, step in steps if step["status"] == "failed"}


def exit_code(record: Mapping) -> int:
    """For a script that ends with this record: 1 if a step failed. What the others found is written
    all the same, and whether bounds are met is theirs to say."""
    return int(bool(failed_steps(record)))


def head_of(record: Mapping) -> list[str]:
    """Title, command, what is missing, and bounds of a written record: the lines that a document
    begins with."""
    lines = [f"# {record['title']}", "", f"`{record['command']}`", ""]
    missing = [f"* **step '{name}' failed**: {why}" for name, why in failed_steps(record).items()]
    left = record.get("left_out", ())
    left = [f"{step}: {why}" for step, why in left.items()] if isinstance(left, Mapping) else left
    missing += [f"* left out: {what}" for what in left]
    lines += [*missing, ""] if missing else []
    lines += ["## Bounds", ""]
    lines += ["| requirement | measured | bound | |", "| --- | ---: | ---: | --- |"]
    for bound in record["bounds"]:
        measured = "-" if bound["measured"] is None else f"{bound['measured']:.3g}"
        lines.append(
            f"| {bound['name']}: {bound['what']} | {measured} | {bound['limit']:.3g} | "
            f"{bound['verdict']} |"
        )
    return lines
