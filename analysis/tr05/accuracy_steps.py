"""Accuracy of maps: at equal bytes, and as their texels predict it."""

from math import isqrt

import numpy as np

from asmjax.options import MEGABYTE, RunOptions
from asmjax.preparation import calibrated
from asmjax.report.figures.aliasing_scatter import Point, draw_scatter
from asmjax.shadow import (
    AdaptiveShadowMap,
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    ShadowAlgorithm,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
    UniformShadowMap,
)
from tr05.setting import Setting, at_size, measured_row, scene_of, setting_of
from tr05.sizes import Analysis

KEPT = ("predicted", "measured", "edge_pixels", "edge_share")
"""What the record keeps of each map's displacement."""

LEAST_SHARE = 0.1
"""Maps so coarse that a smaller part of the edges stands alone are left out: what is left of them
are the odd ones."""

TABLES = 20_000
"""Bytes that the tables of a map of charts take at most."""

PREDICTED: dict[str, type] = {
    "uniform": UniformShadowMap,
    "trapezoidal": TrapezoidalShadowMap,
    "light-space": LightSpaceShadowMap,
    "logarithmic": LogarithmicShadowMap,
    "partitioned": PartitionedShadowMap,
    "subdivided": SubdividedShadowMap,
}
"""Maps whose displacement is predicted, by name."""


def equal_bytes(analysis: Analysis) -> None:
    """Adaptive, subdivided and sample-distribution maps of as many bytes, scene by scene."""
    sizes = analysis.sizes
    record = analysis.record["equal_bytes"] = {}
    for name in sizes.compared:
        setting = _setting(analysis, name)
        if setting is None:
            continue
        rows = []
        for label, algorithm in _of_bytes(setting, int(sizes.memory_mb * MEGABYTE)).items():
            rows.append({**measured_row(setting, algorithm).numbers, "label": label})
        record[name] = setting.record() | {"rows": rows}
        analysis.kept.write()


def _of_bytes(setting: Setting, most: int) -> dict[str, ShadowAlgorithm]:
    """The maps of at most so many bytes."""
    scene, faces = setting.scene, setting.frame.faces
    side = isqrt((most - TABLES) // (4 * faces))
    options = RunOptions(scene=scene.name)
    costs = calibrated(scene, setting.light, setting.rays, setting.frame, options)
    return {
        "ASM": AdaptiveShadowMap(memory_bytes=most, cost_model=costs),
        "SSM*": SubdividedShadowMap(side, parts=2),
        "SDSM": PartitionedShadowMap(side, partitions=4),
    }


def displacements(analysis: Analysis) -> None:
    """Pixels that go wrong per pixel of edge: what the texels' sizes say, and what was counted."""
    sizes = analysis.sizes
    rows = analysis.record["displacements"] = []
    for name in sizes.compared:
        setting = _setting(analysis, name)
        if setting is None:
            continue
        for family, make in PREDICTED.items():
            for resolution in analysis.kept.bar(sizes.resolutions, f"{name}, {family}"):
                numbers = measured_row(setting, make(resolution)).numbers
                rows.append({"scene": name, "map": family, "resolution": resolution}
                            | {key: numbers[key] for key in KEPT})  # fmt: skip
        analysis.kept.write()
    points = [Point(row["map"], row["scene"], row["predicted"], row["measured"]) for row in rows
              if row["edge_share"] >= LEAST_SHARE and row["predicted"] > 0]  # fmt: skip
    found = analysis.record["explained"] = explained(
        np.array([p.predicted for p in points]), np.array([p.measured for p in points])
    )
    drawn = draw_scatter(points, found)
    analysis.kept.figure("displacements", drawn, "measured against predicted displacement")


def explained(predicted: np.ndarray, measured: np.ndarray) -> dict[str, float]:
    """R^2 of measured against predicted: the identity and a fitted line, on both kinds of axes.

    Points of no wrong pixel have no logarithm and are left out of the logarithmic ones.
    """
    some = measured > 0
    found: dict[str, float] = {"points": int(predicted.size)}
    for axes, x, y in (
        ("linear", predicted, measured),
        ("log-log", np.log(predicted[some]), np.log(measured[some])),
    ):
        spread = float(((y - y.mean()) ** 2).sum()) if y.size else 0.0
        if spread == 0:
            continue
        slope, offset = np.polyfit(x, y, 1)
        for line, expected in (("identity", x), ("fitted line", slope * x + offset)):
            found[f"{axes}, {line}"] = 1 - float(((y - expected) ** 2).sum()) / spread
        found[f"{axes}, slope"] = float(slope)
    return found


def _setting(analysis: Analysis, name: str) -> Setting | None:
    scene = scene_of(analysis, name)
    if scene is None:
        return None
    return setting_of(scene, at_size(scene.view(), analysis.sizes.pixels), 1)
