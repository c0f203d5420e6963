"""Camera paths: they pass their keys, at an even pace, and never leave the keys' box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.scene import load_builtin
from asmjax.scene.path import ORBIT_DEG, STEP, CameraPath, aimed_at, orbit_keys, path_length
from asmjax.scene.spec import ViewSpec

coordinates = st.tuples(*[st.floats(-1, 1)] * 3)


@st.composite
def keys(draw, least=2):
    """Views whose targets are two units or more from their eyes, whatever else they do."""
    count = draw(st.integers(least, 5))
    views = []
    for k in range(count):
        eye = draw(coordinates)
        target = (eye[0] + draw(st.floats(2, 3)), *draw(st.tuples(*[st.floats(-1, 1)] * 2)))
        fov = draw(st.floats(20, 60))
        views.append(ViewSpec(f"key{k}", eye, target, fov_x_deg=fov, width=8, height=4))
    return views


def rows_of(views):
    """Views as `path_length` takes them."""
    half = [np.log(np.tan(np.radians(view.fov_x_deg) / 2)) for view in views]
    return np.array(
        [[*v.origin, *v.target, *v.up, h] for v, h in zip(views, half, strict=True)], np.float64
    )


@given(keys())
def test_frames_are_evenly_spaced(views):
    """From any frame to the next is one step, and less only where the path turns at a key."""
    path = CameraPath(views)
    count = min(int(path.length / STEP), 60)
    walked = np.diff(path_length(rows_of([path.view(k) for k in range(count + 1)])))
    assert (walked <= 1.01 * STEP).all()
    turns = 2 * len(views)
    assert (walked < 0.9 * STEP).sum() <= turns


@given(keys())
def test_the_path_stays_in_the_box_of_its_keys(views):
    """Monotone between keys: neither eye nor target nor field of view overshoots."""
    path = CameraPath(views)
    rows, frames = rows_of(views), range(0, int(2.5 * path.length / STEP) + 2, 7)
    walked = rows_of([path.view(k) for k in frames])
    assert (walked >= rows.min(axis=0) - 1e-9).all()
    assert (walked <= rows.max(axis=0) + 1e-9).all()


@given(keys())
def test_the_path_begins_at_its_first_key_and_comes_near_all(views):
    """The first frame is the first key; every key has a frame within a step of it."""
    path = CameraPath(views)
    first = path.view(0)
    np.testing.assert_allclose(first.origin, views[0].origin, atol=1e-12)
    assert first.fov_x_deg == pytest.approx(views[0].fov_x_deg)
    assert (first.width, first.height) == (8, 4)
    frames = rows_of([path.view(k) for k in range(int(path.length / STEP) + 2)])
    for key in rows_of(views):
        # A polyline that visits the key after each frame: every other step is how far it is.
        visits = np.stack([frames, np.broadcast_to(key, frames.shape)], axis=1).reshape(-1, 10)
        assert np.diff(path_length(visits))[::2].min() <= 1.1 * STEP


def test_the_path_is_walked_back():
    """Ten steps to the side, ten back, and so on."""
    away = 10 * STEP * 2.0
    path = CameraPath(
        [ViewSpec("a", (0, 0, 0), (2, 0, 0)), ViewSpec("b", (0, away, 0), (2, away, 0))]
    )
    assert path.length == pytest.approx(10 * STEP)
    aside = [path.view(k).origin[1] for k in range(45)]
    there = np.arange(11) / 10 * away
    np.testing.assert_allclose(aside[:11], there, atol=1e-9)
    np.testing.assert_allclose(aside[10:21], there[::-1], atol=1e-9)
    np.testing.assert_allclose(aside[20:45], aside[:25], atol=1e-9)


def test_one_key_is_a_camera_at_rest():
    view = ViewSpec("only", (0, 0, 0), (1, 0, 0))
    path = CameraPath([view])
    assert path.length == 0
    assert path.view(5).origin == path.view(0).origin == (0, 0, 0)


def test_no_key_is_wrong_use():
    with pytest.raises(UseError, match="at least one key"):
        CameraPath([])


def test_an_orbit_keeps_distance_and_height():
    """Around the up vector through the target; a step is as many degrees everywhere."""
    view = ViewSpec("v", (4.0, 1.0, 2.0), (1.0, 0.0, 0.5))
    views = orbit_keys(view)
    arms = np.array([np.subtract(v.origin, v.target) for v in views])
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), np.linalg.norm(arms[0]))
    np.testing.assert_allclose(arms[:, 2], arms[0, 2])
    turned = np.degrees(np.arctan2(arms[:, 1], arms[:, 0]))
    np.testing.assert_allclose(turned - turned[0], ORBIT_DEG, atol=1e-9)


def test_aimed_at_changes_the_distance_only():
    view = ViewSpec("v", (0.0, 0.0, 0.0), (0.0, 3.0, 4.0))
    assert aimed_at(view, 10.0).target == pytest.approx((0.0, 6.0, 8.0))
    assert aimed_at(view, 10.0).origin == view.origin


def test_the_walk_of_the_paper_room_is_a_walk():
    """Small steps, inside the room, from overview to closeup, over everything in between."""
    scene = load_builtin("paper_room")
    path = CameraPath(scene.path)
    frames = int(path.length / STEP)
    assert 120 <= frames <= 200
    eyes = np.array([path.view(k).origin for k in range(frames + 1)])
    assert (np.abs(eyes[:, :2]) < 4.9).all() and (eyes[:, 2] > 0.15).all()
    assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() < 0.15
    assert path.view(0).origin == scene.views["overview"].origin
    np.testing.assert_allclose(eyes[-1], scene.views["closeup"].origin, atol=0.05)
