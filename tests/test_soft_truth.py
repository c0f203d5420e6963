"""Soft truth by many shadow rays: against closed forms, within the error that it says it has."""

from dataclasses import replace

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.geometry import disk_light, sun_light
from asmjax.scene.analytic_rays import analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES, a5_half_plane
from asmjax.scene.closed_forms import coaxial_sphere_radii, half_plane_disc_visibility
from asmjax.scene.lights import light_frame
from asmjax.scene.soft_visibility import LightSamples, SoftVisibility, analytic_soft_visibility
from asmjax.scene.spec import Disk, LightSpec, Rectangle, ViewSpec

SIDE = 40


def seen(name: str, side: int = SIDE):
    """An analytic scene, its eye's image, its soft light and the frame of that."""
    scene = ANALYTIC_SCENES[name]()
    view = next(iter(scene.spec.views.values())).resized(side, side)
    eye = analytic_eye(scene.spec.shapes, view)
    light = scene.soft_light()
    return scene, eye, light, light_frame(light, eye, scene_bounds(scene.spec.shapes))


def check_against(expected: np.ndarray, found: SoftVisibility, judged: np.ndarray) -> None:
    """All within what the standard errors allow: the mean, the spread of what is off in units of
    the error, and each pixel."""
    off, error = found.visibility[judged] - expected[judged], found.error[judged]
    sure = error == 0
    # Where all samples of each cell agree a part of a cell may still be the other way.
    assert np.abs(off[sure]).max() < 0.02
    assert np.abs(off[~sure]).max() < 0.1
    assert abs(off.mean()) <= 3 * np.sqrt(np.sum(error**2)) / off.size
    scaled = off[~sure] / error[~sure]
    assert scaled.size > 100
    assert np.sqrt(np.mean(scaled**2)) == pytest.approx(1.0, abs=0.2)
    assert np.mean(np.abs(scaled) > 3) < 0.015


@pytest.mark.parametrize("name", ["a2_square_light", "a4_disc_light", "a5_half_plane"])
def test_truth_is_the_closed_form(name):
    scene, eye, _, frame = seen(name)
    found = analytic_soft_visibility(scene.spec.shapes, eye, frame)
    x, y, _ = np.where(eye.valid, eye.world, 0.0)
    assert scene.soft_visibility is not None
    check_against(scene.soft_visibility(x, y), found, eye.shape == 0)


def test_the_suns_disk():
    """A straight edge under an overhead sun of 10 degrees: A5 with tangents for lengths."""
    scene, angle, height = a5_half_plane(), np.radians(10.0), 2.0
    view = ViewSpec("near", (1.0, 0.3, 1.5), (0.0, 0.0, 0.0), fov_x_deg=30.0, width=40, height=40)
    eye = analytic_eye(scene.spec.shapes, view)
    down = (0.0, 0.0, -1.0)
    light = LightSpec("sun", "directional", direction=down, area=sun_light(down, angle))
    frame = light_frame(light, eye, scene_bounds(scene.spec.shapes))
    found = analytic_soft_visibility(scene.spec.shapes, eye, frame)
    expected = half_plane_disc_visibility(eye.world[0] / (height * np.tan(angle / 2)))
    check_against(expected, found, eye.shape == 0)


def test_a_sphere_between_a_spherical_light_and_a_plane():
    """A7: dark within the umbra, lit beyond the penumbra, and between them brighter outwards."""
    scene, eye, _, frame = seen("a7_sphere_light")
    found = analytic_soft_visibility(scene.spec.shapes, eye, frame)
    umbra, penumbra = coaxial_sphere_radii(0.8, 0.5, 4.0, 2.0)
    plane = eye.shape == 0
    radius = np.hypot(*eye.world[:2])
    assert found.visibility[plane & (radius < umbra)].max() == 0
    assert found.visibility[plane & (radius > penumbra)].min() == 1
    within = plane & (radius > umbra) & (radius < penumbra)
    order = np.argsort(radius[within])
    brightness = found.visibility[within][order]
    thirds = [part.mean() for part in np.array_split(brightness, 3)]
    assert 0 < thirds[0] < thirds[1] < thirds[2] < 1


