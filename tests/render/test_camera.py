"""The camera read from a Mitsuba sensor sends the rays that the sensor itself sends."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from helpers.mitsuba_scenes import pinhole, sensor_rays

from asmjax.errors import UseError
from asmjax.render.load import load_scene
from asmjax.render.variant import activate

pytestmark = pytest.mark.mitsuba

# Corners, middle and odd places of the image (2, n), right and down, as fractions of its size.
FILM = np.array([[0.0, 1.0, 0.0, 1.0, 0.5, 0.31, 0.77], [0.0, 0.0, 1.0, 1.0, 0.5, 0.64, 0.12]])

FILMS = {
    "wide": {"width": 90, "height": 50},
    "tall": {"width": 40, "height": 70},
    "crop": {
        "width": 90, "height": 50,
        "crop_offset_x": 13, "crop_offset_y": 21, "crop_width": 33, "crop_height": 17,
    },
}  # fmt: skip


def scene_with(mi, sensor: dict | None) -> dict:
    scene = {
        "type": "scene",
        "ground": {"type": "rectangle"},
        "lamp": {"type": "point", "position": [0.3, 0.2, 4.0]},
    }
    return scene if sensor is None else {**scene, "eye": sensor}


def seen_by(mi, sensor: dict):
    """Our view of a sensor dictionary, the notices, and Mitsuba's own sensor."""
    scene = load_scene(scene_with(mi, sensor))
    return scene.view(), scene.notices, mi.load_dict(sensor)


def assert_same_rays(mi, view, sensor):
    """Directions to 2e-6 of their length (float32 matrices), origins on the near plane."""
    camera = view.camera()
    ours = camera.directions(FILM[0] * camera.width, FILM[1] * camera.height)
    start = camera.origin[:, None] + camera.near * ours
    origins, directions = sensor_rays(mi, sensor, FILM)
    assert ours / np.linalg.norm(ours, axis=0) == pytest.approx(directions, abs=2e-6)
    assert start == pytest.approx(origins, abs=2e-6 * max(1.0, float(np.abs(origins).max())))


@pytest.mark.parametrize("film", FILMS)
@pytest.mark.parametrize("axis", ["x", "y", "smaller", "larger", "diagonal"])
def test_field_of_view_and_crop(axis, film):
    """The field of view spans the named side of the whole film; a crop window cuts it."""
    mi = activate()
    sensor = pinhole(mi, (3.0, -2.0, 1.5), (0.1, 0.2, -0.3), up=(0, 0, 1), fov=47.0, fov_axis=axis)
    sensor["film"] = {"type": "hdrfilm", **FILMS[film]}
    view, _, theirs = seen_by(mi, sensor)
    assert (view.width, view.height) == (
        (33, 17) if film == "crop" else tuple(FILMS[film].values())
    )
    assert_same_rays(mi, view, theirs)


@pytest.mark.parametrize("film", FILMS)
@pytest.mark.parametrize("shift", [(0.2, 0.0), (0.0, -0.15), (-0.3, 0.4)])
def test_principal_point(shift, film):
    """A shifted lens moves the optical axis by a fraction of the film."""
    mi = activate()
    sensor = pinhole(
        mi, fov=60.0, principal_point_offset_x=shift[0], principal_point_offset_y=shift[1]
    )
    sensor["film"] = {"type": "hdrfilm", **FILMS[film]}
    view, _, theirs = seen_by(mi, sensor)
    assert_same_rays(mi, view, theirs)


TRANSFORMS: dict[str, Callable] = {
    "mirrored x": lambda t: t.scale([-1, 1, 1]),
    "mirrored y": lambda t: t.scale([1, -1, 1]),
    "looks back": lambda t: t.scale([1, 1, -1]),
    "rolled": lambda t: t.rotate([0, 0, 1], 33.0),
}


@pytest.mark.parametrize("name", TRANSFORMS)
def test_mirrored_and_rolled(name):
    """A to_world that flips an axis (right-handed exporters write such) flips the image."""
    mi = activate()
    sensor = pinhole(mi, (1.0, -2.0, 3.0), (0.0, 0.5, 0.0), (50, 30), up=(0, 0, 1), fov=40.0)
    sensor["to_world"] = sensor["to_world"] @ TRANSFORMS[name](mi.ScalarTransform4f())
    view, _, theirs = seen_by(mi, sensor)
    assert_same_rays(mi, view, theirs)


