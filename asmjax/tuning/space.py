"""The settings that are tuned, as a unit box: where each lies in its range, and which are steps.

A point of the box is (9,) from 0 to 1, in the order of `NAMES`. Logarithms of the settings are
linear in it, so that a step means as much at either end of a range.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from asmjax.errors import UseError
from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.comparison import BIAS

MEMORY_PARTS = (1 / 4, 1)
"""Parts of the memory limit that are tried."""

NAMES = (
    "ratio_target", "finest_ratio", "discontinuity", "least_profit", "node_resolution", "cells",
    "pixel_share", "memory_bytes", "time_limit",
)  # fmt: skip
"""The settings that are tuned, in the order of a point."""

NODES = (8, 16, 32)
"""Texels per node side that are tried."""

CELLS = (2, 4)
"""Cells per node side that are tried: with 8 the tables are full before the memory is."""

SHARES = (2, 8)
"""Shares of pixels that first looks take, that are tried."""


BALANCED, TURNS = 6, ((0, 1), (0, 1), (1, 2), (0, 3))
"""Combinations of steps that are balanced; and of which number, and how slowly, the steps of each
setting that has some take turns."""


@dataclass(frozen=True)
class Knob:
    """One setting's range.

    Attributes:
        name: of the setting of `AdaptiveShadowMap`.
        low, high: ends of the range, where the box has 0 and 1; positive.
        steps: the only values it can have, ascending; None for any in between.
        off: what the setting is at the end of the range where it does nothing, and which end
            that is: 0 or 1; None where it always acts.
        words: what it is, with its unit, for tables and axes.
    """

    name: str
    low: float
    high: float
    words: str
    steps: tuple[int, ...] | None = None
    off: tuple[int, float | None] | None = None

    def at(self, x: float) -> Any:
        """The setting at place `x` from 0 to 1."""
        if self.steps is not None:
            value = self.continuous(x)
            return min(self.steps, key=lambda step: abs(math.log(step / value)))
        if self.off is not None and abs(x - self.off[0]) < 1e-3:
            return self.off[1]
        return self.continuous(x)

    def continuous(self, x: float) -> float:
        """The same, also between steps."""
        return self.low * (self.high / self.low) ** x

    @property
    def fixed(self) -> bool:
        """Whether there is one value only."""
        return self.low == self.high

    def place(self, value: float | None) -> float:
        """The place of a setting, 0 to 1; the nearest one for settings beyond the range."""
        if self.off is not None and value == self.off[1]:
            return float(self.off[0])
        assert value is not None
        if value <= 0 or self.fixed:
            return 0.0
        return min(max(math.log(value / self.low) / math.log(self.high / self.low), 0.0), 1.0)


@dataclass(frozen=True)
class Space:
    """The box of settings for one limit of memory.

    Attributes:
        base: holds all settings that are not tuned.
        knobs: what is tuned, in order.
    """

    base: AdaptiveShadowMap
    knobs: tuple[Knob, ...]

    def settings(self, point: np.ndarray) -> dict[str, Any]:
        """The tuned settings at a point (9,), steps rounded; possible ones everywhere."""
        found = {knob.name: knob.at(float(x)) for knob, x in zip(self.knobs, point, strict=True)}
        found["finest_ratio"] = min(found["finest_ratio"], found["ratio_target"])
        return found

    def algorithm(self, point: np.ndarray) -> AdaptiveShadowMap:
        """The map with the settings at a point."""
        return replace(self.base, **self.settings(point))

    def point(self, algorithm: AdaptiveShadowMap) -> np.ndarray:
        """The point (9,) of an algorithm's settings."""
        return np.array([knob.place(getattr(algorithm, knob.name)) for knob in self.knobs])

    def snapped(self, point: np.ndarray) -> np.ndarray:
        """The point whose settings are those at `point`: steps in their places."""
        return self.point(self.algorithm(point))

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(knobs,) ends of the ranges."""
        low, high = zip(*((float(knob.low), float(knob.high)) for knob in self.knobs), strict=True)
        return np.array(low), np.array(high)

    def with_steps(self, point: np.ndarray, number: int) -> np.ndarray:
        """The point with the steps of that number: any `BALANCED` in a row have each step of each
        setting as often, and no two settings go together."""
        found, turns = point.copy(), iter(TURNS)
        for k, knob in enumerate(self.knobs):
            if knob.steps is not None:
                shift, slow = next(turns)
                found[k] = knob.place(knob.steps[(number + shift) // slow % len(knob.steps)])
        return found

    def other_steps(self, point: np.ndarray) -> list[np.ndarray]:
        """The points that differ in steps only, all of them, this one's own among them."""
        points = [point]
        for k, knob in enumerate(self.knobs):
            if knob.steps is not None:
                places = [knob.place(step) for step in knob.steps]
                points = [np.r_[other[:k], at, other[k + 1 :]] for other in points for at in places]
        return points

    def neighbours(self, point: np.ndarray, step: float) -> list[np.ndarray]:
        """Points beside one: the next steps up and down, and `step` of the range elsewhere."""
        found = []
        for k, knob in enumerate(self.knobs):
            for way in (-1, 1):
                other = point.copy()
                if knob.steps is None:
                    other[k] = np.clip(point[k] + way * step, 0, 1)
                else:
                    here = knob.steps.index(int(knob.at(float(point[k])) or 0))
                    there = min(max(here + way, 0), len(knob.steps) - 1)
                    other[k] = knob.place(knob.steps[there])
                if abs(other[k] - point[k]) > 1e-9:
                    found.append(other)
        return found


