"""Charts on the device, and where receivers lie in them.

Warps magnify what is near the eye, up to the ratio of the far and near distance, so float32 image
coordinates do not suffice: positions are relative to the eye, rows of coefficients are pairs of
float32, and a receiver's place is formed in float64 from them, as for the adaptive map's pages.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from asmjax.buffers import Anchor, Receivers, SurfacePoints, double, image_rows
from asmjax.geometry import Charts
from asmjax.numerics import dot

FEW_CHARTS = 16
"""Up to so many, a receiver's coefficients are chosen among all; beyond, they are gathered."""


class Exact(NamedTuple):
    """Float64 numbers as `high` + `low` in float32, which is what JAX takes by default."""

    high: np.ndarray | Array
    low: np.ndarray | Array

    def doubles(self) -> Array:
        """The numbers in float64; call it with float64 enabled."""
        return double(self.high) + double(self.low)


def exact(a: np.ndarray) -> Exact:
    """`a` (float64) as a pair."""
    high = np.asarray(a, np.float32)
    return Exact(high, (a - high.astype(np.float64)).astype(np.float32))


class ChartTable(NamedTuple):
    """k charts as the kernels take them; see `Charts`.

    Attributes:
        to_chart, from_chart: (3, 3, k).
        log: (k,).
        face, columns, rows, first: (k,) int32.
        lines: (k, 4, 3) float32.
        depths: (k, 2) float32 eye depths.
    """

    to_chart: Exact
    from_chart: Exact
    log: Exact
    face: np.ndarray | Array
    columns: np.ndarray | Array
    rows: np.ndarray | Array
    first: np.ndarray | Array
    lines: np.ndarray | Array
    depths: np.ndarray | Array


def table_of(charts: Charts) -> ChartTable:
    """The charts, on the host."""
    columns, rows = charts.size.T.astype(np.int32)
    return ChartTable(
        to_chart=exact(np.moveaxis(charts.to_chart, 0, -1)),
        from_chart=exact(np.moveaxis(charts.from_chart, 0, -1)),
        log=exact(charts.log),
        face=charts.face.astype(np.int32),
        columns=columns,
        rows=rows,
        first=charts.first.astype(np.int32),
        lines=charts.lines.astype(np.float32),
        depths=charts.depths.astype(np.float32),
    )


def chart_of(
    table: ChartTable, receivers: Receivers, eye_depth: Float[Array, " n"]
) -> tuple[Int[Array, " n"], Bool[Array, " n"]]:
    """The first chart (n,) that holds each receiver, and whether there is one."""
    u, v = receivers.uv
    face, depths = jnp.asarray(table.face), jnp.asarray(table.depths)
    lines = jnp.asarray(table.lines).astype(u.dtype)

    def look(k, carry):
        chosen, found = carry
        holds = (receivers.face == face[k]) & ~found
        holds &= (eye_depth >= depths[k, 0]) & (eye_depth < depths[k, 1])
        for line in range(lines.shape[1]):
            a, b, c = (lines[k, line, i] for i in range(3))
            holds &= a * u + b * v + c >= 0
        return jnp.where(holds, k, chosen), found | holds

    # Written out whole, some hundred charts take minutes to compile; by twos they are as fast.
    none = jnp.zeros_like(receivers.face), jnp.zeros_like(receivers.facing)
    return jax.lax.fori_loop(0, face.shape[0], look, none, unroll=2)


class Place(NamedTuple):
    """Where receivers lie in their charts.

    Attributes:
        flat: (n,) int32 number of the texel that a receiver lies in.
        offset: (2, n) image offset (du, dv) from the receiver to that texel's centre.
        per_texel: (2, 2, n) image motion per texel along s and t: [k, i] is d(u, v)_k / d(s, t)_i.
        inside: (n,) whether the chart holds the receiver, give or take a texel. Of the others
            everything else means nothing.
        texel: (2, n) int32 column and row of that texel.
        size: (2, n) int32 columns and rows of the chart.
        fraction: (2, n) in [0, 1], of that texel, where the receiver lies.
        nearing: (2, n) part by which the warp's homogeneous scale grows per texel along s and t.
        rate: (n,) part by which a row grows over the one before; 0 without a logarithm.
    """

    flat: Int[Array, " n"]
    offset: Float[Array, "2 n"]
    per_texel: Float[Array, "2 2 n"]
    inside: Bool[Array, " n"]
    texel: Int[Array, "2 n"]
    size: Int[Array, "2 n"]
    fraction: Float[Array, "2 n"]
    nearing: Float[Array, "2 n"]
    rate: Float[Array, " n"]


