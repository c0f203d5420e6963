"""Ray-traced truth: one shadow ray per eye pixel from the very point the map is asked about."""

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.geometry import LightFrame, in_domain, towards_light
from asmjax.render.caster import MitsubaRays
from asmjax.render.geometry import SceneGeometry
from asmjax.render.working_frame import WORLD, WorkingFrame

OFFSET_ULPS = 8.0
"""Shadow rays start this many float32 roundings of the largest coordinate off the surface.

Mitsuba's `spawn_ray` takes (1 + max|p|) x 9e-5: at 5 units from the origin 5e-4, here 5e-6.
"""

LIGHT_GAP = 1e-6
"""Rays towards a point light end this fraction before it, so that nothing behind it counts."""


class ShadowRays:
    """The shadow rays of one view and light, prepared; `trace` casts them.

    Pixels whose seen side faces away from the light, or which lie outside the light's domain,
    are dark without a ray. `count` is the number of rays that are cast.
    """

    def __init__(
        self, geometry: SceneGeometry, eye: EyeBuffer, frame: LightFrame, rays: MitsubaRays
    ):
        rays.check_lamp(frame)
        world = np.where(eye.valid, eye.world, 0.0)
        to_light = towards_light(frame, world)
        facing = np.einsum("in,in->n", eye.normal, to_light) > 0
        self.facing = eye.valid & facing & in_domain(frame, world)
        self.pixels = np.flatnonzero(self.facing)
        self.count = int(self.pixels.size)
        working = rays.working
        chosen = working.inward(world[:, self.pixels])
        gap = offset_along_normal(
            geometry, eye.prim[self.pixels], chosen, eye.shape[self.pixels], working
        )
        origins = (chosen + gap * eye.normal[:, self.pixels]).astype(np.float32)
        if frame.perspective:
            light = working.inward(frame.origin[:, None])
            directions = light - origins.astype(np.float64)
            t_max = 1.0 - LIGHT_GAP
        else:
            directions, t_max = to_light[:, self.pixels], np.inf
        self._query = rays.prepare_occlusion(origins, directions, t_max)

    def trace(self) -> np.ndarray:
        """Cast the rays: visibility (n,) bool of all eye pixels, True where lit."""
        lit = np.zeros(self.facing.shape, bool)
        lit[self.pixels] = ~self._query()
        return lit


def offset_along_normal(
    geometry: SceneGeometry,
    prim: np.ndarray,
    position: np.ndarray,
    shape: np.ndarray | None = None,
    working: WorkingFrame = WORLD,
) -> np.ndarray:
    """How far (n,) off the surface a float32 ray must start not to hit the surface it left.

    Rounding acts on the largest coordinate in play: of the point (3, n), or of its triangle's
    corners. Positions and distances are in `working` coordinates.
    """
    largest = np.abs(position).max(axis=0, initial=0.0)
    on_mesh = geometry.on_mesh(prim, shape)
    for corner in geometry.corners(prim[on_mesh], None if shape is None else shape[on_mesh]):
        reach = np.abs(working.inward(corner)).max(axis=0, initial=0.0)
        largest[on_mesh] = np.maximum(largest[on_mesh], reach)
    return OFFSET_ULPS * np.finfo(np.float32).eps * largest
