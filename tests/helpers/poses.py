"""Random eyes, lights and surface points, and plain float64 twins of the projection.

The twins are written per point and from matrices, with none of the library's kernels.
"""

from dataclasses import dataclass
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import Receivers, SurfacePoints, light_offset, project
from asmjax.footprint import uv_jacobian
from asmjax.geometry import (
    Camera,
    LightFrame,
    fitted_directional_frame,
    fitted_point_frame,
    fixed_frame,
    in_domain,
    look_at,
    unit,
)

Kind = Literal["point", "directional", "cube"]
KINDS: tuple[Kind, ...] = ("point", "directional", "cube")


_project = eqx.filter_jit(project)


def projected(points: SurfacePoints, frame: LightFrame) -> Receivers:
    """`project`, compiled once for all tests."""
    return _project(points, frame, light_offset(points, frame))


@eqx.filter_jit
def _footprints(points, camera, frame, offset):
    receivers = project(points, frame, offset)
    return uv_jacobian(points, camera, frame, receivers)


@dataclass(frozen=True)
class Pose:
    """An eye, a light, and points that both see; `columns` and `rows` are the eye's pixels."""

    camera: Camera
    frame: LightFrame
    world: np.ndarray
    normal: np.ndarray
    columns: np.ndarray
    rows: np.ndarray

    def points(self, dtype: type[np.floating] = np.float64) -> SurfacePoints:
        return surface_points(self.world, self.normal, self.camera.origin, dtype)

    def receivers(self, dtype: type[np.floating] = np.float64) -> Receivers:
        return projected(self.points(dtype), self.frame)

    def jacobian(self, dtype: type[np.floating] = np.float64) -> jax.Array:
        points = self.points(dtype)
        return _footprints(points, self.camera, self.frame, light_offset(points, self.frame))


def surface_points(world, normal, origin, dtype: type[np.floating] = np.float64) -> SurfacePoints:
    """Valid points, relative to `origin`."""
    n = world.shape[1]
    return SurfacePoints(
        position=jnp.asarray(world - np.asarray(origin)[:, None], dtype),
        normal=jnp.asarray(normal, dtype),
        prim=jnp.arange(n, dtype=jnp.int32),
        valid=jnp.ones(n, bool),
        origin=np.asarray(origin, np.float64),
    )


def random_pose(seed: int, kind: Kind = "point", count: int = 200, least_cosine=0.05) -> Pose:
    """Points in a ball of radius about 1, seen by an eye and a light at 3 to 8 units.

    A "cube" light stands in the ball instead. Normals are random among those that both eye and
    light see under cosines of at least `least_cosine`.
    """
    rng = np.random.default_rng(seed)
    eye = unit(rng.normal(size=3)) * rng.uniform(3, 8)
    camera = look_at(
        eye, rng.normal(size=3) * 0.2, unit(rng.normal(size=3)), fov_x_deg=60, width=64, height=48,
        principal_point=(0.1, -0.05), mirrored=bool(seed % 2),
    )  # fmt: skip
    spare = count + count // 2
    columns, rows = rng.uniform(0, 64, spare), rng.uniform(0, 48, spare)
    depth = np.linalg.norm(eye) + rng.uniform(-1, 1, spare)
    world = camera.origin[:, None] + camera.directions(columns, rows) * depth
    towards = -unit(rng.normal(size=3))
    light = np.array([0.1, -0.2, 0.05]) if kind == "cube" else -towards * rng.uniform(3, 8)
    if kind == "directional":
        bounds = np.stack([world.min(axis=1) - 1, world.max(axis=1) + 1], axis=1)
        frame = fitted_directional_frame(towards, world, bounds)
        to_light = np.broadcast_to(-towards[:, None], world.shape)
    else:
        if kind == "point":
            frame = fixed_frame(light, towards, 120.0, np.float64(1e-3))
        else:
            frame = fitted_point_frame(light, world, 1e-3)
        to_light = light[:, None] - world
    to_light = to_light / np.linalg.norm(to_light, axis=0)
    to_eye = camera.origin[:, None] - world
    to_eye = to_eye / np.linalg.norm(to_eye, axis=0)
    normal = _seen_by_both(rng, to_eye, to_light, least_cosine)
    # One count for all poses, so that nothing compiles twice.
    keep = np.flatnonzero(in_domain(frame, world))[:count]
    assert keep.size == count
    return Pose(camera, frame, world[:, keep], normal[:, keep], columns[keep], rows[keep])


