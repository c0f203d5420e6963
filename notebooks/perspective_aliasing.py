# %% [markdown]
# # Perspective aliasing: light angle, far / near, and warp
# Near the eye a pixel covers little of the world, far away much, and a flat map has one size of
# texel for both. How much too coarse it is depends on three things: the angle between light and
# view, the range of depths alpha = far / near, and the warp that the map is drawn in. Here each
# is a slider.
#
# Nothing here needs Mitsuba: the scene is a few shapes with closed forms.

# %%
import functools
import os
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import Normalize

from asmjax import theory
from asmjax.errors import missing_extra
from asmjax.experiment.aliasing import aliasing_maps, aliasing_numbers
from asmjax.experiment.light_angles import (
    FIRST_DEG,
    ViewRange,
    parallel_light,
    storage_factor,
    theory_storage,
    view_range,
)
from asmjax.hard_cases import traced
from asmjax.report.figures.aliasing import Curve, draw_distribution
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.families import look_of
from asmjax.report.figures.scales import colours_of, factor, log2_or_nan
from asmjax.report.figures.style import styled
from asmjax.report.view_pictures import view_pictures
from asmjax.scene import Disk, Rectangle, Sphere, ViewSpec
from asmjax.shadow import (
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    PerspectiveShadowMap,
    SubdividedShadowMap,
    UniformShadowMap,
    family_of,
)

SMOKE = "ASMJAX_SMOKE" in os.environ
WIDTH, TEXELS = (40, 64) if SMOKE else (300, 256)

# %% [markdown]
# ## In theory
# Light from above. The error along the view, as a part of the largest that any warp has: without
# a warp it is all at the near plane, with the eye's own perspective (n = 1) all at the far plane,
# and n = 1 + sqrt(alpha) (light-space perspective maps) balances the two.

# %%
ALPHA = 100.0
z = np.geomspace(1.0, ALPHA, 200)
strengths = {"no warp": 0.0, "n = 1 + √α": theory.u_lispsm(ALPHA), "n = 1": 1.0}
draw_distribution(
    [Curve(label, z, np.asarray(theory.g(z, ALPHA, u))) for label, u in strengths.items()], ALPHA
)

# %% [markdown]
# ## In a scene
# Level ground from depth 1 to alpha, with balls and discs that grow with their distance, so that
# the picture is the same for every alpha: only the map's task changes.

# %%
HALF = np.radians(30.0)
VIEW = ViewSpec(
    "level",
    (0.0, 0.0, float(np.tan(HALF))),
    (0.0, 1.0, float(np.tan(HALF))),
    fov_x_deg=60.0,
    width=WIDTH,
    height=3 * WIDTH // 5,
    # The horizon is high in the picture, whose lower edge sees the ground at depth 1.
    principal_point=(0.0, -1 / 3),
)
WARPS = {
    "none": UniformShadowMap(TEXELS),
    "light-space": LightSpaceShadowMap(TEXELS),
    "perspective": PerspectiveShadowMap(TEXELS),
    "logarithmic": LogarithmicShadowMap(TEXELS),
    "4 slabs": PartitionedShadowMap(TEXELS),
    "faces, 2 parts": SubdividedShadowMap(TEXELS),
}
"""From no warp to the strongest, and beyond: several maps of as many texels in all."""


def shapes(alpha):
    """The scene whose ground is seen from depth 1 to alpha."""
    depths = alpha ** np.linspace(0.06, 0.8, 9)
    across = np.array([-0.3, 0.25, -0.1, 0.35, -0.35, 0.05, 0.3, -0.2, 0.15])
    casters = [
        Sphere(f"ball_{k}", (x * y, y, 0.1 * y), 0.06 * y, (0.75, 0.55, 0.4))
        if k % 2
        else Disk(f"disc_{k}", (x * y, y, 0.13 * y), (0.0, 0.0, 1.0), 0.08 * y, (0.4, 0.55, 0.7))
        for k, (x, y) in enumerate(zip(across.tolist(), depths.tolist(), strict=True))
    ]
    middle, half = (1 + alpha) / 2, (alpha - 1) / 2
    return [Rectangle("ground", (0.0, middle, 0.0), (alpha, 0, 0), (0, half, 0)), *casters]


# %% [markdown]
# A map for one setting, and what is wrong with it. `storage` is the number of texels for each
# pixel of the picture that would leave no texel wider than a pixel, which the theory knows for
# most warps.


# %%
@dataclass(frozen=True)
class Seen:
    """What one setting of the sliders gives; images are (height, width).

    Attributes:
        picture: the scene under the map's shadow.
        perspective: texel / pixel width, of the perspective alone; above 1 is too coarse.
        wrong: share of the pixels whose shadow is wrong.
        wasted: share of the texels that answer no pixel.
        storage: texels / pixels at which no texel is wider than a pixel.
        view: far / near and field of view, as the picture has them.
    """

    picture: np.ndarray
    perspective: np.ndarray
    wrong: float
    wasted: float
    storage: float
    view: ViewRange


