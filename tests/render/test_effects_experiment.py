"""experiments/effects.py: errors are parts of the light of each pixel."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from asmjax.effects.probe import light_paths
from asmjax.render.load import load_scene

ROOT = Path(__file__).parents[2]


@pytest.mark.mitsuba
@pytest.mark.slow
def test_a_lone_light_is_all_that_pixels_get():
    """Where it shines at all: what is off there counts in full, and nothing does elsewhere."""
    script = runpy.run_path(str(ROOT / "experiments/effects.py"))
    scene = load_scene("paper_room")
    view = scene.view().resized(48, 36)
    eye = scene.eye(view)
    part = script["part_of"](scene, view, eye, scene.light().name)
    facing = light_paths(eye, scene.light_frame(eye)).facing
    np.testing.assert_array_equal(part, facing)
    assert 0.5 < facing[eye.valid].mean() < 1
