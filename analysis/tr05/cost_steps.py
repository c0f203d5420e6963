"""Figure 10 and table 2 of TR05-024, measured: what subdivisions cost."""

from dataclasses import replace

import numpy as np

from asmjax.experiment import measure_rays, median_by_stage
from asmjax.experiment.methods import queried
from asmjax.experiment.overdraw import CasterBoxes, caster_boxes, chunks, overdraw, parts_of
from asmjax.report.figures.aliasing_times import draw_frame_times
from asmjax.shadow import Cost, ShadowAlgorithm, SubdividedShadowMap, TrapezoidalShadowMap
from tr05.aliasing_steps import alley_view, short
from tr05.setting import Setting, at_size, scene_of, setting_of
from tr05.sizes import Analysis

FAMILIES = {"TSM": 0, "SSM": 1, "SSM*": 2}
"""Parts of each face by the paper's name; 0 for the trapezoidal map."""

FEW_SHAPES = 200
"""Below so many shapes objects are chunks of triangles as well."""


def algorithm_of(name: str, side: int) -> TrapezoidalShadowMap | SubdividedShadowMap:
    parts = FAMILIES[name]
    return SubdividedShadowMap(side, parts=parts) if parts else TrapezoidalShadowMap(side)


def frame_times(analysis: Analysis) -> None:
    """Fit, cast and query of each map from nothing, and the rays of the same frame: medians.

    All maps take turns, so that another load on the machine meets them alike.
    """
    sizes = analysis.sizes
    scene = scene_of(analysis, sizes.alley)
    assert scene is not None
    setting = setting_of(scene, alley_view(scene, sizes.pixels))
    shadow_rays = [scene.shadow_rays(setting.eye, setting.frame, setting.rays)]
    maps = [(name, side, algorithm_of(name, side)) for side in sizes.sides for name in FAMILIES]
    stages: list[list[dict[str, float]]] = [[] for _ in maps]
    rays, texels = [], [0] * len(maps)
    for turn in analysis.kept.bar(range(sizes.repeats + 1), "frame times"):
        for k, (_, _, algorithm) in enumerate(maps):
            found = measure_once(algorithm, setting)
            texels[k] = found.rays
            if turn:
                stages[k].append(found.seconds)
        traced = measure_rays(shadow_rays, [setting.eye], 1)
        if turn:
            rays.append(traced.cost.seconds["query"])
    rows = []
    for (name, side, _), times, cast in zip(maps, stages, texels, strict=True):
        seconds = median_by_stage(times)
        rows.append({"name": name, "side": side, "label": f"{name} {short(side)}",
                     "texels_cast": cast, "total": sum(seconds.values()),
                     "seconds": {"fit": seconds["analysis"], "cast": seconds["build"],
                                 "query": seconds["query"]}})  # fmt: skip
    traced = float(np.median(rays))
    analysis.record["figure_10"] = setting.record() | {"rows": rows, "rays": traced}
    drawn = draw_frame_times(rows, traced, f"{setting.scene.name}, {sizes.pixels}² pixels")
    analysis.kept.figure("figure_10", drawn, "time of a frame by stage")


def measure_once(algorithm: ShadowAlgorithm, setting: Setting) -> Cost:
    """Build from nothing and query, once; `seconds` with the query."""
    state = algorithm.build(setting.eye, setting.frame, setting.rays)
    cost = algorithm.cost(state)
    _, query = queried(algorithm, state, [setting.eye], 1)
    return replace(cost, seconds=cost.seconds | {"query": query})


def overdrawn(analysis: Analysis) -> None:
    """How many objects a rasteriser would draw for the subdivisions of one view."""
    sizes = analysis.sizes
    rows = analysis.record["overdraw"] = []
    for name in sizes.overdrawn:
        scene = scene_of(analysis, name)
        if scene is None:
            continue
        setting = setting_of(scene, at_size(scene.view(), sizes.pixels))
        for kind, boxes in objects_of(setting, sizes.chunk).items():
            one = parts_of(
                TrapezoidalShadowMap().charts(setting.eye, setting.frame),
                setting.eye, setting.frame,
            )  # fmt: skip
            for family in ("SSM", "SSM*"):
                charts = algorithm_of(family, sizes.sides[0]).charts(setting.eye, setting.frame)
                parts = parts_of(charts, setting.eye, setting.frame)
                found = overdraw(parts, one, boxes)
                rows.append({"scene": name, "objects_are": kind, "objects": boxes.count,
                             "map": family, **found.record()})  # fmt: skip
        analysis.kept.write()


def objects_of(setting: Setting, chunk: int) -> dict[str, CasterBoxes]:
    """The scene's shapes as objects, and chunks of their triangles where shapes are few."""
    geometry = setting.scene.geometry
    prim = np.arange(int(geometry.first_prim[-1]))
    shape = np.repeat(np.arange(geometry.first_prim.size - 1), np.diff(geometry.first_prim))
    meshes = geometry.on_mesh(prim, shape)
    prim, shape = prim[meshes], shape[meshes]
    corners = geometry.corners(prim, shape)
    found = {"shapes": caster_boxes(corners, shape, setting.frame)}
    if found["shapes"].count < FEW_SHAPES:
        owner = chunks(np.mean(corners, axis=0), shape, chunk)
        found[f"chunks of {chunk} triangles"] = caster_boxes(corners, owner, setting.frame)
    return found
