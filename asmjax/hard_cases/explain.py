"""Which wrong pixels a map cannot help at its texels' size, and which it says it cannot tell.

A texel answers for all of its area with the ray through its centre, so a pixel within a texel of a
shadow's edge may be wrong however exact the arithmetic is. What is wrong elsewhere is an error of
computation, of bias, or of what the map holds: what hard cases are about.
"""

from typing import NamedTuple, cast

import jax
import numpy as np

from asmjax.buffers import Receivers, light_offset, project
from asmjax.buffers.receivers import GRAZING
from asmjax.geometry import Charts
from asmjax.hard_cases.scene import Scene
from asmjax.scene.analytic import closest
from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.comparison import Tested, depth_tolerance
from asmjax.shadow.warped.charted import ChartedState, Drawn

_REACH = np.linspace(-1.0, 1.0, 9)
"""Places along both sides of a texel, in texels, at which a shadow's edge is looked for."""

_TOWARDS = np.linspace(0.0, 1.0, 17)
"""Places on the way to the centre of a texel that a strong warp has bent."""

_ROUNDING = 1e-10
"""A surface is not nearer to the light than itself, within this part of its depth."""


_project = jax.jit(project)


class Explained(NamedTuple):
    """Pixels (n,) bool.

    Attributes:
        wrong: judged, and of another visibility than truth.
        edge: of these, the ones within a texel of a shadow's edge.
        stated: of the others, those that are marked, or whose caster is nearer to the receiver
            than the bias that the map states.
        silent: the rest.
    """

    wrong: np.ndarray
    edge: np.ndarray
    stated: np.ndarray
    silent: np.ndarray


def projected(scene: Scene) -> Receivers:
    """The scene's pixels in the image of its light's middle."""
    points = scene.eye.points
    return _project(points, scene.frame, light_offset(points, scene.frame))


def explained(
    scene: Scene, algorithm: ShadowAlgorithm, state, visibility, slack: float = 1.0
) -> Explained:
    """Why pixels are wrong, with light rays in float64 all over each of their texels.

    Args:
        slack: how many times the bias in texels the algorithm says that it forgives.
    """
    points = scene.eye.points
    wrong, receivers = scene.wrong(visibility), projected(scene)
    density = np.moveaxis(np.asarray(algorithm.density(state, points), np.float64), -1, 0)
    marked = np.asarray(receivers.secant) >= 0.999 / GRAZING
    edge, biased = np.zeros_like(wrong), np.zeros_like(wrong)
    known = np.isfinite(density).all(axis=(1, 2)) & (np.abs(np.linalg.det(density)) > 0)
    looked = np.flatnonzero(wrong & known)
    if looked.size:
        texel = np.linalg.inv(density[looked])
        width, forgiven = np.linalg.norm(texel, ord=2, axis=(1, 2)), cast(Tested, algorithm).bias
        tolerance = np.asarray(depth_tolerance(receivers, slack, 0.0), np.float64)[looked] * width
        tolerance += np.asarray(depth_tolerance(receivers, 0.0, forgiven), np.float64)[looked]
        face = np.asarray(receivers.face)[looked]
        uv = _image(scene, face, scene.eye.world[:, looked])
        steps = np.stack([np.tile(_REACH, _REACH.size), np.repeat(_REACH, _REACH.size)])
        places = uv[:, :, None] + np.einsum("nij,jk->ink", texel, steps)
        if isinstance(state, ChartedState):
            to_centre = _centres(state.drawn, face, uv, scene.eye.depth[looked]) - uv
            places = np.concatenate(
                [places, uv[:, :, None] + to_centre[:, :, None] * _TOWARDS], axis=2
            )
        edge[looked], biased[looked] = _texels(scene, looked, face, places, tolerance)
    stated = (marked | biased) & wrong & ~edge
    return Explained(wrong, edge, stated, wrong & ~edge & ~stated)


