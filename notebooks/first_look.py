# %% [markdown]
# # First look
# A scene, one light, what each eye pixel needs, and an adaptive shadow map against traced truth.

# %%
import numpy as np

import asmjax
from asmjax.experiment import analysis_maps
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap

scene = asmjax.load_scene("paper_room")
view = scene.view("closeup").resized(256, 256)
print(scene.name, "-", scene.geometry.triangles, "triangles; views:", ", ".join(scene.views))

# %% [markdown]
# The eye buffer says which surface each pixel sees; the light frame is what the light can draw.

# %%
eye = scene.eye(view)
frame = scene.light_frame(eye)
rays = scene.light_rays()
truth = scene.shadow_rays(eye, frame, rays).trace()
print(f"{eye.valid.mean():.0%} of the pixels see a surface, {truth[eye.valid].mean():.0%} are lit")

# %% [markdown]
# A conventional map, and how far its texels are from the size of the pixels.

# %%
uniform = UniformShadowMap(2048)
flat = uniform.build(eye, frame, rays)
maps = analysis_maps(eye, frame, uniform, flat)
print(f"a texel is {np.nanmedian(maps['m']):.0f} pixels wide in the worst direction (median);")
print(f"matching the eye takes {np.sqrt(np.nanmedian(maps['n_required'])):,.0f} texels a side")

# %% [markdown]
# The adaptive map spends the same memory where the eye can see it.

# %%
adaptive = AdaptiveShadowMap(memory_bytes=16 * 2**20)
tree = adaptive.build(eye, frame, rays)
for algorithm, state in ((uniform, flat), (adaptive, tree)):
    lit = np.asarray(algorithm.visibility(state, eye.points)) > 0.5
    wrong = np.mean((lit != truth)[eye.valid])
    megabytes = algorithm.cost(state).bytes / 2**20
    print(f"{algorithm.name:15s} {wrong:8.3%} wrong, {megabytes:.1f} MB")
