"""How wrong an algorithm is on a scene, and how much of it nothing announces."""

import math
from typing import NamedTuple

import numpy as np

from asmjax.buffers.receivers import GRAZING
from asmjax.hard_cases.explain import explained, projected
from asmjax.hard_cases.scene import Scene
from asmjax.shadow import (
    MAPS,
    AccumulatedShadowMap,
    MomentShadowMap,
    ShadowAlgorithm,
    Status,
)
from asmjax.shadow.comparison import CURVATURE_BIAS

_LARGEST_DENSITY = 2.0**50
"""Texels per image side that a map may claim to have."""

_CONTACT = 1 / CURVATURE_BIAS
"""A moment map forgives a whole texel on the receiver's slope: what is asked about is the nearest
point of the receiver's plane in the window."""


class Judgement(NamedTuple):
    """Errors over the judged pixels.

    Attributes:
        error: in the unit of the case's bound; infinite where answers are not sound.
        silent: the part of it that nothing announces.
        wrong: share of pixels off by half of the light or more, edges of texels included.
        how: what announces the rest.
    """

    error: float
    silent: float
    wrong: float
    how: str


def judged(scene: Scene, algorithm: ShadowAlgorithm, state) -> Judgement:
    """Shares of pixels that are wrong beyond a texel of a shadow's edge, under a light without a
    size."""
    visibility = np.asarray(algorithm.visibility(state, scene.eye.points))
    why = explained(scene, algorithm, state, visibility)
    count = max(int(scene.judged.sum()), 1)
    wrong, silent, stated = (
        float(part.sum()) / count for part in (why.wrong, why.silent, why.stated)
    )
    if not _is_sound(scene, algorithm, state, visibility):
        silent = math.inf
    return Judgement(silent + stated, silent, wrong, "marked, or nearer than the stated bias")


def judged_soft(scene: Scene, algorithm: ShadowAlgorithm, state) -> Judgement:
    """The mean error, of the light.

    Announced are a status; pixels that are marked, nearly along the light's middle; those turned
    away from it, where only accumulated shadows ask what the rest of the light does; and umbrae of
    casters that are nearer than the stated bias.
    """
    visibility = np.asarray(algorithm.visibility(state, scene.eye.points), np.float64)
    off = np.where(scene.judged, np.abs(visibility - scene.expected), 0.0)
    receivers, status = projected(scene), algorithm.status(state)
    marked = np.asarray(receivers.secant) >= 0.999 / GRAZING
    if not isinstance(algorithm, AccumulatedShadowMap):
        marked |= ~np.asarray(receivers.facing)
    slack = _CONTACT if isinstance(algorithm, MomentShadowMap) else 1.0
    marked |= explained(scene, algorithm, state, visibility, slack).stated
    count = max(int(scene.judged.sum()), 1)
    error, wrong = (float(x.sum()) / count for x in (off, scene.wrong(visibility)))
    silent, how = float(off[~marked].sum()) / count, "marked"
    if status is not Status.COMPLETE:
        silent, how = 0.0, f"status {status.name}"
    if not _is_sound(scene, algorithm, state, visibility):
        error = silent = math.inf
    return Judgement(error, silent, wrong, how)


def _is_sound(scene: Scene, algorithm: ShadowAlgorithm, state, visibility: np.ndarray) -> bool:
    """Whether answers are shares of light, of a map 0 or 1, and densities are numbers."""
    density = np.asarray(algorithm.density(state, scene.eye.points), np.float64)
    if isinstance(algorithm, tuple(MAPS.values())):
        answers = np.isin(visibility, (0.0, 1.0))
    else:
        answers = (visibility >= 0) & (visibility <= 1)
    return bool(answers.all() and (np.abs(density) < _LARGEST_DENSITY).all())
