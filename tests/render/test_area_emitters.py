"""Area emitters of Mitsuba: their sizes and fronts, brightness, suns, and soft truth under them."""

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded, pinhole, real_scene, vectorised

from asmjax.errors import UseError
from asmjax.render.load import Scene, load_scene
from asmjax.render.variant import activate
from asmjax.scene.closed_forms import disc_visibility, half_plane_square_visibility
from asmjax.shadow import LightSpaceShadowMap, UniformShadowMap

pytestmark = pytest.mark.mitsuba


def under(mi, *, at=(0.0, 0.0, 0.0), scale: float = 1.0, **parts) -> dict:
    """A ground plane seen from above, and what else there is; moved and scaled as a whole."""
    to_world = mi.ScalarTransform4f().translate(list(at)).scale(scale)

    def placed(part):
        own = part.get("to_world", mi.ScalarTransform4f())
        return part | {"to_world": to_world @ own}

    def eye_at(p):
        return tuple(scale * x + shift for x, shift in zip(p, at, strict=True))

    ground = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(10.0)}
    shapes = {name: placed(part) for name, part in ({"ground": ground} | parts).items()}
    eye = pinhole(
        mi, eye_at((0.8, -1.0, 9.0)), eye_at((0.0, 0.0, 0.0)), (40, 40), (0, 1, 0), fov=30.0
    )
    return {"type": "scene", "eye": eye, **shapes}


def emitting(kind: str, to_world, radiance: object = 1.0, **more) -> dict:
    light = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
    return {"type": kind, "to_world": to_world, "emitter": light, **more}


def only(scene: Scene):
    (light,) = scene.lights.values()
    return light.spec


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_flat_emitters(kind, flipped):
    """Half axes, centre and front, which flipped normals turn."""
    mi = activate()
    placed = mi.ScalarTransform4f().translate([0.5, 0.0, 5.0]).rotate([1, 0, 0], 180)
    placed = placed.scale([0.6, 0.6 if kind == "disk" else 0.3, 1.0])
    # Mitsuba flips the normals of rectangles and disks alike.
    scene = load_scene(under(mi, lamp=emitting(kind, placed, flip_normals=flipped)))
    light = only(scene)
    area = light.area
    assert area is not None and area.shape == kind
    assert light.position == pytest.approx((0.5, 0.0, 5.0), abs=1e-6)
    assert np.abs(area.half_u) == pytest.approx([0.6, 0, 0], abs=1e-6)
    np.testing.assert_allclose(area.normal, [0, 0, 1.0 if flipped else -1.0], atol=1e-6)
    (notice,) = scene.notices
    assert "hard methods take the point at its centre (0.5, 0, 5)" in notice


def test_spheres_and_meshes():
    """A sphere has its radius; of meshes two triangles may be a parallelogram, and others are a
    point at the centre of their box."""
    mi = activate()
    ball = {"type": "sphere", "center": [0, 0, 4], "radius": 0.25, "emitter": {"type": "area"}}
    area = only(load_scene({**under(mi), "ball": ball})).area
    assert area is not None and area.shape == "sphere" and area.radius == pytest.approx(0.25)
    inside = load_scene({**under(mi), "ball": ball | {"flip_normals": True}})
    assert only(inside).area is None and "sphere that emits outwards" in inside.notices[0]
    cube = emitting("cube", mi.ScalarTransform4f().translate([0, 0, 5]).scale(0.2))
    scene = load_scene(under(mi, lamp=cube))
    assert only(scene).area is None
    assert "on a shape that is no rectangle, disk or sphere" in scene.notices[0]
    assert only(scene).position == pytest.approx((0, 0, 5))


def test_the_luminaire_of_the_cornell_box():
    """A mesh of two triangles: a rectangle of 130 by 105, which emits downwards; by its spectrum it
    is bright."""
    light = only(loaded(real_scene("cornell_box")))
    area = light.area
    assert area is not None and area.shape == "rectangle"
    assert area.area == pytest.approx(130 * 105, rel=0.01)
    np.testing.assert_allclose(area.normal, [0, -1, 0], atol=1e-6)
    assert light.intensity > 1


