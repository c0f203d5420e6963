"""Other ways to the truth of hard cases: mpmath, differences, integrals, and segments."""

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np

from asmjax.hard_cases import Scene
from asmjax.scene.spec import Disk, Mesh, Rectangle, Shape

mp: Any = mpmath.mp.clone()
mp.dps = 40


def _each(function: Callable) -> Callable[..., np.ndarray]:
    """`function` of mpmath numbers, entry by entry over arrays."""

    def of_arrays(*arrays):
        rows = zip(*(np.ravel(a).tolist() for a in arrays), strict=True)
        return np.array([float(function(*(mp.mpf(x) for x in row))) for row in rows])

    return of_arrays


def _g(z, alpha, u):
    """The error distribution as a derivative of the projective coordinate (equation 1)."""
    s = projected(alpha, u)
    return 1 / (z * mp.diff(s, z) * (alpha - 1))


def projected(alpha, u):
    """s of a perspective camera n = 1 / u before the near plane, by its homogeneous matrix."""

    def s(z):
        def w(depth):
            return 1 + u * (depth - 1)

        def y(depth):
            return (depth - 1) / w(depth)

        return y(z) / y(alpha)

    return s


def _xi(u, alpha):
    least = 1 / mp.sqrt(alpha)
    near, far = _g(mp.mpf(1), alpha, u), _g(alpha, alpha, u)
    sign = 1 if far > near else -1
    return sign * (max(near, far) - least) / (1 - least)


def _split(alpha, theta):
    """The largest error of the first of four parts, searched on its two ends, times four."""
    part = mp.root(alpha, 4)
    worst = (1 + mp.mpf(1) / 2 * (mp.sqrt(part) - 1)) / mp.sqrt(part)
    return 4 * (part - 1) * worst / (2 * mp.tan(theta))


def _area(px, py, pz, nx, ny, nz, axis, focal):
    """Of the parallelogram of a pixel's two edges on the plane."""
    x, n, w = mp.matrix([px, py, pz]), mp.matrix([nx, ny, nz]), mp.matrix(axis)
    depth = (x.T * w)[0]
    u = mp.matrix([w[1], -w[0], mp.mpf(0)])
    u /= mp.norm(u)
    v = _cross(w, u)
    level, steps = (n.T * x)[0], []
    for side in (u, v):
        ends = []
        for sign in (-1, 1):
            ray = x / depth + sign * side / (2 * focal * 10**12)
            ends.append(ray * (level / (n.T * ray)[0]))
        steps.append((ends[1] - ends[0]) * 10**12)
    return mp.norm(_cross(*steps))


def _cross(a, b):
    return mp.matrix([
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    ])  # fmt: skip


ORACLES: dict[str, Callable[..., np.ndarray]] = {
    "splits as far / near goes to 1": _each(_split),
    "logarithm as far / near goes to 1": _each(
        lambda z, alpha: mp.quad(lambda x: 1 / x, [1, z]) / mp.quad(lambda x: 1 / x, [1, alpha])
    ),
    "warp strength xi as far / near goes to 1": _each(_xi),
    "warp whose centre is far away": _each(lambda z, alpha, u: projected(alpha, u)(z)),
    "points at a warp's centre": _each(lambda z, alpha, u: projected(alpha, u)(z)),
    "error of a warp over a large depth range": _each(
        lambda z, alpha, u, theta: (alpha - 1) * _g(z, alpha, u) / (2 * mp.tan(theta))
    ),
    "light parallel to the receiver, aliasing": _each(lambda eye, light: eye / light),
    "light and eye both parallel to the receiver": _each(lambda eye, light: eye / light),
}
"""By case: the truth of its inputs."""


def area_oracle(position, normal, axis, focal) -> np.ndarray:
    """(n,) world area of a pixel at each point of its plane."""
    rows = np.concatenate([position, normal]).T.tolist()
    axis = [mp.mpf(float(a)) for a in axis]
    return np.array(
        [float(_area(*map(mp.mpf, row), axis=axis, focal=mp.mpf(focal))) for row in rows]
    )


def ref_dark(scene: Scene) -> np.ndarray:
    """(n,) which judged pixels are dark, by linear systems and distances to segments: another way
    than that of `asmjax.scene.analytic`."""
    dark = np.zeros(scene.judged.size, bool)
    size = max(np.abs(scene.eye.world[:, scene.judged]).max(initial=1.0), 1.0)
    reach = 1e3 * size
    for k in np.flatnonzero(scene.judged):
        start, normal = scene.eye.world[:, k], scene.eye.normal[:, k]
        if scene.frame.perspective:
            end = scene.frame.origin
        else:
            end = start - reach * scene.frame.rotation[0, 2]
        away = (end - start) / np.linalg.norm(end - start)
        if normal @ away <= 0:
            dark[k] = True
            continue
        start = start + 1e-9 * size * normal
        dark[k] = any(_crossed(shape, start, end) for shape in scene.shapes)
    return dark


def _crossed(shape: Shape, start: np.ndarray, end: np.ndarray) -> bool:
    if isinstance(shape, Mesh):
        return any(_triangle(shape.vertices[:, face], start, end) for face in shape.faces.T)
    centre = np.asarray(shape.centre)
    if isinstance(shape, Rectangle):
        half_u, half_v = np.asarray(shape.half_u), np.asarray(shape.half_v)
        found = _solved(np.stack([half_u, half_v, start - end], axis=1), start - centre)
        return found is not None and 0 < found[2] < 1 and np.abs(found[:2]).max() <= 1
    if isinstance(shape, Disk):
        normal = np.asarray(shape.normal) / np.linalg.norm(shape.normal)
        above, below = normal @ (start - centre), normal @ (end - centre)
        if above * below >= 0:
            return False
        at = start + (end - start) * above / (above - below)
        return bool(np.linalg.norm(at - centre) <= shape.radius)
    if np.linalg.norm(start - centre) < shape.radius:
        return bool(np.linalg.norm(end - centre) > shape.radius)
    along = end - start
    t = np.clip((centre - start) @ along / (along @ along), 0, 1)
    return bool(np.linalg.norm(start + t * along - centre) < shape.radius)


def _triangle(corners, start, end) -> bool:
    a, b, c = corners.T
    found = _solved(np.stack([b - a, c - a, start - end], axis=1), start - a)
    return bool(
        found is not None and found[:2].min() >= 0 and found[:2].sum() <= 1 and 0 < found[2] < 1
    )


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray | None:
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return None
