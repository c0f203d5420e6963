"""Cases under transformations that must not matter: of scale, of place, of the pixels' order; and
cases whose light stands anywhere, to transform.
"""

from dataclasses import replace
from typing import Literal

import equinox as eqx
import numpy as np

from asmjax.buffers import SurfacePoints
from asmjax.geometry import basis_from_axis, rectangle_light, sphere_light
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import Disk, LightSpec, Mesh, Rectangle, Shape, Sphere, Vector
from helpers.analytic_cases import Case, analytic_case, moved
from helpers.soft_cases import ABOVE, FLOOR, traced_soft_case
from helpers.traced_cases import traced_case

Kind = Literal["lamp", "sun", "bulb", "panel"]

SIZELESS: tuple[Kind, ...] = ("lamp", "sun")
"""A point light that needs three faces, and parallel rays."""

SIZED: tuple[Kind, ...] = ("bulb", "panel")
"""A sphere, and a rectangle at a slant."""

BALL = Sphere("ball", (0.3, 0.1, 1.5), 0.5)


def drawn(kind: Kind, seed: int, side: int, strata: int = 1) -> Case:
    """A sphere over a plane, its light within 0.3 units of a place that needs as many faces all
    around. Truth is a shadow ray for each pixel, or two to each of `strata`^2 parts of the light.
    """
    rng = np.random.default_rng(seed)
    x, y, z = rng.uniform(-0.3, 0.3, 3).tolist()
    if kind == "lamp":
        like = analytic_case("a6_sphere", side)
        lamp = replace(like.light, position=_sum(like.light.position, (x, y, z)))
        return traced_case(like.shapes, like.view, lamp)
    if kind == "sun":
        like = analytic_case("a6_sphere_sun", side)
        sun = replace(like.light, direction=_sum(like.light.direction, (x, y, z)))
        return traced_case(like.shapes, like.view, sun)
    place, size = (x, y, 5.0 + z), rng.uniform(0.1, 0.6)
    area = sphere_light(place, size)
    if kind == "panel":
        e_u, e_v, _ = basis_from_axis((*rng.uniform(-0.3, 0.3, 2), -1.0))
        area = rectangle_light(place, size * e_u, 0.5 * size * e_v)
    light = LightSpec(kind, "point", position=place, area=area)
    return traced_soft_case((FLOOR, BALL), ABOVE.resized(side, side), light, strata)


def _sum(one: Vector | None, other: Vector) -> Vector:
    assert one is not None
    x, y, z = np.add(one, other).tolist()
    return x, y, z


def turned(case: Case, rotation: np.ndarray, shift: np.ndarray) -> Case:
    """The case moved as one rigid body, and its light's area too."""
    other, area = moved(case, rotation, shift), case.frame.area
    if area is None:
        return other
    axes = (rotation @ v for v in (area.half_u, area.half_v, area.normal))
    area = eqx.tree_at(
        lambda a: (a.centre, a.half_u, a.half_v, a.normal), area, (other.frame.origin, *axes)
    )
    return replace(other, frame=replace(other.frame, area=area))


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
    light, area = case.light, case.light.area
    if light.position is not None:
        if area is not None:
            lengths = (area.centre, area.half_u, area.half_v)
            area = eqx.tree_at(
                lambda a: (a.centre, a.half_u, a.half_v), area, tuple(v * factor for v in lengths)
            )
        light = replace(light, position=times(light.position), area=area)
    other = replace(case, view=view, edge_distance=case.edge_distance * factor)
    return refitted(other, tuple(map(shape, case.shapes)), light)


def refitted(case: Case, shapes: tuple[Shape, ...], light: LightSpec) -> Case:
    """The case with its shapes and light given otherwise, under a frame fitted anew. Truth is taken
    over: both must be where they were, in the units and the place of the case's view. Other scenes
    are cases of their own (`traced_case`)."""
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
