"""Sums over square windows of an image."""

import numpy as np
from jaxtyping import Float64, Shaped


def box_sum(
    image: Shaped[np.ndarray, "height width"], side: int
) -> Float64[np.ndarray, "height width"]:
    """(height, width) float64: the sum over the window of `side` pixels around each pixel.

    Windows reach beyond the image, where the values count as 0. For an even `side` the window
    of pixel i starts at i - side // 2.
    """
    values = np.asarray(image, np.float64)
    height, width = values.shape
    before = side // 2
    padded = np.zeros((height + side, width + side))
    padded[before + 1 : before + 1 + height, before + 1 : before + 1 + width] = values
    # Sums of 0/1 images stay exact: a float64 holds every integer up to 2^53.
    table = padded.cumsum(axis=0).cumsum(axis=1)
    return (
        table[side : side + height, side : side + width]
        - table[:height, side : side + width]
        - table[side : side + height, :width]
        + table[:height, :width]
    )
