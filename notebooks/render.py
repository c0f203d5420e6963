"""Notebooks as pages: runs them as Jupyter would, and writes their text, code, output and figures.

    python notebooks/render.py docs/notebooks                # all of them: some minutes
    python notebooks/render.py docs/notebooks first_look     # one

Figures go to `images/` beside the page. The notebooks themselves stay without outputs.
"""

import argparse
import ast
import contextlib
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from PIL import Image

HERE = Path(__file__).parent
NOTEBOOKS = ("first_look", "perspective_aliasing", "tuning", "hard_cases", "your_own_scene")
"""In the order in which to read them."""

MOST_WIDE = 1400
"""Pixels of a page's figures, which are kept small."""

_MARKER = re.compile(r"^# %%(?: \[(markdown)\])?\n", re.MULTILINE)


@dataclass(frozen=True)
class Cell:
    """A cell of a py:percent script; the text of a Markdown cell is without its "# "."""

    kind: Literal["markdown", "code"]
    text: str


@dataclass(frozen=True)
class Ran:
    """A cell, what it printed, and the PNG of the figure that its last line is; either may be
    empty."""

    cell: Cell
    output: str
    figure: bytes


def cells(script: str) -> list[Cell]:
    """The cells of a py:percent script."""
    _, *parts = _MARKER.split(script)
    found = []
    for markdown, text in zip(parts[::2], parts[1::2], strict=True):
        if markdown:
            found.append(Cell("markdown", re.sub(r"^# ?", "", text.strip(), flags=re.MULTILINE)))
        else:
            found.append(Cell("code", text.strip()))
    return found


def run(path: Path, names: dict | None = None) -> Iterator[Ran]:
    """Run a notebook, cell by cell; the value of a cell's last line is shown, as in Jupyter.

    Args:
        names: in which the cells run, to look at afterwards.
    """
    names = {} if names is None else names
    names["__name__"] = "__main__"
    for k, cell in enumerate(cells(path.read_text(encoding="utf-8"))):
        where = f"<{path.stem}, cell {k}>"
        if cell.kind == "markdown":
            yield Ran(cell, "", b"")
            continue
        body, shown = ast.parse(cell.text).body, None
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(ast.Module(body, []), where, "exec"), names)
            if isinstance(last, ast.Expr):
                shown = eval(compile(ast.Expression(last.value), where, "eval"), names)
        figure = shown._repr_png_() if hasattr(shown, "_repr_png_") else b""
        words = "" if figure or shown is None else f"{shown!r}\n"
        yield Ran(cell, printed.getvalue() + words, figure)


def page(path: Path, folder: Path) -> str:
    """The page of a notebook; writes its figures below `folder`."""
    parts = []
    for ran in run(path):
        parts.append(ran.cell.text if ran.cell.kind == "markdown" else _fenced("python", ran.cell))
        if ran.output:
            parts.append(f"```text\n{ran.output.rstrip()}\n```")
        if ran.figure:
            name = f"{path.stem}_{sum('![' in part for part in parts) + 1}.png"
            _small(ran.figure).save(folder / "images" / name, optimize=True)
            parts.append(f"![Figure of the cell above](images/{name})")
    head = f"<!-- written by `python notebooks/render.py docs/notebooks {path.stem}` -->"
    return "\n\n".join([head, *parts]) + "\n"


def _fenced(language: str, cell: Cell) -> str:
    return f"```{language}\n{cell.text}\n```"


def _small(png: bytes) -> Image.Image:
    """At most `MOST_WIDE` across and 256 colours, rare ones too: a third of the bytes."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    if image.width > MOST_WIDE:
        size = MOST_WIDE, round(image.height * MOST_WIDE / image.width)
        image = image.resize(size, Image.Resampling.LANCZOS)
    return image.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)


def main() -> None:
    """Render the notebooks that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the pages go")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(NOTEBOOKS)}; default: all")
    options = parser.parse_args()
    unknown = set(options.names) - set(NOTEBOOKS)
    if unknown:
        parser.error(f"unknown notebook {', '.join(sorted(unknown))}; {parser.format_usage()}")
    (options.folder / "images").mkdir(parents=True, exist_ok=True)
    for name in options.names or NOTEBOOKS:
        text = page(HERE / f"{name}.py", options.folder)
        (options.folder / f"{name}.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