def test_near_clip_is_where_rays_start():
    """Mitsuba's sensor rays start on the near plane, an axial distance from the eye."""
    mi = activate()
    view, _, theirs = seen_by(mi, pinhole(mi, fov=70.0, near_clip=1.25, far_clip=321.0))
    assert (view.near, view.far) == (1.25, 321.0)
    assert_same_rays(mi, view, theirs)


def test_scaled_camera_is_refused():
    """Mitsuba allows no scale in a camera; the reason reaches the user in one line."""
    mi = activate()
    sensor = pinhole(mi)
    sensor["to_world"] = sensor["to_world"] @ mi.ScalarTransform4f().scale(2.0)
    with pytest.raises(UseError, match="[Ss]cale factors.*mend the scene") as problem:
        load_scene(scene_with(mi, sensor))
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize(
    "broken",
    [
        {"to_world": "nan"},
        {"principal_point_offset_x": math.nan},
        {"near_clip": math.nan},
        {"fov": math.nan},
    ],
    ids=lambda broken: next(iter(broken)),
)
def test_camera_that_is_not_finite(broken):
    """NaN anywhere in a camera is one line, never an image of NaN."""
    mi = activate()
    sensor = pinhole(mi) | broken
    if broken.get("to_world"):
        sensor["to_world"] = mi.ScalarTransform4f().translate([math.nan, 0, 0])
    with pytest.raises(UseError) as problem:
        load_scene(scene_with(mi, sensor)).view().camera()
    assert "\n" not in str(problem.value)


def test_thin_lens_is_a_pinhole_and_says_so():
    """Depth of field is left out: the rays are those through the middle of the lens."""
    mi = activate()
    sensor = pinhole(mi, (1.0, 2.0, 5.0), size=(40, 24), fov=35.0)
    lens = sensor | {"type": "thinlens", "aperture_radius": 0.2, "focus_distance": 5.0}
    view, notices, _ = seen_by(mi, lens)
    assert_same_rays(mi, view, mi.load_dict(sensor))
    assert ["eye" in n and "pinhole" in n for n in notices] == [True]


def test_other_sensors_are_left_out_with_a_notice():
    """An orthographic sensor is named as left out, and the perspective one behind it is taken."""
    mi = activate()
    scene = scene_with(mi, {"type": "orthographic"}) | {"second": pinhole(mi)}
    got = load_scene(scene)
    assert list(got.views) == ["second"]
    (notice,) = got.notices
    assert "eye" in notice and "Orthographic" in notice and "perspective" in notice
    with pytest.raises(UseError, match="has no view"):
        load_scene(scene_with(mi, {"type": "orthographic"})).view()


def test_sensors_by_id_and_index():
    """Sensors are picked by id or by index; one without an id is called after its index."""
    mi = activate()
    got = load_scene(scene_with(mi, pinhole(mi, fov=30.0)) | {"close": pinhole(mi, fov=10.0)})
    assert [got.view(w).fov_x_deg for w in (None, "eye", "0", "close", "1")] == pytest.approx(
        [30.0, 30.0, 30.0, 10.0, 10.0]
    )
    with pytest.raises(UseError, match="unknown view.*'clos'.*Did you mean 'close'"):
        got.view("clos")
    with pytest.raises(UseError, match="unknown view.*Indices 0 to 1"):
        got.view("2")


@pytest.mark.parametrize("size", [(64, 64), (200, 50), (31, 97)])
def test_size_keeps_the_horizontal_field_of_view(size):
    """--size changes the pixels, not the width of what is seen; pixels stay square."""
    mi = activate()
    view = load_scene(scene_with(mi, pinhole(mi, size=(90, 50), fov=47.0))).view()
    camera = view.resized(*size).camera()
    left, right = camera.directions([0.0, size[0]], [size[1] / 2] * 2).T
    cosine = left @ right / np.linalg.norm(left) / np.linalg.norm(right)
    assert math.degrees(math.acos(cosine)) == pytest.approx(47.0, abs=1e-4)
    assert camera.focal[0] == camera.focal[1]
