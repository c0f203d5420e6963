"""The pictures of a run: plain images in, PNG files out. The only part that loads matplotlib."""

import os
from pathlib import Path

from asmjax.report.figures.accuracy_time import draw_accuracy_time
from asmjax.report.figures.board import drawing, save
from asmjax.report.figures.errors import draw_errors
from asmjax.report.figures.levels import draw_levels
from asmjax.report.figures.maps import draw_maps
from asmjax.report.figures.pictures import RunPictures, TreePicture
from asmjax.report.figures.shading import linear_parts, shade
from asmjax.report.figures.shadows import draw_shadows
from asmjax.report.figures.tree import draw_tree
from asmjax.writing import Writer, write_files

__all__ = [
    "RunPictures",
    "TreePicture",
    "draw_accuracy_time",
    "draw_errors",
    "draw_levels",
    "draw_maps",
    "draw_shadows",
    "draw_tree",
    "drawing",
    "figure_files",
    "linear_parts",
    "save",
    "shade",
    "write_figures",
]


def write_figures(pictures: RunPictures, folder: str | os.PathLike) -> list[Path]:
    """Draw and write every figure that `pictures` has the data for; returns the files. The folder
    must exist.

    Raises:
        WriteError: one cannot be written.
    """
    return write_files(folder, figure_files(pictures))


def figure_files(pictures: RunPictures) -> dict[str, Writer]:
    """Every figure that `pictures` has the data for, drawn when it is written.

    `shadows.png` always; `errors.png` with a method, `maps.png` with a map, `tree.png` with a
    tree, `levels.png` with an adaptive map's resolutions, `accuracy_time.png` with `methods`.
    """
    files = {"shadows.png": drawing(lambda: draw_shadows(pictures))}
    if pictures.drawn_methods():
        files["errors.png"] = drawing(lambda: draw_errors(pictures))
    if pictures.maps:
        files["maps.png"] = drawing(lambda: draw_maps(pictures))
    if pictures.tree is not None and pictures.tree.level.size:
        files["tree.png"] = drawing(lambda: draw_tree(pictures))
    if pictures.log2_resolution is not None:
        files["levels.png"] = drawing(lambda: draw_levels(pictures))
    if pictures.methods:
        files["accuracy_time.png"] = drawing(
            lambda: draw_accuracy_time(pictures.methods, int(pictures.valid.sum()), pictures.title)
        )
    return files
