"""Cases under transformations that must not matter: of scale, of place, of the pixels' order."""

from dataclasses import replace

import numpy as np

from asmjax.buffers import SurfacePoints
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import Disk, LightSpec, Mesh, Rectangle, Shape, Sphere, Vector
from helpers.analytic_cases import Case


def scaled(case: Case, factor: float) -> Case:
    """The case in other units, its light frame fitted anew; for a power of two without rounding."""

    def times(v) -> Vector:
        x, y, z = (float(c) * factor for c in v)
        return x, y, z

    def shape(s: Shape) -> Shape:
        if isinstance(s, Mesh):
            return replace(s, vertices=s.vertices * factor)
        if isinstance(s, Rectangle):
            s = replace(s, half_u=times(s.half_u), half_v=times(s.half_v))
        elif isinstance(s, Disk | Sphere):
            s = replace(s, radius=s.radius * factor)
        return replace(s, centre=times(s.centre))

    view = replace(
        case.view,
        origin=times(case.view.origin),
        target=times(case.view.target),
        near=case.view.near * factor,
        far=case.view.far * factor,
    )
    light = case.light
    if light.position is not None:
        light = replace(light, position=times(light.position))
    return refitted(replace(case, view=view), tuple(map(shape, case.shapes)), light)


def refitted(case: Case, shapes: tuple[Shape, ...], light: LightSpec) -> Case:
    """The case's view of other shapes under another light, with a frame of its own."""
    eye = analytic_eye(shapes, case.view)
    frame = light_frame(light, eye, scene_bounds(shapes))
    return replace(
        case, shapes=shapes, light=light, eye=eye, frame=frame, rays=AnalyticRays(shapes)
    )


def reordered(points: SurfacePoints, order: np.ndarray) -> SurfacePoints:
    """The same points in another order."""
    return SurfacePoints(
        position=points.position[:, order],
        normal=points.normal[:, order],
        prim=points.prim[order],
        valid=points.valid[order],
        origin=points.origin,
    )
