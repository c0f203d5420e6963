"""The fast adaptive map and its slow twin of plain objects: the same tree, the same image.

In float64, where no rounding decides. Each trial presses on another part of the policy.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from helpers.registry import FAST
from helpers.slow_asm import SlowASM

from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.builtin import load_builtin
from asmjax.scene.lights import light_frame
from asmjax.shadow import AdaptiveShadowMap

SIDE = 40
"""Pixels a side."""

STEP = (0.3, 0.2, -0.1)
STRIDE = (1.0, 0.5, 0.5)
"""How far the eye moves from update to update, scene units."""


class Trial(NamedTuple):
    """A built-in scene and one of its lights, settings, the eye's step, and whether nodes go."""

    scene: str
    light: str
    settings: dict
    step: tuple[float, float, float]
    evicts: bool


PAPER = {"cover": False, "finest_ratio": 1.0, "start_resolution": 16}

TRIALS = {
    # Room to spare is spent on finer edges.
    "disc": Trial("a4_disc_light", "centre", {"memory_bytes": 2**19}, STEP, False),
    # Three faces; areas; a coverage that the memory cannot afford.
    "sphere": Trial(
        "a6_sphere",
        "centre",
        {"memory_bytes": 3 * 2**14, "measure": "area", "node_resolution": 8},
        STEP,
        True,
    ),
    # The 2001 paper with too little memory: newcomers replace by benefit.
    "letter": Trial(
        "letter_f", "spot", {"memory_bytes": 2**14, "node_resolution": 8, **PAPER}, STEP, True
    ),
    # 4 x 4 cells; every pixel; depth alone; what served nobody for a frame goes first.
    "sun": Trial(
        "a6_sphere_sun",
        "sun",
        {
            "memory_bytes": 3 * 2**14,
            "cells": 4,
            "pixel_share": 1,
            "node_resolution": 8,
            "compare": "depth",
        },
        STRIDE,
        True,
    ),
    # A sphere is near one side of its shadow and far off the other: only that one is refined.
    "near": Trial(
        "a6_sphere", "centre", {"memory_bytes": 2**19, "discontinuity": 0.35}, STEP, False
    ),
    # Nodes that serve three pixels and fewer are not worth what they cost.
    "thrift": Trial(
        "a4_disc_light", "centre", {"memory_bytes": 2**19, "least_profit": 3e5}, STEP, False
    ),
}

LEFT = ("sphere", "near", "sun")
"""What the quick run leaves to the other ones."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if name in LEFT else []) for name in TRIALS],
)
def test_the_slow_twin_builds_the_same_tree_and_gives_the_same_image(name, x64):
    """After the build, after an update at rest, and after each of two for a moving view."""
    trial = TRIALS[name]
    spec = load_builtin(trial.scene)
    view = next(iter(spec.views.values())).resized(SIDE, SIDE)
    moved = [
        replace(view, origin=tuple(np.asarray(view.origin) + k * np.asarray(trial.step)))
        for k in (1, 2)
    ]
    eyes = [analytic_eye(spec.shapes, v) for v in (view, view, *moved)]
    frame = light_frame(spec.lights[trial.light], eyes[0], scene_bounds(spec.shapes))
    rays = AnalyticRays(spec.shapes)
    algorithm = AdaptiveShadowMap(cost_model=FAST, **trial.settings)
    slow = SlowASM(algorithm, frame, rays)
    state, evicted = None, 0
    for k, eye in enumerate(eyes):
        if state is None:
            state = algorithm.build(eye, frame, rays)
            slow.build(eye)
        else:
            state = algorithm.update(state, eye, frame, rays)
            slow.update(eye)
        squares = [tuple(square) for square in state.pool.squares[:, state.pool.held()].T.tolist()]
        assert squares == [node.square for node in slow.nodes()], k
        assert algorithm.status(state) is slow.status, k
        cost = algorithm.cost(state)
        assert (cost.nodes, cost.passes) == (slow.counts(), slow.passes), k
        evicted += slow.evicted
        lit = np.asarray(algorithm.visibility(state, eye.points))
        np.testing.assert_array_equal(lit, slow.visibility(eye), err_msg=str(k))
        assert 0.05 < lit.mean() < 0.99
    assert max(node.level for node in slow.nodes()) > 1
    assert (evicted > 0) == trial.evicts
