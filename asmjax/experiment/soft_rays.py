"""Soft truth of a view: rays from every sample of its pixels to points all over a light."""

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.experiment.clock import timed
from asmjax.experiment.methods import Measured, pixel_mean
from asmjax.geometry import AreaLight
from asmjax.scene.soft_visibility import SoftVisibility
from asmjax.shadow import Cost, FilteredShadowMap, ShadowAlgorithm, Status, family_of
from asmjax.shadow.registry import SOFT

SOFT_STRATA, SOFT_REPEATS = 4, 4
"""Cells a side of a light and rays to each of them from every sample, where truth is soft: 64 rays.

A straight edge along the cells crosses 4 of the 16, and only these err: with the share p of light
in them, visibility has the variance 4 p (1 - p) / (4 x 16^2). Its standard error is 1/32 at p = 1/2
and pi / 128, 1/41, in the mean over a penumbra."""


class SoftRays(Protocol):
    """Shadow rays of one sample of the pixels to a light with a size."""

    count: int

    def estimate(self) -> SoftVisibility:
        """Cast them."""
        ...


def answers_softly(algorithm: ShadowAlgorithm) -> bool:
    """Whether a map, or the one that it filters, answers with shares of a light that has a size."""
    inner = algorithm.inner if isinstance(algorithm, FilteredShadowMap) else algorithm
    return family_of(inner) in SOFT


def calls_for_soft_truth(area: AreaLight | None, algorithms: Iterable[ShadowAlgorithm]) -> bool:
    """Whether hard truth would take right answers of one of the algorithms for wrong ones, of a
    light with that `area`."""
    return area is not None and any(answers_softly(item) for item in algorithms)


def soft_truth(
    rays_of: Callable[[int, EyeBuffer], SoftRays], eyes: Sequence[EyeBuffer]
) -> tuple[Measured, np.ndarray]:
    """Soft truth as a method, and the standard error (n,) of the pixels' visibility.

    It is cast once, and nothing is warmed up: its time, with drawing the places on the light, is
    none to compare with.

    Args:
        rays_of: of the k-th of `eyes`. Those of one sample are let go before the next are made.
    """
    images, errors, rays, seconds = [], [], 0, 0.0
    for k, eye in enumerate(eyes):
        soft = rays_of(k, eye)
        found, took = timed(soft.estimate)
        images.append(found.visibility)
        errors.append(found.error * eye.valid)
        rays, seconds = rays + soft.count, seconds + took
        del soft
    each = SOFT_STRATA**2 * SOFT_REPEATS * len(eyes)
    truth = Measured(
        name=f"rays-{each}",
        settings={"rays_per_pixel": each},
        visibility=pixel_mean(images, eyes),
        cost=Cost(
            0, 0, rays, each,
            {"build": 0.0, "analysis": 0.0, "query": seconds},
        ),
        status=Status.COMPLETE,
        effective_resolution=None,
    )  # fmt: skip
    valid = np.sum([eye.valid for eye in eyes], axis=0)
    variance = np.sum([error**2 for error in errors], axis=0)
    return truth, np.sqrt(variance) / np.maximum(valid, 1)
