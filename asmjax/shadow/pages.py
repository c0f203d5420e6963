"""Pages of the documentation with a part between two markers that is written from the code."""

import sys
from collections.abc import Callable
from pathlib import Path

from asmjax.errors import require


def between_markers(page: str, begin: str, end: str, text: str) -> str:
    """`page` with `text` between the lines `begin` and `end`.

    Raises:
        UseError: the page has not one line of each marker, in their order.
    """
    before, first, rest = page.partition(f"{begin}\n")
    _, last, after = rest.partition(f"{end}\n")
    require(
        bool(first and last) and begin not in after,
        f"the page has no part to write; put the lines {begin} and {end} around it, once.",
    )
    return f"{before}{first}\n{text}\n{last}{after}"


def write_pages(written_into: Callable[[str], str]) -> None:
    """Write the files that the command line names."""
    for name in sys.argv[1:]:
        path = Path(name)
        path.write_text(written_into(path.read_text(encoding="utf-8")), encoding="utf-8")
