"""Digests of maps, trees and errors: what a second process must make bit by bit the same.

`python -m helpers.digests` prints a line for each configuration. Builds without a limit of time
only: with one, what is refined depends on how fast the machine is, and says so by its status.
"""

import hashlib
import sys
from collections.abc import Iterator

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.geometry import LightFrame
from asmjax.metrics import error_summary, surface_pairs
from asmjax.shadow import SOFT, ShadowAlgorithm
from helpers.analytic_cases import analytic_case, kept_arrays
from helpers.registry import SIBLINGS, VARIANTS
from helpers.soft_cases import soft_case

SIDE, TEXELS = 64, 4**7
"""As in `test_siblings`, so that nothing more is compiled."""

RENDERED = 2
"""Configurations that need the renderer."""


def digest(
    algorithm: ShadowAlgorithm, eye: EyeBuffer, frame: LightFrame, rays: LightRays, truth
) -> str:
    """Of all arrays of the state after a build and an update, the image, and its errors."""
    state = algorithm.build(eye, frame, rays)
    state = algorithm.update(state, eye, frame, rays)
    lit = np.asarray(algorithm.visibility(state, eye.points))
    found = hashlib.sha256()
    for array in (*kept_arrays(state), lit):
        array = np.ascontiguousarray(array)
        found.update(f"{array.dtype}{array.shape}".encode() + array.tobytes())
    expected, answer, valid, depth = (
        np.reshape(a, eye.size) for a in (truth, lit, eye.valid, eye.depth)
    )
    pairs = surface_pairs(valid, np.where(valid, depth, 1.0))
    errors = error_summary(expected, answer, valid, pairs)
    found.update(repr(errors).encode())
    return found.hexdigest()


def analytic() -> Iterator[tuple[str, str]]:
    """Every algorithm and every variant, and the quickest ones under other lights too."""
    scenes = ("a6_sphere", "a6_sphere_sun")
    chosen = [(s, scenes[k % 2]) for k, s in enumerate((*SIBLINGS, *VARIANTS))]
    quick = [s for s in SIBLINGS if s.name in ("uniform", "light-space", "trapezoidal")]
    chosen += [(s, "a4_disc_light") for s in quick]
    chosen += [(SIBLINGS[0], name) for name in ("a6_sphere_sun", "a1_square")]
    for sibling, name in chosen:
        case = analytic_case(name, SIDE)
        algorithm = sibling.of_budget(TEXELS, case.frame.faces)
        if type(algorithm) in SOFT.values():
            # Of a light without a size they are the uniform map.
            name, case = "a4", soft_case("a4", SIDE)
        made = digest(algorithm, case.eye, case.frame, case.rays, case.expected)
        yield f"{sibling.name} {name}", made


def rendered() -> Iterator[tuple[str, str]]:
    """The flat and the adaptive map of a scene that Mitsuba casts, against its shadow rays."""
    from asmjax.render.load import load_scene

    scene = load_scene("letter_f")
    eye = scene.eye(scene.view().resized(SIDE, SIDE))
    frame, rays = scene.light_frame(eye, "point"), scene.light_rays("point")
    truth = scene.shadow_rays(eye, frame, rays).trace()
    for sibling in SIBLINGS[:RENDERED]:
        algorithm = sibling.of_budget(TEXELS, frame.faces)
        yield f"{sibling.name} letter_f", digest(algorithm, eye, frame, rays, truth)


if __name__ == "__main__":
    for make in (analytic, rendered) if "--rendered" in sys.argv else (analytic,):
        for name, made in make():
            print(name, made, flush=True)
