"""Where to look: the places of an image where something is densest."""

from typing import NamedTuple

import numpy as np

from asmjax.metrics.windows import box_sum


class Spot(NamedTuple):
    """A square of `side` pixels whose top left pixel is (row, column)."""

    row: int
    column: int
    side: int

    def crop(self, image: np.ndarray) -> np.ndarray:
        return image[self.row : self.row + self.side, self.column : self.column + self.side]


def densest_spots(weight, side: int, most: int) -> list[Spot]:
    """Up to `most` squares of `side` pixels inside the image with the largest sums of `weight`.

    Largest first; the next one's centre keeps 2.5 sides away from those taken, so that they show
    different things. Fewer where no weight is left. `side` is cut to the image.

    Args:
        weight: (height, width), not negative.
    """
    values = np.asarray(weight, np.float64)
    height, width = values.shape
    side = min(side, height, width)
    # Sums over the squares by their top left pixel: the window of pixel i starts at i - side // 2.
    half = side // 2
    sums = box_sum(values, side)[half : height - side + half + 1, half : width - side + half + 1]
    sums = sums.copy()
    rows, columns = np.ogrid[: sums.shape[0], : sums.shape[1]]
    spots = []
    for _ in range(most):
        row, column = np.unravel_index(np.argmax(sums), sums.shape)
        if not sums[row, column] > 0:
            break
        spots.append(Spot(int(row), int(column), side))
        near = np.maximum(np.abs(rows - row), np.abs(columns - column)) < 2.5 * side
        sums[near] = 0
    return spots
