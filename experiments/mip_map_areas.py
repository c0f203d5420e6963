"""How wrong is the projected area that the 2001 paper read from a mip-map, and why?

In each view of the paper's room: the ratio of a texel of the 512 x 512 starting map to a pixel, as
a mip-map tells it, against the exact one from the areas. Three sources of error are told apart:
linear reading between levels, a level chosen by one axis of the footprint, and eight bits.

    python experiments/mip_map_areas.py [--smoke]
"""

import argparse
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from asmjax.buffers import light_offset, project
from asmjax.footprint import (
    log2_footprint_axes,
    log2_linear_ratio,
    log2_mip_value,
    log2_mipmap_ratio,
    perspective_area,
    uv_jacobian,
)
from asmjax.render.load import Scene, load_scene
from asmjax.report.figures.style import BACKGROUND, DPI, styled

RESOLUTION = 512
"""Texels per side of the map that the paper starts with."""

RESULTS = Path(__file__).parent / "results"

READINGS = {
    "trilinear reading alone": None,
    "isotropic": {},
    "anisotropic to 2:1": {"max_anisotropy": 2.0},
    "anisotropic to 16:1": {"max_anisotropy": 16.0},
    "isotropic, 8 bits": {"eight_bit": True},
    "anisotropic to 2:1, 8 bits": {"max_anisotropy": 2.0, "eight_bit": True},
}
"""Settings of `log2_mipmap_ratio`; None reads exact areas."""

MAPPED = ("isotropic", "anisotropic to 2:1", "isotropic, 8 bits")
LINES = {
    "trilinear reading alone": {"color": "#4D4D4D"},
    "isotropic": {"color": "#D55E00"},
    "anisotropic to 2:1": {"color": "#0072B2"},
    "anisotropic to 16:1": {"color": "#56B4E9", "linestyle": "--"},
    "isotropic, 8 bits": {"color": "#CC79A7"},
}


def errors(scene: Scene, view: str, size: int | None) -> dict[str, np.ndarray]:
    """log2(mip-map's linear ratio / exact one) of each pixel (height, width), NaN where unlit.

    Eight bits hold footprints from tile/255 on. The tile is as wide as the 99th percentile of what
    either image needs, so what is lost is lost at the fine end.
    """
    chosen = scene.view(view)
    eye = scene.eye(chosen if size is None else chosen.resized(size, size))
    frame = scene.light_frame(eye)
    offset = light_offset(eye.points, frame)
    longest, facing = _longest(eye.points, eye.camera, frame, offset)
    tile = jnp.exp2(np.percentile(np.asarray(longest)[:, np.asarray(facing)], 99))
    found = _errors(eye.points, eye.camera, frame, offset, tile)
    return {name: np.where(facing, found[name], np.nan).reshape(eye.size) for name in READINGS}


@eqx.filter_jit
def _longest(points, camera, frame, offset):
    """log2 of the longer axis of pixels and texels (2, n), and which pixels face the light (n,)."""
    receivers = project(points, frame, offset)
    pixel, texel, known = log2_footprint_axes(points, camera, frame, receivers)
    longest = jnp.stack([jnp.maximum(*pixel), jnp.maximum(*texel) - jnp.log2(RESOLUTION)])
    return longest, known


@eqx.filter_jit
def _errors(points, camera, frame, offset, tile):
    receivers = project(points, frame, offset)
    exact = log2_linear_ratio(uv_jacobian(points, camera, frame, receivers), RESOLUTION)
    area = perspective_area(
        points.position, points.normal, jnp.asarray(camera.rotation[2]), jnp.asarray(camera.focal)
    )
    pixel = 0.5 * jnp.log2(jnp.where(receivers.facing, area, 1))
    level = jnp.log2(tile) - pixel
    errors = {}
    for name, settings in READINGS.items():
        if settings is None:
            read = log2_mip_value(level) - log2_mip_value(level - exact)
        else:
            read = log2_mipmap_ratio(
                points, camera, frame, receivers, RESOLUTION, tile=tile, **settings
            )
        errors[name] = read - exact
    return errors


@styled
def draw(found: dict[str, dict[str, np.ndarray]]) -> Figure:
    """Maps of the first view's errors above, how large each view's errors are below."""
    figure = Figure(figsize=(9.6, 6.6), dpi=DPI, layout="constrained")
    axes = figure.subplots(2, 3, height_ratios=[1.3, 1])
    first = next(iter(found))
    for place, name in zip(axes[0], MAPPED, strict=True):
        place.set(title=f"{first}: {name}", xticks=[], yticks=[], facecolor=BACKGROUND)
        image = place.imshow(found[first][name], cmap="RdBu_r", vmin=-1, vmax=1)
    bar = figure.colorbar(image, ax=axes[0], extend="both", pad=0.01, aspect=25)
    bar.set_ticks([-1, -0.5, 0, 0.5, 1], labels=["1/2", "0.71", "1", "1.41", "2"])
    bar.set_label("ratio read / exact ratio (linear)")
    for place, (view, errors) in zip(axes[1], found.items(), strict=True):
        for name, look in LINES.items():
            error = np.sort(np.abs(errors[name][np.isfinite(errors[name])]))
            place.plot(error, np.linspace(0, 100, error.size), **look, label=name, linewidth=1.4)
        place.set(title=view, xlabel="error of at most, octaves", xlim=(0, 2.5), ylim=(0, 101))
        place.grid(color="#DDDDDD", linewidth=0.6)
    axes[1][0].set_ylabel("% of the pixels that face the light")
    figure.legend(*axes[1][0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="small images, a few seconds")
    smoke = parser.parse_args().smoke
    scene = load_scene("paper_room")
    found = {view: errors(scene, view, 64 if smoke else None) for view in scene.views}
    print("log2(ratio read / exact ratio)       p5     p50     p95   mean |.|   off by 2 or more")
    for view, readings in found.items():
        for name, error in readings.items():
            error = error[np.isfinite(error)]
            low, middle, high = np.percentile(error, [5, 50, 95])
            print(
                f"{view:9s} {name:26s} {low:+.2f}   {middle:+.2f}   {high:+.2f}   "
                f"{np.abs(error).mean():6.3f}   {np.mean(np.abs(error) >= 1):8.1%}"
            )
    RESULTS.mkdir(exist_ok=True)
    draw(found).savefig(RESULTS / f"mip_map_areas{'-smoke' if smoke else ''}.png")


if __name__ == "__main__":
    main()
