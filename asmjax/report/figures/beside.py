"""Methods side by side without the truth: pictures, magnified squares, and their errors marked."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from asmjax.metrics import signed_error
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
from asmjax.report.figures.shadows import worst_spots
from asmjax.report.figures.spots import Spot, outline
from asmjax.report.figures.style import FALSE_DARK, FALSE_LIT, SPOT_COLOURS, hex_rgb, styled
from asmjax.report.table import significant

_INSETS = 2
"""As many sections as the 2001 paper magnifies."""

_MAGNIFY = (8, 6, 4)
"""Screen pixels per image pixel in an inset, beyond the panel's own scale."""

_MARK = 0.8
"""How much of a wrong pixel's colour is the mark's."""


@styled
def draw_beside(pictures: RunPictures, names: Sequence[str], worst: str | None = None) -> Figure:
    """Two or three methods as in the figures of Fernando et al. (2001).

    Below each picture the same two squares, magnified without smoothing, and once more with the
    pixels marked whose shadow is wrong.

    Args:
        names: of `pictures.visibilities`, from left to right.
        worst: the squares lie where this one errs most; the first of `names` if left out.
    """
    columns = len(names)
    height, width = panel_size(*pictures.size, target_width(max(columns, 2)))
    inset = (width - (_INSETS - 1) * GAP // 2) // _INSETS
    scale = width / pictures.size[1]
    sides = [max(4, inset // max(factor, round(factor * scale))) for factor in _MAGNIFY]
    spots = worst_spots(pictures, [worst or names[0]], sides, _INSETS)
    rows = 2 if spots else 0
    board = Board(
        2 * EDGE + columns * width + (columns - 1) * GAP,
        EDGE + HEAD + height + rows * (inset + GAP // 2) + GAP + 2 * CAPTION + EDGE,
    )
    top = EDGE + HEAD
    for i, name in enumerate(names):
        x = EDGE + i * (width + GAP)
        wrong = significant(100 * pictures.error(name).misclassified_fraction)
        board.heading(x, EDGE, width, name, pictures.price(name), f": {wrong} % wrong")
        image = pictures.shaded(pictures.visibilities[name])
        axes = board.image(x, top, width, height, image)
        for k, spot in enumerate(spots):
            outline(axes, spot, SPOT_COLOURS[k])
        for row, shown in enumerate((image, _marked(pictures, name, image))):
            y = top + height + GAP // 2 + row * (inset + GAP // 2)
            for k, spot in enumerate(spots):
                _inset(board, x + k * (inset + GAP // 2), y, inset, spot, shown, SPOT_COLOURS[k])
    _legend(board)
    if spots:
        board.caption(
            f"{pictures.title}. Squares: {spots[0].side} × {spots[0].side} pixels where "
            f"{worst or names[0]} errs most, enlarged {inset / spots[0].side:.1f} times."
        )
    else:
        board.caption(f"{pictures.title}.")
    return board.figure


def _inset(board: Board, x: int, y: int, side: int, spot: Spot, image, colour: str) -> None:
    axes = board.image(x, y, side, side, spot.crop(image), interpolation="nearest")
    for spine in axes.spines.values():
        spine.set(color=colour, linewidth=2.2)


def _marked(pictures: RunPictures, name: str, image: np.ndarray) -> np.ndarray:
    """The picture with wrong pixels in the colours of their error."""
    error = signed_error(pictures.truth, pictures.visibilities[name], pictures.valid)
    marked = image.astype(np.float64)
    for colour, part in ((FALSE_LIT, error), (FALSE_DARK, -error)):
        share = _MARK * np.clip(part, 0, 1)[..., None]
        marked = marked * (1 - share) + hex_rgb(colour) * share
    return np.round(marked).astype(np.uint8)


def _legend(board: Board) -> None:
    board.figure.legend(
        handles=[Patch(color=FALSE_LIT), Patch(color=FALSE_DARK)],
        labels=["lit, but shadowed in truth", "shadowed, but lit in truth"],
        loc="lower left",
        bbox_to_anchor=((EDGE - 8) / board.width, (EDGE + CAPTION - 16) / board.height),
        ncols=2,
        handlelength=1.0,
        handleheight=1.0,
        columnspacing=1.6,
    )
