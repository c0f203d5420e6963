"""Where does precision end: at the renderer's float32 hits, at addresses, or at its rays?

For pixels of a few views, the error of a receiver's place in the light's image, in texels of a map
of 2^k texels a side, against fifty digits: by the renderer's own float32 hit, by re-intersection in
float64 with positions kept in float32, and in float64 all through. And for light rays through the
texels along a shadow's edge: how far that edge is from where float64 rays find it.

    python experiments/ray_precision.py [--smoke]
"""

import argparse
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import mpmath
import numpy as np

from asmjax.buffers import TexelWindows, anchor, image_rows, light_offset, project
from asmjax.buffers.points import EyeBuffer, SurfacePoints
from asmjax.geometry import LightFrame
from asmjax.render.load import Scene, load_scene
from asmjax.scene.analytic_rays import AnalyticRays
from asmjax.scene.builtin import load_builtin
from asmjax.scene.spec import Mesh

RESULTS = Path(__file__).parent / "results"

VIEWS = (("paper_room", "overview"), ("paper_room", "macro"), ("terrain", None), ("statues", None))

LEVELS = (17, 19, 22, 24, 26, 30)
"""log2 of texels a side."""

RAY_LEVELS = (16, 18, 20, 22, 24, 26)

WINDOWS, SIDE = 24, 16
"""Windows of texels along the edge, and texels a side of each."""


def exact_uv(eye: EyeBuffer, corners, frame: LightFrame, pixels: np.ndarray) -> np.ndarray:
    """(2, k) image coordinates of the points where the rays of pixels meet their triangles' planes,
    to fifty digits, as float64; camera, corners and frame are taken for exact."""
    columns, rows = eye.camera.centres()
    directions = eye.camera.directions(columns[pixels], rows[pixels])
    found = np.empty((2, pixels.size))
    with mpmath.workdps(50):
        for k in range(pixels.size):
            o, d, a, b, c = (
                mpmath.matrix(v.tolist())
                for v in (eye.camera.origin, directions[:, k], *(x[:, k] for x in corners))
            )
            p, q = b - a, c - a
            n = mpmath.matrix([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2],
                               p[0] * q[1] - p[1] * q[0]])  # fmt: skip
            t = _dot(n, a - o) / _dot(n, d)
            x, y, z = (
                _dot(mpmath.matrix(row.tolist()), o + t * d - mpmath.matrix(frame.origin.tolist()))
                for row in frame.rotation[0]
            )
            scale = z if frame.perspective else mpmath.mpf(1)
            for i, along in enumerate((x, y)):
                corner, extent = (mpmath.mpf(float(v[0, i])) for v in (frame.corner, frame.extent))
                found[i, k] = float((along / scale - corner) / extent)
    return found


def _dot(u, v):
    return sum(u[i] * v[i] for i in range(3))


def addresses(scene: Scene, view: str | None, count: int) -> dict[str, dict]:
    """Errors of image coordinates by way of finding them: median and largest."""
    eye = scene.eye(scene.view(view))
    frame = scene.light_frame(eye)
    assert frame.faces == 1
    points, offset = eye.points, light_offset(eye.points, frame)
    facing = np.asarray(project(points, frame, offset).facing)
    pixels = np.random.default_rng(0).choice(np.flatnonzero(facing), count, replace=False)
    corners = scene.geometry.corners(eye.prim[pixels], eye.shape[pixels])
    exact = exact_uv(eye, corners, frame, pixels)
    directions = eye.camera.directions(*(x[pixels] for x in eye.camera.centres()))
    start = eye.camera.origin[:, None] + eye.camera.near * directions
    t, _, _ = scene.light_rays().hits(start, directions)
    hit = (start + t * directions).astype(np.float32).astype(np.float64)
    with jax.enable_x64(True):
        ways = {
            "renderer's float32 hit": _uv(frame, hit, eye),
            "float64 hit, float32 position": _anchored(frame, eye, pixels, np.float32),
            "float64 hit and position": _anchored(frame, eye, pixels, np.float64),
        }
    return {way: _summary(uv - exact) for way, uv in ways.items()}


def _uv(frame: LightFrame, world: np.ndarray, eye: EyeBuffer) -> np.ndarray:
    """(2, k) image coordinates of world points, float64."""
    x, y, z = frame.rotation[0] @ (world - frame.origin[:, None])
    plane = np.stack([x, y]) / (z if frame.perspective else 1.0)
    return (plane - frame.corner[0][:, None]) / frame.extent[0][:, None]


