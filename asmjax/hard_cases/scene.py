"""Scenes of hard cases: analytic shapes, an eye, a light, and the visibility in truth."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Optional

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.geometry import LightFrame, in_domain, towards_light
from asmjax.scene.analytic import closest
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.lights import light_frame
from asmjax.scene.soft_visibility import analytic_soft_visibility
from asmjax.scene.spec import LightSpec, Shape, ViewSpec

LIFTED = 1e-9
"""Shadow rays start this much of their coordinates' size above the surface."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene as an algorithm sees it; n pixels.

    Attributes:
        judged: (n,) bool, pixels that see something.
        expected: (n,) float64 visibility in truth, where judged: 0 or 1, or of a light with a size
            the visible share of it.
    """

    shapes: tuple[Shape, ...]
    view: ViewSpec
    light: LightSpec
    eye: EyeBuffer
    frame: LightFrame
    rays: LightRays
    judged: np.ndarray
    expected: np.ndarray

    @property
    def is_soft(self) -> bool:
        """Whether its light has a size."""
        return self.frame.area is not None

    def wrong(self, visibility) -> np.ndarray:
        """(n,) judged pixels whose visibility is off by half of the light or more."""
        return self.judged & (np.abs(np.asarray(visibility, float) - self.expected) >= 0.5)


@dataclass(frozen=True, eq=False)
class Setup:
    """A scene before anything is cast, at any number of pixels.

    Attributes:
        frame_of: another view, to whose receivers the light is fitted: for views of nothing that
            the light reaches.
        same_as: a setup whose pixels have the same visibility in truth and that is milder: the
            same scene at another scale or place.
    """

    shapes: tuple[Shape, ...]
    view: ViewSpec
    light: LightSpec
    frame_of: ViewSpec | None = None
    same_as: Optional["Setup"] = None

    def traced(self, side: int) -> Scene:
        """Cast at `side` x `side` pixels, in JAX's current precision.

        Raises:
            UseError: the toolkit does not take such a view or light.
        """
        frame = None
        if self.frame_of is not None:
            other = analytic_eye(self.shapes, self.frame_of.resized(side, side))
            frame = light_frame(self.light, other, scene_bounds(self.shapes))
        scene = traced(self.shapes, self.view.resized(side, side), self.light, frame)
        if self.same_as is None:
            return scene
        return replace(scene, expected=self.same_as.traced(side).expected)


def traced(
    shapes: Sequence[Shape], view: ViewSpec, light: LightSpec, frame: LightFrame | None = None
) -> Scene:
    """Every pixel that sees something is judged; truth is a float64 shadow ray for each, or 256 of
    them to a light with a size.

    `frame` is that of another view, for views that the light does not reach.
    """
    eye = analytic_eye(shapes, view)
    if frame is None:
        frame = light_frame(light, eye, scene_bounds(shapes))
    soft = frame.area is not None
    return Scene(
        shapes=tuple(shapes),
        view=view,
        light=light,
        eye=eye,
        frame=frame,
        rays=AnalyticRays(shapes),
        judged=np.asarray(eye.valid),
        expected=(
            analytic_soft_visibility(shapes, eye, frame).visibility
            if soft
            else _lit(shapes, eye, frame).astype(float)
        ),
    )


def _lit(shapes: Sequence[Shape], eye: EyeBuffer, frame: LightFrame) -> np.ndarray:
    world = np.where(eye.valid, eye.world, 0.0)
    size = np.maximum(np.abs(world).max(axis=0), np.where(eye.valid, eye.depth, 1.0))
    start = world + LIFTED * size * eye.normal
    towards = towards_light(frame, start)
    _, blocker, _ = closest(shapes, start, towards, 0.0, 1.0 if frame.perspective else np.inf)
    facing = np.einsum("in,in->n", eye.normal, towards) > 0
    return eye.valid & facing & in_domain(frame, world) & (blocker < 0)
