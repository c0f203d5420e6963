"""What figures are tested with: the pictures of a small run, and what a figure shows."""

from functools import cache

import numpy as np

from asmjax.metrics import error_summary, surface_pairs
from asmjax.report import method_record
from asmjax.report.figures import RunPictures, TreePicture, linear_parts

HEIGHT, WIDTH = 48, 64
ADAPTIVE = {"nodes": 9, "passes": 3, "max_level": 8, "status": "converged"}


def texels_over(pictures):
    """Panels of a figure that hold an image, without its colour bars."""
    return [axes for axes in pictures.axes if axes.get_images()]


def words(figure):
    return [text.get_text() for text in figure.texts]


def box_on_floor(face, u, v, size, side):
    """Depth of a floor, of a box in its middle, and of nothing above the diagonal's upper end."""
    at = (np.arange(side) + 0.5) * size / side
    x, y = np.meshgrid(u + at, v + at)
    depth = np.where((np.abs(x - 0.5) < 0.2) & (np.abs(y - 0.5) < 0.2), 2.0, 4.0 + x)
    return np.where(x - y > 0.8, np.inf, depth)


@cache
def run_pictures() -> RunPictures:
    """A wall whose shadow edge is at column 30.2, answered by maps of 4 and 0.5 pixels a texel."""
    x = np.tile(np.arange(WIDTH) + 0.5, (HEIGHT, 1))
    valid = np.ones((HEIGHT, WIDTH), bool)
    valid[:6] = False
    truth = np.where(valid, (x > 30.2) * 1.0, np.nan)
    shadows = {"uniform-16": (x // 4 * 4 + 2 > 30.2) * 1.0, "adaptive-1MB": (x > 30.2) * 1.0}
    shadows["rays-1"] = shadows["adaptive-1MB"]
    methods = [
        method_record(
            name,
            settings={},
            effective_resolution=None if name == "rays-1" else 1024,
            bytes=2**20,
            rays=10,
            seconds={"build": 0.002 * (i + 1)},
            error=error_summary(truth, image, valid, surface_pairs(valid)),
            **(ADAPTIVE if name.startswith("adaptive") else {}),
        )
        for i, (name, image) in enumerate(shadows.items())
    ]
    ratio = np.exp2((x - 32) / 8)
    ratio[:, 0] = np.inf
    direct, ambient = linear_parts(np.full((3, HEIGHT, WIDTH), 0.5), np.full((HEIGHT, WIDTH), 0.8))
    level = np.arange(9)
    return RunPictures(
        title="wall",
        direct=direct,
        ambient=ambient,
        valid=valid,
        truth=truth,
        visibilities=shadows,
        methods=methods,
        maps={
            "area_ratio": ratio,
            "m": np.sqrt(ratio),
            "n_required": 2.0**20 * ratio,
            "benefit": np.where(np.abs(x - 30) < 2, 100.0, 0.0),
        },
        log2_resolution=np.where(x < 40, 8.0, 12.0),
        tree=TreePicture(
            level=level,
            face=np.zeros(9),
            lo=np.stack([0.6 - 0.6 * 0.5**level, 0.3 - 0.3 * 0.5**level]),
            size=0.5**level,
            node_resolution=64,
            faces=1,
            cast=box_on_floor,
        ),
    )
