"""Scenes for the renderer's tests: real files, dictionaries, and Mitsuba's own rays as a twin."""

import functools

import numpy as np
import pytest

from asmjax.scene.other_scenes import other_scene, scenes_dir, why_left_out

REAL_SCENES = scenes_dir()


def real_scene(name: str) -> str:
    """Path of a scene that the project did not make; skips the test where it is not there."""
    path = other_scene(name)
    if path is None:
        pytest.skip(why_left_out(name))
    return str(path)


@functools.cache
def loaded(source: str):
    """`load_scene`, once per process and name."""
    from asmjax.render.load import load_scene

    return load_scene(source)


def vectorised(mi) -> bool:
    return not mi.variant().startswith("scalar")


def pinhole(
    mi, origin=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), size=(32, 32), up=(0, 1, 0), **more
):
    """A perspective sensor as a dictionary."""
    look = mi.ScalarTransform4f().look_at(origin=list(origin), target=list(target), up=list(up))
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
    return {"type": "perspective", "to_world": look, "film": film, **more}


def sensor_rays(mi, sensor, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (3, n) that Mitsuba's sensor gives film points (2, n) in [0, 1]."""
    if vectorised(mi):
        ray, _ = sensor.sample_ray(0.0, 0.0, mi.Point2f(positions.astype(np.float32)), [0.5, 0.5])
        ones = np.ones(positions.shape[1])
        return np.array(ray.o, np.float64) * ones, np.array(ray.d, np.float64) * ones
    rays = [sensor.sample_ray(0.0, 0.0, p, [0.5, 0.5])[0] for p in positions.T.tolist()]
    return np.array([list(r.o) for r in rays]).T, np.array([list(r.d) for r in rays]).T


def mitsuba_points(mi, scene, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Mitsuba's own hit points `si.p` (3, n) of world rays; NaN for a miss."""
    if vectorised(mi):
        hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(origins), mi.Vector3f(directions)))
        return np.where(hit.is_valid().numpy(), np.array(hit.p, np.float64), np.nan)
    points = np.full(directions.shape, np.nan)
    for k, (o, d) in enumerate(zip(origins.T.tolist(), directions.T.tolist(), strict=True)):
        hit = scene.ray_intersect(mi.Ray3f(o, d))
        if hit.is_valid():
            points[:, k] = hit.p
    return points
