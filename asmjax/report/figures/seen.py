"""The view itself as plain pictures, one for each shadow: to be laid over each other."""

import os
from pathlib import Path

import numpy as np

# Pillow is what matplotlib itself writes pictures with.
from PIL import Image

from asmjax.report.figures.errors import error_image, growth
from asmjax.report.figures.pictures import RunPictures

TRUTH = "seen_truth.png"
"""The view under its true shadow."""

_MOST_METHODS = 3
"""Further ones are in the other figures."""

_MOST_SIDE = 1280
"""Of a picture, pixels: a larger view is shown smaller."""


def seen_name(method: str) -> str:
    """File of the view under a method's shadow."""
    return f"seen_{method}.png"


def wrong_name(method: str) -> str:
    """File of a method's wrong pixels."""
    return f"wrong_{method}.png"


def write_seen(pictures: RunPictures, folder: str | os.PathLike) -> list[Path]:
    """Write the view under truth and under up to three methods, and the wrong pixels of these;
    returns the files. The folder must exist.

    All have one size and no margin, so that they fit over each other pixel by pixel.
    """
    folder = Path(folder)
    names = pictures.drawn_methods(_MOST_METHODS)
    grow = growth(pictures, names, min(pictures.size[0], _MOST_SIDE))
    written = [_write(pictures.shaded(pictures.truth), folder / TRUTH)]
    for name in names:
        visibility = pictures.visibilities[name]
        wrong = error_image(pictures.truth, visibility, pictures.valid, grow)
        written.append(_write(pictures.shaded(visibility), folder / seen_name(name)))
        written.append(_write(wrong, folder / wrong_name(name)))
    return written


def _write(image: np.ndarray, path: Path) -> Path:
    height, width = image.shape[:2]
    picture = Image.fromarray(image)
    scale = _MOST_SIDE / max(height, width)
    if scale < 1:
        size = max(1, round(scale * width)), max(1, round(scale * height))
        picture = picture.resize(size, Image.Resampling.BOX)
    picture.save(path, compress_level=6)
    return path
