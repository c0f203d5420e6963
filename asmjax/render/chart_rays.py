"""Rays through the texels of charts, formed on the device from a few numbers for each chart."""

from typing import Any

import numpy as np

from asmjax.buffers import ChartBuffer
from asmjax.geometry import Charts, LightFrame, image_to_plane


def cast_charts(mi, intersect, frame: LightFrame, charts: Charts) -> tuple:
    """Unevaluated depths and primitives, one pair for each chart, of a vectorised variant.

    Places are formed in float64: a warp magnifies what is near the eye by the ratio of far to near.

    Args:
        intersect: rays to (t, prim, shape).
    """
    import drjit as dr

    double: Any = dr.float64_array_t(mi.Float)

    def opaque(value):
        # Constants in the code would mean a new kernel for every view.
        return dr.opaque(double, float(value))

    found = []
    for k in range(charts.count):
        columns, rows = charts.size[k].tolist()
        lane = dr.arange(mi.UInt32, columns * rows)
        width = dr.opaque(mi.UInt32, columns)
        row = lane // width
        s = (double(lane - row * width) + 0.5) * opaque(1 / columns)
        t = (double(row) + 0.5) * opaque(1 / rows)
        log = float(charts.log[k])
        if log:
            t = (dr.exp(t * opaque(np.log1p(log))) - 1) * opaque(1 / log)
        face = int(charts.face[k])
        onto = image_to_plane(frame, face) @ charts.from_chart[k]
        across, along, scale = (
            dr.fma(opaque(a), s, dr.fma(opaque(b), t, opaque(c))) for a, b, c in onto
        )
        x, y = across / scale, along / scale
        e_u, e_v, e_w = frame.rotation[face]
        base = e_w if frame.perspective else frame.origin
        at = [
            mi.Float(dr.fma(opaque(e_u[i]), x, dr.fma(opaque(e_v[i]), y, opaque(base[i]))))
            for i in range(3)
        ]
        fixed = frame.origin if frame.perspective else e_w
        fixed = [dr.opaque(mi.Float, float(a)) for a in fixed]
        ends = (fixed, at) if frame.perspective else (at, fixed)
        ray = mi.Ray3f(mi.Point3f(*ends[0]), mi.Vector3f(*ends[1]))
        depth, prim, _ = intersect(ray)
        found.append((depth, prim))
    return tuple(found)


def chart_buffer_of(found: list[tuple[np.ndarray, np.ndarray]]) -> ChartBuffer:
    """The charts' texels one after the other."""
    depth, prim = (np.concatenate(parts) for parts in zip(*found, strict=True))
    assert depth.dtype == np.float32 and prim.dtype == np.int32
    return ChartBuffer(depth, prim)