def _seen_by_both(rng, to_eye, to_light, least):
    normal = to_eye + to_light
    normal /= np.linalg.norm(normal, axis=0)
    for _ in range(20):
        other = rng.normal(size=normal.shape)
        other /= np.linalg.norm(other, axis=0)
        good = ((other * to_eye).sum(axis=0) > least) & ((other * to_light).sum(axis=0) > least)
        normal = np.where(good, other, normal)
    return normal


def ref_project(frame: LightFrame, world: np.ndarray, normal: np.ndarray) -> dict:
    """Slow twin of `project`, one point and one face at a time, in float64."""
    n = world.shape[1]
    out = {
        "facing": np.zeros(n, bool), "face": np.zeros(n, int), "uv": np.full((2, n), 0.5),
        "depth": np.ones(n), "secant": np.ones(n),
    }  # fmt: skip
    for i in range(n):
        relative = world[:, i] - frame.origin
        axial = frame.cone_axis @ relative
        outside_cone = axial <= frame.cos_cutoff * np.linalg.norm(relative)
        if frame.perspective and outside_cone:
            continue
        for face in range(frame.faces):
            x, y, z = frame.rotation[face] @ relative
            if z <= frame.near:
                continue
            plane = np.array([x, y]) / z if frame.perspective else np.array([x, y])
            uv = (plane - frame.corner[face]) / frame.extent[face]
            ray = relative if frame.perspective else frame.rotation[face, 2]
            cosine = -(normal[:, i] @ ray) / np.linalg.norm(ray)
            if (uv < 0).any() or (uv >= 1).any() or cosine <= 0:
                continue
            out["facing"][i], out["face"][i], out["uv"][:, i] = True, face, uv
            out["depth"][i], out["secant"][i] = z, 1 / max(cosine, 1e-4)
            break
    return out


def ref_jacobian(pose: Pose, face: np.ndarray | None = None) -> np.ndarray:
    """d(u, v) / d(pixel) by forward differentiation of: pixel, ray, tangent plane, light image.

    In float64; call under x64. `face` (n,) chooses the light's face per point, default 0.
    """
    face = np.zeros(pose.columns.size, int) if face is None else face
    each = _ref_jacobians(
        pose.camera, pose.frame, np.stack([pose.columns, pose.rows], axis=1),
        pose.world.T, pose.normal.T, face,
    )  # fmt: skip
    return np.moveaxis(np.asarray(each), 0, -1)


@eqx.filter_jit
def _ref_jacobians(camera: Camera, frame: LightFrame, pixels, world, normal, face):
    def image(pixel, point, normal, rotation, corner, extent):
        ray = jnp.asarray(camera.rotation).T @ jnp.append(
            (pixel - camera.principal) / camera.focal, 1.0
        )
        relative = point - camera.origin
        seen = camera.origin + ray * (normal @ relative) / (normal @ ray)
        x, y, z = rotation @ (seen - frame.origin)
        plane = jnp.stack([x, y]) / z if frame.perspective else jnp.stack([x, y])
        return (plane - corner) / extent

    of_face = (jnp.asarray(a)[face] for a in (frame.rotation, frame.corner, frame.extent))
    return jax.vmap(jax.jacfwd(image))(pixels, world, normal, *of_face)


def ref_homographies(pose: Pose) -> np.ndarray:
    """(n, 3, 3) homographies from eye pixels to the image of a one-face perspective light.

    One per tangent plane: a ray d = A (pixel, 1) meets n . X = n . X_0 at
    X = d (n . X_0) / (n . d), so in homogeneous light coordinates
    H = K R ((n . X_0) I + (C - L) n^T) A.
    """
    camera, frame = pose.camera, pose.frame
    to_ray = camera.rotation.T @ np.array(
        [
            [1 / camera.focal[0], 0, -camera.principal[0] / camera.focal[0]],
            [0, 1 / camera.focal[1], -camera.principal[1] / camera.focal[1]],
            [0, 0, 1],
        ]
    )
    (cu, cv), (eu, ev) = frame.corner[0], frame.extent[0]
    to_image = np.array([[1 / eu, 0, -cu / eu], [0, 1 / ev, -cv / ev], [0, 0, 1]])
    result = []
    for point, normal in zip(pose.world.T, pose.normal.T, strict=True):
        distance = normal @ (point - camera.origin)
        lift = distance * np.eye(3) + np.outer(camera.origin - frame.origin, normal)
        result.append(to_image @ frame.rotation[0] @ lift @ to_ray)
    return np.array(result)
