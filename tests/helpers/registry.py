"""All shadow algorithms that `test_siblings.py` runs: a new sibling is one more entry here."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isqrt

import numpy as np

from asmjax.shadow import (
    AccumulatedShadowMap,
    AdaptiveShadowMap,
    CostModel,
    FilteredShadowMap,
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    MomentShadowMap,
    PartitionedShadowMap,
    PCSSShadowMap,
    PerspectiveShadowMap,
    ShadowAlgorithm,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
    TunedShadowMap,
    UniformShadowMap,
)
from asmjax.shadow.comparison import Compare, texel_bytes

FAST = CostModel(a_seconds_per_texel=1e-8, b_seconds=1e-5, residual=0.0)
"""Fixed costs: calibration would make the order of refinement depend on the machine's load."""

NEVER = 2.0**50
"""A texel / pixel size at which every pixel is matched."""


@dataclass(frozen=True)
class Sibling:
    """One algorithm.

    Attributes:
        name: for test ids.
        of_budget: (texels, faces) to an algorithm whose arrays take at most `texels` texels of
            6 bytes in all (depth and primitive), tables included.
        degenerate: (side, compare) to settings that must give the uniform map of `side` texels.
        log2_resolution: (algorithm, state, points) to log2 of the texels per face side that
            answered each point.
        charts: whether it is a map of charts: these share everything but the choice of charts, and
            one light each is enough; as it is for what of lights without a size is the uniform map.
        soft: whether it answers with shares of light, and not with 0 or 1 alone.
        depth_only: whether it compares nothing but depths.
    """

    name: str
    of_budget: Callable[[int, int], ShadowAlgorithm]
    degenerate: Callable[[int, Compare], ShadowAlgorithm]
    log2_resolution: Callable[..., np.ndarray]
    charts: bool = False
    soft: bool = False
    depth_only: bool = False


def _of_uniform(algorithm, state, points) -> np.ndarray:
    return np.full(points.count, np.log2(algorithm.resolution))


def _of_adaptive(algorithm, state, points) -> np.ndarray:
    return np.asarray(algorithm.lookup(state, points)[1])


def _of_charts(algorithm, state, points) -> np.ndarray:
    """By the longer side of the texel."""
    density = np.moveaxis(np.asarray(algorithm.density(state, points), np.float64), -1, 0)
    found = np.abs(np.linalg.det(density)) > 0
    texel = np.linalg.inv(np.where(found[:, None, None], density, np.eye(2)))
    return -np.log2(np.linalg.norm(texel, ord=2, axis=(1, 2)))


TABLES = 10_000
"""Bytes that the tables of a map of charts may take."""