def test_brightness_is_luminance():
    """Of radiance, radiant intensity and irradiance; a grey is itself."""
    mi = activate()
    spot = mi.ScalarTransform4f().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0])
    lights = {
        "bulb": {"type": "point", "position": [0, 0, 3], "intensity": {"type": "rgb", "value": 2}},
        "torch": {"type": "spot", "to_world": spot, "intensity": {"type": "rgb", "value": 3.0}},
        "far": {
            "type": "directional",
            "direction": [0, 0, -1],
            "irradiance": {"type": "rgb", "value": [1.0, 0.0, 0.0]},
        },
    }
    scene = load_scene(under(mi) | lights)
    found = {name: scene.light(name).intensity for name in lights}
    assert found == pytest.approx({"bulb": 2.0, "torch": 3.0, "far": 0.2126})
    lamp = emitting("disk", mi.ScalarTransform4f().translate([0, 0, 5]), [0.0, 4.0, 0.0])
    assert only(load_scene(under(mi, lamp=lamp))).intensity == pytest.approx(4 * 0.7152)


PLACES = {"here": ((0.0, 0.0, 0.0), 1.0), "far": ((3e4, -1e4, 2e4), 1.0),
          "tiny": ((0.0, 0.0, 0.0), 1e-3)}  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_soft_truth_under_a_disk(place):
    """A4, wherever the scene stands and whatever its size: a mean within three standard errors."""
    mi = activate()
    at, scale = PLACES[place]
    placed = mi.ScalarTransform4f().translate([0, 0, 5]).rotate([1, 0, 0], 180).scale(0.6)
    parts = {
        "lamp": emitting("disk", placed),
        "occluder": {"type": "disk", "to_world": mi.ScalarTransform4f().translate([0, 0, 2])},
    }
    scene = load_scene(under(mi, at=at, scale=scale, **parts))
    light = only(scene)
    assert light.area is not None and light.area.radius == pytest.approx(0.6 * scale)
    eye = scene.eye(scene.view())
    rays = scene.soft_rays(eye, scene.light_frame(eye), scene.light_rays(), 4, 4)
    found = rays.estimate()
    ground = eye.valid & (eye.shape == scene.shape_names.index("ground"))
    x, y, _ = (eye.world[:, ground] - np.array(at)[:, None]) / scale
    off = found.visibility[ground] - disc_visibility(x, y, 1.0, 0.6, 5.0, 2.0)
    assert 0 < rays.count <= eye.valid.sum() * 64
    assert abs(off.mean()) <= 3 * np.sqrt(np.sum(found.error[ground] ** 2)) / off.size
    assert np.abs(off).max() < 0.2 and 0.1 < found.visibility[ground].mean() < 0.95


def test_soft_truth_is_not_shaded_by_its_lamp():
    """A rectangle before an edge, and the lamp's own shape left out: A5 with a linear ramp."""
    mi = activate()
    down = mi.ScalarTransform4f().translate([0, 0, 5]).rotate([1, 0, 0], 180).scale(0.6)
    edge = mi.ScalarTransform4f().translate([-20, 0, 2]).scale(20)
    scene = load_scene(under(
        mi, lamp=emitting("rectangle", down), edge={"type": "rectangle", "to_world": edge}
    ))  # fmt: skip
    eye = scene.eye(scene.view())
    found = scene.soft_rays(eye, scene.light_frame(eye), scene.light_rays(), 4, 4).estimate()
    ground = eye.shape == scene.shape_names.index("ground")
    expected = half_plane_square_visibility(eye.world[0, ground], 0.8)
    off = found.visibility[ground] - expected
    assert abs(off.mean()) <= 3 * np.sqrt(np.sum(found.error[ground] ** 2)) / off.size
    assert np.abs(off).max() < 0.15


def test_soft_truth_needs_a_size():
    mi = activate()
    scene = load_scene(under(mi) | {"bulb": {"type": "point", "position": [0, 0, 3]}})
    eye = scene.eye(scene.view())
    with pytest.raises(UseError, match="this one has none"):
        scene.soft_rays(eye, scene.light_frame(eye), scene.light_rays())


