"""Scenes of any size, anywhere: truth and maps are as they are for the same scene at home."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mitsuba_scenes import pinhole
from helpers.shadow_oracle import ref_blocked

from asmjax.render.load import load_scene
from asmjax.render.moving import MovingShapes
from asmjax.render.variant import activate
from asmjax.render.working_frame import WORLD, WorkingFrame, working_frame
from asmjax.scene.builtin import load_builtin
from asmjax.scene.mesh_tools import transform
from asmjax.scene.shapes import quad
from asmjax.scene.spec import Mesh, SceneSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel, UniformShadowMap

pytestmark = pytest.mark.mitsuba

SIZE = (96, 80)
HOME = np.zeros(3)
OUT = np.array([0.8, -0.5, 0.33])


def letter(scale: float = 1.0, offset: np.ndarray = HOME) -> SceneSpec:
    """`letter_f`, all of it meshes, `scale` times as large and then moved."""
    spec = load_builtin("letter_f")
    plane = quad("plane", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)])
    shapes = [plane, *(shape for shape in spec.shapes[1:] if isinstance(shape, Mesh))]
    assert len(shapes) == len(spec.shapes)

    def place(point):
        return None if point is None else tuple((scale * np.asarray(point) + offset).tolist())

    def view(v):
        return replace(v, origin=place(v.origin), target=place(v.target), near=scale * v.near)

    return replace(
        spec,
        shapes=tuple(transform(s, scale * np.eye(3), tuple(offset)) for s in shapes),
        views={name: view(v) for name, v in spec.views.items()},
        lights={n: replace(li, position=place(li.position)) for n, li in spec.lights.items()},
    )


def traced(scene, light=None):
    eye = scene.eye(scene.view("angle").resized(*SIZE))
    frame = scene.light_frame(eye, light)
    return eye, frame, scene.shadow_rays(eye, frame, scene.light_rays(light)).trace()


def ref_lit(spec: SceneSpec, eye, frame, shift: np.ndarray | float = 0.0) -> np.ndarray:
    """Visibility of all pixels by the spec's own float64 triangles, starts moved by `shift`."""
    meshes = [shape for shape in spec.shapes if isinstance(shape, Mesh)]
    a, b, c = (np.concatenate([s.vertices[:, s.faces[k]] for s in meshes], 1) for k in range(3))
    light = frame.origin if frame.perspective else frame.rotation[0, 2]
    start = np.where(eye.valid, eye.world, frame.origin[:, None] + 1.0) + shift
    return ~ref_blocked((a, b, c), start, light, eye.prim, parallel=not frame.perspective)


def wrong_for_sure(spec, scene, eye, frame, lit) -> int:
    """Pixels that float64 answers otherwise, and would still with starts 2e-6 diagonals aside."""
    low, high = scene.geometry.bounds.T
    step = 2e-6 * np.linalg.norm(high - low)
    judged = eye.valid & (np.sum(eye.normal * _towards(frame, eye), axis=0) > 0)
    wrong = judged & (ref_lit(spec, eye, frame) != lit)
    for axis in np.eye(3):
        for way in (-step, step):
            wrong &= ref_lit(spec, eye, frame, way * axis[:, None]) != lit
    return int(wrong.sum())


def _towards(frame, eye):
    if frame.perspective:
        return frame.origin[:, None] - np.where(eye.valid, eye.world, 0.0)
    return -frame.rotation[0, 2][:, None]


PLACES = [
    (1.0, 0.0), (1e-6, 0.0), (1e-4, 0.0), (1e3, 0.0), (1e6, 0.0),
    (1.0, 2e4), (1.0, 1e6), (1e-3, 1e3), (1e3, 1e6),
]  # fmt: skip

WORST = ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e6))
"""All that the quick run tries."""

EACH_PLACE = [
    pytest.param(*place, marks=[] if place in WORST else [pytest.mark.slow]) for place in PLACES
]


