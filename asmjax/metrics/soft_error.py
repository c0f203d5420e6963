"""How far a soft shadow is off: shares of light, widths of penumbrae, leaks and acne."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Shaped

from asmjax.metrics.boundary import (
    CAP_PX,
    SurfacePairs,
    boundary_edges,
    boundary_length,
    distances,
    edge_midpoints,
)
from asmjax.metrics.visibility_error import signed_error

NOTICED = 1 / 16
"""Shares of light by which a pixel may be off before it counts as a leak or as acne, and within
which of 0 or 1 it counts as dark or lit: two standard errors of a truth of 64 rays where a straight
edge halves its cells."""

SURE = 4.0
"""Standard errors of truth by which a pixel may be off besides."""

REACH_PX = CAP_PX
"""Distance from truth's half-lit edges within which a pixel may be of a penumbra, pixels: farther
away a share of light is that of a face, all of which is partly lit."""


class SoftError(NamedTuple):
    """Of one method against truth, over the valid pixels; all 0 where there is none.

    Attributes:
        mae, rmse, max: of abs(visibility - truth).
        penumbra_width_px: mean width of the method's penumbrae minus truth's, pixels, as of linear
            ramps: pixels within `REACH_PX` that are neither dark nor lit, which 7/8 of a ramp is,
            per pixel of truth's half-lit edge. 0 where truth has no edge.
        leak_fraction: pixels that are lighter than truth by more than `NOTICED` and `SURE` of its
            standard errors.
        acne_fraction: pixels that are lit in truth and darker by more than that.
    """

    mae: float
    rmse: float
    max: float
    penumbra_width_px: float
    leak_fraction: float
    acne_fraction: float


def soft_error(
    truth: Shaped[np.ndarray, "height width"],
    visibility: Shaped[np.ndarray, "height width"],
    valid: Bool[np.ndarray, "height width"],
    pairs: SurfacePairs,
    standard_error: Shaped[np.ndarray, "height width"] | float = 0.0,
) -> SoftError:
    """Errors of images (height, width) of visibility from 0 to 1.

    Args:
        pairs: of the valid pixels, from `surface_pairs`.
        standard_error: (height, width) of truth.

    Raises:
        UseError: as `signed_error`.
    """
    off = signed_error(truth, visibility, valid)
    mask = np.asarray(valid, bool)
    count = max(int(np.count_nonzero(mask)), 1)
    truth, visibility = (np.where(mask, image, 0.0) for image in (truth, visibility))
    edges = boundary_edges(truth, pairs)
    length = boundary_length(edges)
    wider = _penumbra(visibility, edges) - _penumbra(truth, edges)
    allowed = np.maximum(NOTICED, SURE * np.asarray(standard_error))
    lit = mask & (truth >= 1 - NOTICED)
    return SoftError(
        mae=float(np.abs(off).sum()) / count,
        rmse=float(np.sqrt((off**2).sum() / count)),
        max=float(np.abs(off).max(initial=0.0)),
        penumbra_width_px=wider / (length * (1 - 2 * NOTICED)) if length > 0 else 0.0,
        leak_fraction=int(np.count_nonzero(off > allowed)) / count,
        acne_fraction=int(np.count_nonzero(lit & (off < -allowed))) / count,
    )


def _penumbra(image: np.ndarray, edges: SurfacePairs) -> int:
    """Pixels that are neither dark nor lit, near the edges."""
    rows, columns = np.nonzero((image > NOTICED) & (image < 1 - NOTICED))
    centres = np.stack([columns + 0.5, rows + 0.5], axis=1)
    return int(np.count_nonzero(distances(centres, edge_midpoints(edges)) <= REACH_PX))
