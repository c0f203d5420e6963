"""Summed-area tables of the moments of depth: the four moments of any window in sixteen look-ups.

A table holds at (x, y) the sum of all texels left of x and above y; the sum over a window is a
difference of four such numbers, read between the entries where the window's ends cut texels, which
is the exact area filter. Differences of large numbers lose digits: the sums are formed in float64
and kept as pairs of float32 (48 bits), as JAX takes no float64 unless told so. Adding noise of
2^-48 N^2 to a window's sum, they ask for a bias of the moments that shrinks with its area.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64, Int

from asmjax.buffers import double
from asmjax.shadow.soft.hamburger import ALPHA

ROUNDING = 2.0**-44
"""Bias of moments for each texel of the map per texel of the window: sixteen roundings, which is
what `ALPHA` has of those of float32."""

BYTES = 32
"""Bytes of an entry."""

BEYOND = 1e-3
"""Part of the range of depths that what is nowhere hit lies behind all that is."""

NARROWEST = 1e-3
"""The range of depths is at least this part of the depth itself: below it, rounding of depths would
count."""


class Sums(NamedTuple):
    """The moments of all faces' depths, which are scaled to [-1, 1].

    Attributes:
        table: (entries, 8) float32: high and low parts of the sums of x, x^2, x^3, x^4; entry
            (face * (N + 1) + y) * (N + 1) + x.
        scale: (2,) float32: depth in the middle of the range, and half the range, scene units.
    """

    table: Array
    scale: np.ndarray | Array


def summed(depth: np.ndarray) -> Sums:
    """The sums of depths (faces, N, N) float32, +inf where nothing is hit."""
    hit = np.isfinite(depth)
    nearest = float(depth.min(where=hit, initial=np.inf)) if hit.any() else 0.0
    farthest = float(depth.max(where=hit, initial=-np.inf)) if hit.any() else 1.0
    half = max((farthest - nearest) / 2, NARROWEST * abs(farthest)) * (1 + BEYOND)
    # As float32 has them, for both the texels and who is compared with them.
    scale = np.array([(nearest + farthest) / 2, half], np.float32)
    scaled = np.where(hit, (depth.astype(np.float64) - scale[0]) / scale[1], 1.0).clip(-1, 1)
    faces, side, _ = depth.shape
    table = np.zeros((faces, side + 1, side + 1, 8), np.float32)
    power = np.ones_like(scaled)
    for k in range(4):
        power *= scaled
        total = power.cumsum(axis=1).cumsum(axis=2)
        high = total.astype(np.float32)
        table[:, 1:, 1:, k] = high
        table[:, 1:, 1:, 4 + k] = total - high
    return Sums(jax.device_put(table.reshape(-1, 8)), scale)


def window_moments(
    sums: Sums,
    face: Int[Array, " n"],
    low: Float64[Array, "2 n"],
    high: Float64[Array, "2 n"],
    resolution: int,
) -> tuple[Float64[Array, "4 n"], Float64[Array, " n"]]:
    """Moments of the windows from `low` to `high` (columns and rows, in texels, inside the map),
    and the bias that they need. Call it with float64 enabled.

    They have gradients in the windows' ends, and none in `sums`: texels are what rays met.
    """
    total = _window_sums(jnp.concatenate([low, high]), sums.table, face, resolution)
    width, height = high - low
    area = width * height
    alpha = jnp.maximum(ALPHA["float64"], ROUNDING * resolution**2 / area)
    return total / area, alpha


@functools.partial(jax.custom_jvp, nondiff_argnums=(3,))
def _window_sums(
    ends: Float64[Array, "4 n"], table: Array, face: Int[Array, " n"], resolution: int
) -> Float64[Array, "4 n"]:
    """Sums of the windows whose `ends` are columns and rows of one corner, then of the other."""
    side = resolution + 1

    def ends_of(start, end):
        """Entries (4, n) along one axis, and their weights: before and after both ends."""
        found = []
        for at, sign in ((start, -1.0), (end, 1.0)):
            before = jnp.clip(jnp.floor(at), 0, resolution - 1)
            first = jax.lax.convert_element_type(before, jnp.int32)
            found += [(first, sign * (1 - (at - before))), (first + 1, sign * (at - before))]
        index, weight = zip(*found, strict=True)
        return jnp.stack(index), jnp.stack(weight)

    (columns, across), (rows, down) = (ends_of(ends[k], ends[2 + k]) for k in range(2))

    # A loop: sixteen gathers written out take ten seconds to compile.
    def added(k, total):
        x, y = k % 4, k // 4
        entry = table[(face * side + rows[y]) * side + columns[x]]
        return total + (across[x] * down[y])[:, None] * (
            double(entry[:, :4]) + double(entry[:, 4:])
        )

    none = jnp.zeros((*face.shape, 4), jnp.float64)
    return jax.lax.fori_loop(0, 16, added, none).T


@_window_sums.defjvp
def _window_sums_pushed(resolution: int, given, pushes):
    """The loop would be transposed when float64 is off again, which JAX takes for float32; products
    with slopes, formed here, keep what they are."""
    ends, table, face = given

    def sums(ends):
        return _window_sums.fun(ends, table, face, resolution)

    with jax.enable_x64(True):
        total = sums(ends)
        # Each point has its own four ends: four pushes are all slopes.
        each = jnp.eye(4, dtype=ends.dtype)[..., None] * jnp.ones_like(ends)
        slopes = jax.vmap(lambda push: jax.jvp(sums, (ends,), (push,))[1])(each)
        pushed = sum(slopes[k] * pushes[0][k] for k in range(4))
    return total, pushed


def scaled(sums: Sums, depth: Float[Array, " n"]) -> Float64[Array, " n"]:
    """Depths as the moments have them. Call it with float64 enabled."""
    middle, half = (double(jnp.asarray(sums.scale)[k]) for k in range(2))
    return jnp.clip((double(depth) - middle) / half, -1, 1)


def unscaled(sums: Sums, depth: Float64[Array, " n"]) -> Float64[Array, " n"]:
    """Scene units from what the moments have. Call it with float64 enabled."""
    middle, half = (double(jnp.asarray(sums.scale)[k]) for k in range(2))
    return middle + half * depth
