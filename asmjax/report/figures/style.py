"""One look for all figures: fonts and colours.

Figures are `matplotlib.figure.Figure` objects, without pyplot and its global state; the style is
in force only while one is drawn or saved.
"""

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import ParamSpec

import matplotlib
import numpy as np
from matplotlib.figure import Figure

_P = ParamSpec("_P")

DPI = 160
"""Pixels per inch of every figure: 1 point is 2.2 pixels."""

# Okabe and Ito's palette: told apart with every common colour-vision deficiency.
FALSE_LIT = "#E69F00"
FALSE_DARK = "#0072B2"
SPOT_COLOURS = ("#F0E442", "#CC79A7", "#56B4E9")
KIND_COLOURS = {"uniform": "#4D4D4D", "adaptive": "#009E73", "rays": "#CC79A7"}

BACKGROUND = "#A3A3A3"
"""Pixels without a value: nothing is seen there, or nothing applies."""

SKY = "#C9C9C9"
"""The same in pictures of the scene, where shadows are as dark as `BACKGROUND`."""

INK = "#1A1A1A"
FAINT = "#6E6E6E"

_STYLE: dict = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "normal",
    "axes.titlelocation": "left",
    "axes.titlepad": 5.0,
    "axes.titlecolor": INK,
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#444444",
    "axes.linewidth": 0.6,
    "axes.spines.top": True,
    "axes.spines.right": True,
    "axes.facecolor": "white",
    "axes.grid": False,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "text.color": INK,
    "text.usetex": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.bbox": None,
    "image.interpolation": "auto",
    "image.origin": "upper",
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
}


def hex_rgb(colour: str) -> np.ndarray:
    """(3,) uint8 of "#RRGGBB"."""
    return np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)


def style() -> AbstractContextManager:
    """Context in which figures are drawn and saved; a user's own settings return afterwards."""
    return matplotlib.rc_context(_STYLE)


def styled(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """Decorates a function that draws a figure: it runs inside `style()`."""

    @functools.wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        with style():
            return draw(*args, **kwargs)

    return drawn
