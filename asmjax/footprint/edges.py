"""Where refinement can pay: pixels whose map stencil straddles a depth discontinuity."""

from collections.abc import Sequence

from jaxtyping import Array, Bool


def straddles_discontinuity(
    lit_taps: Bool[Array, "taps n"] | Sequence[Bool[Array, " n"]],
) -> Bool[Array, " n"]:
    """Whether the taps around a pixel see both outcomes for *this* receiver: 0 < PCF < 1.

    Relative to the receiver, unlike a threshold on depth gaps: free of scale, and it marks
    exactly the pixels whose visibility more texels could change.
    """
    # Written out: a reduction over the first axis takes XLA's CPU backend several times as long.
    some, every = lit_taps[0], lit_taps[0]
    for lit in lit_taps[1:]:
        some, every = some | lit, every & lit
    return some & ~every
