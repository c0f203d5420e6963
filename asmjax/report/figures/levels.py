"""How fine a map answered each eye pixel, beside how fine a map each pixel needs."""

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from asmjax.report.figures.board import (
    CAPTION,
    EDGE,
    GAP,
    HEAD,
    Board,
    panel_size,
    target_width,
)
from asmjax.report.figures.pictures import RunPictures
from asmjax.report.figures.scales import (
    beyond,
    colours_of,
    exponent_ticks,
    log2_or_nan,
    power_of_two,
    scale_limits,
)
from asmjax.report.figures.style import styled

_BAR, _BAR_LABELS = 16, 70


@styled
def draw_levels(pictures: RunPictures) -> Figure:
    """Side of the flat map as fine as the node that answered each pixel; and the side needed.

    Both panels share one scale over whole powers of two, which leaves out 1 % of the pixels at
    either end: a few pixels at grazing light need a million texels. Raises `ValueError` where
    `pictures.log2_resolution` is None.
    """
    if pictures.log2_resolution is None:
        raise ValueError("there is no adaptive map to draw the levels of")
    used = np.where(pictures.valid, pictures.log2_resolution, np.nan)
    panels = [("Resolution used", "of the node that answered the pixel", used)]
    if "n_required" in pictures.maps:
        needed = 0.5 * log2_or_nan(pictures.maps["n_required"])
        side = np.where(pictures.valid, needed, np.nan)
        panels.append(("Resolution needed", "to match the pixel; only edges profit from it", side))
    shown = np.stack([exponents for *_, exponents in panels])
    least, most = scale_limits(shown, centred=False)
    low, high = float(np.floor(least)), float(np.ceil(most))
    norm, colours = Normalize(low, high), matplotlib.colormaps["viridis"]
    height, width = panel_size(*pictures.size, target_width(2 if len(panels) == 2 else 1) - 100)
    top = EDGE + HEAD
    board = Board(
        2 * EDGE + len(panels) * (width + GAP) + _BAR + _BAR_LABELS,
        top + height + GAP + CAPTION + EDGE // 2,
    )
    for i, (title, small, exponents) in enumerate(panels):
        x = EDGE + i * (width + GAP)
        board.heading(x, EDGE, width, title, small)
        axes = board.image(x, top, width, height, colours_of(exponents, colours, norm))
        axes.set_label(title)
    ticks = {float(k): power_of_two(k) for k in exponent_ticks(low, high, 12)}
    bar_x = EDGE + len(panels) * (width + GAP) - GAP // 2
    board.scale_bar(colours, norm, bar_x, top, _BAR, height, ticks, beyond(shown, low, high))
    board.caption(f"{pictures.title}. Texels per side; grey: no surface, or not lit by the light.")
    return board.figure
