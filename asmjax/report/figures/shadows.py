"""The scene under each method's shadow, with insets at the worst places of the uniform map."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

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
from asmjax.report.figures.spots import Spot, best_spots, densest_spots, outline, square_sums
from asmjax.report.figures.style import SPOT_COLOURS, styled
from asmjax.report.table import significant

_MOST_METHODS = 3
"""Beside truth; further ones are in the other figures."""

_INSETS = 3
_MAGNIFY = (5, 3, 2)
"""Screen pixels per image pixel in an inset, beyond the panel's own scale; the first that shows
a method's edges."""

_MIXED = 0.25
"""How evenly lit and dark a method's squares should be, from 0 to 1; see `_mixed`."""

_ANY_ERROR = 0.05
"""Weight of squares without an edge, beside that of squares with one."""


@styled
def draw_shadows(pictures: RunPictures) -> Figure:
    """Truth and up to three methods side by side; below each, the same magnified squares.

    The squares lie where the first uniform map (or the first method) has most wrong pixels along
    shadow edges; if nothing is wrong, where shadow edges are densest.
    """
    names = pictures.drawn_methods(_MOST_METHODS)
    columns = 1 + len(names)
    height, width = panel_size(*pictures.size, target_width(columns))
    scale = width / pictures.size[1]
    inset = (width - (_INSETS - 1) * GAP // 2) // _INSETS
    sides = [max(4, inset // max(factor, round(factor * scale))) for factor in _MAGNIFY]
    spots = worst_spots(pictures, names, sides, _INSETS)
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
            outline(axes, spot, SPOT_COLOURS[k])
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
    most = f"{names[0]} errs most along" if names else "truth has most"
    if spots:
        board.caption(
            f"{pictures.title}. Squares: {spots[0].side} × {spots[0].side} pixels where {most} "
            f"shadow edges, enlarged {inset / spots[0].side:.1f} times, no smoothing."
        )
    else:
        board.caption(f"{pictures.title}.")
    return board.figure


def _titles(pictures: RunPictures, name: str | None) -> tuple[str, str, str]:
    if name is None:
        return "Ray-traced truth", "shadow rays from every pixel", ""
    wrong = significant(100 * pictures.error(name).misclassified_fraction)
    return name, pictures.price(name), f": {wrong} % wrong"


def worst_spots(
    pictures: RunPictures, names: list[str], sides: Sequence[int], most: int
) -> list[Spot]:
    """Squares of the eye's image in which the first of `names` errs visibly, near true edges.

    Of the `sides`, the first in whose squares the method too shows both light and shadow: then
    one sees where its edges went. Without errors, squares along truth's shadow edges; without
    those too, none.
    """
    sees = pictures.valid & (pictures.direct.max(axis=-1) > 0)
    error = np.zeros(pictures.size)
    if names:
        error = np.abs(
            signed_error(pictures.truth, pictures.visibilities[names[0]], pictures.valid)
        )
    if not error.any():
        edges = boundary_edges(pictures.truth, surface_pairs(pictures.valid))
        error[:, :-1] += edges.right
        error[:-1] += edges.down
        return _in_order(densest_spots(error, sides[0], most))
    # What is as dark lit as shadowed shows no error.
    error *= np.where(sees, 1.0, 0.1)
    spots: list[Spot] = []
    for side in sides:
        side = min(side, *pictures.size)
        truth = _mixed(pictures.truth, sees, side)
        shown = _mixed(pictures.visibilities[names[0]], sees, side)
        score = square_sums(error, side) * (_ANY_ERROR + truth) * (_ANY_ERROR + shown)
        spots = best_spots(score, side, most)
        if np.mean([shown[spot.row, spot.column] for spot in spots]) >= _MIXED:
            break
    return _in_order(spots)


def _mixed(visibility: np.ndarray, sees: np.ndarray, side: int) -> np.ndarray:
    """How evenly each square is lit and dark: 1 for half and half, 0 for all the same."""
    lit = square_sums(np.where(sees, visibility, 0.0), side)
    dark = square_sums(np.where(sees, 1.0 - visibility, 0.0), side)
    return 4.0 * np.maximum(lit, 0) * np.maximum(dark, 0) / side**4


def _in_order(spots: list[Spot]) -> list[Spot]:
    """From left to right, so that insets stand in the order of their squares."""
    return sorted(spots, key=lambda spot: spot.column)
