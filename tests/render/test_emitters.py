"""Every Mitsuba emitter becomes a light that casts hard shadows, or one notice."""

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded, pinhole, real_scene

from asmjax.errors import UseError
from asmjax.render.load import load_scene
from asmjax.render.variant import activate

pytestmark = pytest.mark.mitsuba


def lit_by(mi, **emitters) -> dict:
    """A ground plane seen from above, and emitters by id."""
    ground = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(4.0)}
    eye = pinhole(mi, (0.5, -7.0, 6.0), (0.0, 0.0, 0.0), (48, 40), (0, 0, 1), fov=50.0)
    return {"type": "scene", "ground": ground, "eye": eye, **emitters}


def aimed(mi, origin, target):
    return mi.ScalarTransform4f().look_at(origin=origin, target=target, up=[0.1, 0.9, 0.2])


def test_point_spot_and_directional():
    """Position, axis along the light's travel and cone of the three lights without a size."""
    mi = activate()
    down = aimed(mi, [1.0, 2.0, 5.0], [0.0, 0.5, 0.0])
    scene = load_scene(lit_by(
        mi, bulb={"type": "point", "position": [0.5, -0.25, 3.0]},
        torch={"type": "spot", "to_world": down, "cutoff_angle": 33.0, "beam_width": 10.0},
        sun={"type": "directional", "direction": [1.0, 2.0, -2.0]},
        moon={"type": "directional", "to_world": down},
    ))  # fmt: skip
    assert list(scene.lights) == ["bulb", "torch", "sun", "moon"] and scene.notices == ()
    bulb, torch, sun, moon = (scene.light(name) for name in scene.lights)
    assert (bulb.kind, torch.kind, sun.kind) == ("point", "spot", "directional")
    assert bulb.position == (0.5, -0.25, 3.0)
    assert torch.position == pytest.approx((1.0, 2.0, 5.0))
    axis = np.array([-1.0, -1.5, -5.0]) / np.linalg.norm([1.0, 1.5, 5.0])
    assert torch.direction == pytest.approx(axis, abs=1e-6)
    assert torch.cutoff_deg == pytest.approx(33.0)
    # To the last digit: at 2^22 texels float32 moves shadows by a quarter of a texel.
    assert np.array(sun.direction) == pytest.approx(np.array([1.0, 2.0, -2.0]) / 3.0, abs=2e-16)
    assert moon.direction == pytest.approx(axis, abs=1e-6)
    assert all(light.shape is None for light in scene.lights.values())


