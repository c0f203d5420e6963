"""Figures 1 and 9 of TR05-024, measured: aliasing of the maps in an alley of 1 : 100."""

import numpy as np

from asmjax.experiment import Measured
from asmjax.report.figures import RunPictures
from asmjax.report.figures.aliasing_beside import draw_aliasing
from asmjax.report.measured import light_parts
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import SubdividedShadowMap, TrapezoidalShadowMap
from tr05.setting import (
    Setting,
    at_size,
    from_above_ground,
    measured_row,
    scene_of,
    setting_of,
    sun_along,
)
from tr05.sizes import Analysis

ALONG_DEG = 10.0
"""Angle between light and view at which warping algorithms have no axis to warp along."""

HEIGHT, NEAR = 0.68, 0.9
"""Eye height and near plane, metres: visible far / near is about 100 with a million triangles, as
in figure 9. Only the railing beside the eye is cut away."""


def alley_view(scene, pixels: int) -> ViewSpec:
    """Along the plant's alley, from near the ground."""
    return from_above_ground(at_size(scene.view("alley"), pixels), HEIGHT, NEAR)


def alley(analysis: Analysis) -> None:
    """TSM and SSM under the plant's own sun and under one along the view."""
    sizes = analysis.sizes
    scene = scene_of(analysis, sizes.alley)
    assert scene is not None
    view = alley_view(scene, sizes.pixels)
    small, large = sizes.sides
    maps = {
        f"TSM {short(small)}": TrapezoidalShadowMap(small),
        f"TSM {short(large)}": TrapezoidalShadowMap(large),
        f"SSM {short(small)}": SubdividedShadowMap(small, parts=1),
        f"SSM* {short(small)}": SubdividedShadowMap(small, parts=2),
    }
    record = analysis.record["alley"] = {}
    for key, light in (("sun", None), ("along", sun_along(view, ALONG_DEG))):
        setting = setting_of(scene, view, light=light)
        found = {name: measured_row(setting, algorithm) for name, algorithm in maps.items()}
        rows = [{**row.numbers, "label": name} for name, row in found.items()]
        record[key] = setting.record() | {"rows": rows}
        size = setting.eye.size
        titled = pictures(
            setting, {name: row.visibility.reshape(size) for name, row in found.items()}
        )
        drawn = draw_aliasing(
            titled,
            {name: row.maps.m.reshape(size) for name, row in found.items()},
            worst=f"TSM {short(small)}",
        )
        words = f"{setting.light.name}: shadows and m of TSM and SSM"
        analysis.kept.figure(f"alley_{key}", drawn, words)
        analysis.kept.write()


def pictures(setting: Setting, visibilities: dict[str, np.ndarray]) -> RunPictures:
    """What the eye sees under each shadow."""
    eye, truth = setting.eye, setting.truth
    direct, ambient = light_parts(eye, setting.frame)
    assert isinstance(truth, Measured)
    return RunPictures(
        title=f"{setting.scene.name}, {setting.light.name}, far / near {setting.far_near:.0f}",
        direct=direct,
        ambient=ambient,
        valid=eye.valid.reshape(eye.size),
        truth=truth.visibility.reshape(eye.size),
        visibilities=visibilities,
    )


def short(side: int) -> str:
    """1K for 1024 texels."""
    return f"{side // 1024}K" if side % 1024 == 0 else str(side)
