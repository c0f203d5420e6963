"""All errors of one method, under the keys that `report.json` gives them."""

import numpy as np
from jaxtyping import Bool, Shaped

from asmjax.metrics.boundary import SurfacePairs, boundary_displacement
from asmjax.metrics.visibility_error import visibility_error


def error_summary(
    truth: Shaped[np.ndarray, "height width"],
    visibility: Shaped[np.ndarray, "height width"],
    valid: Bool[np.ndarray, "height width"],
    pairs: SurfacePairs,
    length: float | None = None,
) -> dict:
    """The `error` entry of a method: plain floats, fractions of valid pixels and pixels.

    Arguments and errors as `boundary_displacement`.
    """
    image = visibility_error(truth, visibility, valid)
    edges = boundary_displacement(truth, visibility, valid, pairs, error=image, length=length)
    return {
        "misclassified_fraction": image.misclassified_fraction,
        "false_lit_fraction": image.false_lit_fraction,
        "false_dark_fraction": image.false_dark_fraction,
        "boundary_displacement_px": {
            "mean": edges.mean,
            "p95": edges.p95,
            "hausdorff": edges.hausdorff,
            "unmatched_fraction": edges.unmatched_fraction,
            "per_edge_length": edges.per_edge_length,
        },
    }
