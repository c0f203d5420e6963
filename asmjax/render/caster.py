"""Rays through Mitsuba: the only place where arrays cross between NumPy, JAX and Dr.Jit.

Everything that comes back is copied once, with its dtype asserted.
"""

from collections.abc import Callable
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np

from asmjax.buffers import ChartBuffer, LightBuffer, LightRays, TexelWindows
from asmjax.errors import require
from asmjax.geometry import ANY_LAMP, NO_LAMP, Charts, LightFrame
from asmjax.render.chart_rays import cast_charts, chart_buffer_of
from asmjax.render.geometry import SceneGeometry
from asmjax.render.instanced_hits import InstancedHits, shape_number
from asmjax.render.instances import Instancing
from asmjax.render.threads import all_threads
from asmjax.render.working_frame import WORLD, WorkingFrame

LANES = 1 << 24
"""Texels cast in one launch at most; larger requests are cut (memory: about 40 bytes a texel)."""

FEW_LANES = 1 << 13
"""Launches of up to this many rays are done before a second thread has started."""


def _rows(v) -> np.ndarray:
    return np.stack([component.numpy() for component in v])


def _f32(a: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(a, np.float32)


class FirstSurfaces(NamedTuple):
    """First hits of rays, as the renderer has them.

    Attributes:
        t: (n,) float32 ray parameter in working coordinates, +inf for a miss.
        prim, shape: (n,) int32 global primitive id and dense shape id, -1 for a miss.
        albedo: (3, n) float32 diffuse reflectance, 0 for a miss.
        normal: (3, n) float32 geometric normal, as the shape defines it; 0 for a miss.
    """

    t: np.ndarray
    prim: np.ndarray
    shape: np.ndarray
    albedo: np.ndarray
    normal: np.ndarray


class MitsubaRays(LightRays):
    """Light rays against a Mitsuba scene, vectorised (`llvm_*`, `cuda_*`) or one at a time
    (`scalar_*`).

    What the protocol names takes and gives world coordinates in float64. Mitsuba casts in float32,
    near the origin of `working`: t has its rounding, 6e-8 of the distance and of that from the
    working origin to the ray's, and float64 only holds it. `prepare_occlusion` and
    `first_surfaces` take rays in the coordinates of `working`, from those who have to know what
    rounding does to them.

    Args:
        mi: the mitsuba module with its variant set.
        scene: the Mitsuba scene of casters.
        shape_ids: dense shape id of each of the scene's shapes, in `geometry`'s order.
        geometry: gives the global primitive ids.
        instancing: which of the shapes in `geometry`'s order are instances; None if none is.
        working: the frame in which the Mitsuba scene stands.
        lamp: number of the shape that is left out, in `geometry`'s order; `NO_LAMP` for none.
    """

    def __init__(
        self,
        mi,
        scene,
        shape_ids: list[int],
        geometry: SceneGeometry,
        instancing: Instancing | None = None,
        working: WorkingFrame = WORLD,
        lamp: int = NO_LAMP,
    ):
        self.mi = mi
        self.lamp = lamp
        self.scene = scene
        self.geometry = geometry
        self.working = working
        self.vectorised = not mi.variant().startswith("scalar")
        first = geometry.first_prim[:-1]
        shapes = scene.shapes()
        if self.vectorised:
            import drjit as dr

            self._dr = dr
            numbers = [shape_number(mi, s) for s in shapes]
            offsets = np.zeros(max(numbers, default=0) + 1, np.int32)
            dense = np.full(offsets.size, -1, np.int32)
            offsets[numbers], dense[numbers] = first[shape_ids], shape_ids
            self._offsets, self._dense = mi.Int32(offsets), mi.Int32(dense)
            self._instanced = (
                InstancedHits(mi, instancing, geometry, numbers, shape_ids, working)
                if instancing
                else None
            )
        else:
            self._ids = {
                _key(s): (int(first[i]), i) for s, i in zip(shapes, shape_ids, strict=True)
            }

    def check_lamp(self, frame: LightFrame) -> None:
        """Raise `UseError` where these are not the rays of the frame's light: a lamp would shade
        itself, or another one would cast no shadow."""
        lamp = int(frame.lamp)
        require(
            lamp in (self.lamp, ANY_LAMP),
            f"the light's frame is of {_words(lamp)}, but its rays are those of "
            f"{_words(self.lamp)}; ask scene.light_frame and scene.light_rays for the same light.",
        )

    def hits(
        self, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First hits of world rays (3, n): t (n,) float64, primitive and dense shape id (n,)."""
        t, prim, shape = self._hits(self.working.inward(origins), directions)
        return t / self.working.scale, prim, shape

    def _hits(self, origins, directions):
        if not self.vectorised:
            return self._hits_one_by_one(origins, directions)
        mi, dr = self.mi, self._dr
        ray = mi.Ray3f(mi.Point3f(_f32(origins)), mi.Vector3f(_f32(directions)))
        with all_threads():
            t, prim, shape = self._intersect(ray)
            dr.eval(t, prim, shape)
            return t.numpy().astype(np.float64), prim.numpy(), shape.numpy()

    def _intersect(self, ray):
        return self._identify(self.scene.ray_intersect_preliminary(ray, coherent=True))

    def _identify(self, hit):
        mi, dr = self.mi, self._dr
        valid = hit.is_valid()
        if self._instanced is None:
            raw, inner = dr.reinterpret_array(mi.UInt32, hit.shape), 0
        else:
            raw, inner = self._instanced.number(hit), self._instanced.first_prim(hit)
        first = dr.gather(mi.Int32, self._offsets, raw, valid) + inner
        prim = dr.select(valid, first + mi.Int32(hit.prim_index), -1)
        shape = dr.select(valid, dr.gather(mi.Int32, self._dense, raw, valid), -1)
        return dr.select(valid, hit.t, dr.inf), prim, shape

    def _hits_one_by_one(self, origins, directions):
        ray3, point, vector = self.mi.Ray3f, self.mi.Point3f, self.mi.Vector3f
        intersect = self.scene.ray_intersect_preliminary
        n = directions.shape[1]
        t, prim, shape = np.full(n, np.inf), np.full(n, -1, np.int32), np.full(n, -1, np.int32)
        rays = zip(_f32(origins).T.tolist(), _f32(directions).T.tolist(), strict=True)
        for k, (o, d) in enumerate(rays):
            hit = intersect(ray3(point(*o), vector(*d)))
            if hit.is_valid():
                t[k] = hit.t
                prim[k], shape[k] = self._identify_one(hit)
        return t, prim, shape

    def _identify_one(self, hit) -> tuple[int, int]:
        """Global primitive id and dense shape id of a scalar variant's hit."""
        if hit.instance is None:
            first, shape = self._ids[_key(hit.shape)]
            return first + hit.prim_index, shape
        first, shape = self._ids[_key(hit.instance)]
        part = self.geometry.first_part[shape] + hit.shape_index
        return first + int(self.geometry.part_prim[part]) + hit.prim_index, shape

    def closest(self, origins, directions, t_min=0.0):
        t, prim, _ = self.hits(origins + t_min * directions, directions)
        return t + t_min, prim

    def occluded(self, origins, directions, t_max):
        end = t_max * self.working.scale
        return self.prepare_occlusion(self.working.inward(origins), directions, end)()

    def prepare_occlusion(
        self, origins: np.ndarray, directions: np.ndarray, t_max: float
    ) -> Callable[[], np.ndarray]:
        """Put rays (3, n) in working coordinates on the device; the returned function casts them,
        again at each call."""
        if self.vectorised:
            mi = self.mi
            ray = mi.Ray3f(mi.Point3f(_f32(origins)), mi.Vector3f(_f32(directions)))
            ray.maxt = self._dr.opaque(mi.Float, t_max)
            self._dr.eval(ray)

            def cast():
                with all_threads():
                    return self.scene.ray_test(ray, coherent=True).numpy()

            return cast
        ray3, point, vector = self.mi.Ray3f, self.mi.Point3f, self.mi.Vector3f
        rays = []
        for o, d in zip(_f32(origins).T.tolist(), _f32(directions).T.tolist(), strict=True):
            rays.append(ray3(point(*o), vector(*d)))
            rays[-1].maxt = t_max
        test = self.scene.ray_test
        return lambda: np.fromiter((test(ray) for ray in rays), bool, len(rays))

    def first_surfaces(self, origins: np.ndarray, directions: np.ndarray) -> FirstSurfaces:
        """What rays (3, n) in working coordinates hit first, and what it looks like there, in one
        cast."""
        mi = self.mi
        if self.vectorised:
            dr = self._dr
            ray = mi.Ray3f(mi.Point3f(_f32(origins)), mi.Vector3f(_f32(directions)))
            found = self.scene.ray_intersect_preliminary(ray, coherent=True)
            valid = found.is_valid()
            if self._instanced is None:
                albedo, normal = self._look(found, ray)
            else:
                with all_threads(), self._instanced.few_calls():
                    albedo, normal = self._look(*self._instanced.in_part(found, ray))
                normal = self._instanced.to_world(found, normal)
            albedo, normal = (dr.select(valid, v, 0.0) for v in (albedo, normal))
            t, prim, shape = self._identify(found)
            with all_threads():
                dr.eval(t, prim, shape, albedo, normal)
                return FirstSurfaces(
                    t.numpy(), prim.numpy(), shape.numpy(), _rows(albedo), _rows(normal)
                )
        n = directions.shape[1]
        result = FirstSurfaces(
            t=np.full(n, np.inf, np.float32),
            prim=np.full(n, -1, np.int32),
            shape=np.full(n, -1, np.int32),
            albedo=np.zeros((3, n), np.float32),
            normal=np.zeros((3, n), np.float32),
        )
        ray3, point, vector = mi.Ray3f, mi.Point3f, mi.Vector3f
        rays = zip(_f32(origins).T.tolist(), _f32(directions).T.tolist(), strict=True)
        for k, (o, d) in enumerate(rays):
            ray = ray3(point(*o), vector(*d))
            found = self.scene.ray_intersect_preliminary(ray)
            if found.is_valid():
                hit = found.compute_surface_interaction(ray)
                result.t[k] = found.t
                result.prim[k], result.shape[k] = self._identify_one(found)
                result.albedo[:, k] = hit.bsdf().eval_diffuse_reflectance(hit)
                result.normal[:, k] = hit.n
        return result

    def _look(self, found, ray):
        """Diffuse reflectance and geometric normal of hits on shapes of their own."""
        # Textures need uv; two-sided materials need a shading frame to know their side.
        hit = found.compute_surface_interaction(ray, self.mi.RayFlags.All)
        albedo = hit.bsdf().eval_diffuse_reflectance(hit, found.is_valid())
        return albedo, self.mi.Vector3f(hit.n)

    def light_buffer(self, frame: LightFrame, windows: TexelWindows) -> LightBuffer:
        """All windows in one launch; rays are formed on the device from nine numbers a window."""
        self.check_lamp(frame)
        if not self.vectorised:
            return super().light_buffer(frame, windows)
        frame = self.working.light_frame(frame)
        parts = [
            self._launch(frame, windows, start, min(LANES, windows.texels - start))
            for start in range(0, windows.texels, LANES)
        ]
        depth, prim = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
        shape = (windows.count, windows.side, windows.side)
        return LightBuffer(self._in_scene_units(depth).reshape(shape), prim.reshape(shape))

    def chart_buffer(self, frame: LightFrame, charts: Charts) -> ChartBuffer:
        """All charts in one launch each, which run side by side."""
        self.check_lamp(frame)
        if not self.vectorised:
            return super().chart_buffer(frame, charts)
        found = cast_charts(self.mi, self._intersect, self.working.light_frame(frame), charts)
        with all_threads():
            self._dr.eval(*found)
            return chart_buffer_of([(self._in_scene_units(t.numpy()), p.numpy()) for t, p in found])

    def _in_scene_units(self, depth: np.ndarray) -> np.ndarray:
        """Depths (n,) float32 of working coordinates, as the scene has them; exact."""
        scale = self.working.scale
        return depth if scale == 1 else depth / np.float32(scale)

    def _launch(
        self, frame: LightFrame, windows: TexelWindows, start: int, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Working depth and primitive of `count` texels from the flat texel index `start` on;
        `frame` is in working coordinates."""
        mi, dr = self.mi, self._dr
        first, step = windows.plane(frame)
        e_u, e_v, e_w = np.moveaxis(frame.rotation[windows.face], 0, -1)
        corner = e_u * first[0] + e_v * first[1]
        corner += e_w if frame.perspective else frame.origin[:, None]
        # One array and not nine: each one costs as much as a few thousand rays.
        table = mi.Float(_f32(np.concatenate([corner, e_u * step[0], e_v * step[1]])).reshape(-1))
        side, windows_in_all = windows.side, dr.opaque(mi.UInt32, windows.count)
        lane = dr.arange(mi.UInt32, count) + dr.opaque(mi.UInt32, start)
        window = lane // (side * side)
        texel = lane - window * (side * side)
        row = texel // side
        column = mi.Float(texel - row * side)
        row = mi.Float(row)
        corner, right, down = (
            mi.Vector3f(
                *(
                    dr.gather(mi.Float, table, window + (3 * i + k) * windows_in_all)
                    for k in range(3)
                )
            )
            for i in range(3)
        )
        at = dr.fma(down, row, dr.fma(right, column, corner))
        if frame.perspective:
            origin = mi.Point3f(*frame.origin.tolist())
            dr.make_opaque(origin)
            ray = mi.Ray3f(origin, at)
        else:
            axis = [mi.Float(_f32(row)) for row in e_w]
            axis = mi.Vector3f(*(dr.gather(mi.Float, row, window) for row in axis))
            ray = mi.Ray3f(mi.Point3f(at), axis)
        t, prim, _ = self._intersect(ray)
        with all_threads() if count > FEW_LANES else nullcontext():
            dr.eval(t, prim)
            depth, prim = t.numpy(), prim.numpy()
        assert depth.dtype == np.float32 and prim.dtype == np.int32
        return depth, prim


def _words(lamp: int) -> str:
    return "a light without a lamp" if lamp == NO_LAMP else f"the lamp that is shape {lamp}"


def _key(shape) -> int:
    """A scalar variant's shape as a dictionary key: the address of the renderer's object."""
    return shape.ptr