def _anchored(frame: LightFrame, eye: EyeBuffer, pixels: np.ndarray, dtype) -> np.ndarray:
    """(2, k) by the anchored address of positions relative to the eye, rounded to `dtype`."""
    relative = eye.world[:, pixels] - eye.camera.origin[:, None]
    points = SurfacePoints(
        position=jnp.asarray(relative.astype(dtype)),
        normal=jnp.asarray(eye.normal[:, pixels].astype(dtype)),
        prim=jnp.asarray(eye.prim[pixels]),
        valid=jnp.ones(pixels.size, bool),
        origin=eye.camera.origin,
    )
    face = jnp.zeros(pixels.size, int)
    x, y, w = image_rows(points, anchor(points, frame), face, frame.perspective)
    return np.stack([np.asarray(x / w), np.asarray(y / w)])


def _summary(error: np.ndarray) -> dict:
    size = np.abs(error).max(axis=0)
    return {"median": float(np.median(size)), "max": float(size.max())}


def ray_displacement(log2: int) -> float:
    """Texels by which an edge in the light's image is off, on average, in windows of texels of a
    map of 2^log2 a side, against float64 rays at the same triangles."""
    scene = load_scene("letter_f")
    eye = scene.eye(scene.view())
    frame = scene.light_frame(eye, "point")
    corners = [s for s in load_builtin("letter_f").shapes if isinstance(s, Mesh)]
    truth = AnalyticRays(corners)
    letter = corners[0]
    # Along the outline of the letter's top, which is seen against the plane.
    x, y, z = frame.rotation[0] @ (letter.vertices - frame.origin[:, None])
    uv = (np.stack([x, y]) / z - frame.corner[0][:, None]) / frame.extent[0][:, None]
    count = uv.shape[1] // 2
    ends = uv[:, count:], np.roll(uv[:, count:], -1, axis=1)
    share = np.random.default_rng(1).random((WINDOWS, count))
    places = np.concatenate([ends[0] + s * (ends[1] - ends[0]) for s in share], axis=1)
    texel = np.full((2, places.shape[1]), 2.0**-log2)
    corner = np.floor(places / texel - SIDE / 2) * texel
    windows = TexelWindows(np.zeros(places.shape[1], int), corner, texel, SIDE)
    mine = scene.light_rays("point").light_buffer(frame, windows).prim
    faces = letter.faces.shape[1]
    first = scene.geometry.first_prim[scene.shape_names.index("letter")]
    on_letter = (mine >= first) & (mine < first + faces)
    exact = truth.light_buffer(frame, windows).prim
    expected = (exact >= 0) & (exact < faces)
    # Windows that an edge crosses; where one does, it is about as long as the window is wide.
    crossed = expected.any(axis=(1, 2)) & ~expected.all(axis=(1, 2))
    differ = (on_letter != expected)[crossed].sum(axis=(1, 2))
    return float(differ.mean() / SIDE)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="one view, few pixels")
    smoke = parser.parse_args().smoke
    count = 40 if smoke else 1000
    found = {
        f"{name}, {view or 'default'}": addresses(load_scene(name), view, count)
        for name, view in (VIEWS[:1] if smoke else VIEWS)
    }
    print("largest error of an address, texels of a map of 2^k a side:")
    heads = "".join(f"{f'2^{k}':>11}" for k in LEVELS)
    print(f"{'view':24}{'way':32}{heads}")
    for view, ways in found.items():
        for way, error in ways.items():
            cells = "".join(f"{error['max'] * 2.0**k:11.2g}" for k in LEVELS)
            print(f"{view:24}{way:32}{cells}")
    rays = {log2: ray_displacement(log2) for log2 in (RAY_LEVELS[:2] if smoke else RAY_LEVELS)}
    print("\nedge of a caster by float32 light rays, mean displacement, texels:")
    print("  ".join(f"2^{log2}: {value:.2g}" for log2, value in rays.items()))
    RESULTS.mkdir(exist_ok=True)
    record = {"addresses": found, "rays": {str(k): v for k, v in rays.items()}}
    (RESULTS / "ray_precision.json").write_text(json.dumps(record, indent=2) + "\n")


if __name__ == "__main__":
    main()
