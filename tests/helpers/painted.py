"""Texels painted lit or dark, and what filters make of them by integrals and by the listings."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from asmjax.shadow.neighbourhood import Neighbourhood, beside

PAD = 80
"""Texels that the last one of a picture is repeated by, for oracles."""


class Painted(Neighbourhood):
    """Texels whose shadow tests are known: `picture` (rows, columns) bool."""

    receivers: Any
    fraction: Any
    texel: Any
    picture: Any
    side: int = eqx.field(static=True)

    def lit(self, columns=0, rows=0, *, most=None):
        if most is not None and isinstance(columns, int) and isinstance(rows, int):
            assert max(abs(columns), abs(rows)) <= most
        column, row = (
            beside(at, step, self.side - 1)
            for at, step in zip(self.texel, (columns, rows), strict=True)
        )
        return self.picture[row, column]


def painted(picture, at) -> Painted:
    """The neighbourhood of places `at` (2, n) in texels."""
    texel = jnp.floor(at).astype(jnp.int32)
    return Painted(None, at - jnp.floor(at), texel, jnp.asarray(picture), len(picture))


def ref_area(picture: np.ndarray, at: np.ndarray, half) -> np.ndarray:
    """Share of light of the window of half sides `half` around each place, in float64: four corners
    of the picture's integral, which is bilinear within a texel."""
    held = np.pad(picture.astype(np.float64), PAD, mode="edge")
    integral = np.pad(held.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    half = np.broadcast_to(half, at.shape)

    def upto(x, y):
        column, row = np.floor(x).astype(int), np.floor(y).astype(int)
        s, t = x - column, y - row
        top = integral[row, column] * (1 - s) + integral[row, column + 1] * s
        below = integral[row + 1, column] * (1 - s) + integral[row + 1, column + 1] * s
        return top * (1 - t) + below * t

    (left, up), (right, down) = at + PAD - half, at + PAD + half
    whole = upto(right, down) - upto(left, down) - upto(right, up) + upto(left, up)
    return whole / (4 * half[0] * half[1])


def ref_bilinear(picture: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The hardware's test: a bilinear mix of the four outcomes whose centres are nearest."""
    x, y = at - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = x - column, y - row

    def outcome(dx, dy):
        side = len(picture) - 1
        return picture[np.clip(row + dy, 0, side), np.clip(column + dx, 0, side)]

    top = outcome(0, 0) * (1 - s) + outcome(1, 0) * s
    return top * (1 - t) + (outcome(0, 1) * (1 - s) + outcome(1, 1) * s) * t


def ref_sixteen(picture: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The brute-force listing of Bunnell and Pellacini (2004, 11.3): 64 texels are read."""
    total = np.zeros(at.shape[1])
    for y in (-1.5, -0.5, 0.5, 1.5):
        for x in (-1.5, -0.5, 0.5, 1.5):
            total += ref_bilinear(picture, at + np.array([[x], [y]]))
    return total / 16


def ref_dithered(
    picture: np.ndarray, at: np.ndarray, position: np.ndarray, cast: int = 2
) -> np.ndarray:
    """The listing of their 11.4 line by line, for window `position` (2, n) at +0.5 or not.

    `cast` 1 is its first line as printed: a scalar, the first of the two, becomes both.
    """
    offset = ((position * 0.5) % 1.0 > 0.25).astype(float)
    offset = np.stack([offset[0], offset[cast - 1]])
    offset[1] += offset[0]
    offset[1] = np.where(offset[1] > 1.1, 0, offset[1])
    taps = ((-1.5, 0.5), (0.5, 0.5), (-1.5, -1.5), (0.5, -1.5))
    tests = [ref_bilinear(picture, at + offset + np.array([[x], [y]])) for x, y in taps]
    return np.mean(tests, axis=0)
