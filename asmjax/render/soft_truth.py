"""Soft truth: many shadow rays per eye pixel to samples of a light that has a size."""

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import LightFrame
from asmjax.render.caster import MitsubaRays
from asmjax.render.geometry import SceneGeometry
from asmjax.render.truth import LIGHT_GAP, offset_along_normal
from asmjax.scene.soft_visibility import REPEATS, STRATA, LightSamples, SoftVisibility


class SoftShadowRays:
    """The shadow rays of one view and one light with a size; `estimate` casts them.

    They start where the single rays of `ShadowRays` do. Places on the light are drawn while rays
    are cast, one for each pixel at a time, as all together would fill the memory; the renderer's
    `rays` leave out the lamp.

    Args:
        strata: cells of the light a side.
        repeats: rays of a pixel to each cell.
        seed: of their places in the cells.

    Attributes:
        count: rays that are cast.

    Raises:
        UseError: as `LightSamples`.
    """

    def __init__(
        self,
        geometry: SceneGeometry,
        eye: EyeBuffer,
        frame: LightFrame,
        rays: MitsubaRays,
        strata: int = STRATA,
        repeats: int = REPEATS,
        seed: int | tuple[int, ...] = 0,
    ):
        rays.check_lamp(frame)
        self._samples = LightSamples(eye, frame, strata, repeats, seed)
        self._rays, self._perspective = rays, frame.perspective
        self.count = self._samples.count
        pixels, chosen = self._samples.pixels, rays.working.inward(self._samples.world)
        gap = offset_along_normal(
            geometry, eye.prim[pixels], chosen, eye.shape[pixels], rays.working
        )
        self._origins = (chosen + gap * self._samples.normal).astype(np.float32)

    def estimate(self) -> SoftVisibility:
        """Cast the rays: visibility of all eye pixels and its standard error, (n,) float64."""
        return self._samples.estimate(self._blocked)

    def trace(self) -> np.ndarray:
        """Cast the rays: visibility (n,) float64 of all eye pixels."""
        return self.estimate().visibility

    def _blocked(self, sample: np.ndarray) -> np.ndarray:
        directions, t_max = sample, np.inf
        if self._perspective:
            directions = self._rays.working.inward(sample) - self._origins.astype(np.float64)
            t_max = 1.0 - LIGHT_GAP
        return self._rays.prepare_occlusion(self._origins, directions, t_max)()
