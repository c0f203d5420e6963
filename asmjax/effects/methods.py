"""From a decision to the shadow algorithms that carry it out."""

import numpy as np

from asmjax.effects.records import Decision
from asmjax.shadow import (
    AccumulatedShadowMap,
    FilteredShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
)
from asmjax.shadow.filtered.pcf import LEAST_WIDTH, MOST_WIDTH


def wants_softness(decision: Decision) -> bool:
    """Whether the penumbrae of a light are simulated: its truth then is soft, and a method of its
    own makes them."""
    return decision.simulated and decision.methods[-1:] in _MAKERS


def soft_methods(decision: Decision, resolution: int, texel_px: float) -> list[ShadowAlgorithm]:
    """What makes the penumbrae of a decision, of maps of `resolution` texels a side in all; nothing
    where there are none to make.

    Args:
        texel_px: texel / pixel of such a map, linear, at the typical receiver.
    """
    if not wants_softness(decision):
        return []
    return [_MAKERS[decision.methods[-1:]](decision, resolution, texel_px)]


def _filtered(decision: Decision, resolution: int, texel_px: float) -> FilteredShadowMap:
    """A window as wide as penumbrae are, in texels."""
    width = decision.settings["kernel_px"] / texel_px
    width = float(np.clip(width, LEAST_WIDTH, MOST_WIDTH))
    return FilteredShadowMap("area", width=width, inner=UniformShadowMap(resolution))


def _pcss(decision: Decision, resolution: int, texel_px: float) -> PCSSShadowMap:
    taps = {name: int(decision.settings[name]) for name in ("blocker_taps", "filter_taps")}
    return PCSSShadowMap(resolution, **taps)


def _moment(decision: Decision, resolution: int, texel_px: float) -> MomentShadowMap:
    return MomentShadowMap(resolution)


def _accumulated(decision: Decision, resolution: int, texel_px: float) -> AccumulatedShadowMap:
    samples = int(decision.settings["samples"])
    return AccumulatedShadowMap(max(resolution, samples), samples)


_MAKERS = {
    ("filtered",): _filtered,
    ("pcss",): _pcss,
    ("moment",): _moment,
    ("accumulated",): _accumulated,
}
