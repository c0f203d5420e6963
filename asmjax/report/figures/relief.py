"""What a light sees, as a grey picture: depth with local contrast, shaded as a relief."""

import numpy as np

_NOTHING = 112
"""Grey value where no surface is."""

_FAR, _NEAR = 166.0, 226.0
"""Grey values of the farthest and the nearest surface before shading; pale, for lines to show."""

_SHADE, _CREASE = 30.0, 60.0
"""Grey values by which slopes and depth steps darken or brighten at most."""

_EQUALISED = 0.7
"""Share of rank, the rest being logarithm, in the scale of depth."""

_SAMPLE = 7
"""Every which pixel is enough to know how values are distributed."""

_PRECISION = 4e-7
"""Relative error of depth, float32: smaller steps are no relief."""


def relief(depth) -> np.ndarray:
    """(n, n, 3) uint8: near pale, far darker, lit from the upper left, depth steps outlined.

    Depth is scaled mostly by rank and slopes by how steep most are, so that every window has
    contrast, however little its depth varies. `_NOTHING` where `depth` is not finite or not
    positive.
    """
    values = np.asarray(depth, np.float64)
    good = np.isfinite(values) & (values > 0)
    image = np.full((*values.shape, 3), _NOTHING, np.uint8)
    if not good.any():
        return image
    far = values[good].max()
    values = np.where(good, values, far)
    grey = _NEAR + (_FAR - _NEAR) * _depth_scale(values, good)
    shade, step = _slopes(np.log(values), good)
    grey += _SHADE * shade - _CREASE * step
    image[good] = np.clip(np.round(grey[good]), _NOTHING + 16, 255)[:, None]
    return image


def structure(depth) -> float:
    """Share of an image, 0 to 1, that depth steps between surfaces take."""
    values = np.asarray(depth, np.float64)
    good = np.isfinite(values) & (values > 0)
    if not good.any():
        return 0.0
    logs = np.log(np.where(good, values, values[good].max()))
    return float((_slopes(logs, good)[1] * good).mean())


def _depth_scale(values: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Depth from 0, nearest, to 1, farthest: partly by rank, partly by the logarithm."""
    logs = np.log(values)
    share = np.linspace(0, 1, 201)
    levels = np.quantile(logs[good][::_SAMPLE], share)
    near, far = levels[[2, -3]]
    if far - near < 4 * _PRECISION:
        return np.zeros(values.shape)
    # Equal depths have equal ranks: the middle of theirs.
    rank = 0.5 * (np.interp(logs, levels, share) + 1 - np.interp(-logs, -levels[::-1], share))
    return _EQUALISED * rank + (1 - _EQUALISED) * np.clip((logs - near) / (far - near), 0, 1)


def _slopes(logs: np.ndarray, good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shade in [-1, 1] of each slope under light from the upper left, and depth steps in [0, 1]."""
    # Continued at the same slope beyond the border.
    wide = np.pad(logs, 1, mode="reflect", reflect_type="odd")
    ahead = [wide[1:-1, 2:] - logs, wide[2:, 1:-1] - logs]
    behind = [logs - wide[1:-1, :-2], logs - wide[:-2, 1:-1]]
    # The lesser of both one-sided slopes does not see a step, the difference between them does.
    slope = [np.where(np.abs(a) < np.abs(b), a, b) for a, b in zip(ahead, behind, strict=True)]
    steep = np.hypot(*slope)
    steepness = max(float(np.percentile(steep[good][::_SAMPLE], 75)), _PRECISION)
    u, v = (part / steepness for part in slope)
    # Depth that grows to the lower right faces the upper left.
    shade = (u + v) / np.sqrt(2) / np.sqrt(1 + u**2 + v**2)
    bend = np.maximum(*(np.abs(a - b) for a, b in zip(ahead, behind, strict=True)))
    step = np.clip(bend / (12 * steepness) - 0.5, 0, 1)
    return shade, step