def test_spot_lights_the_inside_of_its_cone_only():
    """A spot straight above at height 3 with a half angle of 30 degrees lights a disk of radius
    3 tan 30 degrees around its foot."""
    mi = activate()
    torch = {"type": "spot", "to_world": aimed(mi, [0.5, 0, 3], [0.5, 0, 0]), "cutoff_angle": 30.0}
    scene = load_scene(lit_by(mi, torch=torch))
    eye = scene.eye(scene.view())
    frame = scene.light_frame(eye)
    lit = scene.shadow_rays(eye, frame, scene.light_rays()).trace()
    radius = np.hypot(eye.world[0] - 0.5, eye.world[1])
    expected = radius < 3.0 * np.tan(np.radians(30.0))
    sure = eye.valid & (np.abs(radius - 3.0 * np.tan(np.radians(30.0))) > 1e-4)
    assert np.array_equal(lit[sure], expected[sure]) and 20 < lit.sum() < 0.9 * lit.size


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ({"type": "constant"}, "ConstantBackgroundEmitter"),
        ({"type": "envmap"}, "EnvironmentMapEmitter"),
        ({"type": "sunsky", "sun_scale": 0.0}, "SunskyEmitter"),
        ({"type": "projector"}, "Projector"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_the_others_give_one_notice_each(kind, name):
    """What casts no hard shadow is named, and the next light is taken. Alone, it is no light."""
    mi = activate()
    if name == "EnvironmentMapEmitter":
        kind = kind | {"bitmap": mi.Bitmap(np.ones((4, 8, 3), np.float32))}
    if name == "Projector":
        kind = kind | {"irradiance": {"type": "rgb", "value": 1.0}}
    scene = load_scene(lit_by(mi, sky=kind, bulb={"type": "point", "position": [0, 0, 3]}))
    assert list(scene.lights) == ["bulb"]
    (notice,) = scene.notices
    assert "'sky'" in notice and name in notice and "no hard shadow" in notice
    with pytest.raises(UseError, match="has no light.*add a light"):
        load_scene(lit_by(mi, sky=kind)).light()


def test_directional_area_gives_a_notice():
    """An emitter on a shape that sends parallel light is left out too."""
    mi = activate()
    lamp = {"type": "rectangle", "emitter": {"type": "directionalarea"},
            "to_world": mi.ScalarTransform4f().translate([0, 0, 3])}  # fmt: skip
    scene = load_scene(lit_by(mi, lamp=lamp))
    assert not scene.lights and "DirectionalArea" in scene.notices[0]


def test_sphere_lamp_lights_the_ground_below_it():
    """An area light is its centre, and the lamp's own shape, which surrounds that centre, shades
    nothing; a ball below it does, in the circle of its cone."""
    mi = activate()
    lamp = {"type": "sphere", "center": [0, 0, 3], "radius": 0.5, "emitter": {"type": "area"}}
    ball = {"type": "sphere", "center": [0, 0, 1], "radius": 0.5}
    scene = load_scene(lit_by(mi, lamp=lamp, ball=ball))
    ((name, light),) = scene.lights.items()
    assert light.spec.kind == "point" and light.spec.position == (0.0, 0.0, 3.0)
    (notice,) = scene.notices
    assert f"'{name}'" in notice and "area emitter" in notice and "(0, 0, 3)" in notice
    shapes = [shape.id() for shape in scene._scene.shapes()]
    assert light.shape == shapes.index("lamp")
    eye = scene.eye(scene.view())
    frame = scene.light_frame(eye)
    rays = scene.light_rays()
    lit = scene.shadow_rays(eye, frame, rays).trace()
    ground = eye.shape == shapes.index("ground")
    radius = np.hypot(eye.world[0], eye.world[1])
    # A ball of radius r at distance d from a point light shades a cone of sin = r / d.
    edge = 3.0 * np.tan(np.arcsin(0.5 / 2.0))
    sure = ground & (np.abs(radius - edge) > 1e-4)
    assert np.array_equal(lit[sure], radius[sure] > edge) and lit[ground].mean() > 0.8
    # Nor is the lamp in the light's image: straight down there is the ball, not the lamp's inside.
    t, prim = rays.closest(np.array([[0.0], [0.0], [3.0]]), np.array([[0.0], [0.0], [-1.0]]))
    assert prim[0] == scene.geometry.first_prim[shapes.index("ball")]
    assert t[0] == pytest.approx(1.5, rel=1e-6)


def test_lamp_still_shades_the_light_of_another():
    """Only the own lamp is left out: for the bulb above it the lamp is a caster like any other."""
    mi = activate()
    lamp = {"type": "sphere", "center": [0, 0, 1.5], "radius": 0.5, "emitter": {"type": "area"}}
    scene = load_scene(lit_by(mi, lamp=lamp, bulb={"type": "point", "position": [0, 0, 5]}))
    down = np.array([[0.0], [0.0], [4.5]]), np.array([[0.0], [0.0], [-1.0]])
    area = next(name for name, light in scene.lights.items() if light.shape is not None)
    assert scene.light_rays("bulb").closest(*down)[0][0] == pytest.approx(2.5, rel=1e-6)
    assert scene.light_rays(area).closest(*down)[0][0] == pytest.approx(4.5, rel=1e-6)


def test_cornell_box():
    """The luminaire's two triangles surround its centre; most of the floor is lit by it."""
    scene = loaded(real_scene("cornell_box"))
    (light,) = scene.lights.values()
    assert light.shape == 0 and "area emitter" in scene.notices[0]
    assert light.spec.position == pytest.approx((278.0, 548.3, 279.5), abs=0.5)
    eye = scene.eye(scene.view().resized(96, 96))
    lit = scene.shadow_rays(eye, scene.light_frame(eye), scene.light_rays()).trace()
    floor = np.abs(eye.world[1]) < 1.0
    assert 0.4 < lit[floor].mean() < 0.95


def test_ids_and_indices():
    """Lights are picked by id or by index among those that cast; nested lamps without an id, or
    with the same one, get names of their own and none is lost."""
    mi = activate()

    def lamp(x):
        return {"type": "sphere", "center": [x, 0, 3], "radius": 0.1, "emitter": {"type": "area"}}

    scene = load_scene(lit_by(
        mi, sky={"type": "constant"}, left=lamp(-1.0), right=lamp(1.0),
        light2={"type": "point", "position": [0, 0, 3]},
    ))  # fmt: skip
    assert len(scene.lights) == 3 == len({light.spec.position for light in scene.lights.values()})
    for index, (name, light) in enumerate(scene.lights.items()):
        assert scene.light(str(index)) == scene.light(name) == light.spec
        assert light.spec.name == name
    assert scene.light("light2").position == (0.0, 0.0, 3.0)
    assert scene.light() == next(iter(scene.lights.values())).spec
    with pytest.raises(UseError, match="unknown light.*'lihgt2'.*Did you mean 'light2'"):
        scene.light("lihgt2")


XML = """<scene version="3.0.0"><sensor type="perspective"/><shape type="sphere"/>{}</scene>"""


def test_same_id_twice(tmp_path):
    """Mitsuba refuses a scene file with one id twice; its reason, with the place, is passed on."""
    path = tmp_path / "twice.xml"
    path.write_text(XML.format('<emitter id="a" type="point"/><emitter id="a" type="point"/>'))
    with pytest.raises(UseError, match="duplicate ID.*mend the scene"):
        load_scene(path)
    path.write_text(XML.format('<emitter type="point"/><emitter id="light0" type="point"/>'))
    assert len(load_scene(path).lights) == 2


def test_light_that_is_not_finite(tmp_path):
    """A NaN position is one line with the light's name."""
    path = tmp_path / "nan.xml"
    path.write_text(XML.format(
        '<emitter type="point" id="bulb"><point name="position" x="nan" y="0" z="0"/></emitter>'
    ))  # fmt: skip
    with pytest.raises(UseError, match="light 'bulb' is not finite"):
        load_scene(path)


def test_light_that_shines_on_nothing_seen():
    """From below the ground no seen side is lit: said in one line when the frame is fitted."""
    mi = activate()
    scene = load_scene(lit_by(mi, bulb={"type": "point", "position": [0, 0, -3]}))
    with pytest.raises(UseError, match="shines on no surface that this view sees"):
        scene.light_frame(scene.eye(scene.view()))
