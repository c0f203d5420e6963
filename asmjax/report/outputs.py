"""The folder of a run: which files are its own, what is there before, and how all is written.

A folder holds one run. Its report.json lists the other files (`files`), and is written before them:
what it does not list is somebody else's, and is neither deleted nor overwritten. A run that is
killed at any point therefore leaves nothing that its next start would take for somebody else's.
"""

import contextlib
import fnmatch
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from asmjax.errors import require
from asmjax.report.record import write_json
from asmjax.writing import WriteError, Writer, write_file, written

REPORT = "report.json"

PAGE = "report.html"
"""The page of a folder, by `asmjax report`."""

MEASUREMENTS = "measurements.jsonl"
"""Finished measurements, which outlive a run."""

SWEEP_STORE = ("sweep.sqlite", "sweep.sqlite-*", "sweep.lock")
"""The trials of a sweep, which outlive a run."""

SINGLE_RUN = (
    "methods.csv",
    "arrays.npz",
    "shadows.png",
    "errors.png",
    "maps.png",
    "tree.png",
    "levels.png",
    "accuracy_time.png",
    "seen_*.png",
    "wrong_*.png",
)
"""What a run of one view writes, beside report.json."""

WALKTHROUGH = (
    "frames.csv",
    "frame_[0-9][0-9][0-9][0-9]*.npz",
    "walkthrough.png",
    "frames.png",
    "walkthrough.gif",
)
"""What a walkthrough writes, beside report.json."""

ANALYSIS = (
    "methods.csv",
    "arrays.npz",
    "aliasing.png",
    "light_angles.png",
    "displacement.png",
)
"""What `asmjax analyze` writes, beside report.json."""

COMPARISON = ("trials.csv", "costs_[0-9]*.png")
"""What `asmjax compare` writes, beside report.json and the measurements."""

TUNING = ("tuned.toml", "tried.csv", "tried.png", "surrogate.png", "sensitivity.png")
"""What `asmjax tune` writes, beside report.json and the measurements."""

PLAN = ("plan.png",)
"""What `asmjax plan` writes, beside report.json."""

KINDS: Mapping[str, tuple[str, ...]] = {
    "run": SINGLE_RUN,
    "walkthrough": WALKTHROUGH,
    "aliasing": ANALYSIS,
    "comparison": COMPARISON,
    "tuning": TUNING,
    "plan": PLAN,
    "sweep": (),
}
"""Patterns of the files of each kind of report, by the name in its schema."""

_KEPT = (MEASUREMENTS, *SWEEP_STORE)

_PAGE_BEGINS = b"<title>Shadow-map accuracy: "
"""Stands among the first bytes of every page."""

_MOST_BYTES = 256 * 2**20
"""Of a report.json that is read."""


