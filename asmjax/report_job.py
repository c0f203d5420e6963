"""`asmjax report`: one HTML page of what other commands wrote."""

from pathlib import Path

from asmjax.errors import UseError
from asmjax.options import ReportOptions
from asmjax.report.outputs import PAGE
from asmjax.report.page import write_page
from asmjax.report.page.words import megabytes


def run_report(options: ReportOptions) -> Path:
    """Write the page of `options.folders`, print where it is, and return that.

    Raises:
        UseError: a folder has no results that are known, they are damaged, or the page cannot be
            written.
    """
    folders = [Path(folder) for folder in options.folders]
    path = Path(options.out) if options.out else folders[0] / PAGE
    if options.out:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise UseError(
                f"cannot write the page to '{path}' ({problem.strerror}); choose another --out."
            ) from problem
    size = write_page(folders, path)
    if not options.quiet:
        print(f"page: {path} ({megabytes(size)})")
    return path
