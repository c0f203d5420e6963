"""Does the error of a conventional map fall in the first order of its resolution?

The wrong pixels lie within half a texel of a shadow edge, so doubling the resolution should halve
them: a slope of -1 in the log-log plot, on any scene whose shadow is known in closed form.

    python experiments/error_against_resolution.py [--smoke]
"""

import argparse

import numpy as np

from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.lights import light_frame
from asmjax.shadow import UniformShadowMap


def errors(name: str, resolutions: list[int], pixels: int) -> list[float]:
    """Fraction of receiver pixels that a map of each resolution gets wrong in a scene."""
    scene = ANALYTIC_SCENES[name]()
    shapes = scene.spec.shapes
    view = next(iter(scene.spec.views.values())).resized(pixels, pixels)
    eye = analytic_eye(shapes, view)
    light = next(iter(scene.spec.lights.values()))
    frame = light_frame(light, eye, scene_bounds(shapes))
    on_plane = eye.valid & (np.abs(eye.world[2]) < 1e-9)
    lit = scene.hard_visibility(eye.world[0][on_plane], eye.world[1][on_plane]) > 0.5
    result = []
    for resolution in resolutions:
        algorithm = UniformShadowMap(resolution)
        state = algorithm.build(eye, frame, AnalyticRays(shapes))
        seen = np.asarray(algorithm.visibility(state, eye.points))[on_plane] > 0.5
        result.append(float(np.mean(seen != lit)))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="small sizes, a few seconds")
    smoke = parser.parse_args().smoke
    resolutions = [16, 32, 64] if smoke else [32, 64, 128, 256, 512]
    print("scene             slope   wrong pixels at " + ", ".join(f"{r}^2" for r in resolutions))
    for name in ["a1_square", "a6_sphere_sun"] if smoke else list(ANALYTIC_SCENES):
        wrong = errors(name, resolutions, 128 if smoke else 512)
        slope = np.polyfit(np.log2(resolutions), np.log2(wrong), 1)[0]
        print(f"{name:16s}  {slope:+.2f}   " + ", ".join(f"{w:.3%}" for w in wrong))


if __name__ == "__main__":
    main()
