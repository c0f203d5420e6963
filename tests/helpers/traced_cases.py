"""Cases of any analytic shapes, whose truth is a float64 shadow ray for each pixel."""

from collections.abc import Sequence

import numpy as np

from asmjax.geometry import LightFrame, in_domain, towards_light
from asmjax.scene.analytic import closest
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, Shape, ViewSpec
from helpers.analytic_cases import Case

LIFTED = 1e-9
"""Shadow rays start this much of their coordinates' size above the surface."""


def traced_case(
    shapes: Sequence[Shape], view: ViewSpec, light: LightSpec, frame: LightFrame | None = None
) -> Case:
    """Every pixel that sees something is judged; edges have no known distance (infinite).

    `frame` is that of another view, for views that the light does not reach.
    """
    eye = analytic_eye(shapes, view)
    if frame is None:
        frame = light_frame(light, eye, scene_bounds(shapes))
    return Case(
        shapes=tuple(shapes),
        view=view,
        light=light,
        eye=eye,
        frame=frame,
        rays=AnalyticRays(shapes),
        judged=np.asarray(eye.valid),
        expected=_lit(shapes, eye, frame).astype(float),
        edge_distance=np.full(eye.valid.size, np.inf),
    )


def _lit(shapes: Sequence[Shape], eye, frame: LightFrame) -> np.ndarray:
    world = np.where(eye.valid, eye.world, 0.0)
    size = np.maximum(1.0, np.abs(world).max(axis=0))
    start = world + LIFTED * size * eye.normal
    towards = towards_light(frame, start)
    _, blocker, _ = closest(shapes, start, towards, 0.0, 1.0 if frame.perspective else np.inf)
    facing = np.einsum("in,in->n", eye.normal, towards) > 0
    return eye.valid & facing & in_domain(frame, world) & (blocker < 0)