def charted(name: str, family: type, flat: dict, **settings) -> Sibling:
    """A map of charts; `flat` are its settings that leave nothing but a flat map."""

    def of_budget(texels: int, faces: int):
        held = (texels * texel_bytes("both") - TABLES) // texel_bytes("both")
        return family(resolution=isqrt(held // faces), compare="both", **settings)

    return Sibling(
        name,
        of_budget=of_budget,
        degenerate=lambda side, compare: family(
            resolution=side, compare=compare, **(settings | flat)
        ),
        log2_resolution=_of_charts,
        charts=True,
    )


def filtered(name: str, inner: Sibling, **settings) -> Sibling:
    """A filter of another sibling's map; degenerate, one that asks a single texel."""

    def of_budget(texels: int, faces: int):
        held = texels - TABLES // texel_bytes("both")
        return FilteredShadowMap(inner=inner.of_budget(held, faces), **settings)

    return Sibling(
        name,
        of_budget=of_budget,
        degenerate=lambda side, compare: FilteredShadowMap(
            "area", width=0, inner=inner.degenerate(side, compare)
        ),
        log2_resolution=lambda algorithm, state, points: inner.log2_resolution(
            algorithm.inner, state.inner, points
        ),
        soft=True,
    )


_UNIFORM = Sibling(
    "uniform",
    of_budget=lambda texels, faces: UniformShadowMap(isqrt(texels // faces), compare="both"),
    degenerate=lambda side, compare: UniformShadowMap(side, compare=compare),
    log2_resolution=_of_uniform,
)
_ADAPTIVE = Sibling(
    "adaptive",
    of_budget=lambda texels, faces: AdaptiveShadowMap(
        memory_bytes=texels * texel_bytes("both"), cost_model=FAST
    ),
    degenerate=lambda side, compare: AdaptiveShadowMap(
        start_resolution=side,
        cover=False,
        ratio_target=NEVER,
        finest_ratio=NEVER,
        compare=compare,
        cost_model=FAST,
    ),
    log2_resolution=_of_adaptive,
)
_LIGHT_SPACE = charted("light-space", LightSpaceShadowMap, {"falloff": "none"})

SIBLINGS = (
    _UNIFORM,
    _ADAPTIVE,
    charted("perspective", PerspectiveShadowMap, {"slide": np.inf}),
    _LIGHT_SPACE,
    charted("trapezoidal", TrapezoidalShadowMap, {"focus": 1e9}),
    charted("logarithmic", LogarithmicShadowMap, {"ratio": 1.0}),
    charted("partitioned", PartitionedShadowMap, {"partitions": 1}),
    charted("subdivided", SubdividedShadowMap, {"parts": 0}),
    charted("tuned", TunedShadowMap, {"partitions": 1, "warp": "none"}),
    filtered("filtered", _UNIFORM, kernel="bilinear"),
    Sibling(
        "accumulated",
        of_budget=lambda texels, faces: AccumulatedShadowMap(
            isqrt(texels // faces), compare="both"
        ),
        degenerate=lambda side, compare: AccumulatedShadowMap(side, compare=compare),
        log2_resolution=_of_uniform,
        charts=True,
    ),
    Sibling(
        "pcss",
        of_budget=lambda texels, faces: PCSSShadowMap(isqrt(texels // faces), compare="both"),
        degenerate=lambda side, compare: PCSSShadowMap(side, compare=compare),
        log2_resolution=_of_uniform,
        charts=True,
    ),
    Sibling(
        "moment",
        of_budget=lambda texels, faces: MomentShadowMap(isqrt(texels // faces)),
        degenerate=lambda side, compare: MomentShadowMap(side),
        log2_resolution=_of_uniform,
        charts=True,
        depth_only=True,
    ),
)

VARIANTS = (
    charted("logarithmic-uniform", LogarithmicShadowMap, {"ratio": 1.0}, across="uniform"),
    charted(
        "partitioned-warped",
        PartitionedShadowMap,
        {"partitions": 1, "warp": "none"},
        warp="light-space",
        blend=0.5,
    ),
    charted("subdivided-1", SubdividedShadowMap, {"parts": 0}, parts=1, strength=0.5),
    # The 2001 paper as printed: areas, edges only, texels of a pixel's size; coarse levels.
    Sibling(
        "adaptive-2001",
        of_budget=lambda texels, faces: AdaptiveShadowMap(
            memory_bytes=texels * texel_bytes("both"),
            cover=False,
            finest_ratio=1.0,
            measure="area",
            node_resolution=32,
            cells=4,
            cost_model=FAST,
        ),
        degenerate=lambda side, compare: AdaptiveShadowMap(
            start_resolution=side,
            node_resolution=32,
            cells=4,
            cover=False,
            ratio_target=NEVER,
            finest_ratio=NEVER,
            measure="area",
            compare=compare,
            cost_model=FAST,
        ),
        log2_resolution=_of_adaptive,
    ),
    filtered("filtered-sixteen", _ADAPTIVE),
    filtered("filtered-dithered", _LIGHT_SPACE, kernel="dithered"),
    filtered("filtered-original", _UNIFORM, kernel="original", width=1.0),
)
"""Further settings of algorithms above, for the tests that depend on settings."""
