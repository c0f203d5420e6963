"""How far a soft shadow is off: shares of light, widths of penumbrae, leaks and acne."""

from typing import NamedTuple

import numpy as np

from asmjax.metrics.boundary import SurfacePairs, boundary_edges, boundary_length
from asmjax.metrics.visibility_error import signed_error

NOTICED = 1 / 16
"""Shares of light by which a pixel may be off before it counts as a leak or as acne, and within
which of 0 or 1 it counts as dark or lit: four standard errors of a truth of 64 rays."""


class SoftError(NamedTuple):
    """Of one method against truth, over the valid pixels; all 0 where there is none.

    Attributes:
        mae, rmse, max: of abs(visibility - truth).
        penumbra_width_px: mean width of the method's penumbrae minus truth's, pixels: pixels that
            are neither dark nor lit per pixel of truth's half-lit edge. 0 where truth has no edge.
        leak_fraction: pixels that are lighter than truth by more than `NOTICED`.
        acne_fraction: pixels that are lit in truth and darker by more than that.
    """

    mae: float
    rmse: float
    max: float
    penumbra_width_px: float
    leak_fraction: float
    acne_fraction: float


def soft_error(truth, visibility, valid, pairs: SurfacePairs) -> SoftError:
    """Errors of images (height, width) of visibility from 0 to 1.

    Args:
        pairs: of the valid pixels, from `surface_pairs`.

    Raises:
        UseError: as `signed_error`.
    """
    off = signed_error(truth, visibility, valid)
    mask = np.asarray(valid, bool)
    count = max(int(np.count_nonzero(mask)), 1)
    truth, visibility = (np.where(mask, image, 0.0) for image in (truth, visibility))
    edges = boundary_edges(truth, pairs)
    length = boundary_length(edges)
    between = [
        np.count_nonzero((image > NOTICED) & (image < 1 - NOTICED)) for image in (truth, visibility)
    ]
    lit = mask & (truth >= 1 - NOTICED)
    return SoftError(
        mae=float(np.abs(off).sum()) / count,
        rmse=float(np.sqrt((off**2).sum() / count)),
        max=float(np.abs(off).max(initial=0.0)),
        penumbra_width_px=(between[1] - between[0]) / length if length > 0 else 0.0,
        leak_fraction=np.count_nonzero(off > NOTICED) / count,
        acne_fraction=np.count_nonzero(lit & (off < -NOTICED)) / count,
    )
