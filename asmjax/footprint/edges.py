"""Where refinement can pay: pixels whose map stencil straddles a depth discontinuity."""

from jaxtyping import Array, Bool


def straddles_discontinuity(lit_taps: Bool[Array, "taps n"]) -> Bool[Array, " n"]:
    """Whether the taps around a pixel see both outcomes for *this* receiver: 0 < PCF < 1.

    Relative to the receiver, unlike a threshold on depth gaps: free of scale, and it marks
    exactly the pixels whose visibility more texels could change.
    """
    return lit_taps.any(axis=0) & ~lit_taps.all(axis=0)
