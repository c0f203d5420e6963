"""How much of the image a method gets wrong (M1 of docs/theory.md)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Shaped

from asmjax.errors import require


@dataclass(frozen=True)
class VisibilityError:
    """Fractions of the valid pixels; all 0 where there is none.

    Attributes:
        misclassified_fraction: `false_lit_fraction + false_dark_fraction`.
        false_lit_fraction: shadowed in truth, lit by the method (leaks, displaced edges).
        false_dark_fraction: lit in truth, shadowed by the method (acne, displaced edges).
        count: number of valid pixels.
    """

    misclassified_fraction: float
    false_lit_fraction: float
    false_dark_fraction: float
    count: int


def signed_error(
    truth: Shaped[np.ndarray, "..."],
    visibility: Shaped[np.ndarray, "..."],
    valid: Bool[np.ndarray, "..."],
) -> Float64[np.ndarray, "..."]:
    """(height, width) float64 `visibility - truth`, 0 where not valid: > 0 is false light.

    Args:
        truth: visibility in truth, any shape: 1 lit, 0 shadowed, between for sub-samples.
        visibility: the method's, same shape.
        valid: bool, same shape; what the other two hold elsewhere is not read.

    Raises:
        UseError: shapes differ, or a valid pixel holds no number from 0 to 1.
    """
    mask = np.asarray(valid, bool)
    images = []
    for name, image in (("truth", truth), ("visibility", visibility)):
        values = np.asarray(image, np.float64)
        require(
            values.shape == mask.shape,
            f"{name} has shape {values.shape} but the mask has {mask.shape}; give equal shapes.",
        )
        values = np.where(mask, values, 0.0)
        require(
            bool(np.all((values >= 0) & (values <= 1))),
            f"{name} holds a value outside [0, 1] at a valid pixel; visibility is 1 lit, 0 dark.",
        )
        images.append(values)
    return images[1] - images[0]


def visibility_error(
    truth: Shaped[np.ndarray, "..."],
    visibility: Shaped[np.ndarray, "..."],
    valid: Bool[np.ndarray, "..."],
) -> VisibilityError:
    """M1: mean |visibility - truth| over valid pixels, false light and false dark apart.

    For hard shadows (0 or 1) these are fractions of pixels; for sub-sampled truth, fractions of
    sub-samples. Arguments and errors as `signed_error`.
    """
    error = signed_error(truth, visibility, valid)
    count = int(np.count_nonzero(np.asarray(valid, bool)))
    # Dividing sums, not averaging: one rounding, and the two parts add up to the whole.
    lit = float(error[error > 0].sum()) / max(count, 1)
    dark = float(0.0 - error[error < 0].sum()) / max(count, 1)
    return VisibilityError(lit + dark, lit, dark, count)
