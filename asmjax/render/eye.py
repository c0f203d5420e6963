"""The eye buffer: which surface each pixel sees, and exactly where."""

import numpy as np

from asmjax.buffers import EyeBuffer, eye_buffer
from asmjax.geometry import Camera
from asmjax.render.caster import MitsubaRays
from asmjax.render.geometry import NOT_A_MESH, SceneGeometry, meet_planes


def cast_eye(
    mi, rays: MitsubaRays, geometry: SceneGeometry, camera: Camera, offset=(0.0, 0.0)
) -> EyeBuffer:
    """Cast one eye ray per pixel, `offset` pixels right and down of the pixel centres.

    Rays start at the camera's near plane, as Mitsuba's sensors do. Mitsuba says which triangle is
    hit; the position is where the float64 ray meets that triangle's plane. Other shapes keep
    Mitsuba's float32 hit.
    """
    columns, rows = camera.centres()
    directions = camera.directions(columns + offset[0], rows + offset[1])
    start = camera.origin[:, None] + camera.near * directions
    t, prim, shape = rays.hits(start, directions)
    t += camera.near
    hit = (prim >= 0) & (t <= camera.far)
    normal = np.zeros_like(directions)
    on_mesh = np.flatnonzero(hit & (geometry.faces[0][prim] != NOT_A_MESH))
    exact, normal[:, on_mesh] = meet_planes(
        geometry, prim[on_mesh], camera.origin, directions[:, on_mesh]
    )
    sane = np.isfinite(exact) & (exact > 0)
    t[on_mesh] = np.where(sane, exact, t[on_mesh])
    hit[on_mesh[~sane]] = False
    other = np.flatnonzero(hit & (geometry.faces[0][prim] == NOT_A_MESH))
    world = np.where(hit, camera.origin[:, None] + np.where(hit, t, 0.0) * directions, np.nan)
    seen = np.flatnonzero(hit)
    albedo = np.zeros((3, hit.size), np.float32)
    albedo[:, seen], smooth = rays.surface(start[:, seen], directions[:, seen])
    if other.size:
        where = np.searchsorted(seen, other)
        normal[:, other] = smooth[:, where]
        away = np.einsum("in,in->n", normal[:, other], directions[:, other]) > 0
        normal[:, other[away]] *= -1
    return eye_buffer(
        camera,
        world=world,
        normal=np.where(hit, normal, 0.0),
        depth=np.where(hit, t, np.inf),
        prim=np.where(hit, prim, -1).astype(np.int32),
        shape=np.where(hit, shape, -1).astype(np.int32),
        albedo=albedo,
    )
