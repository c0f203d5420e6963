"""The nearest depth in any window of a flat map: where a search for blockers has to look.

How far from a receiver's own place a caster may stand and still be before a light depends on how
near to the light it is. The nearest caster of the whole map would make all receivers look far
aside; that of the window which it asks for is usually farther, and asks for a smaller one.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

FINEST = 2
"""Level of the finest cells: 4 x 4 texels."""

ACROSS = 3
"""Cells a side that hold any window: with two, those of a third of the map would hold all of it."""


def sides(resolution: int) -> list[int]:
    """Cells a side of each level, from `FINEST` on to the one that is a single cell."""
    found, level = [], FINEST
    while not found or found[-1] > 1:
        found.append(-(-resolution // 2**level))
        level += 1
    return found


def least_depths(depth: np.ndarray) -> np.ndarray:
    """Least depths (cells,) of the cells of all levels, each by face and row, of the texels' depths
    (faces, N, N); +inf where nothing is hit."""
    levels = []
    for side in sides(depth.shape[1]):
        factor = 2**FINEST if not levels else 2
        rest = side * factor - depth.shape[1]
        padded = np.pad(depth, ((0, 0), (0, rest), (0, rest)), constant_values=np.inf)
        cells = padded.reshape(-1, side, factor, side, factor)
        depth = cells.min(axis=(2, 4))
        levels.append(depth)
    return np.concatenate([level.ravel() for level in levels])


def least_in(
    cells: Float[Array, " cells"],
    face: Int[Array, " n"],
    low: Float[Array, "2 n"],
    high: Float[Array, "2 n"],
    resolution: int,
    faces: int,
) -> Float[Array, " n"]:
    """The least depth (n,) of cells that hold the windows from `low` to `high`, columns and rows in
    texels: `ACROSS` a side, none of them wider than the window, or the finest."""
    side = np.array(sides(resolution))
    first = np.concatenate([[0], np.cumsum(faces * side**2)[:-1]]).astype(np.int32)
    low, high = jnp.clip(low, 0, resolution), jnp.clip(high, 0, resolution)
    width = jnp.maximum(high[0] - low[0], high[1] - low[1])
    level = jnp.ceil(jnp.log2(jnp.maximum(width / (ACROSS - 1), 1))).astype(jnp.int32) - FINEST
    level = jnp.clip(level, 0, side.size - 1)
    per_side = jnp.asarray(side, jnp.int32)[level]
    start = jnp.asarray(first)[level] + face * per_side * per_side
    size = jnp.exp2((level + FINEST).astype(low.dtype))
    (left, right), (above, below) = (
        [jnp.clip((end[k] / size).astype(jnp.int32), 0, per_side - 1) for end in (low, high)]
        for k in range(2)
    )

    def nearer(k, least):
        row, column = (
            jnp.minimum(begin + step, end)
            for begin, step, end in ((above, k // ACROSS, below), (left, k % ACROSS, right))
        )
        return jnp.minimum(least, cells[start + row * per_side + column])

    none = jnp.full(face.shape, jnp.inf, low.dtype)
    return jax.lax.fori_loop(0, ACROSS**2, nearer, none)
