"""Several maps side by side: their shadows, one magnified square, and m on one colour scale."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board, panel_size
from asmjax.report.figures.pictures import RunPictures
from asmjax.report.figures.scales import (
    around_zero,
    beyond,
    colours_of,
    exponent_ticks,
    factor,
    log2_or_nan,
    scale_limits,
)
from asmjax.report.figures.shadows import worst_spots
from asmjax.report.figures.spots import outline
from asmjax.report.figures.style import SPOT_COLOURS, styled
from asmjax.report.table import significant

_TARGET = 512
"""About how wide a panel is, in pixels."""

_MAGNIFY = (12, 8, 6)
"""Screen pixels per image pixel in an inset; the first that shows a map's edges."""

_BAR = 16


@styled
def draw_aliasing(pictures: RunPictures, m: Mapping[str, np.ndarray], worst: str) -> Figure:
    """Truth and each map (figures 1 and 9 of TR05-024).

    Args:
        m: texel width / pixel width by name of a map, (height, width), NaN where unknown; names
            and order as in `pictures.visibilities`.
        worst: the map whose errors say where the magnified square lies.
    """
    height, width = panel_size(*pictures.size, _TARGET)
    columns = 1 + len(m)
    spots = worst_spots(pictures, [worst], [width // by for by in _MAGNIFY], 1)
    inset = width if spots else 0
    board = Board(
        2 * EDGE + columns * width + (columns - 1) * GAP,
        EDGE + HEAD + height + inset + 2 * GAP + HEAD + height + CAPTION + EDGE,
    )
    low_row = EDGE + HEAD + height + GAP // 2 + inset + GAP
    exponents = {name: log2_or_nan(values) for name, values in m.items()}
    every = np.concatenate([values.ravel() for values in exponents.values()])
    low, high = scale_limits(every, centred=True)
    norm, colours = Normalize(low, high), around_zero(matplotlib.colormaps["RdBu_r"], low, high)
    for i, name in enumerate([None, *m]):
        x = EDGE + i * (width + GAP)
        visibility = pictures.truth if name is None else pictures.visibilities[name]
        board.heading(x, EDGE, width, *_titles(pictures, name))
        image = pictures.shaded(visibility)
        axes = board.image(x, EDGE + HEAD, width, height, image)
        for spot in spots:
            outline(axes, spot, SPOT_COLOURS[0])
            y = EDGE + HEAD + height + GAP // 2
            detail = board.image(x, y, width, inset, spot.crop(image), interpolation="nearest")
            for spine in detail.spines.values():
                spine.set(color=SPOT_COLOURS[0], linewidth=2.2)
        if name is None:
            continue
        finite = np.asarray(m[name], np.float64)
        finite = finite[np.isfinite(finite)]
        small = "no lit surface"
        if finite.size:
            middle, most = (significant(float(v)) for v in np.percentile(finite, [50, 95]))
            small = f"median {middle}, 95 % below {most}"
        board.heading(x, low_row, width, f"m of {name}", small)
        shown = colours_of(exponents[name], colours, norm)
        board.image(x, low_row + HEAD, width, height, shown)
    board.heading(
        EDGE, low_row, width, "m: texel width / pixel width",
        "red: too coarse, white: matched, blue: finer",
    )  # fmt: skip
    ticks = {float(k): factor(k) for k in exponent_ticks(low, high)}
    board.scale_bar(
        colours,
        norm,
        EDGE + width // 2,
        low_row + HEAD,
        _BAR,
        height,
        ticks,
        beyond(every, low, high),
    )
    inset_words = ""
    if spots:
        times = width / spots[0].side
        inset_words = f" Square: where {worst} errs most, enlarged {times:.0f} times."
    board.caption(f"{pictures.title}.{inset_words} Grey: no surface, or turned from the light.")
    return board.figure


def _titles(pictures: RunPictures, name: str | None) -> tuple[str, str, str]:
    if name is None:
        return "Ray-traced truth", "a shadow ray from every pixel", ""
    wrong = significant(100 * pictures.error(name).misclassified_fraction)
    return name, "shadows by this map", f": {wrong} % wrong"
