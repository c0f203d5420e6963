"""asmjax: shadow-map accuracy, measured.

Where does a shadow map alias, what would each eye pixel need, and what does accuracy cost?
Mitsuba 3 renders eye and light buffers; JAX computes the rest. Start with::

    import asmjax
    scene = asmjax.load_scene("paper_room")
    eye = scene.eye("closeup")
    frame = scene.light_frame(eye)
    asm = asmjax.AdaptiveShadowMap()
    state = asm.build(eye, frame, scene.light_rays())
    lit = asm.visibility(state, eye.points)
"""

import importlib
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from asmjax.analyze_job import analyse_scene, run_analysis
    from asmjax.compare_job import compare, run_comparison
    from asmjax.effects import Plan
    from asmjax.errors import UseError
    from asmjax.main_job import measure_scene, run_main_job
    from asmjax.options import AnalyzeOptions, CompareOptions, PlanOptions, RunOptions, TuneOptions
    from asmjax.plan_job import plan_scene, run_plan
    from asmjax.planning import plan_effects
    from asmjax.render.load import Scene, load_scene
    from asmjax.scene import list_scenes
    from asmjax.shadow import (
        AccumulatedShadowMap,
        AdaptiveShadowMap,
        FilteredShadowMap,
        LightSpaceShadowMap,
        LogarithmicShadowMap,
        MomentShadowMap,
        PartitionedShadowMap,
        PCSSShadowMap,
        PerspectiveShadowMap,
        ShadowAlgorithm,
        Status,
        SubdividedShadowMap,
        TrapezoidalShadowMap,
        TunedShadowMap,
        UniformShadowMap,
        calibrate,
        read_settings,
        settings_text,
        write_settings,
    )
    from asmjax.tune_job import run_tuning, tune
    from asmjax.walkthrough_job import Walk, measure_walkthrough, run_walkthrough

_HOME = {
    "AccumulatedShadowMap": "asmjax.shadow",
    "AdaptiveShadowMap": "asmjax.shadow",
    "AnalyzeOptions": "asmjax.options",
    "CompareOptions": "asmjax.options",
    "FilteredShadowMap": "asmjax.shadow",
    "LightSpaceShadowMap": "asmjax.shadow",
    "LogarithmicShadowMap": "asmjax.shadow",
    "MomentShadowMap": "asmjax.shadow",
    "PCSSShadowMap": "asmjax.shadow",
    "PartitionedShadowMap": "asmjax.shadow",
    "PerspectiveShadowMap": "asmjax.shadow",
    "Plan": "asmjax.effects",
    "PlanOptions": "asmjax.options",
    "RunOptions": "asmjax.options",
    "Scene": "asmjax.render.load",
    "ShadowAlgorithm": "asmjax.shadow",
    "Status": "asmjax.shadow",
    "SubdividedShadowMap": "asmjax.shadow",
    "TrapezoidalShadowMap": "asmjax.shadow",
    "TuneOptions": "asmjax.options",
    "TunedShadowMap": "asmjax.shadow",
    "UniformShadowMap": "asmjax.shadow",
    "UseError": "asmjax.errors",
    "Walk": "asmjax.walkthrough_job",
    "analyse_scene": "asmjax.analyze_job",
    "calibrate": "asmjax.shadow",
    "compare": "asmjax.compare_job",
    "list_scenes": "asmjax.scene",
    "load_scene": "asmjax.render.load",
    "measure_scene": "asmjax.main_job",
    "measure_walkthrough": "asmjax.walkthrough_job",
    "plan_effects": "asmjax.planning",
    "plan_scene": "asmjax.plan_job",
    "read_settings": "asmjax.shadow",
    "run_analysis": "asmjax.analyze_job",
    "run_comparison": "asmjax.compare_job",
    "run_main_job": "asmjax.main_job",
    "run_plan": "asmjax.plan_job",
    "run_tuning": "asmjax.tune_job",
    "run_walkthrough": "asmjax.walkthrough_job",
    "settings_text": "asmjax.shadow",
    "tune": "asmjax.tune_job",
    "write_settings": "asmjax.shadow",
}

__all__ = [
    "AccumulatedShadowMap",
    "AdaptiveShadowMap",
    "AnalyzeOptions",
    "CompareOptions",
    "FilteredShadowMap",
    "LightSpaceShadowMap",
    "LogarithmicShadowMap",
    "MomentShadowMap",
    "PCSSShadowMap",
    "PartitionedShadowMap",
    "PerspectiveShadowMap",
    "Plan",
    "PlanOptions",
    "RunOptions",
    "Scene",
    "ShadowAlgorithm",
    "Status",
    "SubdividedShadowMap",
    "TrapezoidalShadowMap",
    "TuneOptions",
    "TunedShadowMap",
    "UniformShadowMap",
    "UseError",
    "Walk",
    "analyse_scene",
    "calibrate",
    "compare",
    "list_scenes",
    "load_scene",
    "measure_scene",
    "measure_walkthrough",
    "plan_effects",
    "plan_scene",
    "read_settings",
    "run_analysis",
    "run_comparison",
    "run_main_job",
    "run_plan",
    "run_tuning",
    "run_walkthrough",
    "settings_text",
    "tune",
    "write_settings",
]


def __getattr__(name: str):
    # Names are loaded when they are used: `asmjax --help` must load neither JAX nor Mitsuba.
    if name not in _HOME:
        raise AttributeError(f"module 'asmjax' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__():
    return sorted([*globals(), *_HOME])
