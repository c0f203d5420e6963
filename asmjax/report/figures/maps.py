"""Where the shadow map is too coarse, and what each pixel would need: four maps per eye pixel."""

from collections.abc import Callable
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure

from asmjax.report.figures.board import (
    CAPTION,
    EDGE,
    GAP,
    HEAD,
    Board,
    columns_for,
    panel_size,
    target_width,
)
from asmjax.report.figures.pictures import RunPictures
from asmjax.report.figures.scales import (
    around_zero,
    beyond,
    colours_of,
    exponent_ticks,
    factor,
    half_ticks,
    log2_or_nan,
    power_of_two,
    scale_limits,
)
from asmjax.report.figures.style import hex_rgb, styled
from asmjax.report.table import significant

_BAR, _BAR_LABELS = 16, 84
"""Width in pixels of a colour bar, and of the labels to its right."""


_NONE = "#F6F6F6"
"""Colour of a benefit of 0."""


@dataclass(frozen=True)
class _Map:
    """How one map is drawn: log2 of its values, centred on 0 (`matched`) or over their range."""

    name: str
    title: str
    small: str
    log2: Callable[[np.ndarray], np.ndarray]
    colours: str
    centred: bool
    label: Callable[[float], str]


_MAPS = (
    _Map(
        "area_ratio",
        "Area ratio: texel / eye pixel",
        "red: too coarse, white: matched, blue: finer",
        log2_or_nan,
        "RdBu_r",
        True,
        factor,
    ),
    _Map(
        "m",
        "Linear error m: texel width / pixel width",
        "worst direction; mean edge shift ≤ m/4 pixels",
        log2_or_nan,
        "RdBu_r",
        True,
        factor,
    ),
    _Map(
        "n_required",
        "Side of the flat map that each pixel needs",
        "square root of n_required, texels",
        lambda values: 0.5 * log2_or_nan(values),
        "viridis",
        False,
        power_of_two,
    ),
    _Map(
        "benefit",
        "Benefit of refining",
        "eye pixels that refining the cell helps; white: none",
        log2_or_nan,
        "magma_r",
        False,
        lambda k: f"{2 ** round(k):,}" if k > 0 else power_of_two(k),
    ),
)


@styled
def draw_maps(pictures: RunPictures) -> Figure:
    """The maps that `pictures.maps` holds, each with its scale; grey where a pixel has no value.

    Scales end at the 1st and 99th percentile: a light edge-on to a surface has no largest ratio.
    """
    chosen = [entry for entry in _MAPS if entry.name in pictures.maps]
    columns = columns_for(len(chosen) or 1)
    rows = -(-len(chosen) // columns)
    height, width = panel_size(*pictures.size, min(target_width(columns), 560))
    cell = width + GAP // 2 + _BAR + _BAR_LABELS
    board = Board(
        2 * EDGE + columns * cell + (columns - 1) * GAP,
        2 * EDGE + rows * (HEAD + height) + (rows - 1) * 2 * GAP + CAPTION,
    )
    for i, entry in enumerate(chosen):
        x = EDGE + (i % columns) * (cell + GAP)
        y = EDGE + (i // columns) * (HEAD + height + 2 * GAP)
        board.heading(x, y, cell, entry.title, _small(entry, pictures))
        values = np.asarray(pictures.maps[entry.name], np.float64)
        exponents = np.where(pictures.valid, entry.log2(values), np.nan)
        low, high = scale_limits(exponents, entry.centred)
        if entry.name == "benefit":
            # Counts: they begin at 1, and a single one would have no scale.
            low, high = 0.0, max(high, 2.0)
        norm, colours = Normalize(low, high), _colours(entry, low, high)
        image = colours_of(exponents, colours, norm)
        if entry.name == "benefit":
            # 0 has no logarithm, and "refining helps nobody" is an answer and no missing value.
            image[pictures.valid & (values == 0)] = hex_rgb(_NONE)
        axes = board.image(x, y + HEAD, width, height, image)
        axes.set_label(entry.name)
        bar_x = x + width + GAP // 2
        at = half_ticks(low, high) if entry.label is power_of_two else exponent_ticks(low, high)
        ticks = {float(k): entry.label(k) for k in at}
        ends = beyond(exponents, low, high)
        board.scale_bar(colours, norm, bar_x, y + HEAD, _BAR, height, ticks, ends)
    board.caption(f"{pictures.title}. Grey: no surface, or the light does not shine there.")
    return board.figure


def _small(entry: _Map, pictures: RunPictures) -> str:
    """The small print of a map, with its median where a single number says how it is."""
    values = np.asarray(pictures.maps[entry.name], np.float64)
    good = values[pictures.valid & np.isfinite(values)]
    if entry.name == "benefit" or not good.size:
        return entry.small
    middle = float(np.median(good))
    if not entry.centred:
        return f"{entry.small}; median {np.sqrt(middle):,.0f}"
    return f"{entry.small}; median {f'{middle:,.0f}' if middle >= 1000 else significant(middle)}×"


def _colours(entry: _Map, low: float, high: float) -> Colormap:
    whole = matplotlib.colormaps[entry.colours]
    if entry.centred:
        return around_zero(whole, low, high)
    if entry.name == "benefit":
        # Its pale end would look like `_NONE`, its dark end like an outline.
        return ListedColormap(whole(np.linspace(0.12, 0.88, 256)))
    return whole
