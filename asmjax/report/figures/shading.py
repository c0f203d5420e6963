"""Pictures of a scene from its surface colours and a shadow: ambient and direct light, toned."""

import numpy as np

from asmjax.report.figures.style import SKY, hex_rgb

AMBIENT = 0.2
"""Light from everywhere, as a fraction of the direct light."""


def linear_parts(albedo, n_dot_l) -> tuple[np.ndarray, np.ndarray]:
    """What the light adds where it is seen, and what is there without it.

    Lambert's law for the direct part. The ambient part keeps a quarter of the light's direction,
    so that surfaces in shadow keep their shape.

    Args:
        albedo: (3, height, width) linear reflectance.
        n_dot_l: (height, width) cosine between normal and direction to the light; negative on
            the far side.

    Returns:
        (direct, ambient), each (height, width, 3) float32, linear.
    """
    colour = np.moveaxis(np.nan_to_num(np.asarray(albedo, np.float32)), 0, -1)
    cosine = np.clip(np.nan_to_num(np.asarray(n_dot_l, np.float32)), -1.0, 1.0)[..., None]
    direct = colour * np.maximum(cosine, 0.0)
    return direct, AMBIENT * colour * (0.75 + 0.25 * cosine)


def exposure(direct, ambient, valid) -> float:
    """Factor that brings the 98th percentile of the fully lit picture to 1; 1 if all is black.

    Of the fully lit picture: pictures of one scene with different shadows must compare.
    """
    lit = (np.asarray(direct) + np.asarray(ambient))[np.asarray(valid, bool)]
    bright = float(np.percentile(lit.max(axis=-1), 98)) if lit.size else 0.0
    return 1.0 / bright if bright > 0 and np.isfinite(bright) else 1.0


def tone(linear, exposed: float = 1.0) -> np.ndarray:
    """uint8 sRGB of linear values: 1 - exp(-x) rolls highlights off instead of clipping them.

    `exposed` is the factor of `exposure`; what it brings to 1 is shown at 89 % of white.
    """
    x = np.maximum(np.asarray(linear, np.float32), 0.0) * (1.5 * exposed)
    y = -np.expm1(-x)
    srgb = np.where(y <= 0.0031308, 12.92 * y, 1.055 * np.power(y, 1 / 2.4) - 0.055)
    return np.round(255 * np.clip(srgb, 0, 1)).astype(np.uint8)


def compose(direct, ambient, visibility, valid, exposed: float) -> np.ndarray:
    """(height, width, 3) uint8 sRGB of `ambient + visibility * direct`, grey where not valid."""
    mask = np.asarray(valid, bool)
    seen = np.where(mask, np.asarray(visibility, np.float32), 0.0)[..., None]
    image = tone(np.asarray(ambient) + seen * np.asarray(direct), exposed)
    image[~mask] = hex_rgb(SKY)
    return image


def shade(albedo, n_dot_l, visibility, valid=None) -> np.ndarray:
    """(height, width, 3) uint8 sRGB picture of Lambertian surfaces under one light.

    Args:
        albedo: (3, height, width) linear reflectance.
        n_dot_l: (height, width), as `linear_parts`.
        visibility: (height, width), 1 lit to 0 shadowed.
        valid: (height, width) bool; None for all.
    """
    direct, ambient = linear_parts(albedo, n_dot_l)
    mask = np.ones(direct.shape[:2], bool) if valid is None else np.asarray(valid, bool)
    return compose(direct, ambient, visibility, mask, exposure(direct, ambient, mask))
