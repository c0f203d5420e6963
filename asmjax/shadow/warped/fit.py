"""Homographies that lay a body into the unit square: a rectangle, or a perspective along its axis.

Symbols: the axis runs away from the eye; y counts along it from the body's near end, d is the
body's length; the warp's centre lies n before the near end. TR05-024 measures both in near
distances: their n and alpha - 1.
"""

import numpy as np

from asmjax.buffers import BLUR
from asmjax.geometry import Chart, LightFrame, image_to_plane, plane_to_image
from asmjax.shadow.warped.body import Body, affine

GROWN = 1e-4
"""The unit square holds the body and this part of its size around it."""

MEASURED = 4096
"""Receivers of a chart that its error is measured at."""

NEAREST = 1e-6
"""The warp's centre keeps this part of the body's length from its near end."""


def whole_face(body: Body) -> Chart:
    """The face's own rectangle, as a flat map has it."""
    return Chart(body.face, np.eye(3))


def rectangle(frame: LightFrame, body: Body, log: float = 0.0) -> Chart:
    """The body's bounding rectangle along its axis; `log` as in `Chart`."""
    return _fitted(frame, body, body.turn, log)


def perspective(
    frame: LightFrame,
    body: Body,
    n: float,
    logarithmic: bool = False,
    onto: np.ndarray | None = None,
) -> Chart:
    """A perspective along the axis with its centre `n` (plane units) before the near end, in line
    with the eye.

    t runs with 1 / y', y' = y + n, and s with x / y'; `logarithmic` lets t run with log y'.
    An infinite n, or a body without length, gives no warp: the face's rectangle. `onto` (3, 3) is
    an affine map of plane coordinates to x and y, where it is another than the body's turn; x = 0
    is its middle then.
    """
    turn = body.turn if onto is None else onto
    x, y = body.turned if onto is None else (affine(row, body.plane) for row in onto[:2])
    near, length = float(y.min()), float(np.ptp(y))
    if not np.isfinite(n) or length <= _blur(frame, body) * np.hypot(*turn[1, :2]):
        return whole_face(body) if onto is None else _fitted(frame, body, turn)
    n = max(n, NEAREST * length)
    middle = body.centre if onto is None else 0.0
    # Beyond its far end a warp soon reaches the horizon, so it is grown before it is bent.
    near, n = near - GROWN * min(n, length), n - GROWN * min(n, length)
    length *= 1 + 2 * GROWN
    far = n + length
    # (x - middle, y') -> (x / y', far (y' - n) / ((far - n) y')): the unit interval along y'.
    shifted = np.array([[1.0, 0, -middle], [0, 1, n - near], [0, 0, 1]])
    divided = np.array([[n, 0.0, 0], [0, far / length, -far * n / length], [0, 1, 0]])
    log = n / far - 1 if logarithmic else 0.0
    return _fitted(frame, body, divided @ shifted @ turn, log, along=(0.0, 1.0))


def _fitted(
    frame: LightFrame,
    body: Body,
    onto: np.ndarray,
    log: float = 0.0,
    along: tuple[float, float] | None = None,
) -> Chart:
    """The chart of a homography of plane coordinates, scaled so that it holds the body.

    `along` are corner and size of what it makes of the axis, if they are known.
    """
    x, y, w = (affine(row, body.plane) for row in onto)
    x, y = x / w, y / w
    blur = _blur(frame, body) / np.abs(w).min()
    lo, size = np.transpose([
        _interval(place, blur * (np.hypot(*row[:2]) + np.abs(place).max() * np.hypot(*onto[2, :2])))
        for place, row in ((x, onto[0]), (y, onto[1]))
    ])  # fmt: skip
    if along is not None:
        lo[1], size[1] = along
    scale = np.diag([1 / size[0], 1 / size[1], 1.0])
    scale[:2, 2] = -lo / size
    return Chart(body.face, scale @ onto @ image_to_plane(frame, body.face), log)


def _blur(frame: LightFrame, body: Body) -> float:
    """What plane coordinates of the receivers may be off by; no chart is narrower, lest it miss
    what it is for."""
    depth = body.eye_depth / body.light_depth if frame.perspective else body.eye_depth
    return BLUR * float(depth.max())


def _interval(x: np.ndarray, least: float) -> tuple[float, float]:
    """Start and size of an interval around numbers (m,), a little larger, and `least` at least."""
    lo, hi = float(x.min()), float(x.max())
    size = max(hi - lo, least)
    return (lo + hi) / 2 - size * (0.5 + GROWN), size * (1 + 2 * GROWN)


def errors_of(frame: LightFrame, chart: Chart, body: Body) -> tuple[float, float]:
    """Largest perspective error of a chart of one texel along s and along t, over its receivers.

    The width of a texel's beam beside that of a pixel's beam, m without the projective factor
    (TR05-024, section 3), up to the pixels' focal length and, as there, without the cosines of the
    angles off the image's middle.
    """
    some = np.linspace(0, body.eye_depth.size - 1, min(body.eye_depth.size, MEASURED)).astype(int)
    plane = body.plane.take(some, axis=1)
    onto = chart.to_chart @ plane_to_image(frame, body.face)
    x, y, w = (affine(row, plane) for row in onto)
    t = y / w
    back = image_to_plane(frame, body.face) @ np.linalg.inv(chart.to_chart)
    scale = affine(back[2], np.stack([x / w, t]))
    # dt of the homography for dt of the chart: the logarithm's derivative.
    pace = (1 + chart.log * t) * np.log1p(chart.log) / chart.log if chart.log else np.ones_like(t)
    found = []
    for i, stretch in enumerate((np.ones_like(t), pace)):
        step = (back[:2, i, None] - plane * back[2, i]) / scale * stretch
        beam = np.hypot(*step) * (body.light_depth.take(some) if frame.perspective else 1.0)
        found.append(float((beam / body.eye_depth.take(some)).max()))
    return found[0], found[1]
