"""Measuring shadow methods: same eye pixels, same light, same truth."""

import gc
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jax.typing import ArrayLike

from asmjax.buffers import EyeBuffer, LightRays, seen_points
from asmjax.experiment.bias import bias_summary, stated_bias
from asmjax.experiment.clock import median_by_stage, repeated
from asmjax.geometry import LightFrame
from asmjax.shadow import Cost, ShadowAlgorithm, Status, family_of


@runtime_checkable
class TracedShadows(Protocol):
    """Prepared shadow rays of one view: how many, and what traces them."""

    count: int

    def trace(self) -> np.ndarray:
        """Visibility (n,) bool of all eye pixels."""
        ...


@dataclass(frozen=True, eq=False)
class Measured:
    """What one method did to one view.

    Attributes:
        name: for tables.
        settings: what it ran with.
        visibility: (n,) from 0 to 1, the mean over the valid samples of each pixel.
        cost: of the last timed run; `cost.seconds` holds medians by stage, `query` included.
        status: how the build ended.
        effective_resolution: texels per side, None for traced rays.
        state: of the last timed run; None for traced rays.
        bias: median and largest distance that its shadow test cannot tell, scene units
            (`asmjax.experiment.bias`); None for traced rays.
    """

    name: str
    settings: dict
    visibility: np.ndarray
    cost: Cost
    status: Status
    effective_resolution: int | None
    state: Any = None
    bias: dict | None = None


def queried(
    algorithm: ShadowAlgorithm, state, eyes: Sequence[EyeBuffer], repeats: int
) -> tuple[np.ndarray, float]:
    """Visibility (n,) of the pixels, the mean over their samples, and median seconds of finding it.

    Only the pixels that see a surface are asked about, as only they get a shadow ray.
    """
    seen = [seen_points(eye) for eye in eyes]
    samples, seconds = repeated(
        lambda: [algorithm.visibility(state, some.points) for some in seen], repeats
    )
    images = [some.image(lit) for some, lit in zip(seen, samples, strict=True)]
    return pixel_mean(images, eyes), seconds


def pixel_mean(samples: Sequence[ArrayLike], eyes: Sequence[EyeBuffer]) -> np.ndarray:
    """Visibility (n,) of pixels from that of their samples: the mean over those that are valid."""
    valid = np.stack([eye.valid for eye in eyes])
    lit = np.stack([np.asarray(visibility, np.float64) for visibility in samples]) * valid
    return lit.sum(axis=0) / np.maximum(valid.sum(axis=0), 1)


def measure(
    algorithm: ShadowAlgorithm,
    eyes: Sequence[EyeBuffer],
    frame: LightFrame,
    rays: LightRays,
    repeats: int,
) -> Measured:
    """Build from nothing for the first of `eyes` and query them all, `repeats` times after a
    warm-up. `eyes` are the samples of each pixel, the pixel centres first.
    """
    stages, state = [], None
    for run in range(repeats + 1):
        # The previous tree is freed before the next one takes as much again.
        state = None
        gc.collect()
        state = algorithm.build(eyes[0], frame, rays)
        if run:
            stages.append(algorithm.cost(state).seconds)
    visibility, query = queried(algorithm, state, eyes, repeats)
    cost = algorithm.cost(state)
    return Measured(
        name=algorithm.name,
        settings=settings_of(algorithm),
        visibility=visibility,
        cost=replace(cost, seconds=median_by_stage(stages) | {"query": query}),
        status=algorithm.status(state),
        effective_resolution=algorithm.effective_resolution(state),
        state=state,
        bias=bias_summary(stated_bias(algorithm, state, eyes[0], frame)),
    )


def measure_rays(
    shadow_rays: Sequence[TracedShadows],
    eyes: Sequence[EyeBuffer],
    repeats: int,
) -> Measured:
    """The honest yardstick, and the truth of hard shadows: a shadow ray per sample that faces the
    light."""
    samples, query = repeated(lambda: [rays.trace() for rays in shadow_rays], repeats)
    return Measured(
        name=f"rays-{len(eyes)}",
        settings={"rays_per_pixel": len(eyes)},
        visibility=pixel_mean(samples, eyes),
        cost=Cost(
            0, 0, sum(rays.count for rays in shadow_rays), len(eyes),
            {"build": 0.0, "analysis": 0.0, "query": query},
        ),
        status=Status.COMPLETE,
        effective_resolution=None,
    )  # fmt: skip


def settings_of(algorithm: ShadowAlgorithm) -> dict:
    """The documented settings of an algorithm as plain values; of a map that it filters, a table of
    `algorithm` and `settings`, as in a settings file."""
    names = [field.name for field in fields(algorithm) if field.name != "cost_model"]
    return {name: _plain(getattr(algorithm, name)) for name in names}


def _plain(value: Any) -> Any:
    if isinstance(value, ShadowAlgorithm):
        return {"algorithm": family_of(value), "settings": settings_of(value)}
    return value
