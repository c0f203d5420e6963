"""Texel / pixel width of several maps side by side, on one colour scale."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
    columns_for,
    panel_size,
    target_width,
)
from asmjax.report.figures.scales import around_zero, beyond, colours_of
from asmjax.report.figures.style import styled
from asmjax.report.table import significant

_BAR, _BAR_LABELS = 18, 200
"""Width in pixels of the colour bar, and of the labels to its right."""

_LEAST, _MOST = 0.5, 2.0
"""The scale reaches from 10^-`_MOST` to 10^`_MOST` at most, and `_LEAST` to both sides of 1."""


@dataclass(frozen=True, eq=False)
class MPanel:
    """One map.

    Attributes:
        name: of the method.
        m: (height, width) texel / pixel width in the worst direction, NaN where not known.
        valid: (height, width) which pixels see a surface.
    """

    name: str
    m: np.ndarray
    valid: np.ndarray


@styled
def draw_aliasing_maps(panels: Sequence[MPanel], title: str = "") -> Figure:
    """A panel for each map; grey where the light does not shine. The scale is logarithmic and
    holds the inner 98 % of all maps' values, up to factors of 100."""
    columns = columns_for(len(panels))
    rows = -(-len(panels) // columns)
    rows_seen, columns_seen = panels[0].m.shape
    height, width = panel_size(rows_seen, columns_seen, min(target_width(columns), 560))
    grid_width = columns * width + (columns - 1) * GAP
    grid_height = rows * (HEAD + height) + (rows - 1) * GAP
    board = Board(
        2 * EDGE + grid_width + GAP + _BAR + _BAR_LABELS, 2 * EDGE + grid_height + GAP + CAPTION
    )
    exponents = [_log10(panel) for panel in panels]
    every = np.concatenate([values[np.isfinite(values)] for values in exponents] or [np.zeros(0)])
    low, high = _limits(every)
    norm = Normalize(low, high)
    colours = around_zero(matplotlib.colormaps["RdBu_r"], low, high)
    for i, (panel, values) in enumerate(zip(panels, exponents, strict=True)):
        x = EDGE + (i % columns) * (width + GAP)
        y = EDGE + (i // columns) * (HEAD + height + GAP)
        board.heading(x, y, width, panel.name, _small(panel.m[np.isfinite(values)]))
        axes = board.image(x, y + HEAD, width, height, colours_of(values, colours, norm))
        axes.set_label(panel.name)
    ticks = {_log(tick): f"{tick:g}" for tick in _ticks(low, high)}
    ticks |= {value: f"{ticks[value]}  {word}" for value, word in _WORDS.items() if value in ticks}
    bar = board.scale_bar(
        colours, norm, EDGE + grid_width + GAP, EDGE + HEAD, _BAR,
        min(grid_height - HEAD, 900), ticks, beyond(every, low, high),
    )  # fmt: skip
    bar.ax.set_title("m: texel / pixel width", fontsize=8, loc="left", pad=8)
    board.caption(f"{title}. m: in the worst direction. Grey: no surface, or no light there.")
    return board.figure


_WORDS = {0.0: "clean", 1.0: "bad"}


def _log(value: float) -> float:
    return round(math.log10(value), 9)


def _log10(panel: MPanel) -> np.ndarray:
    m = np.asarray(panel.m, np.float64)
    known = panel.valid & np.isfinite(m) & (m > 0)
    return np.where(known, np.log10(np.where(known, m, 1.0)), np.nan)


def _limits(exponents: np.ndarray) -> tuple[float, float]:
    if not exponents.size:
        return -1.0, 1.0
    low, high = np.percentile(exponents, [1, 99]).tolist()
    return (
        float(np.clip(low, -_MOST, -_LEAST)),
        float(np.clip(high, max(_LEAST, 1.0), _MOST)),
    )


def _ticks(low: float, high: float) -> list[float]:
    """1, 2, 5 in each decade of the scale."""
    values = [digit * 10.0**k for k in range(-3, 4) for digit in (1, 2, 5)]
    return [float(f"{v:g}") for v in values if low - 1e-9 <= math.log10(v) <= high + 1e-9]


def _small(m: np.ndarray) -> str:
    if not m.size:
        return "no receiver"
    p50, p95 = (significant(value) for value in np.percentile(m, [50, 95]).tolist())
    above = significant(100 * float(np.mean(m > 1)))
    return f"median {p50}, p95 {p95}; {above} % above 1"
