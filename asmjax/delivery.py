"""What every command that measures does last: print what was found, and write it."""

from collections.abc import Callable

from tqdm import tqdm

from asmjax.report.outputs import Outputs
from asmjax.writing import WriteError


def deliver(
    text: str,
    write: Callable[[], object],
    outputs: Outputs,
    bar: tqdm,
    *,
    quiet: bool,
    what: str = "report and figures",
) -> None:
    """Print `text`, then write the results: no full disk takes back what is printed.

    Args:
        text: the tables; with `quiet` it is printed only if results cannot be written.
        write: into `outputs`, which are made before.
        bar: of the progress; stands below the text until all is written.
        what: is in the folder.

    Raises:
        UseError: the folder cannot be made.
        WriteError: not all could be written.
    """
    try:
        if not quiet:
            bar.write(text)
    finally:
        # Also where nobody reads what is printed.
        try:
            outputs.make()
            write()
        except WriteError:
            if quiet:
                bar.write(text)
            raise
    bar.close()
    if not quiet:
        print(f"{what}: {outputs}/")
