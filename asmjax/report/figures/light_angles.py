"""Error against the angle between light and view: measurements as markers, theory as lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.families import look_of
from asmjax.report.figures.labels import tick_words
from asmjax.report.figures.style import FAINT, INK, styled

_WIDTH, _HEIGHT = 540, 520
"""Size in pixels of a panel, axis labels not included."""

_LEFT, _BELOW, _LEGEND = 104, 66, 230


@dataclass(frozen=True, eq=False)
class AngleCurve:
    """One algorithm.

    Attributes:
        family: of the registry.
        angle_deg: (n,) angles between light and view that were measured.
        max_perspective, p95_m, storage: (n,) measured.
        theory: (2, k) angles and storage factors of the theory, None without one.
    """

    family: str
    angle_deg: np.ndarray
    max_perspective: np.ndarray
    p95_m: np.ndarray
    storage: np.ndarray
    theory: np.ndarray | None


@styled
def draw_light_angles(
    curves: Sequence[AngleCurve], alpha: float, theta: float, title: str = ""
) -> Figure:
    """Largest perspective factor, p95 of m, and the storage factor with the theory's lines.

    Args:
        alpha, theta: of `ViewRange`: the theory's far / near, and half field of view in radians.
    """
    board = Board(
        2 * EDGE + 3 * (_LEFT + _WIDTH) + _LEGEND,
        EDGE + HEAD + _HEIGHT + _BELOW + 2 * CAPTION + EDGE,
    )
    texts = (
        ("Largest perspective factor", "texel's widest / pixel's narrowest beam",
         "texel / pixel beam width"),
        ("m, 95th percentile", "texel / pixel width on the receiver, worst direction",
         "texel / pixel width"),
        ("Storage factor", "markers: measured; lines: theory, full frustum",
         "texels needed / image pixels"),
    )  # fmt: skip
    panels = [_panel(board, column, *text) for column, text in enumerate(texts)]
    half = float(np.degrees(theta))
    for curve in curves:
        colour, marker = look_of(curve.family)
        series = (curve.max_perspective, curve.p95_m, curve.storage)
        for axes, values in zip(panels, series, strict=True):
            alone = axes is panels[2] and curve.theory is not None
            axes.plot(
                curve.angle_deg, np.where(values > 0, values, np.nan), marker=marker, color=colour,
                markersize=5.5, linewidth=0 if alone else 0.9, dashes=(2, 2) if alone else (),
                alpha=0.95, label=curve.family,
            )  # fmt: skip
        if curve.theory is not None:
            angles, expected = curve.theory
            known = np.isfinite(expected)
            panels[2].plot(angles, expected, color=colour, linewidth=1.3, zorder=1.5)
            if known.sum() == 1:
                # A single direction is no line.
                panels[2].plot(
                    angles[known], expected[known], "o", markersize=11, color=colour,
                    markerfacecolor="none", clip_on=False,
                )  # fmt: skip
    _room_for(panels[2], [curve.storage for curve in curves])
    for axes in panels:
        _scales(axes, half)
    handles, labels = panels[0].get_legend_handles_labels()
    board.figure.legend(
        handles, labels, loc="upper left", labelcolor=INK, handlelength=2.2,
        bbox_to_anchor=(
            (EDGE + 3 * (_LEFT + _WIDTH) + 8) / board.width, 1 - (EDGE + HEAD - 12) / board.height
        ),
    )  # fmt: skip
    board.caption(
        f"{title}; parallel light, 90°: overhead. Theory: α = far / near = {alpha:.3g}, half field "
        f"of view {half:.3g}°, a map fitted to the full square frustum with the eye on its axis; "
        "the maps are fitted to what is seen.",
        line=1,
    )
    board.caption(
        "Ring: theory for the overhead light alone. Thin lines join measurements without a theory. "
        f"Left of the upright at {half:.3g}° the light lies inside the view cone."
    )
    return board.figure


def _panel(board: Board, column: int, title: str, small: str, label: str) -> Axes:
    x = EDGE + column * (_LEFT + _WIDTH) + _LEFT
    board.heading(x, EDGE, _WIDTH, title, small)
    axes = board.axes(x, EDGE + HEAD, _WIDTH, _HEIGHT)
    axes.set_xlabel("angle γ between light and view, degrees")
    axes.set_ylabel(label)
    axes.set_yscale("log")
    axes.grid(which="major", color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def _room_for(axes: Axes, measured: Sequence[np.ndarray]) -> None:
    """Where the light comes along the view, theory is so far above that nothing else would show."""
    values = np.concatenate([values[values > 0] for values in measured] or [np.zeros(0)])
    if values.size:
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, values.min() / 10), min(high, values.max() * 6))


def _scales(axes: Axes, half: float) -> None:
    axes.set_xlim(0, 92)
    axes.xaxis.set_major_locator(FixedLocator(range(0, 91, 15)))
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 200 * low else (1.0,)))
    axes.yaxis.set_major_formatter(FuncFormatter(tick_words))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.axvline(half, color=FAINT, linewidth=0.8, dashes=(2, 2), zorder=0.5)
    if low < 1 < high:
        axes.axhline(1.0, color=FAINT, linewidth=0.8, zorder=0.5)
