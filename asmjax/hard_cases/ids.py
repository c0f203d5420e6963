"""Kernel cases: ids of primitives in the 16 bits that maps keep of each."""

import jax
import numpy as np

from asmjax.buffers import EXACT_IDS
from asmjax.hard_cases.case import Bound, HardCase, Kernel
from asmjax.shadow.comparison import pack_prim

_PAIRS = 1 << 20

_packed = jax.jit(pack_prim)


def _alike(severity: float) -> Kernel:
    """Pairs of different primitives out of so many: any two, those whose ids differ by multiples of
    65,536, and by powers of two, as of objects of as many triangles."""
    count = round(severity)
    rng = np.random.default_rng(26)
    first = rng.integers(0, count, _PAIRS)
    apart = (
        rng.integers(1, count, _PAIRS),
        EXACT_IDS * rng.integers(1, max(count // EXACT_IDS, 1) + 1, _PAIRS),
        2 ** rng.integers(4, 31, _PAIRS),
    )

    def share(distance: np.ndarray) -> float:
        """Of pairs that share their bits: there the caster lets light through."""
        there = first + distance < count
        # All of them, so that there is one shape: it is compiled once.
        one, other = (
            np.asarray(_packed(np.where(there, prim, 0).astype(np.int32)))
            for prim in (first, first + distance)
        )
        return float((one == other)[there].mean()) if there.any() else 0.0

    return Kernel(
        inputs=(np.zeros(len(apart)),),
        value=lambda none: np.array([share(distance) for distance in apart]),
        truth=lambda none: none,
        unit=1.0,
        host=True,
    )


CASES = (
    HardCase(
        "primitives whose ids share their bits", (21, 26), "addresses",
        "Of ids cut to 16 bits one 65,536 further on is the receiver's own, and lets light in.",
        "a shift drawn for each run of 65,536 (asmjax.shadow.comparison.pack_prim), and a notice",
        "closed form", "primitives of the scene",
        (1e4, float(EXACT_IDS), 1e6, 1e8, 1e9),
        Bound(4 / EXACT_IDS, 4 / EXACT_IDS, "share of pairs taken for one primitive"), _alike,
    ),
)  # fmt: skip
"""Of the theme "addresses"."""
