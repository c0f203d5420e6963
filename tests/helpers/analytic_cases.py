"""Analytic scenes as one algorithm sees them: eye, light, rays, and the visibility in truth."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import EyeBuffer, LightRays, SurfacePoints
from asmjax.geometry import LightFrame
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import Disk, LightSpec, Mesh, Rectangle, Shape, Sphere, ViewSpec
from helpers.poses import projected

EDGE_MARGIN = 1e-5
"""Points nearer to an edge of the shadow than this are not judged."""


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, a view and a light, with what is known in closed form about the receiver z = 0.

    Attributes:
        judged: (n,) pixels that see the receiver, further from any shadow edge than `EDGE_MARGIN`.
        expected: (n,) visibility in truth, where judged.
        edge_distance: (n,) to the nearest shadow edge, scene units, where judged.
    """

    shapes: tuple[Shape, ...]
    view: ViewSpec
    light: LightSpec
    eye: EyeBuffer
    frame: LightFrame
    rays: LightRays
    judged: np.ndarray
    expected: np.ndarray
    edge_distance: np.ndarray

    def wrong(self, visibility) -> np.ndarray:
        """(n,) judged pixels that are on the other side of one half than in truth."""
        return self.judged & ((np.asarray(visibility) >= 0.5) != (self.expected >= 0.5))

    def off(self, visibility) -> float:
        """By how much judged pixels differ from truth, in all."""
        return float(np.abs(np.asarray(visibility) - self.expected)[self.judged].sum())

    def error(self, visibility) -> float:
        """Misclassified fraction of the judged pixels."""
        return float(self.wrong(visibility).sum() / self.judged.sum())

    def texel_width(self, log2_resolution) -> np.ndarray:
        """(n,) the longest side of a texel on each receiver's plane, at most: scene units."""
        seen = projected(self.eye.points, self.frame)
        return np.asarray(seen.reach * seen.secant) * np.exp2(-np.asarray(log2_resolution, float))


def analytic_case(name: str, side: int = 160, **light) -> Case:
    """The built-in analytic scene `name` at `side` x `side` pixels, in JAX's current precision.

    Further arguments replace fields of its light.
    """
    return _cached(name, side, tuple(sorted(light.items())), jnp.zeros(()).dtype.name)


@functools.cache
def _cached(name: str, side: int, light: tuple, precision: str) -> Case:
    del precision  # only tells cached cases apart
    scene = ANALYTIC_SCENES[name]()
    spec = replace(next(iter(scene.spec.lights.values())), **dict(light))
    view = next(iter(scene.spec.views.values())).resized(side, side)
    return case_of(scene, scene.spec.shapes, view, spec)


def case_of(scene, shapes: Sequence[Shape], view: ViewSpec, light: LightSpec) -> Case:
    """The case of an `AnalyticScene` seen by any view; shape 0 is its receiver."""
    eye = analytic_eye(shapes, view)
    x, y, _ = np.where(eye.valid, eye.world, 0.0)
    distance = np.asarray(scene.edge_distance(x, y))
    return Case(
        shapes=tuple(shapes),
        view=view,
        light=light,
        eye=eye,
        frame=light_frame(light, eye, scene_bounds(shapes)),
        rays=AnalyticRays(shapes),
        judged=(eye.shape == 0) & (distance > EDGE_MARGIN),
        expected=np.asarray(scene.hard_visibility(x, y)),
        edge_distance=distance,
    )


def walk(name: str, side: int, steps: Sequence[Sequence[float]], **light) -> list[Case]:
    """The built-in analytic scene seen by an eye that has moved by each of `steps`, looking the
    same way, under the light frame of the first: what an algorithm updates its state for."""
    scene, case = ANALYTIC_SCENES[name](), analytic_case(name, side, **light)
    cases = []
    for step in steps:
        origin, target = (
            tuple(np.add(point, step).tolist()) for point in (case.view.origin, case.view.target)
        )
        view = replace(case.view, origin=origin, target=target)
        cases.append(replace(case_of(scene, case.shapes, view, case.light), frame=case.frame))
    return [replace(each, frame=cases[0].frame) for each in cases]


def moved(case: Case, rotation: np.ndarray, shift: np.ndarray) -> Case:
    """The case with scene, eye and light moved as one rigid body; what is expected stays."""

    def point(p):
        return tuple(float(x) for x in rotation @ np.asarray(p, float) + shift)

    def vector(v):
        return tuple(float(x) for x in rotation @ np.asarray(v, float))

    def shape(s: Shape) -> Shape:
        if isinstance(s, Mesh):
            return replace(s, vertices=rotation @ s.vertices + shift[:, None])
        if isinstance(s, Rectangle):
            s = replace(s, half_u=vector(s.half_u), half_v=vector(s.half_v))
        elif isinstance(s, Disk):
            s = replace(s, normal=vector(s.normal))
        else:
            assert isinstance(s, Sphere)
        return replace(s, centre=point(s.centre))

    shapes = tuple(shape(s) for s in case.shapes)
    view = replace(
        case.view,
        origin=point(case.view.origin),
        target=point(case.view.target),
        up=vector(case.view.up),
    )
    frame = eqx.tree_at(
        lambda f: (f.origin, f.rotation, f.cone_axis),
        case.frame,
        (
            rotation @ case.frame.origin + shift,
            case.frame.rotation @ rotation.T,
            rotation @ case.frame.cone_axis,
        ),
    )
    eye = analytic_eye(shapes, view)
    return replace(case, shapes=shapes, view=view, eye=eye, frame=frame, rays=AnalyticRays(shapes))


def permuted(eye: EyeBuffer, order: np.ndarray) -> EyeBuffer:
    """The same eye samples in another order; the images no longer are images."""
    points = SurfacePoints(
        position=eye.points.position[:, order],
        normal=eye.points.normal[:, order],
        prim=eye.points.prim[order],
        valid=eye.points.valid[order],
        origin=eye.points.origin,
    )
    return EyeBuffer(
        camera=eye.camera,
        points=points,
        world=eye.world[:, order],
        normal=eye.normal[:, order],
        depth=eye.depth[order],
        prim=eye.prim[order],
        shape=eye.shape[order],
        albedo=eye.albedo[:, order],
    )


def kept_arrays(state) -> list[jax.Array | np.ndarray]:
    """All arrays that a state holds on to, on the device and on the host, wherever they stand in
    it; all but those of the light frame, which is not its own."""
    found: dict[int, jax.Array | np.ndarray] = {}
    seen: set[int] = set()

    def look(value) -> None:
        if id(value) in seen or isinstance(value, LightFrame):
            return
        seen.add(id(value))
        if isinstance(value, jax.Array | np.ndarray):
            found[id(value)] = value
        elif isinstance(value, dict):
            for item in value.values():
                look(item)
        elif isinstance(value, list | tuple | set):
            for item in value:
                look(item)
        elif type(value).__module__.startswith("asmjax"):
            look(vars(value))

    look(state)
    return list(found.values())


def unit_frame(perspective: bool) -> LightFrame:
    """A light whose image coordinates are x / z and y / z, or x and y."""
    return LightFrame(
        origin=np.zeros(3),
        rotation=np.eye(3)[None],
        corner=np.zeros((1, 2)),
        extent=np.ones((1, 2)),
        cone_axis=np.array([0.0, 0.0, 1.0]),
        cos_cutoff=-1.0,
        near=1e-6,
        perspective=perspective,
    )


def random_rotation(seed: int) -> np.ndarray:
    """A rotation matrix, evenly distributed."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))