def test_half_a_light_above_the_horizon_is_half_a_light():
    """A wall whose plane cuts a disk light in the middle; a light that looks away is refused."""
    wall = [Rectangle("wall", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    view = ViewSpec("aside", (4.0, 0.5, 0.2), (0.0, 0.0, 0.0), fov_x_deg=20, width=16, height=16)
    eye = analytic_eye(wall, view)
    down, up = (
        LightSpec("lamp", "point", (0.0, 0.0, 3.0), area=disk_light((0, 0, 3), (0.5, 0, 0), half_v))
        for half_v in ((0, -0.5, 0), (0, 0.5, 0))
    )
    frame = light_frame(down, eye, scene_bounds(wall))
    found = analytic_soft_visibility(wall, eye, frame, strata=4, repeats=2)
    assert found.visibility[eye.valid] == pytest.approx(0.5, abs=1e-12)
    assert not found.visibility[~eye.valid].any() and not found.error.any()
    with pytest.raises(UseError, match="shines on no surface"):
        light_frame(up, eye, scene_bounds(wall))


def test_a_seed_is_the_same_for_everybody():
    scene, eye, _, frame = seen("a4_disc_light", 16)
    shapes = scene.spec.shapes
    first, again, other = (
        analytic_soft_visibility(shapes, eye, frame, seed=seed) for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_rays_are_counted_and_wrong_use_is_refused():
    """Rays go to what the light may reach, and none at all without a size or a spread."""
    scene, eye, light, frame = seen("a4_disc_light", 16)
    samples = LightSamples(eye, frame, 3, 2)
    assert samples.count == samples.pixels.size * 18
    top = eye.shape == 1
    # The occluder's upper side faces the light; of all that is seen nothing is turned away.
    assert top.any() and samples.pixels.size == eye.valid.sum()
    with pytest.raises(UseError, match="this one has none"):
        LightSamples(eye, replace(frame, area=None))
    with pytest.raises(UseError, match="2 samples or more"):
        LightSamples(eye, frame, 3, 1)
    with pytest.raises(UseError, match="has no area light"):
        ANALYTIC_SCENES["a1_square"]().soft_light()
    assert light.area is not None and light.position == tuple(light.area.centre)


@pytest.mark.mitsuba
@pytest.mark.parametrize("far", [False, True])
def test_the_renderer_casts_the_same_rays(far):
    """Bit for bit but for edges, also of a scene that is far away and is cast in a frame of its
    own: places on the light and their order are the same."""
    from asmjax.render.load import load_scene

    scene, eye, light, frame = seen("a4_disc_light", 24)
    shift = 3e4 if far else 0.0

    def away(point):
        x, y, z = point
        return (x + shift, y + shift, z + shift)

    ground, disk = scene.spec.shapes
    assert isinstance(ground, Rectangle) and isinstance(disk, Disk)
    shapes = (replace(ground, centre=away(ground.centre)), replace(disk, centre=away(disk.centre)))
    view = next(iter(scene.spec.views.values())).resized(24, 24)
    view = replace(view, origin=away(view.origin), target=away(view.target))
    assert light.position is not None
    moved = light.moved_to(away(light.position))
    spec = replace(scene.spec, shapes=shapes, views={"a": view}, lights={"l": moved})
    made = load_scene(spec)
    image = made.eye(made.view())
    where = made.light_frame(image)
    rays = made.soft_rays(image, where, made.light_rays(), strata=4, repeats=2)
    found = rays.estimate()
    expected = analytic_soft_visibility(shapes, image, where, strata=4, repeats=2)
    assert rays.count == LightSamples(image, where, 4, 2).count > 0
    np.testing.assert_array_equal(rays.trace(), found.visibility)
    differ = np.abs(found.visibility - expected.visibility)
    assert differ.max() <= 2 / 32 and np.mean(differ > 0) < 0.01
    assert 0.1 < found.visibility.mean() < 0.95
