"""Which pixels each method gets wrong, and which way."""

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
    columns_for,
    panel_size,
    target_width,
)
from asmjax.report.figures.pictures import RunPictures
from asmjax.report.figures.style import BACKGROUND, FALSE_DARK, FALSE_LIT, hex_rgb, styled
from asmjax.report.table import significant

_DOT = 3.0
"""Screen pixels across a wrong pixel where few are wrong."""

_MANY = 0.15
"""Share of the image that enlarged wrong pixels may cover."""

_LEGEND = 26
"""Height in pixels of the legend, above the caption."""

_LIT, _SHADOW = 247, 214
"""Grey values of correct pixels: paler than any error, dark enough to see the shadow."""


@styled
def draw_errors(pictures: RunPictures) -> Figure:
    """One map per method: false lit orange, false dark blue, over a pale image of truth.

    Where few pixels are wrong, they are drawn larger than they are, or nobody would see them.
    """
    names = pictures.drawn_methods()
    columns = columns_for(max(len(names), 1))
    rows = -(-len(names) // columns)
    height, width = panel_size(*pictures.size, target_width(columns))
    board = Board(
        2 * EDGE + max(columns * width + (columns - 1) * GAP, 560),
        2 * EDGE + rows * (HEAD + height + GAP) + _LEGEND + CAPTION // 2,
    )
    grow = growth(pictures, names, height)
    for i, name in enumerate(names):
        x = EDGE + (i % columns) * (width + GAP)
        y = EDGE + (i // columns) * (HEAD + height + GAP)
        error = pictures.error(name)
        lit, dark, wrong = (
            significant(100 * part)
            for part in (
                error.false_lit_fraction,
                error.false_dark_fraction,
                error.misclassified_fraction,
            )
        )
        board.heading(
            x,
            y,
            width,
            name,
            f"{lit} % false lit, {dark} % false dark",
            tail=f": {wrong} % wrong",
        )
        image = error_image(pictures.truth, pictures.visibilities[name], pictures.valid, grow)
        board.image(x, y + HEAD, width, height, image)
    _legend(board)
    enlarged = f" Wrong pixels are drawn {grow} × {grow} pixels large." if grow > 1 else ""
    board.caption(f"{pictures.title}.{enlarged}")
    return board.figure


def growth(pictures: RunPictures, names: list[str], height: int) -> int:
    """Odd side in image pixels at which to draw a wrong pixel; 1 where there are many."""
    most = max((pictures.error(name).misclassified_fraction for name in names), default=0.0)
    wanted = 2 * round(0.5 * (_DOT * pictures.size[0] / height - 1)) + 1
    return next((side for side in range(wanted, 1, -2) if most * side**2 <= _MANY), 1)


def error_image(truth, visibility, valid, grow: int = 1) -> np.ndarray:
    """(height, width, 3) uint8: truth in pale greys, errors in colour by how large they are.

    Every error covers the square of `grow` pixels around it; where squares of both kinds meet,
    each kind keeps its own pixels.
    """
    mask = np.asarray(valid, bool)
    error = signed_error(np.asarray(truth), np.asarray(visibility), mask)
    lit = np.where(mask, np.asarray(truth, np.float64), 0.0)[..., None]
    image = np.repeat(_SHADOW + (_LIT - _SHADOW) * lit, 3, axis=-1)
    for colour, part in ((FALSE_LIT, error), (FALSE_DARK, -error)):
        own = np.clip(part, 0, 1)
        share = np.where(error == 0, _largest_near(own, grow), own)[..., None]
        image = image * (1 - share) + hex_rgb(colour) * share
    image[~mask] = hex_rgb(BACKGROUND)
    return np.round(image).astype(np.uint8)


def _largest_near(values: np.ndarray, side: int) -> np.ndarray:
    """Largest value in the square of that odd `side` around each pixel."""
    reach = side // 2
    for axis in (0, 1):
        padded = np.pad(values, [(reach, reach) if k == axis else (0, 0) for k in (0, 1)])
        length = values.shape[axis]
        windows = [np.take(padded, range(k, k + length), axis) for k in range(side)]
        values = np.maximum.reduce(windows)
    return values


def _legend(board: Board) -> None:
    grey = [f"#{value:02x}{value:02x}{value:02x}" for value in (_LIT, _SHADOW)]
    entries = (
        (FALSE_LIT, "false lit"),
        (FALSE_DARK, "false dark"),
        (grey[0], "lit, right"),
        (grey[1], "shadow, right"),
        (BACKGROUND, "nothing seen"),
    )
    board.figure.legend(
        handles=[Patch(facecolor=c, edgecolor="#888888", linewidth=0.4) for c, _ in entries],
        labels=[label for _, label in entries],
        loc="lower left",
        bbox_to_anchor=((EDGE - 8) / board.width, (EDGE + 4) / board.height),
        ncols=len(entries),
        handlelength=1.0,
        handleheight=1.0,
        columnspacing=1.6,
        borderpad=0.6,
    )
