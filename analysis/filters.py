"""Percentage-closer filters beside each other: the picture of docs/theory.md, "Filtering".

The shadow of a disc and a bar on a floor, by a map whose texels are several pixels wide, which
each filter asks once for each pixel; and the truth, a float64 shadow ray.

    python analysis/filters.py [--out DIR]
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from asmjax.hard_cases import Scene, traced
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board, save
from asmjax.report.figures.style import styled
from asmjax.scene.spec import Disk, LightSpec, Rectangle, ViewSpec
from asmjax.shadow import FilteredShadowMap, ShadowAlgorithm, UniformShadowMap

SIDE = 120
"""Pixels a side of a panel's image."""

MAGNIFY = 4
"""Screen pixels a side of each."""

COLUMNS = 3

SHAPES = (
    Rectangle("floor", (0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0)),
    Disk("disc", (-0.3, 0.0, 1.8), (0.0, 0.0, 1.0), 0.55),
    Rectangle("bar", (0.15, -0.2, 1.7), (0.5, 0.3, 0.0), (-0.03, 0.05, 0.0)),
)
SUN = LightSpec("sun", "directional", direction=(0.35, 0.1, -1.0))
EYE = ViewSpec("eye", (0.5, -1.3, 1.1), (0.44, 0.08, 0.0), fov_x_deg=44.0, width=SIDE, height=SIDE)

FLAT = UniformShadowMap(56)
SHOWN: dict[str, tuple[str, ShadowAlgorithm | None]] = {
    "truth": ("a shadow ray for each pixel", None),
    "no filter": ("1 test", FLAT),
    "bilinear": ("4 tests", FilteredShadowMap("bilinear", inner=FLAT)),
    "sixteen": ("25 tests", FilteredShadowMap("sixteen", inner=FLAT)),
    "dithered": ("16 tests", FilteredShadowMap("dithered", inner=FLAT)),
    "original": (
        "16 samples in a box of at least 4 texels", FilteredShadowMap("original", inner=FLAT),
    ),
}  # fmt: skip
"""Title, to what is below it and what answers."""

SHADE = 0.25
"""Brightness of what is in shadow; of what is lit 0.95."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Draw percentage-closer filters beside each other."
    )
    parser.add_argument("--out", type=Path, default=Path("out/filters"))
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    print(save(draw(answers(traced(SHAPES, EYE, SUN))), folder / "filtered.png"))


def answers(scene: Scene) -> dict[str, np.ndarray]:
    """The image (height, width) of each of `SHOWN`."""
    found = {}
    for name, (_, algorithm) in SHOWN.items():
        if algorithm is None:
            lit = scene.expected
        else:
            state = algorithm.build(scene.eye, scene.frame, scene.rays)
            lit = algorithm.visibility(state, scene.eye.points)
        found[name] = np.asarray(lit, np.float64).reshape(scene.eye.size)
    return found


@styled
def draw(images: dict[str, np.ndarray]) -> Figure:
    """All images, each pixel a square of `MAGNIFY` of the screen's."""
    side, rows = SIDE * MAGNIFY, -(-len(images) // COLUMNS)
    board = Board(
        2 * EDGE + COLUMNS * side + (COLUMNS - 1) * GAP,
        2 * EDGE + rows * (HEAD + side) + (rows - 1) * GAP + CAPTION,
    )
    for k, (name, image) in enumerate(images.items()):
        x = EDGE + k % COLUMNS * (side + GAP)
        y = EDGE + k // COLUMNS * (HEAD + side + GAP)
        board.heading(x, y, side, name, SHOWN[name][0])
        grey = SHADE + (0.95 - SHADE) * image
        board.image(
            x, y + HEAD, side, side, grey, cmap="gray", vmin=0, vmax=1, interpolation="nearest"
        )
    board.caption(
        f"{FLAT.resolution} x {FLAT.resolution} texels; each pixel is {MAGNIFY} x {MAGNIFY} here"
    )
    return board.figure


if __name__ == "__main__":
    main()
