"""Shapes that move: the renderer casts against them where they are, and boxes hold the change."""

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.render.load import load_scene
from asmjax.render.moving import MovingShapes

pytestmark = pytest.mark.mitsuba

OFFSET = np.array([0.3, -0.2, 0.1])
CENTRES = {"mesh": (1.0, 0.0, 1.0), "ball": (-1.0, 0.0, 1.0), "plate": (0.0, 1.5, 1.0)}


def small_scene(lamp: bool = False):
    """A floor with a mesh, a curved shape and a rectangle above it; seen from above."""

    def at(centre, scale):
        import mitsuba as mi

        return mi.ScalarTransform4f().translate(list(centre)) @ mi.ScalarTransform4f().scale(scale)

    from asmjax.render.variant import activate

    mi = activate()
    parts = {
        "ground": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(8)},
        "mesh": {"type": "cube", "to_world": at(CENTRES["mesh"], 0.4)},
        "ball": {"type": "sphere", "to_world": at(CENTRES["ball"], 0.4)},
        "plate": {"type": "rectangle", "to_world": at(CENTRES["plate"], 0.4)},
        "eye": {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 9], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 64, "height": 64},
        },
        "light": {"type": "point", "position": [0.5, 0.5, 6]},
    }
    if lamp:
        bulb = {"type": "sphere", "to_world": at((0, 0, 5), 0.2)}
        parts["bulb"] = bulb | {"emitter": {"type": "area"}}
        del parts["light"]
    return load_scene({"type": "scene", **parts})


def down(scene, x, y):
    """Depth below z = 8 of the first surface under (x, y)."""
    t, _, _ = scene._rays.hits(np.array([[x], [y], [8.0]]), np.array([[0.0], [0.0], [-1.0]]))
    return t[0]


@pytest.mark.parametrize("name", CENTRES)
def test_a_shape_moves_there_and_back(name):
    """Rays meet it at its new place, the host's triangles follow, and back is as before."""
    scene = small_scene()
    x, y, _ = CENTRES[name]
    mover = MovingShapes(scene, name)
    before, rest = down(scene, x, y), scene.eye(scene.view())
    moved, boxes = mover.at(OFFSET)
    assert boxes is not None and boxes.shape == (2, 3, 2)
    np.testing.assert_allclose(boxes[1] - boxes[0], np.repeat(OFFSET[:, None], 2, 1), atol=1e-6)
    assert down(moved, x + OFFSET[0], y + OFFSET[1]) == pytest.approx(before - OFFSET[2], abs=1e-5)
    eye = moved.eye(moved.view())
    mine = eye.shape == moved.shape_names.index(name)
    assert mine.any()
    low, high = boxes[1].T
    seen = eye.world[:, mine]
    assert ((seen > low[:, None] - 1e-5) & (seen < high[:, None] + 1e-5)).all()
    back, _ = mover.at(np.zeros(3))
    np.testing.assert_array_equal(back.eye(back.view()).world, rest.world)
    assert mover.at(np.zeros(3))[1] is None


def test_boxes_hold_all_vertices_that_moved():
    """Every vertex that is somewhere else than before lies in one of the boxes, in both places."""
    scene = load_scene("letter_f")
    mover = MovingShapes(scene)
    assert mover.name == "letter"
    moved, boxes = mover.at(OFFSET)
    was, now = scene.geometry.vertices, moved.geometry.vertices
    changed = (was != now).any(axis=0)
    assert changed.any() and not changed.all()
    np.testing.assert_allclose(
        now[:, changed] - was[:, changed], np.repeat(OFFSET[:, None], changed.sum(), 1), atol=1e-6
    )
    assert boxes is not None
    for place, (low, high) in zip((was, now), (box.T for box in boxes), strict=True):
        points = place[:, changed]
        assert ((points >= low[:, None]) & (points <= high[:, None])).all()
    outside = ~changed
    np.testing.assert_array_equal(was[:, outside], now[:, outside])


def test_truth_changes_near_the_object_only():
    """Pixels whose truth changes lie in the old or the new shadow: under the swept caster."""
    scene = small_scene()
    frame = scene.light_frame(scene.eye(scene.view()))

    def truth(scene):
        eye = scene.eye(scene.view())
        ground = eye.shape == scene.shape_names.index("ground")
        lit = scene.shadow_rays(eye, frame, scene.light_rays()).trace()
        return eye, lit, ground

    eye, before, ground = truth(scene)
    moved, boxes = MovingShapes(scene, "mesh").at(OFFSET)
    _, after, ground_after = truth(moved)
    changed = (before != after) & ground & ground_after
    assert changed.any()
    assert boxes is not None
    # From each changed point the way to the light meets the box that holds both places.
    low, high = boxes[:, :, 0].min(axis=0), boxes[:, :, 1].max(axis=0)
    start, light = eye.world[:, changed], np.array(scene.light().position)
    t = np.linspace(0, 1, 400)
    way = start[:, :, None] + t * (light[:, None] - start)[:, :, None]
    inside = (way > low[:, None, None] - 0.02) & (way < high[:, None, None] + 0.02)
    assert inside.all(axis=0).any(axis=1).all()


def test_light_rays_of_a_lamp_follow():
    """The casters without their lamp are a scene of their own, which must be rebuilt too."""
    scene = small_scene(lamp=True)
    x, y, _ = CENTRES["mesh"]
    moved, _ = MovingShapes(scene, "mesh").at(OFFSET)
    t, _ = moved.light_rays().closest(
        np.array([[x + OFFSET[0]], [y + OFFSET[1]], [8.0]]), np.array([[0.0], [0.0], [-1.0]])
    )
    assert t[0] == pytest.approx(8 - 1.4 - OFFSET[2], abs=1e-5)


def test_an_object_is_chosen_by_name_prefix_or_size():
    scene = load_scene("paper_room")
    assert MovingShapes(scene).name == "bunny"
    assert MovingShapes(scene, "robot").name == "robot_shell, robot_joints, robot_accents"
    assert MovingShapes(scene, "7").name == "bunny"
    with pytest.raises(UseError, match="unknown object 'buny'.*Did you mean 'bunny'"):
        MovingShapes(scene, "buny")
    with pytest.raises(UseError, match="larger than half the scene"):
        MovingShapes(load_scene("terrain"))


def test_a_light_is_replaced_in_its_place():
    """Another position, the same name, order and lamp; the old scene is as it was."""
    from dataclasses import replace

    scene = load_scene("letter_f")
    light = scene.light("spot")
    assert light.position is not None
    other = scene.with_light(replace(light, position=(1.0, 2.0, 3.0)), "spot")
    assert list(other.lights) == list(scene.lights)
    assert other.light("spot").position == (1.0, 2.0, 3.0)
    assert scene.light("spot") == light
    assert other.light("point") == scene.light("point")