class Outputs:
    """The folder of a run that is about to begin.

    Args:
        path: need not exist.
        kind: of the run, one of `KINDS`.
        source: absolute path of the scene file; None for a built-in scene.

    Attributes:
        path: as given.
        report: as written last.

    Raises:
        UseError: the folder holds files of somebody else and no report, or a file that the run
            would overwrite, or a sweep.
    """

    def __init__(self, path: str | os.PathLike, kind: str, source: str | None = None):
        self.path, self.report = Path(path), {}
        self._kind, self._source = kind, source
        self._listed: set[str] | None = None
        self._problems: list[WriteError] = []
        self._check()

    def __str__(self) -> str:
        return str(self.path)

    def _check(self) -> None:
        remedy = "choose another --out"
        present = _files(self.path)
        earlier = read_report(self.path)
        if earlier is None:
            page = own_page(self.path)
            foreign = [n for n in present if not _matches(n, _KEPT) and n not in page]
            require(
                not foreign,
                f"'{self.path}' holds files that asmjax did not write ({_some(foreign)}), which "
                f"results are not mixed with; {remedy}, or an empty folder.",
            )
        if self._kind != "sweep":
            store = [name for name in present if _matches(name, SWEEP_STORE)]
            require(not store, f"'{self.path}' holds a sweep ({_some(store)}); {remedy}.")
        own = _listed(self.path, earlier)
        taken = [name for name in present if _matches(name, KINDS[self._kind]) and name not in own]
        require(
            not taken,
            f"'{self.path}' holds files of names that results have, but that its {REPORT} does not "
            f"list ({_some(taken)}); move them away, or {remedy}.",
        )

    def spare(self, needed: str | os.PathLike | None) -> None:
        """Raise `UseError` if the run needs a file that it would delete."""
        if needed is None:
            return
        # However it is spelled: by way of `..`, of a link to the folder, or as a link to the file.
        folder, path = self.path.resolve(), Path(needed)
        ways = (path.parent.resolve() / path.name, path.resolve())
        own = {way.name for way in ways if way.parent == folder}
        require(
            own.isdisjoint(_listed(self.path, read_report(self.path)) if own else ()),
            f"'{needed}' belongs to the run in '{self.path}', which this one replaces; copy it to "
            "another folder, or choose another --out.",
        )

    def make(self) -> None:
        """Make the folder. Raises `WriteError` where that is not possible."""
        with written(self.path):
            self.path.mkdir(parents=True, exist_ok=True)

    def forget(self) -> None:
        """Delete what the report before this run lists, and its page."""
        for name in self._before():
            (self.path / name).unlink(missing_ok=True)

    def keep(self, report: Mapping[str, Any], names: Iterable[str] = ()) -> None:
        """Write report.json, then delete the files of the report before it that are not in `names`:
        those that this one will have.

        Raises:
            WriteError: it cannot be written; the run before it is still there.
        """
        names = sorted(names)
        for name in names:
            assert _matches(name, KINDS[self._kind]), f"{name} is missing in KINDS"
        before = self._before() if self._listed is None else self._listed
        where = {} if self._source is None else {"scene_file": self._source}
        self.report = {**report, **where, "files": names}
        write_json(self.path / REPORT, self.report)
        self._listed = set(names)
        for name in before - self._listed:
            (self.path / name).unlink(missing_ok=True)

    def add(self, files: Mapping[str, Writer]) -> None:
        """List files in report.json, then write them; `finish` tells which could not be written.

        Raises:
            WriteError: as `keep`.
        """
        assert self._listed is not None, "the report comes first"
        if not self._listed.issuperset(files):
            self.keep(self.report, self._listed.union(files))
        for name, write in files.items():
            try:
                write_file(self.path / name, write)
            except WriteError as problem:
                self._problems.append(problem)

    def _before(self) -> set[str]:
        return _listed(self.path, read_report(self.path)) | own_page(self.path)

    def finish(self) -> None:
        """Raise `WriteError` if files could not be written; all others are there."""
        if not self._problems:
            return
        first, more = self._problems[0], len(self._problems) - 1
        others = f" {more} more could not be written." if more else ""
        raise WriteError(
            f"{first}{others} {REPORT} and whatever else could be written is in '{self.path}'."
        ) from first


def read_report(folder: Path) -> dict[str, Any] | None:
    """The report of a command in `folder`, unchecked but for its schema's name; None where there is
    none, or something else."""
    path = folder / REPORT
    try:
        if path.stat().st_size > _MOST_BYTES:
            return None
        report = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return report if _kind_of(report) in KINDS else None


def _kind_of(report: Any) -> str | None:
    schema = report.get("schema") if isinstance(report, dict) else None
    parts = schema.split("/") if isinstance(schema, str) else []
    return parts[1] if len(parts) == 3 and parts[0] == "asmjax" else None


def _listed(folder: Path, report: Mapping[str, Any] | None) -> set[str]:
    """The files in `folder` that its report lists and that some command may have written: whoever
    sent the report decides about no other."""
    if report is None:
        return set()
    patterns = [pattern for patterns in KINDS.values() for pattern in patterns]
    named = report.get("files")
    if not isinstance(named, list):
        # Of a version that did not list them.
        patterns = KINDS[str(_kind_of(report))]
        named = _files(folder)
    return {name for name in _files(folder) if name in named and _matches(name, patterns)}


def own_page(folder: Path) -> set[str]:
    """The name of a folder's page, if asmjax made it."""
    with contextlib.suppress(OSError), (folder / PAGE).open("rb") as file:
        if _PAGE_BEGINS in file.read(4096):
            return {PAGE}
    return set()


def _files(folder: Path) -> list[str]:
    """Names of what stands in a folder but for folders and hidden files."""
    try:
        with os.scandir(folder) as entries:
            return sorted(
                entry.name
                for entry in entries
                if not entry.name.startswith(".") and not entry.is_dir()
            )
    except OSError:
        return []


def _matches(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def _some(names: list[str]) -> str:
    """The first names of a list, for a message."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{', '.join(names[:3])}{more}"