def values_at(point: Float[Array | np.ndarray, "knobs ..."], low, high) -> dict[str, Any]:
    """Continuous settings by name at points of the box whose ranges end at `low` and `high`
    (knobs, ...); differentiable."""
    values = low * (high / low) ** point
    return dict(zip(NAMES, values, strict=True))


def space_of(base: AdaptiveShadowMap, faces: int, seconds: float) -> Space:
    """The box of settings up to the memory limit of `base`, for a light of so many faces.

    Args:
        base: with its cost model.
        seconds: that a frame of `base` takes; limits of time are parts and multiples of it.

    Raises:
        UseError: the limit does not hold one node per face of the largest kind.
    """
    coarsest = replace(base, node_resolution=NODES[-1], start_resolution=None, time_limit=None)
    coarsest.tree_shape(faces)
    memory = [int(base.memory_bytes * part) for part in MEMORY_PARTS]
    possible = tuple(size for size in memory if _holds_a_node(coarsest, size, faces))
    per_texel, launch = node_cost(base)
    pixel = float(1 / (per_texel * NODES[1] ** 2 + launch))
    knobs = (
        Knob("ratio_target", 0.5, 16.0, "texel / pixel at which a pixel is matched"),
        Knob("finest_ratio", 1 / 64, 4.0, "texel / pixel down to which edges are refined"),
        Knob("discontinuity", BIAS, 0.1, "least gap of a shadow's edge / depth", off=(0, 0.0)),
        Knob("least_profit", 0.4 * pixel, 60 * pixel, "least eye pixels / second", off=(0, 0.0)),
        Knob("node_resolution", NODES[0], NODES[-1], "texels per node side", steps=NODES),
        Knob("cells", CELLS[0], CELLS[-1], "cells per node side", steps=CELLS),
        Knob("pixel_share", SHARES[0], SHARES[-1], "pixels per first look's", steps=SHARES),
        Knob("memory_bytes", possible[0], possible[-1], "memory limit, bytes", steps=possible),
        Knob("time_limit", 0.1 * seconds, 3 * seconds, "time limit, seconds", off=(1, None)),
    )
    # What was fit for the default's nodes may not be for all that are tried.
    return Space(replace(base, time_limit=None, start_resolution=None), knobs)


def node_cost(base: AdaptiveShadowMap) -> np.ndarray:
    """(2,) seconds per texel and per launch, by which the map itself reckons its nodes' costs."""
    assert base.cost_model is not None
    return np.array([base.cost_model.a_seconds_per_texel, base.cost_model.b_seconds])


def _holds_a_node(algorithm: AdaptiveShadowMap, memory_bytes: int, faces: int) -> bool:
    try:
        replace(algorithm, memory_bytes=memory_bytes).tree_shape(faces)
    except UseError:
        return False
    return True
