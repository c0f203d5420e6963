"""The eye buffer: which surface each pixel sees, and exactly where."""

import numpy as np

from asmjax.buffers import EyeBuffer, eye_buffer
from asmjax.geometry import Camera
from asmjax.render.caster import FirstSurfaces, MitsubaRays
from asmjax.render.geometry import SceneGeometry, meet_surfaces

_BLOCK = 1 << 14
"""Pixels whose float64 temporaries fit the processor's cache."""


def cast_eye(
    rays: MitsubaRays, geometry: SceneGeometry, camera: Camera, offset=(0.0, 0.0)
) -> EyeBuffer:
    """Cast one eye ray per pixel, `offset` pixels right and down of the pixel centres.

    Rays start at the camera's near plane, as Mitsuba's sensors do. Mitsuba says what is hit; the
    position is where the float64 ray meets that triangle, sphere, cylinder or disk. Other shapes
    keep Mitsuba's float32 hit.
    """
    columns, rows = camera.centres()
    n = columns.size
    blocks = [slice(start, start + _BLOCK) for start in range(0, n, _BLOCK)]
    directions = np.empty((3, n))
    start, working = np.empty((3, n), np.float32), rays.working
    for block in blocks:
        directions[:, block] = camera.directions(
            columns[block] + offset[0], rows[block] + offset[1]
        )
        start[:, block] = working.inward(
            camera.origin[:, None] + camera.near * directions[:, block]
        )
    seen = rays.first_surfaces(start, directions)
    world, normal = np.empty((3, n)), np.empty((3, n))
    depth = np.empty(n)
    for block in blocks:
        world[:, block], normal[:, block], depth[block] = _exact(
            geometry,
            camera,
            working.scale,
            directions[:, block],
            FirstSurfaces(*(a[..., block] for a in seen)),
        )
    missed = np.isinf(depth)
    for array, nothing in ((seen.prim, -1), (seen.shape, -1), (seen.albedo, 0)):
        array[..., missed] = nothing
    return eye_buffer(
        camera,
        world=world,
        normal=normal,
        depth=depth,
        prim=seen.prim,
        shape=seen.shape,
        albedo=seen.albedo,
        flat=geometry.flat[geometry.stored(seen.prim, seen.shape)],
    )


def _exact(
    geometry: SceneGeometry,
    camera: Camera,
    scale: float,
    directions: np.ndarray,
    seen: FirstSurfaces,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position (3, n), normal (3, n) on the eye's side, and axial depth (n,) of some pixels.

    `scale` are working units per scene unit. NaN, 0 and +inf where nothing is seen.
    """
    t = camera.near + seen.t.astype(np.float64) / scale
    hit = (seen.prim >= 0) & (t <= camera.far)
    mesh = hit & geometry.on_mesh(seen.prim, seen.shape)
    normal = np.zeros_like(directions)
    world = camera.origin[:, None] + np.where(hit, t, np.nan) * directions
    # Most blocks see nothing else; a slice spares the copies of an index.
    on_mesh = slice(None) if mesh.all() else np.flatnonzero(mesh)
    t[on_mesh], world[:, on_mesh], normal[:, on_mesh] = meet_surfaces(
        geometry,
        seen.prim[on_mesh],
        camera.origin,
        directions[:, on_mesh],
        seen.shape[on_mesh],
    )
    hit[on_mesh] &= t[on_mesh] > 0
    other = np.flatnonzero(hit & ~mesh)
    normal[:, other] = seen.normal[:, other]
    curved = other[geometry.quadrics.known(geometry.stored(seen.prim[other], seen.shape[other]))]
    t[curved], normal[:, curved] = geometry.meet_quadrics(
        seen.prim[curved], seen.shape[curved], camera.origin, directions[:, curved], t[curved]
    )
    world[:, curved] = camera.origin[:, None] + t[curved] * directions[:, curved]
    hit[curved] &= t[curved] > 0
    towards_eye = -np.sign(np.einsum("in,in->n", normal[:, other], directions[:, other]))
    normal[:, other] *= np.where(towards_eye == 0, 1, towards_eye)
    return np.where(hit, world, np.nan), np.where(hit, normal, 0.0), np.where(hit, t, np.inf)
