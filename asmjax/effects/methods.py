"""From a decision to the shadow algorithms that carry it out."""

from collections.abc import Callable

from asmjax.effects.decide import FILTERED, FLAT, samples_worth
from asmjax.effects.records import Decision
from asmjax.shadow import (
    AccumulatedShadowMap,
    FilteredShadowMap,
    MomentShadowMap,
    PCSSShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
)
from asmjax.shadow.filtered.pcf import MOST_WIDTH


def wants_softness(decision: Decision) -> bool:
    """Whether the penumbrae of a light are simulated: its truth then is soft, and a method of its
    own makes them."""
    return decision.simulated and decision.methods in _MAKERS


def soft_methods(decision: Decision, resolution: int) -> list[ShadowAlgorithm]:
    """What makes the penumbrae of a decision, of maps of `resolution` texels a side in all; nothing
    where there are none to make."""
    if not wants_softness(decision):
        return []
    return [_MAKERS[decision.methods](decision, resolution)]


def _filtered(decision: Decision, resolution: int) -> FilteredShadowMap:
    """A window as wide as penumbrae are, and at least a texel, whose steps would be seen."""
    width = min(max(decision.settings["width_map"] * resolution, 1.0), MOST_WIDTH)
    return FilteredShadowMap("area", width=width, inner=UniformShadowMap(resolution))


def _pcss(decision: Decision, resolution: int) -> PCSSShadowMap:
    settings = decision.settings
    return PCSSShadowMap(
        resolution,
        blocker_taps=int(settings["blocker_taps"]),
        filter_taps=int(settings["filter_taps"]),
    )


def _moment(decision: Decision, resolution: int) -> MomentShadowMap:
    return MomentShadowMap(resolution)


def _accumulated(decision: Decision, resolution: int) -> AccumulatedShadowMap:
    texels = decision.settings["width_map"] * resolution
    samples = samples_worth(int(decision.settings["samples"]), texels)
    return AccumulatedShadowMap(max(resolution, samples), samples)


_MAKERS: dict[tuple[str, ...], Callable[[Decision, int], ShadowAlgorithm]] = {
    (*FLAT, *FILTERED): _filtered,
    ("pcss",): _pcss,
    ("moment",): _moment,
    ("accumulated",): _accumulated,
}