def _texels(scene: Scene, pixels: np.ndarray, face: np.ndarray, places: np.ndarray, tolerance):
    """Whether an edge lies at one of the `places` (2, n, k) of each pixel's texel, in its face's
    image, and whether the tolerance (n,) of the shadow test hides a caster from it."""
    frame, k = scene.frame, places.shape[2]
    world, normal = scene.eye.world[:, pixels], scene.eye.normal[:, pixels]
    origins, directions = np.empty((3, pixels.size, k)), np.empty((3, pixels.size, k))
    for number in range(frame.faces):
        mine = face == number
        origin, direction = frame.ray(number, *places[:, mine].reshape(2, -1))
        origins[:, mine] = origin.reshape(3, -1, k)
        directions[:, mine] = direction.reshape(3, -1, k)
    along = np.einsum("in,ink->nk", normal, directions)
    level = np.einsum("in,ink->nk", normal, world[:, :, None] - origins)
    met = (along < 0) & (level < 0)
    plane = np.where(met, level / np.where(met, along, -1.0), np.inf)
    first, _, _ = closest(scene.shapes, origins.reshape(3, -1), directions.reshape(3, -1))
    first = first.reshape(plane.shape)
    lit = first >= plane * (1 - _ROUNDING)
    hidden = first >= plane * (1 - _ROUNDING) - tolerance[:, None]
    truth = scene.expected[pixels] > 0
    # A ray that never meets the receiver's plane tells nothing: the texel reaches beyond it.
    edge = np.where(truth, (~lit | ~met).any(axis=1), (lit | ~met).any(axis=1))
    return edge, ~truth & hidden.any(axis=1)


def _centres(drawn: Drawn, face: np.ndarray, uv: np.ndarray, eye_depth: np.ndarray) -> np.ndarray:
    """(2, n) image coordinates of the centres of the texels that answer, by the charts in float64;
    `uv` itself where no chart holds it."""
    charts = _charts(drawn)
    centres, left = uv.copy(), np.ones(face.size, bool)
    line = np.stack([*uv, np.ones(face.size)])
    for k in range(charts.count):
        least, most = charts.depths[k]
        mine = left & (face == charts.face[k]) & (eye_depth >= least) & (eye_depth < most)
        mine &= (charts.lines[k] @ line >= 0).all(axis=0)
        left &= ~mine
        if mine.any():
            s, t, w = charts.to_chart[k] @ line[:, mine]
            s, t, log = s / w, t / w, charts.log[k]
            if log:
                t = np.log1p(np.maximum(log * t, -0.999999)) / np.log1p(log)
            columns, rows = charts.size[k]
            s, t = (
                (np.clip(np.floor(x * n), 0, n - 1) + 0.5) / n for x, n in ((s, columns), (t, rows))
            )
            centres[:, mine] = charts.image(k, s, t)
    return centres


def _charts(drawn: Drawn) -> Charts:
    table = drawn.table
    to_chart, log = (
        np.asarray(x.high, np.float64) + np.asarray(x.low, np.float64)
        for x in (table.to_chart, table.log)
    )
    return Charts(
        face=np.asarray(table.face, np.int64),
        to_chart=np.moveaxis(to_chart, -1, 0),
        log=log,
        lines=np.asarray(table.lines, np.float64),
        depths=np.asarray(table.depths, np.float64),
        size=np.stack([table.columns, table.rows], axis=1).astype(np.int64),
        first=np.asarray(table.first, np.int64),
    )


def _image(scene: Scene, face: np.ndarray, world: np.ndarray) -> np.ndarray:
    """Image coordinates (2, n) in float64 of world points on their faces."""
    frame = scene.frame
    x, y, depth = np.einsum("nij,jn->in", frame.rotation[face], world - frame.origin[:, None])
    scale = depth if frame.perspective else 1.0
    return (np.stack([x / scale, y / scale]) - frame.corner[face].T) / frame.extent[face].T
