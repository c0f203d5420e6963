"""What is looked at: no more than decisions need, and all that a light shines on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.plans import CountedRays, asked_about

from asmjax.effects import plan_lights, probe_size
from asmjax.effects.convex import is_convex
from asmjax.effects.probe import light_paths
from asmjax.effects.widths import RAYS, TEXELS
from asmjax.experiment.traces import counted_traces
from asmjax.geometry import sphere_light, sun_light
from asmjax.scene.analytic_rays import AnalyticRays
from asmjax.scene.analytic_scenes import a1_square, a2_square_light
from asmjax.scene.soft_visibility import LightSamples
from asmjax.scene.spec import LightSpec, Mesh


def test_looking_is_no_closer_than_decisions_need():
    """A point light: one ray for each pixel of the probe that faces it, and no texel. A light with
    a size: its map of minima on top. A light below the tolerance: nothing at all."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()

    def cast(lights, **more) -> tuple[CountedRays, int]:
        rays = CountedRays(AnalyticRays(scene.spec.shapes))
        asked = asked_about(scene, lights, rays=rays)
        plan = plan_lights(asked, **more)
        assert plan.probe_rays == asked.eye.valid.size + rays.all
        frame = asked.lights[0].frame
        assert frame is not None
        return rays, int(light_paths(asked.eye, frame).facing.sum())

    rays, facing = cast([lamp])
    assert (rays.single, rays.texels, rays.occlusion) == (facing, 0, 0)
    soft = a2_square_light().soft_light()
    rays, facing = cast([soft])
    assert (rays.single, rays.texels) == (facing, (TEXELS * RAYS) ** 2)
    dim = replace(soft, name="dim", intensity=0.0)
    rays, facing = cast([lamp, dim])
    assert (rays.single, rays.texels) == (facing, 0)
    rays, _ = cast([lamp], force={"*": "none"})
    assert rays.all == 0
    with counted_traces() as traced:
        cast([soft])
    assert traced == []


@pytest.mark.parametrize("kind", ["lamp", "sun"])
def test_what_a_light_shines_on_is_what_soft_truth_asks_about(kind):
    """A sphere half below the floor's plane, and a sun that half sets: all that any part of it
    shines on counts, and the pixels in whose plane it stands are said."""
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    low = (1.0, 0.0, -0.01)
    sun = LightSpec("centre", "directional", direction=low, area=sun_light(low, math.radians(4)))
    ball = replace(lamp, position=(4.0, 0.0, -0.1), area=sphere_light((4.0, 0.0, -0.1), 0.5))
    asked = asked_about(scene, [sun if kind == "sun" else ball])
    frame = asked.lights[0].frame
    assert frame is not None
    samples = LightSamples(asked.eye, frame)
    plan = plan_lights(asked, 0.0)
    (numbers,) = plan.numbers
    assert numbers.facing == samples.pixels.size / asked.eye.valid.sum()
    floor = asked.eye.valid & (asked.eye.shape == 0)
    assert 0 < floor.sum() / asked.eye.valid.sum() <= numbers.straddled <= numbers.facing
    paths = light_paths(asked.eye, frame)
    assert (paths.facing <= paths.reached).all() and (paths.straddled <= paths.reached).all()


def test_probe_sizes():
    assert probe_size(512, 512) == (64, 64)
    assert probe_size(1024, 256) == (128, 32)
    assert probe_size(16, 2000) == (6, 716) and probe_size(3, 2) == (3, 2)


def test_a_light_that_shines_on_nothing_says_so():
    scene = a1_square()
    (lamp,) = scene.spec.lights.values()
    below = replace(lamp, position=(0.0, 0.0, -5.0))
    plan = plan_lights(asked_about(scene, [below]))
    assert plan.lights == () and plan.methods_for("centre") == ()
    assert "shines on no surface" in plan.decision("centre").reason
    with pytest.raises(KeyError):
        plan.decision("other")


def cube(*moved: tuple[int, float]) -> Mesh:
    """The unit cube around the origin; corners `moved` along z."""
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij")).reshape(3, 8)
    for corner, by in moved:
        corners[2, corner] += by
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))]
    return Mesh("cube", corners, np.array(faces, np.int32).T)


def test_convex_objects():
    """A cube seen from outside is; with a corner pushed in, or from inside, it is not; a flat
    square is, from anywhere."""
    whole, dented = cube(), cube((7, -0.4))
    out, inside = np.array([0.0, 0.0, 3.0]), np.zeros(3)
    assert is_convex(whole.vertices, whole.faces, out)
    assert not is_convex(whole.vertices, whole.faces, inside)
    assert not is_convex(dented.vertices, dented.faces, out)
    square = np.array([[0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 0.0]])
    assert is_convex(square, np.array([[0, 0], [1, 2], [2, 3]]), inside)
    assert not is_convex(square, np.zeros((3, 0), np.int32), out)
