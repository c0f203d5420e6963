"""`asmjax report`: one HTML page of what other commands wrote."""

from pathlib import Path

from asmjax.errors import file_errors, require
from asmjax.options import ReportOptions
from asmjax.report.outputs import PAGE, own_page
from asmjax.report.page import SECTIONS, write_page
from asmjax.report.page.words import megabytes
from asmjax.report.schema import validate_report
from asmjax.sweep.page import sweep_part
from asmjax.sweep.schema import SWEEP_SCHEMA, check_sweep

ALL_SECTIONS = {**SECTIONS, SWEEP_SCHEMA: sweep_part}
"""Of every kind of report."""


def check_report(report: object) -> None:
    """Check a report of any kind. Raises `InvalidReport` where it does not follow its schema."""
    is_sweep = isinstance(report, dict) and report.get("schema") == SWEEP_SCHEMA
    (check_sweep if is_sweep else validate_report)(report)


def run_report(options: ReportOptions) -> Path:
    """Write the page of `options.folders`, print where it is, and return that.

    Raises:
        UseError: a folder has no results that are known, they are damaged, or the page cannot be
            written.
    """
    folders = [Path(folder) for folder in options.folders]
    path = Path(options.out) if options.out else folders[0] / PAGE
    require(
        options.out is not None or not path.exists() or bool(own_page(folders[0])),
        f"'{path}' is not a page that asmjax made; move it away, or give --out.",
    )
    if options.out:
        with file_errors(f"cannot write the page to '{path}'", "choose another --out"):
            path.parent.mkdir(parents=True, exist_ok=True)
    size = write_page(folders, path, ALL_SECTIONS, check_report)
    if not options.quiet:
        print(f"page: {path} ({megabytes(size)})")
    return path
