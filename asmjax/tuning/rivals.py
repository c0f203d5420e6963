"""Settings that know nothing of what was measured: a grid, and points at random. The search starts
from some of the latter; all others are what it is compared with."""

import numpy as np
from scipy.stats import qmc

from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.space import BALANCED, NAMES, Space

GRID = {
    "finest_ratio": (1 / 64, 1 / 16, 1 / 4, 1.0),
    "ratio_target": (1.0, 4.0),
    "least_profit": (0.0, None),
    "node_resolution": (16, 32),
}
"""The grid of 32 points that tuned settings are compared with; None is the middle of the range. All
other settings are the default's."""


def grid_size() -> int:
    """Points of the grid."""
    return int(np.prod([len(values) for values in GRID.values()]))


def grid(space: Space, base: AdaptiveShadowMap) -> list[np.ndarray]:
    """Points of the grid about the settings of `base`."""
    points = [space.point(base)]
    for name, values in GRID.items():
        k = NAMES.index(name)
        places = [0.5 if value is None else space.knobs[k].place(value) for value in values]
        points = [np.r_[p[:k], place, p[k + 1 :]] for p in points for place in places]
    return points


def drawn(space: Space, count: int, seed: int) -> list[np.ndarray]:
    """`count` points spread over the whole box. Few combinations of steps: each has programs of its
    own to compile."""
    # By its old name: SciPy's stubs know `rng` only, SciPy 1.14 `seed` only.
    sequence = qmc.Sobol(len(NAMES), seed=seed)  # pyright: ignore[reportCallIssue]
    points = sequence.random(1 << (count - 1).bit_length())[:count]
    return [space.with_steps(point, k % BALANCED) for k, point in enumerate(points)]
