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

_LIT, _SHADOW = 247, 214
"""Grey values of correct pixels: paler than any error, dark enough to see the shadow."""


@styled
def draw_errors(pictures: RunPictures) -> Figure:
    """One map per method: false lit orange, false dark blue, over a pale image of truth."""
    names = pictures.drawn_methods()
    columns = columns_for(max(len(names), 1))
    rows = -(-len(names) // columns)
    height, width = panel_size(*pictures.size, target_width(columns))
    board = Board(
        2 * EDGE + max(columns * width + (columns - 1) * GAP, 560),
        2 * EDGE + rows * (HEAD + height + GAP) + CAPTION,
    )
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
        image = error_image(pictures.truth, pictures.visibilities[name], pictures.valid)
        board.image(x, y + HEAD, width, height, image)
    _legend(board)
    return board.figure


def error_image(truth, visibility, valid) -> np.ndarray:
    """(height, width, 3) uint8: truth in pale greys, errors in colour by how large they are."""
    error = signed_error(truth, visibility, valid)
    mask = np.asarray(valid, bool)
    lit = np.where(mask, np.asarray(truth, np.float64), 0.0)[..., None]
    image = np.repeat(_SHADOW + (_LIT - _SHADOW) * lit, 3, axis=-1)
    for colour, part in ((FALSE_LIT, error), (FALSE_DARK, -error)):
        share = np.clip(part, 0, 1)[..., None]
        image = image * (1 - share) + hex_rgb(colour) * share
    image[~mask] = hex_rgb(BACKGROUND)
    return np.round(image).astype(np.uint8)


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
        bbox_to_anchor=((EDGE - 8) / board.width, 0.0),
        ncols=len(entries),
        handlelength=1.0,
        handleheight=1.0,
        columnspacing=1.6,
        borderpad=0.6,
    )
