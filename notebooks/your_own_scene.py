# %% [markdown]
# # Bring your own scene
# A Mitsuba scene file, a Mitsuba dictionary, or plain data: whatever has surfaces, a sensor and a
# light can be planned for, measured and drawn.

# %%
import os
from pathlib import Path

import asmjax
from asmjax.report import comparison_table
from asmjax.report.figures import draw_maps, draw_shadows
from asmjax.report.run_files import pictures_of, report_of
from asmjax.scene import LightSpec, Rectangle, SceneSpec, Sphere, ViewSpec

SMOKE = "ASMJAX_SMOKE" in os.environ
SIDE = 40 if SMOKE else 512
SIZE = (SIDE, SIDE) if SMOKE else None  # None: as the scene's sensor says.
MEMORY_MB = 0.25 if SMOKE else 4.0

# %% [markdown]
# ## A scene file
# Yours is probably there already; this one is written here.

# %%
SCENE = """<scene version="3.0.0">
  <sensor type="perspective" id="terrace">
    <float name="fov" value="50"/>
    <transform name="to_world">
      <lookat origin="3.4, -4.2, 2.6" target="0, 0.3, 0.6" up="0, 0, 1"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="512"/><integer name="height" value="512"/>
    </film>
  </sensor>
  <bsdf type="diffuse" id="stone"><rgb name="reflectance" value="0.62, 0.6, 0.55"/></bsdf>
  <bsdf type="diffuse" id="clay"><rgb name="reflectance" value="0.7, 0.38, 0.26"/></bsdf>
  <shape type="rectangle" id="floor">
    <transform name="to_world"><scale value="8"/></transform>
    <ref id="stone"/>
  </shape>
  <shape type="cube" id="wall">
    <transform name="to_world">
      <scale x="0.1" y="1.6" z="1.1"/><translate x="-1.6" y="0.4" z="1.1"/>
    </transform>
    <ref id="clay"/>
  </shape>
  <shape type="sphere" id="ball">
    <point name="center" x="0.3" y="0.2" z="0.5"/><float name="radius" value="0.5"/>
    <ref id="stone"/>
  </shape>
  <shape type="cylinder" id="post">
    <point name="p0" x="1.3" y="1.2" z="0"/><point name="p1" x="1.3" y="1.2" z="1.8"/>
    <float name="radius" value="0.05"/>
    <ref id="clay"/>
  </shape>
  <emitter type="directional" id="sun">
    <vector name="direction" x="0.8" y="0.3" z="-0.7"/>
    <rgb name="irradiance" value="3, 3, 2.8"/>
  </emitter>
  <emitter type="point" id="lantern">
    <point name="position" x="1.2" y="-1.2" z="1.2"/>
    <rgb name="intensity" value="0.4, 0.35, 0.3"/>
  </emitter>
</scene>
"""
folder = Path("out/your_own_scene")
folder.mkdir(parents=True, exist_ok=True)
terrace = folder / "terrace.xml"
terrace.write_text(SCENE, encoding="utf-8")

# Put the path of a scene of your own here: path = "my_room/room.xml".
path = terrace

# A file from elsewhere is checked first, in a child process: docs/scene_files.md.
scene = asmjax.load_scene(path)
scene

# %% [markdown]
# ## Which effects it calls for
# A few thousand rays decide, light by light, what is simulated, and say what is missing.

# %%
plan = asmjax.plan_effects(scene)
print(plan.explain())

# %% [markdown]
# ## Measured
# What `asmjax run terrace.xml` does, without writing anything: a uniform and an adaptive map of
# the same memory beside traced truth.

# %%
result = asmjax.measure_scene(
    asmjax.RunOptions(scene=str(path), size=SIZE, memory_mb=MEMORY_MB, repeats=2)
)
report = report_of(result, seed=0)
print(comparison_table(report["methods"]))

# %%
pictures = pictures_of(result, report)
draw_shadows(pictures)

# %%
draw_maps(pictures)

# %% [markdown]
# The other light is a name away: `RunOptions(light="lantern")`, `scene.light_frame(eye,
# "lantern")`.
#
# ## As plain data
# Shapes without a file, for experiments: every number is yours, and meshes are NumPy arrays.

# %%
spec = SceneSpec(
    name="two_balls",
    summary="two balls on a floor",
    shapes=(
        Rectangle("floor", (0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0)),
        Sphere("large", (-0.4, 0.3, 0.6), 0.6),
        Sphere("small", (0.7, -0.4, 0.25), 0.25),
    ),
    views={"front": ViewSpec("front", (2.5, -3.0, 2.0), (0.0, 0.0, 0.4))},
    lights={"lamp": LightSpec("lamp", "point", position=(1.5, 1.0, 3.0))},
)
own = asmjax.load_scene(spec)
eye = own.eye(own.view().resized(SIDE, SIDE))
truth = own.shadow_rays(eye, own.light_frame(eye), own.light_rays()).trace()
print(f"{own}: {truth[eye.valid].mean():.1%} of what is seen is lit")

# %% [markdown]
# ## What is refused
# A file that could run code, read other files or crash the renderer is refused in one line that
# says what to do; `load_scene(path, trust=True)` takes a file of your own as it is.

# %%
hostile = folder / "hostile.xml"
plugin = '<shape type="../plugins/anything"/>'
hostile.write_text(f'<scene version="3.0.0">{plugin}</scene>', encoding="utf-8")
for source in (hostile, "paper_romm"):
    try:
        asmjax.load_scene(source)
    except asmjax.UseError as problem:
        print(problem)
