"""The view itself as plain pictures, one for each shadow: to be laid over each other."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

# Pillow is what matplotlib itself writes pictures with.
from PIL import Image

from asmjax.report.figures.errors import error_image, growth
from asmjax.report.figures.pictures import RunPictures
from asmjax.writing import Writer, write_files

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
    """Write `seen_files` into a folder that exists; returns the paths. Raises `WriteError`."""
    return write_files(folder, seen_files(pictures))


def seen_files(pictures: RunPictures) -> dict[str, Writer]:
    """The view under truth and under up to three methods, and the wrong pixels of these.

    All have one size and no margin, so that they fit over each other pixel by pixel.
    """
    names = pictures.drawn_methods(_MOST_METHODS)
    grow = growth(pictures, names, min(pictures.size[0], _MOST_SIDE))
    files = {TRUTH: _picture(lambda: pictures.shaded(pictures.truth))}
    for name in names:
        lit = pictures.visibilities[name]
        files[seen_name(name)] = _picture(partial(pictures.shaded, lit))
        files[wrong_name(name)] = _picture(
            partial(error_image, pictures.truth, lit, pictures.valid, grow)
        )
    return files


def _picture(make: Callable[[], np.ndarray]) -> Writer:
    return lambda file: _reduced(make()).save(file, "PNG", compress_level=6)


def _reduced(image: np.ndarray) -> Image.Image:
    """The picture at its own size, or smaller where it is too large."""
    height, width = image.shape[:2]
    picture = Image.fromarray(image)
    scale = _MOST_SIDE / max(height, width)
    if scale < 1:
        size = max(1, round(scale * width)), max(1, round(scale * height))
        picture = picture.resize(size, Image.Resampling.BOX)
    return picture