@pytest.mark.parametrize(("scale", "offset"), EACH_PLACE)
@pytest.mark.parametrize("light", ["point", "directional"])
def test_truth_is_right_at_any_scale_and_offset(scale, offset, light):
    """Against float64 shadow rays at the triangles that the spec gives, and as full of light as
    at home. Before there was a working frame, an offset of 20,000 had 27 % of the pixels wrong."""
    spec = letter(scale, offset * OUT)
    scene = load_scene(spec)
    eye, frame, lit = traced(scene, light)
    at_home = load_scene(letter())
    home_eye, _, home_lit = traced(at_home, light)
    assert np.mean(eye.valid != home_eye.valid) < 1e-3
    assert np.mean(lit != home_lit) < 2e-3 and 0.3 < home_lit.mean() < 0.97
    assert wrong_for_sure(spec, scene, eye, frame, lit) == 0


@pytest.mark.parametrize(("scale", "offset"), [(1e-6, 0.0), (1.0, 1e6), (1e6, 0.0)])
@pytest.mark.parametrize(
    "algorithm",
    [
        UniformShadowMap(256),
        AdaptiveShadowMap(memory_bytes=2**20, cost_model=CostModel(1e-8, 1e-5, 0.0)),
    ],
    ids=lambda a: a.name,
)
def test_maps_are_as_good_as_at_home(algorithm, scale, offset):
    errors = []
    for spec in (letter(), letter(scale, offset * OUT)):
        scene = load_scene(spec)
        eye, frame, lit = traced(scene)
        state = algorithm.build(eye, frame, scene.light_rays())
        found = np.asarray(algorithm.visibility(state, eye.points)) > 0.5
        errors.append(np.mean(found[eye.valid] != lit[eye.valid]))
    assert errors[1] <= errors[0] + 2e-3 and errors[0] < 0.05


def test_powers_of_two_change_nothing():
    """Scaled by 2^-20 and 2^20 the same pixels are lit, bit for bit, truth and map."""
    algorithm = UniformShadowMap(128)
    found = []
    for scale in (2.0**-20, 2.0**-8, 2.0**20):
        scene = load_scene(letter(scale))
        eye, frame, lit = traced(scene)
        state = algorithm.build(eye, frame, scene.light_rays())
        found.append((lit, np.asarray(algorithm.visibility(state, eye.points))))
    for lit, image in found[1:]:
        np.testing.assert_array_equal(lit, found[0][0])
        np.testing.assert_array_equal(image, found[0][1])


XML = """<scene version="3.0.0">
<sensor type="perspective" id="eye"><float name="fov" value="40"/>
  <transform name="to_world"><lookat origin="{eye}" target="{target}" up="0,0,1"/>{shift}
  </transform>
  <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/></film>
</sensor>
<emitter type="point" id="lamp"><transform name="to_world">
  <translate x="1.5" y="0.7" z="3"/>{place}</transform></emitter>
<shape type="rectangle" id="ground"><transform name="to_world">
  <scale value="2"/>{place}</transform></shape>
<shape type="sphere" id="ball"><point name="center" x="0.1" y="0.1" z="0.5"/>
  <float name="radius" value="0.3"/><transform name="to_world">{place}</transform></shape>
<shape type="cylinder" id="rod"><point name="p0" x="-0.6" y="0" z="0.1"/>
  <point name="p1" x="-0.6" y="0" z="0.9"/><float name="radius" value="0.05"/>
  <transform name="to_world">{place}</transform></shape>
<shape type="shapegroup" id="group"><shape type="cube"><transform name="to_world">
  <scale value="0.1"/></transform></shape></shape>
<shape type="instance" id="one"><ref id="group"/><transform name="to_world">
  <translate x="0.6" y="-0.2" z="0.4"/>{place}</transform></shape>
</scene>"""
"""A curved shape, one with ends of its own, an instance; `place` comes last everywhere."""


