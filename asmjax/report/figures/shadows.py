"""The scene under each method's shadow, with insets at the worst places of the uniform map."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from asmjax.metrics import boundary_edges, signed_error, surface_pairs
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
from asmjax.report.figures.spots import Spot, densest_spots
from asmjax.report.figures.style import SPOT_COLOURS, styled
from asmjax.report.table import significant

_MOST_METHODS = 2
"""Beside truth; further ones are in the other figures."""

_INSETS = 3
_MAGNIFY = 5
"""Screen pixels per image pixel in an inset, beyond the panel's own scale."""


@styled
def draw_shadows(pictures: RunPictures) -> Figure:
    """Truth and up to two methods side by side; below each, the same magnified squares.

    The squares lie where the first uniform map (or the first method) has most wrong pixels; if
    nothing is wrong, where shadow edges are densest.
    """
    names = pictures.drawn_methods(_MOST_METHODS)
    columns = 1 + len(names)
    height, width = panel_size(*pictures.size, target_width(columns))
    scale = width / pictures.size[1]
    inset = (width - (_INSETS - 1) * GAP // 2) // _INSETS
    magnify = max(_MAGNIFY, round(_MAGNIFY * scale))
    spots = worst_spots(pictures, names, max(4, inset // magnify), _INSETS)
    inset_row = inset + GAP // 2 if spots else 0
    board = Board(
        2 * EDGE + columns * width + (columns - 1) * GAP,
        EDGE + HEAD + height + inset_row + GAP + CAPTION + EDGE // 2,
    )
    top = EDGE + HEAD
    for i, name in enumerate([None, *names]):
        x = EDGE + i * (width + GAP)
        image = pictures.shaded(pictures.truth if name is None else pictures.visibilities[name])
        board.heading(x, EDGE, width, *_titles(pictures, name))
        axes = board.image(x, top, width, height, image)
        for k, spot in enumerate(spots):
            _outline(axes, spot, SPOT_COLOURS[k])
            left = x + k * (inset + GAP // 2)
            detail = board.image(
                left,
                top + height + GAP // 2,
                inset,
                inset,
                spot.crop(image),
                interpolation="nearest",
            )
            for spine in detail.spines.values():
                spine.set(color=SPOT_COLOURS[k], linewidth=2.2)
    if spots:
        board.caption(
            f"{pictures.title}. Squares: {spots[0].side} × {spots[0].side} pixels where "
            f"{names[0] if names else 'truth'} is wrong most often, enlarged "
            f"{inset / spots[0].side:.1f} times, no smoothing."
        )
    else:
        board.caption(f"{pictures.title}.")
    return board.figure


def _titles(pictures: RunPictures, name: str | None) -> tuple[str, str, str]:
    if name is None:
        return "Ray-traced truth", "shadow rays from every pixel", ""
    wrong = significant(100 * pictures.error(name).misclassified_fraction)
    return name, pictures.price(name), f": {wrong} % wrong"


def worst_spots(pictures: RunPictures, names: list[str], side: int, most: int) -> list[Spot]:
    """Squares of the eye's image in which the first of `names` errs most.

    Without errors, squares along truth's shadow edges; without those too, none.
    """
    wrong = np.zeros(pictures.size)
    if names:
        wrong = np.abs(
            signed_error(pictures.truth, pictures.visibilities[names[0]], pictures.valid)
        )
    if not wrong.any():
        edges = boundary_edges(pictures.truth, surface_pairs(pictures.valid))
        wrong[:, :-1] += edges.right
        wrong[:-1] += edges.down
    # From left to right, so that insets stand in the order of their squares.
    return sorted(densest_spots(wrong, side, most), key=lambda spot: spot.column)


def _outline(axes: Axes, spot: Spot, colour: str) -> None:
    """A square around a spot, dark beneath its colour so that it shows on any picture."""
    for line, shade in ((2.4, "#202020"), (1.3, colour)):
        axes.add_patch(
            Rectangle(
                (spot.column - 0.5, spot.row - 0.5),
                spot.side,
                spot.side,
                fill=False,
                edgecolor=shade,
                linewidth=line,
            )
        )
