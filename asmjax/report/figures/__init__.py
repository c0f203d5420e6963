"""The pictures of a run: plain images in, PNG files out. The only part that loads matplotlib."""

import os
from pathlib import Path

from asmjax.report.figures.accuracy_time import draw_accuracy_time
from asmjax.report.figures.board import save
from asmjax.report.figures.errors import draw_errors
from asmjax.report.figures.levels import draw_levels
from asmjax.report.figures.maps import draw_maps
from asmjax.report.figures.pictures import RunPictures, TreePicture
from asmjax.report.figures.shading import linear_parts, shade
from asmjax.report.figures.shadows import draw_shadows
from asmjax.report.figures.tree import draw_tree

__all__ = [
    "RunPictures",
    "TreePicture",
    "draw_accuracy_time",
    "draw_errors",
    "draw_levels",
    "draw_maps",
    "draw_shadows",
    "draw_tree",
    "linear_parts",
    "save",
    "shade",
    "write_figures",
]


def write_figures(pictures: RunPictures, folder: str | os.PathLike) -> list[Path]:
    """Draw and write every figure that `pictures` has the data for; returns the files.

    `shadows.png` always; `errors.png` with a method, `maps.png` with a map, `tree.png` with a
    tree, `levels.png` with an adaptive map's resolutions, `accuracy_time.png` with `methods`.
    The folder must exist.
    """
    folder = Path(folder)
    written = [save(draw_shadows(pictures), folder / "shadows.png")]
    if pictures.drawn_methods():
        written.append(save(draw_errors(pictures), folder / "errors.png"))
    if pictures.maps:
        written.append(save(draw_maps(pictures), folder / "maps.png"))
    if pictures.tree is not None and pictures.tree.level.size:
        written.append(save(draw_tree(pictures), folder / "tree.png"))
    if pictures.log2_resolution is not None:
        written.append(save(draw_levels(pictures), folder / "levels.png"))
    if pictures.methods:
        pixels = int(pictures.valid.sum())
        chart = draw_accuracy_time(pictures.methods, pixels, pictures.title)
        written.append(save(chart, folder / "accuracy_time.png"))
    return written
