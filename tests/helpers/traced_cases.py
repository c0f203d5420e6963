"""Cases of any analytic shapes, whose truth is a float64 shadow ray for each pixel."""

from collections.abc import Sequence

import numpy as np

from asmjax.geometry import LightFrame
from asmjax.hard_cases import Scene, Setup, traced
from asmjax.scene.spec import LightSpec, Shape, ViewSpec
from helpers.analytic_cases import Case


def traced_case(
    shapes: Sequence[Shape], view: ViewSpec, light: LightSpec, frame: LightFrame | None = None
) -> Case:
    """Every pixel that sees something is judged; edges have no known distance (infinite).

    `frame` is that of another view, for views that the light does not reach.
    """
    return case_of_scene(traced(shapes, view, light, frame))


def hard_case(setup: Setup, side: int) -> Case:
    """A setup of `asmjax.hard_cases` at `side` x `side` pixels."""
    return case_of_scene(setup.traced(side))


def case_of_scene(scene: Scene) -> Case:
    return Case(
        shapes=scene.shapes,
        view=scene.view,
        light=scene.light,
        eye=scene.eye,
        frame=scene.frame,
        rays=scene.rays,
        judged=scene.judged,
        expected=scene.expected,
        edge_distance=np.full(scene.eye.valid.size, np.inf),
    )
