"""Shadow rays in float64 against all triangles at once: the oracle of ray-traced truth.

Independent of the renderer and of `asmjax.scene.analytic`: instead of intersecting planes first,
it asks on which side a ray passes each directed edge (Pluecker's side product), and that is four
matrix products for all pairs of rays and triangles.
"""

import numpy as np

_PAIRS = 4_000_000
"""Ray-triangle pairs at once: about 200 MB of temporaries."""


def ref_blocked(
    corners: tuple[np.ndarray, np.ndarray, np.ndarray],
    starts: np.ndarray,
    light: np.ndarray,
    own: np.ndarray,
    *,
    parallel: bool = False,
) -> np.ndarray:
    """Whether any triangle stands between each start (3, n) and the light: (n,) bool.

    Args:
        corners: corners (3, m) of all triangles, float64.
        light: (3,) position, or for `parallel` light its direction of travel.
        own: (n,) number of the triangle that a ray starts on, left out for that ray.
    """
    anchor = starts.mean(axis=1) if parallel else light
    a, b, c = (corner - anchor[:, None] for corner in corners)
    start = starts - anchor[:, None]
    normal = np.cross(b - a, c - a, axis=0)
    plane = np.sum(normal * a, axis=0)[:, None]
    blocked = np.zeros(start.shape[1], bool)
    block = max(1, _PAIRS // a.shape[1])
    for first in range(0, start.shape[1], block):
        rays = slice(first, first + block)
        origin = start[:, rays]
        towards = -np.repeat(light[:, None], origin.shape[1], 1) if parallel else -origin
        moment = np.cross(origin, towards, axis=0)
        inside = np.ones((a.shape[1], origin.shape[1]), bool)
        backwards = inside.copy()
        for p, q in ((a, b), (b, c), (c, a)):
            side = np.cross(p, q, axis=0).T @ towards
            if parallel:
                side += (q - p).T @ moment
            inside &= side >= 0
            backwards &= side <= 0
        inside |= backwards
        # Most pairs miss: the plane is met for the others only.
        triangle, ray = np.nonzero(inside)
        slope = np.sum(normal[:, triangle] * towards[:, ray], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (plane[triangle, 0] - np.sum(normal[:, triangle] * origin[:, ray], axis=0)) / slope
        between = (t > 1e-13) & (parallel | (t < 1 - 1e-13)) & (triangle != own[first + ray])
        blocked[first + ray[between]] = True
    return blocked


def disagreements(scene, eye, frame, lit: np.ndarray, pixels: np.ndarray, relative: float = 1e-6):
    """How many of `pixels` have another visibility than the oracle says: (for sure, at an edge).

    A disagreement is at an edge when the oracle's own answer changes with the start moved by
    `relative` times the largest coordinate in play, off the surface or along it.
    """
    geometry = scene.geometry
    corners = geometry.corners(np.arange(geometry.faces.shape[1]))
    light = frame.origin if frame.perspective else frame.rotation[0, 2]
    prim = eye.prim

    def ref_lit(chosen, shift):
        return ~ref_blocked(
            corners, eye.world[:, chosen] + shift, light, prim[chosen],
            parallel=not frame.perspective,
        )  # fmt: skip

    wrong = pixels[ref_lit(pixels, 0.0) != lit[pixels]]
    if wrong.size == 0:
        return 0, 0
    point, normal = eye.world[:, wrong], eye.normal[:, wrong]
    step = relative * np.abs([point, *geometry.corners(prim[wrong])]).max(axis=(0, 1))
    aside = np.cross(normal, np.roll(normal, 1, axis=0) + [[0.3], [0.2], [0.1]], axis=0)
    aside /= np.linalg.norm(aside, axis=0)
    across = np.cross(normal, aside, axis=0)
    sure = np.ones(wrong.size, bool)
    for way in (normal, aside, -aside, across, -across):
        sure &= ref_lit(wrong, step * way) != lit[wrong]
    return int(sure.sum()), int((~sure).sum())