SUNS = {
    "by time": {"hour": 9.0},
    "by direction": {"sun_direction": [1.0, 0.3, 2.0], "sun_aperture": 1.0},
    "turned": {"sun_direction": [1.0, 0.3, 2.0], "turned": True},
}


@pytest.mark.parametrize("name", SUNS)
def test_the_sun_of_a_sky(name):
    """It shines from where most samples of the emitter are, as wide as the scene says, and as
    bright as what they bring together."""
    mi = activate()
    words = dict(SUNS[name])
    if words.pop("turned", False):
        words["to_world"] = mi.ScalarTransform4f().rotate([1, 0, 0], -60)
    scene = load_scene(under(mi) | {"sky": {"type": "sunsky", **words}})
    light = only(scene)
    assert light.kind == "directional" and light.area is not None and light.area.shape == "sun"
    half = np.radians(words.get("sun_aperture", 0.5338)) / 2
    assert light.area.radius == pytest.approx(np.tan(half))
    (emitter,) = scene._scene.emitters()
    origin = mi.Interaction3f()
    origin.p, origin.time = mi.Point3f(0.0), mi.Float(0.0)
    squares = np.random.default_rng(3).random((2, 1000)).astype(np.float32)
    many = [squares] if vectorised(mi) else squares.T.tolist()
    found = []
    for square in many:
        sample, weight = emitter.sample_direction(origin, mi.Point2f(square))
        found.append(np.concatenate([np.array(v).reshape(3, -1) for v in (sample.d, weight)]))
    samples = np.concatenate(found, axis=1)
    towards = -np.array(light.direction)
    cosine = towards @ samples[:3]
    hit = cosine > np.cos(half)
    middle = samples[:3, hit].mean(axis=1)
    assert middle @ towards / np.linalg.norm(middle) > np.cos(0.3 * half)
    assert (cosine > np.cos(0.9 * half)).sum() < hit.sum()
    luminance = np.array([0.2126, 0.7152, 0.0722]) @ samples[3:]
    assert light.intensity == pytest.approx((luminance * hit).mean(), rel=0.1)
    assert "the sky (SunskyEmitter) casts no hard shadow" in scene.notices[0]


def test_no_sun_at_night():
    mi = activate()
    off = {"type": "sunsky", "sun_scale": 0.0}
    assert not load_scene(under(mi) | {"sky": off}).lights


def test_a_frame_and_rays_of_different_lights_are_refused():
    """A lamp would shade itself, or another one would cast no shadow, and nobody would know."""
    mi = activate()
    placed = mi.ScalarTransform4f().translate([0.5, 0.0, 5.0]).rotate([1, 0, 0], 180)
    bulb = {"type": "point", "position": [1.0, 0.5, 7.0]}
    scene = load_scene(under(mi, lamp=emitting("disk", placed)) | {"bulb": bulb})
    eye = scene.eye()
    (lamp,) = (name for name, light in scene.lights.items() if light.shape is not None)
    (other,) = (name for name in scene.lights if name != lamp)
    for frame_of, rays_of in ((lamp, other), (other, lamp)):
        frame, rays = scene.light_frame(eye, frame_of), scene.light_rays(rays_of)
        for used in (
            lambda frame=frame, rays=rays: scene.shadow_rays(eye, frame, rays),
            lambda frame=frame, rays=rays: UniformShadowMap(8).build(eye, frame, rays),
            lambda frame=frame, rays=rays: LightSpaceShadowMap(8).build(eye, frame, rays),
        ):
            with pytest.raises(UseError, match="lamp that is shape .* for the same light"):
                used()
        kept = scene.kept_light_frame(frame, eye, frame_of)
        assert kept.lamp == frame.lamp
        assert scene.shadow_rays(eye, kept, scene.light_rays(frame_of)).trace().any()
    with pytest.raises(UseError, match="for the same light"):
        scene.soft_rays(eye, scene.light_frame(eye, lamp), scene.light_rays(other))