def in_file(tmp_path, place: str = "", scale: float = 1.0):
    """The scene with `place` after all transforms but the eye's, which knows no scale."""
    eye, target = (",".join(str(scale * x) for x in point) for point in ((0.5, -3, 2), (0, 0, 0.2)))
    shift = place if scale == 1 else ""
    path = tmp_path / f"scene{len(list(tmp_path.iterdir()))}.xml"
    path.write_text(XML.format(place=place, eye=eye, target=target, shift=shift))
    return load_scene(path)


@pytest.mark.parametrize(
    ("place", "scale"),
    [
        ('<translate x="20000.5" y="-3000.25" z="1000"/>', 1.0),
        ('<translate x="1000000" y="-500000" z="250000"/>', 1.0),
        ('<scale value="0.00001"/>', 1e-5),
        ('<scale value="100000"/>', 1e5),
    ],
)
def test_scene_files_are_read_in_float64(tmp_path, place, scale):
    """Views, lights and shapes of a file far away, tiny or huge: the picture of home. Nothing is
    clipped though the scene lies inside the renderer's own clip distance."""
    home, there = in_file(tmp_path), in_file(tmp_path, place, scale)
    assert home.working is WORLD and there.working.scale * scale >= 0.5
    images = []
    for scene in (home, there):
        eye = scene.eye(scene.view())
        frame = scene.light_frame(eye)
        rays = scene.light_rays()
        lit = scene.shadow_rays(eye, frame, rays).trace()
        texels = UniformShadowMap(512).build(eye, frame, rays)
        images.append((eye.shape, lit, UniformShadowMap(512).visibility(texels, eye.points)))
    for here, away in zip(*images, strict=True):
        assert np.mean(np.asarray(here) != np.asarray(away)) < 2e-3
    assert set(images[0][0].tolist()) == {-1, 0, 1, 2, 3}
    assert 0.05 < np.mean(~images[0][1]) < 0.9
    low, high = (box.geometry.bounds for box in (home, there))
    assert np.ptp(high, axis=1) == pytest.approx(scale * np.ptp(low, axis=1), rel=1e-4)


def test_objects_move_in_scene_units():
    """Far away, a mesh that is moved is where it should be, and its boxes say so."""
    spec = letter(1.0, 1e5 * OUT)
    mover = MovingShapes(load_scene(spec), "letter")
    step = np.array([0.25, -0.125, 0.5])
    scene, boxes = mover.at(step)
    assert boxes is not None and not scene.working.is_identity
    np.testing.assert_allclose(boxes[1] - boxes[0], np.repeat(step[:, None], 2, 1), atol=1e-5)
    moved = replace(
        spec,
        shapes=tuple(transform(s, np.eye(3), tuple(step)) if s.name == "letter" else s
                     for s in spec.shapes if isinstance(s, Mesh)),
    )  # fmt: skip
    eye, frame, lit = traced(scene)
    assert wrong_for_sure(moved, scene, eye, frame, lit) == 0


def test_what_is_made_already_is_cast_where_it_is():
    """A dictionary with ready-made shapes far away says that rays lose digits."""
    mi = activate()
    far = mi.ScalarTransform4f().translate([5e4, 0, 0])
    plate = mi.load_dict({"type": "rectangle", "to_world": far})
    eye = pinhole(mi, (5e4, 0, 5), (5e4, 0, 0))
    light = {"type": "point", "position": [5e4, 1, 4]}
    parts = {"type": "scene", "plate": plate, "eye": eye, "light": light}
    scene = load_scene(parts)
    assert scene.working is WORLD and "lose digits" in scene.notices[0]
    parts["plate"] = {"type": "rectangle", "to_world": far}
    scene = load_scene(parts)
    assert not scene.working.is_identity and scene.notices == ()


def with_parts(tmp_path, *parts: str):
    path = tmp_path / f"scene{len(list(tmp_path.iterdir()))}.xml"
    path.write_text(f'<scene version="3.0.0">{"".join(parts)}</scene>')
    return load_scene(path)


