"""Light frames that outlive one view: kept while they hold its receivers, else grown."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest

from asmjax.buffers import eye_buffer
from asmjax.geometry import in_domain, look_at
from asmjax.scene.lights import KEPT_MARGIN, kept_light_frame, light_frame
from asmjax.scene.motion import TURN, circle, moved_light
from asmjax.scene.spec import LightSpec

BOUNDS = np.array([[-10.0, 10.0], [-10.0, 10.0], [0.0, 6.0]])
LIGHTS = {
    "point": LightSpec("point", "point", position=(0.0, 0.0, 5.0)),
    "spot": LightSpec(
        "spot", "spot", position=(0.0, 0.0, 5.0), direction=(0.0, 0.0, -1.0), cutoff_deg=60.0
    ),
    "directional": LightSpec("sun", "directional", direction=(0.3, 0.1, -1.0)),
}


def floor(x, y=0.0, half=1.0):
    """An eye that sees a square of the floor around (x, y)."""
    side = np.linspace(-half, half, 9)
    at = np.stack(np.meshgrid(x + side, y + side)).reshape(2, -1)
    n = at.shape[1]
    return eye_buffer(
        look_at((x, y, 4.0), (x, y, 0.0), (0.0, 1.0, 0.0), fov_x_deg=40, width=9, height=9),
        world=np.concatenate([at, np.zeros((1, n))]),
        normal=np.repeat([[0.0], [0.0], [1.0]], n, axis=1),
        depth=np.full(n, 4.0),
        prim=np.zeros(n, np.int32),
        shape=np.zeros(n, np.int32),
        albedo=np.ones((3, n), np.float32),
        flat=np.ones(n, bool),
    )


@pytest.mark.parametrize("kind", LIGHTS)
def test_a_frame_is_kept_until_it_is_left(kind):
    """Small moves of the eye keep it, to the last bit; a large one keeps what it held."""
    light = LIGHTS[kind]
    first = kept_light_frame(None, light, floor(0.0), BOUNDS)
    fitted = light_frame(light, floor(0.0), BOUNDS)
    np.testing.assert_allclose(first.extent, (1 + KEPT_MARGIN) * fitted.extent)
    near = kept_light_frame(first, light, floor(0.1), BOUNDS)
    assert eqx.tree_equal(first, near)
    far = kept_light_frame(first, light, floor(2.5), BOUNDS)
    assert not eqx.tree_equal(first, far)
    for x in (0.0, 2.5):
        assert in_domain(far, floor(x).world).all()


def test_a_frame_with_its_own_field_of_view_is_always_the_same():
    light = LightSpec("lamp", "point", (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), fov_deg=90.0)
    first = kept_light_frame(None, light, floor(0.0), BOUNDS)
    assert eqx.tree_equal(first, kept_light_frame(first, light, floor(4.0), BOUNDS))
    assert eqx.tree_equal(first, light_frame(light, floor(0.0), BOUNDS))


@pytest.mark.parametrize("kind", LIGHTS)
def test_a_moving_light_takes_its_frame_along(kind):
    """Rectangles stay, so that a tree of nodes can; rays start from the new place."""
    light = LIGHTS[kind]
    first = kept_light_frame(None, light, floor(0.0), BOUNDS)
    if light.position is None:
        moved = replace(light, direction=(0.31, 0.1, -1.0))
    else:
        moved = replace(light, position=(0.05, 0.0, 5.0))
    along = kept_light_frame(first, moved, floor(0.0), BOUNDS)
    np.testing.assert_array_equal(along.corner, first.corner)
    np.testing.assert_array_equal(along.extent, first.extent)
    assert not eqx.tree_equal(along, first)
    assert in_domain(along, floor(0.0).world).all()


def test_a_sun_does_not_miss_a_caster_that_rises():
    """A caster above the old scene: depth must count from above it, so the frame is a new one."""
    light = LIGHTS["directional"]
    first = kept_light_frame(None, light, floor(0.0), BOUNDS)
    taller = BOUNDS.copy()
    taller[2, 1] = 12.0
    risen = kept_light_frame(first, light, floor(0.0), taller)
    top = np.array([[0.0], [0.0], [11.9]])
    assert (risen.rotation[0, 2] @ (top - risen.origin[:, None]) > 0).all()
    assert (first.rotation[0, 2] @ (top - first.origin[:, None]) < 0).all()


def test_a_light_among_its_receivers_keeps_cube_faces():
    """Wide receivers take cube faces, which do not grow over their edges."""
    light = LightSpec("bulb", "point", position=(0.0, 0.0, 0.4))
    wide = floor(0.0, half=4.0)
    first = kept_light_frame(None, light, wide, BOUNDS)
    assert first.faces > 1
    assert (first.corner >= -1.001).all() and (first.corner + first.extent <= 1.001).all()
    assert in_domain(first, wide.world).all()
    assert eqx.tree_equal(first, kept_light_frame(first, light, wide, BOUNDS))


def test_circles_begin_and_end_at_rest():
    """Level with the axis, a small step each frame, back after a turn."""
    at = np.array([circle(k, 2.0, (0.0, 0.0, 1.0)) for k in range(TURN + 1)])
    np.testing.assert_allclose(at[0], 0)
    np.testing.assert_allclose(at[-1], 0, atol=1e-12)
    np.testing.assert_allclose(at[:, 2], 0, atol=1e-12)
    steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    np.testing.assert_allclose(steps, steps[0])
    assert np.linalg.norm(at, axis=1).max() == pytest.approx(4.0)
    assert moved_light(LIGHTS["point"], 0, 20.0, (0, 0, 1)).position == (0.0, 0.0, 5.0)
    turned = moved_light(LIGHTS["directional"], 30, 20.0, (0, 0, 1)).direction
    assert turned is not None
    was = np.array(LIGHTS["directional"].direction)
    cosine = was @ turned / np.linalg.norm(was) / np.linalg.norm(turned)
    assert 1 < np.degrees(np.arccos(cosine)) < 5


def test_a_spot_that_turns_gets_a_frame_of_its_own():
    """Its cone is where it points to now; one that only moves keeps its rectangles."""
    spot = LIGHTS["spot"]
    first = kept_light_frame(None, spot, floor(0.0), BOUNDS)
    turned = replace(spot, direction=(0.3, 0.0, -1.0))
    found = kept_light_frame(first, turned, floor(0.0), BOUNDS)
    np.testing.assert_allclose(found.cone_axis, np.array([0.3, 0.0, -1.0]) / np.hypot(0.3, 1.0))
    assert in_domain(found, floor(0.0).world).all()
    narrower = kept_light_frame(first, replace(spot, cutoff_deg=50.0), floor(0.0), BOUNDS)
    assert narrower.cos_cutoff == pytest.approx(np.cos(np.radians(50.0)))
    moved = kept_light_frame(first, replace(spot, position=(0.1, 0.0, 5.0)), floor(0.0), BOUNDS)
    np.testing.assert_array_equal(moved.extent, first.extent)


@pytest.mark.parametrize("kind", LIGHTS)
def test_a_frame_holds_all_samples_of_its_pixels(kind):
    """Not only the first: what lies outside a frame is dark without a ray."""
    light, eyes = LIGHTS[kind], [floor(0.0), floor(0.4, 0.3), floor(-0.2)]
    for found in (light_frame(light, eyes, BOUNDS), kept_light_frame(None, light, eyes, BOUNDS)):
        assert all(in_domain(found, eye.world).all() for eye in eyes)
    assert not in_domain(light_frame(light, eyes[0], BOUNDS), eyes[1].world).all()
