"""How do one-query soft shadows compare with the truth under a large round light?

A disk above a plane, whose penumbra is known in closed form (A4): the conventional map of the
light's centre, percentage-closer soft shadows and a moment map, with as many texels, and their
errors beneath.

    python experiments/soft_shadows.py [--smoke] [--out docs/images/soft.png]
"""

import argparse
import time
from pathlib import Path

import jax
import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from asmjax.buffers import EyeBuffer
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board, save
from asmjax.report.figures.style import styled
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import a4_disc_light
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import (
    MomentShadowMap,
    PCSSShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
)

LIGHT_HALF, HEIGHT, OCCLUDER = 1.2, 5.0, 2.0
"""Radius of the light, its height, and the height of the disk of radius 1 below it."""

VIEW = ViewSpec("aside", (0.0, -9.0, 5.5), (0.0, 0.35, 0.0), fov_x_deg=32.0)

WIDEST = 0.2
"""Error at the ends of the colour scale."""


def measured(pixels: int, resolution: int) -> tuple[EyeBuffer, np.ndarray, dict[str, tuple]]:
    """The eye's image, truth, and of each map its visibility and seconds of building and asking."""
    scene = a4_disc_light(1.0, LIGHT_HALF, HEIGHT, OCCLUDER)
    shapes = scene.spec.shapes
    eye = analytic_eye(shapes, VIEW.resized(pixels, pixels * 3 // 4))
    frame = light_frame(scene.soft_light(), eye, scene_bounds(shapes))
    assert scene.soft_visibility is not None
    x, y, _ = np.where(eye.valid, eye.world, 0.0)
    # The disk is lit from above and seen from there.
    truth = np.where(eye.shape == 0, scene.soft_visibility(x, y), 1.0)
    maps: list[ShadowAlgorithm] = [
        UniformShadowMap(resolution),
        PCSSShadowMap(resolution),
        MomentShadowMap(resolution),
    ]
    found = {}
    for algorithm in maps:
        for _ in range(2):
            start = time.perf_counter()
            state = algorithm.build(eye, frame, AnalyticRays(shapes))
            built = time.perf_counter()
            lit = np.asarray(jax.block_until_ready(algorithm.visibility(state, eye.points)))
            seconds = built - start, time.perf_counter() - built
        found[algorithm.name] = (lit, *seconds, algorithm.cost(state).bytes)
    return eye, truth, found


@styled
def draw(eye: EyeBuffer, truth: np.ndarray, found: dict[str, tuple]) -> Figure:
    """Truth and the maps side by side, their errors beneath."""
    height, width = eye.size
    columns, bar = 1 + len(found), 96
    board = Board(
        2 * EDGE + columns * width + (columns - 1) * GAP + bar,
        2 * EDGE + 2 * HEAD + 2 * height + GAP + 2 * CAPTION,
    )
    judged = eye.shape == 0
    below = EDGE + HEAD + height + GAP
    panels = {"truth": ("closed form: lens of two circles", truth)}
    for name, (lit, *_) in found.items():
        mean = float(np.abs(lit - truth)[judged].mean())
        panels[name] = (f"mean error {mean:.4f}", lit)
    norm = TwoSlopeNorm(0.0, -WIDEST, WIDEST)
    for column, (name, (small, lit)) in enumerate(panels.items()):
        x = EDGE + column * (width + GAP)
        board.heading(x, EDGE, width, name, small)
        grey = np.where(eye.valid, 0.08 + 0.87 * lit, 0.8)
        colour = np.stack([grey, grey, grey], axis=-1)
        colour[eye.shape > 0] = (0.62, 0.55, 0.45)
        board.image(x, EDGE + HEAD, width, height, colour.reshape(height, width, 3))
        if name == "truth":
            continue
        error = np.where(judged, lit - truth, np.nan).reshape(height, width)
        largest = float(np.nanmax(np.abs(error)))
        board.heading(x, below, width, "error", f"largest {largest:.3f}")
        axes = board.image(x, below + HEAD, width, height, error, cmap="PuOr_r", norm=norm)
        axes.set_facecolor("#A3A3A3")
    ticks = {v: f"{v:+.1f}" if v else "0" for v in np.array([-1, -0.5, 0, 0.5, 1]) * WIDEST}
    board.scale_bar(
        axes.images[0].cmap, norm, board.width - EDGE - bar + 24, below + HEAD, 18, height, ticks,
        extend="both",
    )  # fmt: skip
    board.caption(
        f"A disk of radius 1 at {OCCLUDER:g} below a round light of radius {LIGHT_HALF:g} at "
        f"{HEIGHT:g}. Errors: visibility - truth; orange is false light, violet false dark."
    )
    return board.figure


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="small sizes, a few seconds")
    parser.add_argument("--out", default="experiments/results/soft.png", help="picture to write")
    options = parser.parse_args()
    eye, truth, found = measured(*(160, 128) if options.smoke else (420, 512))
    print("map          mean error   build s   query s   MB")
    judged = eye.shape == 0
    for name, (lit, build, query, size) in found.items():
        error = np.abs(lit - truth)[judged].mean()
        print(f"{name:12s} {error:10.4f} {build:9.3f} {query:9.3f} {size / 2**20:6.2f}")
    Path(options.out).parent.mkdir(parents=True, exist_ok=True)
    print(save(draw(eye, truth, found), options.out))


if __name__ == "__main__":
    main()
