"""Settings of the adaptive shadow map by name, so that one can see what each change buys."""

from typing import Any

from asmjax.errors import unknown_name
from asmjax.shadow.adaptive.asm import AdaptiveShadowMap

PAPER_2001: dict[str, Any] = {
    "start_resolution": 512,
    "node_resolution": 64,
    "cells": 2,
    "ratio_target": 1.0,
    "measure": "mipmap_anisotropic",
    "pixel_share": 8,
    "cover": False,
    "finest_ratio": 1.0,
}
"""Fernando et al. 2001 to the letter, as far as it says: starts at 512 x 512, looks at one pixel in
eight, measures areas with a mip-map, refines mismatched edges and nothing else. The paper gives
neither R nor c: an effective 65,536 and 524,288 both follow from 512 with c = 2 only, and R = 64
leaves 16 MB some 600 nodes."""

PRESETS: dict[str, dict[str, Any]] = {"default": {}, "paper_2001": PAPER_2001}
"""Settings that differ from those of `AdaptiveShadowMap()`, by name."""


def preset(name: str, **changes) -> AdaptiveShadowMap:
    """The adaptive shadow map of that name, with `changes` to its settings.

    Raises:
        UseError: there is no preset of that name, or a setting is not possible.
    """
    if name not in PRESETS:
        raise unknown_name("preset", name, PRESETS)
    return AdaptiveShadowMap(**(PRESETS[name] | changes))