@functools.lru_cache(maxsize=64)
def seen(angle_deg: float, alpha: float, warp: str) -> Seen:
    """Build the map, ask it, and compare it with truth."""
    scene = traced(shapes(alpha), VIEW, parallel_light("sun", VIEW.camera(), angle_deg))
    algorithm, eye = WARPS[warp], scene.eye
    state = algorithm.build(eye, scene.frame, scene.rays)
    visibility = np.asarray(algorithm.visibility(state, eye.points))
    maps = aliasing_maps(algorithm, state, eye, scene.frame)
    pictures = view_pictures("", eye, scene.frame, scene.expected, {warp: visibility})
    return Seen(
        picture=pictures.shaded(pictures.visibilities[warp]),
        perspective=maps.perspective.reshape(eye.size),
        wrong=float(scene.wrong(visibility).sum() / scene.judged.sum()),
        wasted=aliasing_numbers(maps, algorithm.cost(state).texels).wasted,
        storage=storage_factor(algorithm, state, eye, scene.frame, maps.known),
        view=view_range(eye),
    )


print(f"{'warp':15s} {'wrong':>7s} {'wasted':>7s} {'texels / pixels for a clean map':>32s}")
for name in WARPS:
    one = seen(90.0, 50.0, name)
    print(f"{name:15s} {one.wrong:7.2%} {one.wasted:7.1%} {one.storage:32.1f}")

# %% [markdown]
# ## Sliders
# `explore` draws one setting: the shadow, where the map is too coarse (red) and finer than the
# eye can tell (blue), and the texels that would be enough: lines are the theory's for the full
# frustum, the mark is this map. It is a plain function: call it with any numbers.

# %%
ANGLES = np.linspace(FIRST_DEG, 90.0, 45)
LIMIT = 4.0
"""log2 of the error at both ends of the colours."""


@styled
def explore(angle_deg=60.0, alpha=50.0, warp="light-space"):
    """A figure of that angle between light and view, far / near, and warp."""
    one = seen(float(angle_deg), float(alpha), warp)
    scale = max(1, 600 // WIDTH)
    width, height = scale * WIDTH, scale * VIEW.height
    bar, chart = 16 + 70, 480
    board = Board(
        2 * EDGE + 2 * width + bar + chart + 6 * GAP + 60, 2 * EDGE + HEAD + height + 2 * CAPTION
    )
    board.heading(EDGE, EDGE, width, f"Shadow: {one.wrong:.2%} wrong", f"warp: {warp}")
    board.image(EDGE, EDGE + HEAD, width, height, one.picture)
    left = EDGE + width + GAP
    board.heading(left, EDGE, width, "Texel / pixel", f"{one.wasted:.0%} of the texels are wasted")
    colours, norm = matplotlib.colormaps["RdBu_r"], Normalize(-LIMIT, LIMIT)
    image = colours_of(log2_or_nan(one.perspective), colours, norm)
    board.image(left, EDGE + HEAD, width, height, image)
    ticks = {float(k): factor(k) for k in range(-4, 5, 2)}
    at = left + width + GAP // 2
    board.scale_bar(colours, norm, at, EDGE + HEAD, 16, height, ticks, "both")
    left = at + bar + 4 * GAP
    board.heading(left, EDGE, chart, "Texels for a clean map", "texels / pixels of the picture")
    axes = board.axes(left, EDGE + HEAD, chart, height - 30)
    axes.set_yscale("log")
    for name, algorithm in WARPS.items():
        curve = theory_storage(algorithm, one.view, ANGLES)
        if curve is not None and np.isfinite(curve).sum() > 1:
            colour, chosen = look_of(family_of(algorithm))[0], name == warp
            axes.plot(ANGLES, curve, color=colour, linewidth=2.4 if chosen else 0.9,
                      alpha=1.0 if chosen else 0.6, label=name)  # fmt: skip
    axes.plot([angle_deg], [one.storage], "o", color="#1A1A1A", markersize=7, zorder=5)
    axes.set(xlim=(0, 92), ylim=(0.3, 1e6), xlabel="angle between light and view, degrees")
    axes.grid(which="major", color="#ECECEC", linewidth=0.6)
    axes.legend(loc="upper right", ncols=2)
    board.caption(
        f"Light {angle_deg:.0f} degrees off the view, far / near {one.view.alpha:.3g} as seen, "
        f"{TEXELS} x {TEXELS} texels. Grey: sky, or turned away from the light."
    )
    return board.figure


explore(60.0, 50.0, "light-space")

# %% [markdown]
# The light falls into the view, and every warp along it fades: splits are what remains.

# %%
explore(15.0, 50.0, "light-space")

# %%
explore(15.0, 50.0, "faces, 2 parts")

# %% [markdown]
# Move the sliders, in Jupyter: `make extras EXTRA=notebooks` installs it.


# %%
def sliders():
    """The three sliders above the figure. Raises `ImportError` without ipywidgets."""
    import ipywidgets

    return ipywidgets.interactive(
        explore,
        {"auto_display": True},
        angle_deg=ipywidgets.IntSlider(
            60, 5, 90, 5, description="light, deg", continuous_update=False
        ),
        alpha=ipywidgets.FloatLogSlider(
            value=50.0,
            base=10,
            min=np.log10(2),
            max=2,
            step=0.1,
            description="far / near",
            continuous_update=False,
        ),
        warp=ipywidgets.SelectionSlider(
            options=list(WARPS), value="light-space", description="warp", continuous_update=False
        ),
    )


try:
    controls = sliders()
except ImportError:
    controls = str(missing_extra("ipywidgets", "notebooks"))
controls
