"""The notebooks as tests run them: cell by cell, as `notebooks/render.py` does, or as Jupyter's."""

import importlib.util
import json
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "notebooks"
PNG = b"\x89PNG"
"""With which a figure begins."""

_spec = importlib.util.spec_from_file_location("render", FOLDER / "render.py")
assert _spec is not None and _spec.loader is not None
render = importlib.util.module_from_spec(_spec)
sys.modules["render"] = render
_spec.loader.exec_module(render)


def script(name: str) -> str:
    """The source of a notebook."""
    return (FOLDER / f"{name}.py").read_text(encoding="utf-8")


def ran(name: str) -> tuple[dict, str, list[bytes]]:
    """The names of a notebook after its last cell, all that it printed, and its figures."""
    names: dict = {}
    done = list(render.run(FOLDER / f"{name}.py", names))
    return names, "".join(cell.output for cell in done), [d.figure for d in done if d.figure]


def as_ipynb(name: str, path: Path) -> Path:
    """Write a notebook as Jupyter keeps it, for the kernel of Python; returns `path`."""
    import nbformat.v4 as v4

    cells = [
        v4.new_markdown_cell(cell.text) if cell.kind == "markdown" else v4.new_code_cell(cell.text)
        for cell in render.cells(script(name))
    ]
    # Without a kernel named, Jupyter asks for one.
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    path.write_text(json.dumps(v4.new_notebook(cells=cells, metadata=kernel)), encoding="utf-8")
    return path
