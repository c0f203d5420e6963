"""Where to look: the places of an image where something is densest."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from asmjax.metrics.windows import box_sum


class Spot(NamedTuple):
    """A square of `side` pixels whose top left pixel is (row, column)."""

    row: int
    column: int
    side: int

    def crop(self, image: np.ndarray) -> np.ndarray:
        return image[self.row : self.row + self.side, self.column : self.column + self.side]


def square_sums(weight, side: int) -> np.ndarray:
    """(height - side + 1, width - side + 1): sum over the square of each top left pixel."""
    values = np.asarray(weight, np.float64)
    height, width = values.shape
    # The window of pixel i starts at i - side // 2.
    half = side // 2
    return box_sum(values, side)[half : height - side + half + 1, half : width - side + half + 1]


def best_spots(score: np.ndarray, side: int, most: int) -> list[Spot]:
    """Up to `most` squares with the largest positive scores, best first.

    The next one's centre keeps 2.5 sides away from those taken, or half the image where that is
    less, so that they show different things.

    Args:
        score: of the square of each top left pixel, as `square_sums`.
    """
    left = np.array(score, np.float64)
    rows, columns = np.ogrid[: left.shape[0], : left.shape[1]]
    apart = min(2.5 * side, max(1.1 * side, 0.5 * max(left.shape)))
    spots = []
    for _ in range(most):
        row, column = np.unravel_index(np.argmax(left), left.shape)
        if not left[row, column] > 0:
            break
        spots.append(Spot(int(row), int(column), side))
        left[np.maximum(np.abs(rows - row), np.abs(columns - column)) < apart] = 0
    return spots


def densest_spots(weight, side: int, most: int) -> list[Spot]:
    """Up to `most` squares of `side` pixels inside the image with the largest sums of `weight`.

    Fewer where no weight is left. `side` is cut to the image.

    Args:
        weight: (height, width), not negative.
    """
    side = min(side, *np.shape(weight))
    return best_spots(square_sums(weight, side), side, most)


def outline(axes: Axes, spot: Spot, colour: str) -> None:
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
