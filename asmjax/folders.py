"""Where results go: the folder of the options, or one named after command and scene."""

import hashlib
import os
from pathlib import Path

from asmjax.errors import file_errors
from asmjax.experiment.ledger import Ledger
from asmjax.options import RunOptions, ViewJobOptions
from asmjax.preparation import check_writable
from asmjax.report.outputs import MEASUREMENTS, Outputs, read_report
from asmjax.scene.builtin import is_builtin

GENERIC = ("default", "index", "main", "mitsuba", "scene", "untitled")
"""Names of scene files that say nothing: their folder's name stands for them."""

_KINDS = {"analyze": "aliasing", "compare": "comparison", "tune": "tuning", "plan": "plan"}
"""Of the report of each command."""


def results_folder(options: ViewJobOptions) -> Outputs:
    """Where the results of a command go; makes nothing yet.

    Without `--out` two scenes do not share a folder, whatever their files are called.

    Raises:
        UseError: they cannot go there, as `check_writable` and `Outputs` say, or the settings file
            is one of those that they replace, or scene or file has what no name may have.
    """
    source = None if is_builtin(options.scene) else _real(options.scene, "the scene")
    path = Path(options.out) if options.out else _default(options, source)
    _real(path, "the folder of results")
    check_writable(path)
    outputs = Outputs(path, _kind(options), source)
    settings = getattr(options, "settings", None)
    if settings is not None:
        _real(settings, "the settings file")
    outputs.spare(settings)
    return outputs


def _real(path: str | os.PathLike, what: str) -> str:
    """The path, links followed. Raises `UseError` where it cannot be one, whether or not there is
    such a file."""
    with file_errors(f"{what} '{str(path)[:80]}' cannot be looked for", "name another"):
        return os.path.realpath(path)


def _kind(options: ViewJobOptions) -> str:
    if isinstance(options, RunOptions):
        return "run" if options.frames is None else "walkthrough"
    return _KINDS[options.command]


def _default(options: ViewJobOptions, source: str | None) -> Path:
    """The folder where nobody names one."""
    # A colon, as of "surface:2.5m", does not suit every file system.
    name = _name(options.scene, source).replace(":", "-")
    folder = Path(f"out/{options.command}-{name}")
    there = read_report(folder)
    if there is None or there.get("scene_file") == source:
        return folder
    known_by = hashlib.sha256((source or options.scene).encode(errors="surrogateescape"))
    return folder.with_name(f"{folder.name}-{known_by.hexdigest()[:6]}")


def _name(scene: str, source: str | None) -> str:
    path = Path(scene)
    if source is None or path.suffix.lower() != ".xml":
        return path.name
    if path.stem.lower() in GENERIC:
        return Path(os.path.abspath(scene)).parent.name or path.stem
    return path.stem


def kept_measurements(folder: Path, fresh: bool) -> Ledger:
    """The measurements in a folder that exists; `fresh` forgets those of earlier runs.

    Raises:
        UseError: as `Ledger`, also of what was to be forgotten: it may be somebody else's.
    """
    path = folder / MEASUREMENTS
    known = Ledger(path)
    if not fresh:
        return known
    path.unlink(missing_ok=True)
    return Ledger(path)
