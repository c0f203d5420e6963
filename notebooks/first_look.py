# %% [markdown]
# # A first look
# A scene, one light, what each eye pixel needs, and an adaptive shadow map against traced truth:
# in ten cells.

# %%
import os

import numpy as np

import asmjax
from asmjax.experiment import analysis_maps
from asmjax.report.figures import draw_maps, draw_shadows, draw_tree
from asmjax.report.view_pictures import tree_picture, view_pictures
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap

# ASMJAX_SMOKE=1 only shows that everything runs.
SMOKE = "ASMJAX_SMOKE" in os.environ
SIDE, RESOLUTION, MEMORY_MB = (64, 512, 1) if SMOKE else (512, 2048, 16)

scene = asmjax.load_scene("paper_room")
view = scene.view("closeup").resized(SIDE, SIDE)
scene

# %% [markdown]
# The eye buffer says which surface each pixel sees; the light frame is what the light can draw.
# One shadow ray from each pixel is the truth that all maps are judged by.

# %%
eye = scene.eye(view)
frame = scene.light_frame(eye)
rays = scene.light_rays()
truth = scene.shadow_rays(eye, frame, rays).trace()
print(f"{eye.valid.mean():.0%} of the pixels see a surface, {truth[eye.valid].mean():.0%} are lit")

# %%
title = f"{scene.name}, {view.name}"
draw_shadows(view_pictures(title, eye, frame, truth))

# %% [markdown]
# A conventional map of 16 MB: one depth for each of 2048 x 2048 texels.

# %%
uniform = UniformShadowMap(RESOLUTION)
flat = uniform.build(eye, frame, rays)


def wrong(algorithm, state):
    """Share of the pixels whose shadow is not that of truth."""
    lit = np.asarray(algorithm.visibility(state, eye.points)) > 0.5
    return np.mean((lit != truth)[eye.valid])


print(f"{uniform.name}: {wrong(uniform, flat):.1%} of the pixels are wrong")

# %% [markdown]
# Why: how much larger its texels are than the pixels that look at them, what would match, and
# where refining it helps.

# %%
maps = analysis_maps(eye, frame, uniform, flat)
print(f"a texel is {np.nanmedian(maps['m']):.0f} pixels wide in the worst direction (median);")
print(f"matching the eye takes {np.sqrt(np.nanmedian(maps['n_required'])):,.0f} texels a side")

# %%
draw_maps(view_pictures(title, eye, frame, truth, maps=maps))

# %% [markdown]
# The adaptive map spends the same memory where the eye can see it.

# %%
adaptive = AdaptiveShadowMap(memory_bytes=MEMORY_MB * 2**20)
tree = adaptive.build(eye, frame, rays)
for algorithm, state in ((uniform, flat), (adaptive, tree)):
    megabytes = algorithm.cost(state).bytes / 2**20
    print(f"{algorithm.name:15s} {wrong(algorithm, state):8.3%} wrong, {megabytes:.1f} MB")

# %%
shadows = {
    algorithm.name: algorithm.visibility(state, eye.points)
    for algorithm, state in ((uniform, flat), (adaptive, tree))
}
draw_shadows(view_pictures(title, eye, frame, truth, shadows))

# %% [markdown]
# Its nodes over what the light sees: fine along the edges of shadows that the eye looks at.

# %%
picture = tree_picture(adaptive, tree, frame, rays)
draw_tree(view_pictures(title, eye, frame, truth, tree=picture))

# %% [markdown]
# What it cost. The first build of a process also compiles: `asmjax run` warms up before it
# measures.

# %%
for algorithm, state in ((uniform, flat), (adaptive, tree)):
    cost, finest = algorithm.cost(state), algorithm.effective_resolution(state)
    print(
        f"{algorithm.name:15s} {cost.texels:>9,} texels from {cost.rays:>9,} rays, "
        f"passes: {cost.passes}; the finest are those of a flat map of {finest:,} a side"
    )