def place_in(
    table: ChartTable,
    chart: Int[Array, " n"],
    points: SurfacePoints,
    receivers: Receivers,
    anchor: Anchor,
    perspective: bool,
) -> Place:
    """The `Place` of each receiver in the chart that was chosen for it."""
    dtype, facing = points.position.dtype, receivers.facing
    with jax.enable_x64(True):
        is_chart = [chart == k for k in range(table.face.shape[0])]

        def of(values):
            values = jnp.asarray(values)
            if len(is_chart) > FEW_CHARTS:
                return values[..., chart]
            chosen = values[..., 0]
            if len(is_chart) > 1:
                # Chosen one after the other, in the same loop as what follows: a gather per number
                # takes twice as long as all the rest.
                chosen = chosen[..., None]
                for k, mine in enumerate(is_chart):
                    chosen = jnp.where(mine, values[..., k, None], chosen) if k else chosen
            return chosen

        image = image_rows(points, anchor, receivers.face, perspective)
        weight = jnp.where(facing, image[2], 1)
        u, v = (jnp.where(facing, row, 0.5) / weight for row in image[:2])
        to_chart, from_chart = of(table.to_chart.doubles()), of(table.from_chart.doubles())
        log = of(table.log.doubles())
        columns, rows = (double(of(n)) for n in (table.columns, table.rows))
        across, along, scale = (row[0] * u + row[1] * v + row[2] for row in to_chart)
        # Beyond the warp's horizon signs are turned round.
        ahead = facing & (scale > 0)
        scale = jnp.where(ahead, scale, 1)
        s, t = (jnp.where(ahead, x / scale, 0.5) for x in (across, along))
        straight = log == 0
        bent = jnp.where(straight, 1, log)
        rate = jnp.log1p(bent)
        grown = jnp.maximum(bent * t, -1 + 1e-12)
        t = jnp.where(straight, t, jnp.log1p(grown) / jnp.where(straight, 1, rate))
        at = s * columns, t * rows
        column, row = (jnp.floor(x) for x in at)
        inside = ahead & (column >= -1) & (column <= columns) & (row >= -1) & (row <= rows)
        column, row = jnp.clip(column, 0, columns - 1), jnp.clip(row, 0, rows - 1)
        fraction = [jnp.clip(x - k, 0, 1) for x, k in zip(at, (column, row), strict=True)]
        # The way back from the texel's centre, and how fast it moves there.
        s, t = (column + 0.5) / columns, (row + 0.5) / rows
        pace = jnp.where(straight, 1, jnp.exp(t * rate) * rate / bent)
        t = jnp.where(straight, t, jnp.expm1(t * rate) / bent)
        scale = dot(from_chart[2], (s, t, 1))
        centre = [dot(from_chart[k], (s, t, 1)) / scale for k in range(2)]
        steps = (1 / columns, pace / rows)
        per_texel = [
            [(from_chart[k, i] - centre[k] * from_chart[2, i]) / scale * steps[i] for i in range(2)]
            for k in range(2)
        ]
        nearing = [from_chart[2, i] / scale * steps[i] for i in range(2)]
        rate = jnp.where(straight, 0, rate / rows)
        offset = [centre[0] - u, centre[1] - v]
        index = row * columns + column
        index, texel, size = (
            jax.tree.map(lambda a: jax.lax.convert_element_type(a, jnp.int32), part)
            for part in (index, [column, row], [columns, rows])
        )
        offset, per_texel, fraction, nearing, rate = (
            jax.tree.map(lambda a: jax.lax.convert_element_type(a, dtype), part)
            for part in (offset, per_texel, fraction, nearing, rate)
        )
    return Place(
        jnp.asarray(of(table.first)) + index,
        jnp.stack(offset),
        jnp.stack([jnp.stack(part) for part in per_texel]),
        inside,
        jnp.stack(texel),
        jnp.stack(size),
        jnp.stack(fraction),
        jnp.stack(nearing),
        rate,
    )
