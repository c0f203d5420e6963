"""Analytic scenes under lights that have a size, and their visibility in truth."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from asmjax.geometry import AreaLight, rectangle_light
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import (
    PlaneFunction,
    a2_square_light,
    a4_disc_light,
    a5_half_plane,
)
from asmjax.scene.closed_forms import half_plane_square_visibility
from asmjax.scene.lights import light_frame
from asmjax.scene.soft_visibility import analytic_soft_visibility
from asmjax.scene.spec import LightSpec, Rectangle, Shape, ViewSpec
from asmjax.shadow import ShadowAlgorithm
from helpers.analytic_cases import Case, case_of, kept_arrays
from helpers.counting import CountingRays

HEIGHT = 5.0
"""Of the lights above the receiver z = 0."""

SIDE = 64
"""Pixels a side."""

FLOOR = Rectangle("floor", (0.0, 0.0, 0.0), (6.0, 0.0, 0.0), (0.0, 6.0, 0.0))
ABOVE = ViewSpec("v", (0.6, -0.8, 9.0), (0.2, 0.1, 0.0), fov_x_deg=30.0, width=SIDE, height=SIDE)


def asked(algorithm: ShadowAlgorithm, case: Case):
    """State, and visibility of the case's pixels."""
    state = algorithm.build(case.eye, case.frame, case.rays)
    return state, np.asarray(algorithm.visibility(state, case.eye.points))


def square_light(half: float, height: float = HEIGHT) -> AreaLight:
    """Above the origin, along x and y, emitting downwards."""
    return rectangle_light((0.0, 0.0, height), (0.0, half, 0.0), (half, 0.0, 0.0))


def soft_case(name: str, side: int, half: float = 0.6, occluder_height: float = 2.0) -> Case:
    """A2 or A4, or the half-plane of A5 below a disk ("a5") or a square ("a5_square") of half side
    `half`; `expected` is the visible share of the light."""
    if name == "a2":
        scene = a2_square_light(1.0, half, HEIGHT, occluder_height)
    elif name == "a4":
        scene = a4_disc_light(1.0, half, HEIGHT, occluder_height)
    else:
        scene = a5_half_plane(half, HEIGHT, occluder_height)
    light, soft = scene.soft_light(), scene.soft_visibility
    if name == "a5_square":
        light = replace(light, area=square_light(half))
        soft = square_ramp(penumbra(half, occluder_height))
    view = next(iter(scene.spec.views.values())).resized(side, side)
    case = case_of(scene, scene.spec.shapes, view, light)
    x, y, _ = np.where(case.eye.valid, case.eye.world, 0.0)
    assert soft is not None
    return replace(case, judged=case.eye.shape == 0, expected=soft(x, y))


def square_ramp(width: float) -> PlaneFunction:
    """Of the half-plane x < 0 below a square light."""
    return lambda x, y: half_plane_square_visibility(x, width) + 0 * y


def penumbra(half: float, occluder_height: float) -> float:
    """Width of the penumbra of a straight edge below a square light."""
    return 2 * half * occluder_height / (HEIGHT - occluder_height)


def texel_on_receiver(case: Case, resolution: int, margin: np.ndarray | None = None) -> float:
    """The longer side of a texel on z = 0, for light straight from above; scene units."""
    wide = 1 if margin is None else 1 + 2 * margin
    extent = case.frame.extent * wide / resolution
    return float(extent.max()) * (HEIGHT if case.frame.perspective else 1.0)


def traced_soft_case(
    shapes: Sequence[Shape], view: ViewSpec, light: LightSpec, strata: int = 8
) -> Case:
    """Of any shapes, by float64 rays to two points in each of `strata` x `strata` cells of the
    light; the first shape is judged."""
    eye = analytic_eye(shapes, view)
    frame = light_frame(light, eye, scene_bounds(shapes))
    truth = analytic_soft_visibility(shapes, eye, frame, strata, 2)
    return Case(
        shapes=tuple(shapes),
        view=view,
        light=light,
        eye=eye,
        frame=frame,
        rays=AnalyticRays(shapes),
        judged=eye.shape == 0,
        expected=truth.visibility,
        edge_distance=np.full(eye.valid.size, np.inf),
    )


def mean_error(case: Case, visibility) -> float:
    """Mean absolute error of the judged pixels."""
    return float(np.abs(np.asarray(visibility, np.float64) - case.expected)[case.judged].mean())


def ramp_width(case: Case, visibility, least: float = 0.1) -> float:
    """Width in x of a linear ramp from 0 to 1, by least squares where it is neither."""
    lit = np.asarray(visibility, np.float64)
    inside = case.judged & (lit > least) & (lit < 1 - least)
    assert inside.sum() > 20
    return 1 / float(np.polyfit(case.eye.world[0, inside], lit[inside], 1)[0])


def lone_floor(tilt_deg: float) -> Case:
    """The floor alone, below a square light that stands so far from its normal: lit all over."""
    tilt = np.radians(tilt_deg)
    place = tuple(6.0 * np.array([0.8 * np.sin(tilt), 0.6 * np.sin(tilt), np.cos(tilt)]))
    light = LightSpec("lamp", "point", position=place, area=square_light(0.4).at(place))
    return traced_soft_case((FLOOR,), ABOVE, light, 1)


def built_and_kept(algorithm, case: Case):
    """Rays, state, visibility, and the state of an update in which nothing has moved, of an
    algorithm that keeps its map: costs are those of the arrays and of the rays that were cast."""
    rays = CountingRays(case.rays)
    state = algorithm.build(case.eye, case.frame, rays)
    cost = algorithm.cost(state)
    assert cost.bytes == sum(array.nbytes for array in kept_arrays(state))
    assert cost.bytes <= algorithm.memory(1).state.bytes
    assert (cost.rays, cost.passes) == (rays.texels, rays.launches)
    lit = np.asarray(algorithm.visibility(state, case.eye.points))
    kept = algorithm.update(state, case.eye, case.frame, rays)
    assert algorithm.cost(kept).rays == 0 and rays.launches == cost.passes
    return rays, state, lit, kept