def placed(shape: str, x: float, scale: float = 1.0, more: str = "") -> str:
    return (f'<shape type="{shape}" {more}><transform name="to_world"><scale value="{scale}"/>'
            f'<translate x="{x}"/></transform></shape>')  # fmt: skip


def test_a_shape_that_is_referred_to_twice_is_moved_once(tmp_path):
    twice = with_parts(tmp_path, placed("cube", 5e4, 1.0, 'id="a"'), '<ref id="a"/>')
    assert not twice.working.is_identity
    np.testing.assert_allclose(twice.geometry.bounds[0], [5e4 - 1, 5e4 + 1])


def test_a_shape_in_a_group_and_outside_of_it_stays(tmp_path):
    """It cannot be moved for both, and the run says what that costs."""
    group = '<shape type="shapegroup" id="g"><ref id="a"/></shape>'
    one = '<shape type="instance"><ref id="g"/></shape>'
    scene = with_parts(tmp_path, placed("cube", 5e4, 1.0, 'id="a"'), group, one)
    assert scene.working is WORLD and "stand in several places" in scene.notices[0]
    np.testing.assert_allclose(scene.geometry.bounds[0], [5e4 - 1, 5e4 + 1])


def test_a_small_scene_that_float32_makes_a_point_is_found(tmp_path):
    """0.01 units wide, a million away: there float32 knows 0.06 units."""
    scene = with_parts(tmp_path, placed("cube", 1e6 + 0.3, 0.005))
    size = np.ptp(scene.geometry.bounds, axis=1)
    np.testing.assert_allclose(size, 0.01, rtol=1e-4)
    np.testing.assert_allclose(scene.geometry.bounds[0].mean(), 1e6 + 0.3, atol=1e-6)


def test_curves_are_moved_and_the_run_says_what_is_left(tmp_path):
    (tmp_path / "curve.txt").write_text("0 0 0 1e-7\n1e-6 0 0 1e-7\n2e-6 1e-6 0 1e-7\n")
    curve = '<shape type="linearcurve"><string name="filename" value="curve.txt"/></shape>'
    scene = with_parts(tmp_path, placed("cube", 0.0, 1e-6), curve)
    assert scene.working.scale == 1 and "cannot be scaled" in scene.notices[0]


def test_a_texture_s_own_transform_is_no_place():
    mi = activate()
    checks = {"type": "checkerboard", "to_uv": mi.ScalarTransform3f().scale(2)}
    ground = {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": checks}}
    scene = load_scene({"type": "scene", "ground": ground, "eye": pinhole(mi)})
    assert scene.eye(scene.view()).valid.any()


def test_frames_round_trip_and_know_when_they_are_needed():
    """Usual scenes are left alone; the others come to 8 to 16 units about the origin, exactly."""
    box = np.array([[-1.0, 2.0], [0.0, 3.0], [-2.0, 1.0]])
    assert working_frame(box) is WORLD and working_frame(1000 * box) is WORLD
    for moved in (1e-6 * box, 1e6 * box, box + 1e5, 3e-3 * box - 77.0):
        frame = working_frame(moved)
        diagonal = np.linalg.norm(np.ptp(frame.inward(moved), axis=1))
        assert 8 <= diagonal < 16.0001 and np.log2(frame.scale) % 1 == 0
        assert np.abs(frame.inward(moved)).max() < 12
        np.testing.assert_allclose(frame.outward(frame.inward(moved)), moved, rtol=1e-15)
        np.testing.assert_allclose(
            frame.matrix @ np.r_[moved, np.ones((1, 2))],
            np.r_[frame.inward(moved), np.ones((1, 2))],
            atol=1e-9 * np.abs(moved).max() * frame.scale,
        )
    assert working_frame(moved, frame) is frame
    point = np.full((3, 2), 1e6)
    assert working_frame(point).centre == (1e6, 1e6, 1e6) and working_frame(0 * point) is WORLD
    assert working_frame(np.full((3, 2), np.nan)) is WORLD
    assert isinstance(frame, WorkingFrame) and jnp.isfinite(frame.scale)
