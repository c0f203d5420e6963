"""Instances of shape groups: everything as if their meshes had been written out."""

import os
import subprocess
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.mitsuba_scenes import pinhole, vectorised

from asmjax.buffers import whole_image
from asmjax.errors import UseError
from asmjax.render.geometry import MOST_PRIMITIVES, first_ids
from asmjax.render.instances import known_instances
from asmjax.render.load import load_scene
from asmjax.render.moving import MovingShapes
from asmjax.render.variant import activate
from asmjax.scene.mesh_tools import rotation, transform, written_out
from asmjax.scene.shapes import box, quad, sphere
from asmjax.scene.spec import Instances, LightSpec, SceneSpec, Sphere, ViewSpec

pytestmark = pytest.mark.mitsuba

FEW = 2e-3
"""Share of pixels in which an edge may fall to the other side: the renderer turns rays, not
triangles, so both are rounded differently."""

SIZE = (96, 80)

ARROW = (
    box("shaft", (-0.5, -0.1, 0.0), (0.5, 0.15, 0.4), (0.8, 0.3, 0.2)),
    sphere("tip", (0.6, 0.1, 0.5), 0.25, 5, (0.2, 0.4, 0.8)),
)
"""Two meshes of 12 and 200 triangles without any symmetry."""

POST = (box("post", (-0.1, -0.1, 0.0), (0.1, 0.1, 1.5)),)


def placed(at, matrix=None) -> np.ndarray:
    """One transform (3, 4)."""
    linear = np.eye(3) if matrix is None else np.asarray(matrix, float)
    return np.concatenate([linear, np.array(at, float)[:, None]], axis=1)


QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
EXACT = np.stack(
    [
        placed((-1.5, -1.0, 0.0)),
        placed((1.5, -1.25, 0.0), QUARTER),
        placed((0.0, 1.0, 0.25), 2.0 * np.eye(3)),
        placed((-1.0, 1.5, 0.0), np.diag([-1.0, 1.0, 1.0])),
    ]
)
"""A shift, a quarter turn, a scale and a reflection, none of which rounds anything."""

GENERAL = np.stack(
    [
        placed((1.9 * np.cos(k), 1.7 * np.sin(k), 0.1), 0.7 * rotation((0.3, 0.2, 1.0), 1.1 * k))
        for k in range(5)
    ]
    + [placed((0.1, 0.2, 0.0), np.diag([1.3, -0.6, 0.8]) @ rotation((1.0, 0.0, 0.2), 0.4))]
)


def scene_of(arrows: np.ndarray) -> SceneSpec:
    """Arrows and posts over a floor with a ball on it, under a sun and a lamp."""
    floor = quad("floor", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)])
    posts = np.stack([placed((x, 2.5, 0.0)) for x in (-2.0, -0.5, 1.0)])
    return SceneSpec(
        "arrows",
        "instances",
        (floor, Sphere("ball", (2.6, 0.3, 0.5), 0.5)),
        {"above": ViewSpec("above", origin=(1.0, -5.0, 6.0), target=(0.0, 0.2, 0.2))},
        {
            "sun": LightSpec("sun", "directional", direction=(0.5, 0.3, -1.0)),
            "lamp": LightSpec("lamp", "point", position=(-0.7, -0.4, 4.0)),
        },
        instances=(Instances("arrow", ARROW, arrows), Instances("post", POST, posts)),
    )


def everything(spec: SceneSpec, frames=None) -> dict:
    """Eye buffer, light buffers and shadow rays, the latter from the light frames of `frames`."""
    scene = load_scene(spec)
    eye = scene.eye(scene.view().resized(*SIZE))
    found = {"scene": scene, "eye": eye, "frames": {}}
    for name in spec.lights:
        frame = scene.light_frame(eye, name) if frames is None else frames[name]
        rays = scene.light_rays(name)
        found["frames"][name] = frame
        found[f"{name}_map"] = rays.light_buffer(frame, whole_image(frame, 61))
        found[f"{name}_lit"] = scene.shadow_rays(eye, frame, rays).trace()
    return found


@pytest.fixture(scope="module", params=["exact", "general"])
def pair(request):
    """What the renderer makes of a scene with instances and of the same written out."""
    spec = scene_of(EXACT if request.param == "exact" else GENERAL)
    ours = everything(spec)
    return ours, everything(written_out(spec), ours["frames"]), request.param


def test_eye_buffer_as_written_out(pair):
    """The same primitives by the same ids, at the same places, of the same colours."""
    ours, ref, kind = pair
    ours, ref = ours["eye"], ref["eye"]
    same = ours.prim == ref.prim
    assert same.all() if kind == "exact" else np.mean(~same) <= FEW
    assert ours.valid.mean() > 0.5 and same[ours.valid].any()
    assert ours.world[:, same] == pytest.approx(ref.world[:, same], abs=2e-6, nan_ok=True)
    assert ours.normal[:, same] == pytest.approx(ref.normal[:, same], abs=1e-5)
    assert ours.albedo[:, same] == pytest.approx(ref.albedo[:, same], abs=1e-6)
    assert np.array_equal(
        np.asarray(ours.points.prim)[same], np.asarray(ref.points.prim)[same]
    )  # flat or curved


def test_light_buffer_as_written_out(pair):
    """Depths and primitives of both lights' images."""
    ours, ref, kind = pair
    for name in ("sun_map", "lamp_map"):
        same = ours[name].prim == ref[name].prim
        assert same.all() if kind == "exact" else np.mean(~same) <= FEW
        assert (ours[name].prim >= 3).mean() > 0.05
        assert ours[name].depth[same] == pytest.approx(ref[name].depth[same], rel=3e-6)


def test_shadow_rays_as_written_out(pair):
    """The same truth, light and shadow both."""
    ours, ref, _ = pair
    for name in ("sun_lit", "lamp_lit"):
        assert np.mean(ours[name] != ref[name]) <= FEW
        assert 0.2 < ours[name].mean() < 0.9


def test_shapes_are_the_instances(pair):
    """Each pixel's shape is the placed instance whose meshes the written-out scene sees there."""
    ours, ref, _ = pair
    names, ref_names = ours["scene"].shape_names, ref["scene"].shape_names
    assert names[:2] == ref_names[:2] == ("floor", "ball") and len(names) < len(ref_names)
    same = ours["eye"].valid & (ours["eye"].prim == ref["eye"].prim)
    seen = zip(ours["eye"].shape[same], ref["eye"].shape[same], strict=True)
    for mine, theirs in {(names[a], ref_names[b]) for a, b in seen}:
        kind, _, k = mine.partition("_")
        parts = [m.name for m in {"arrow": ARROW, "post": POST}.get(kind, ())]
        assert theirs in ([f"{part}_{k}" for part in parts] or [mine])


def test_ids_and_corners_are_those_of_the_instance(pair):
    """Global id = first id of the instance + primitive in its group; corners by its transform."""
    ours, _, kind = pair
    geometry = ours["scene"].geometry
    transforms = EXACT if kind == "exact" else GENERAL
    assert geometry.first_prim[:3].tolist() == [0, 2, 3]
    assert np.diff(geometry.first_prim)[2:].tolist() == [212] * len(transforms) + [12] * 3
    # Stored once: floor, ball, one arrow, one post.
    assert geometry.faces.shape[1] == 2 + 1 + 212 + 12
    assert geometry.triangles == 2 + 212 * len(transforms) + 12 * 3
    for k, matrix in enumerate(transforms):
        for local, mesh, face in ((5, ARROW[0], 5), (12 + 77, ARROW[1], 77)):
            prim = np.array([3 + 212 * k + local])
            assert geometry.on_mesh(prim).all()
            for corner, vertex in zip(geometry.corners(prim), mesh.faces[:, face], strict=True):
                want = matrix[:, :3] @ mesh.vertices[:, vertex] + matrix[:, 3]
                assert corner[:, 0] == pytest.approx(want, abs=1e-6)
    assert not geometry.on_mesh(np.array([2])).any()


def test_normals_of_instances_are_exact(pair):
    """Float64 planes of the transformed corners, not the renderer's float32 normals."""
    ours, _, _ = pair
    eye, geometry = ours["eye"], ours["scene"].geometry
    pixels = np.flatnonzero(eye.prim >= 3)
    assert pixels.size > 500
    a, b, c = geometry.corners(eye.prim[pixels])
    normal = np.cross(b - a, c - a, axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    off = np.sum(normal * (eye.world[:, pixels] - a), axis=0)
    assert np.abs(off).max() < 1e-11
    cosine = np.sum(normal * eye.normal[:, pixels], axis=0)
    assert np.abs(cosine) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (37.0, -61.0, 3.0), (410.0, 300.0, -70.0)])
def test_convex_bodies_do_not_shade_themselves(at):
    """Every pixel of a ball of triangles that faces the sun is lit, near the origin or far."""
    turns = [rotation((1.0, 2.0, 3.0), 0.7 * k) * (0.6 + 0.1 * k) for k in range(4)]
    centres = np.array(at) + 3.0 * np.array([[k, 0.3 * k, 0.0] for k in range(4)])
    transforms = np.stack([placed(c, m) for c, m in zip(centres, turns, strict=True)])
    middle = centres.mean(axis=0)
    spec = SceneSpec(
        "balls",
        "",
        (),
        {"v": ViewSpec("v", tuple(middle + [-4.0, -14.0, 5.0]), tuple(middle), fov_x_deg=50.0)},
        {"sun": LightSpec("sun", "directional", direction=(0.1, 0.6, -0.8))},
        instances=(Instances("ball", (sphere("ball", (0, 0, 0), 1.0, 24),), transforms),),
    )
    scene = load_scene(spec)
    eye = scene.eye(scene.view().resized(256, 192))
    rays = scene.shadow_rays(eye, scene.light_frame(eye), scene.light_rays())
    assert rays.count > 1500
    assert rays.trace()[rays.facing].all()


def test_groups_of_a_scene_file(tmp_path):
    """Two groups as Mitsuba reads them, one with a sphere in it, and a lamp beside them.

    The oracle has the same bodies written out, but for a ball that is stretched by its instance:
    such a one Mitsuba has as an instance only.
    """
    mi = activate()
    (tmp_path / "grouped.xml").write_text(SCENE_FILE)
    scene = load_scene(tmp_path / "grouped.xml")
    sizes = dict(zip(scene.shape_names, np.diff(scene.geometry.first_prim), strict=True))
    assert sizes == {"ground": 2, "bulb": 1, "first": 13, "second": 13, "third": 12}
    move = mi.ScalarTransform4f().translate
    size, lift = mi.ScalarTransform4f().scale([0.5, 0.3, 0.5]), move([0, 0, 0.5])
    stretch = move([1.0, 0.8, 0]) @ mi.ScalarTransform4f().scale([1.5, 1.0, 1.0])
    alone = load_scene({
        "type": "scene",
        "eye": pinhole(mi, (0.0, -6.0, 5.0), (0.0, 0.0, 0.0), SIZE, (0, 0, 1), fov=50.0),
        "ground": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(5.0)},
        "first": {"type": "cube", "to_world": move([-1.5, 0, 0]) @ lift @ size},
        "ball": {"type": "sphere", "center": [-1.5, 0.0, 1.3], "radius": 0.3},
        "second": {"type": "cube", "to_world": stretch @ lift @ size},
        "third": {"type": "cube", "to_world": move([0, 2, 0]) @ lift @ size},
    })  # fmt: skip
    eye, ref = (s.eye(alone.view()) for s in (scene, alone))
    stretched = scene.geometry.first_prim[scene.shape_names.index("second")] + 12
    ball = eye.prim == stretched
    assert ball.sum() > 20 and not scene.geometry.on_mesh(np.array([stretched]))
    x, y, z = eye.world[:, ball] - [[1.0], [0.8], [1.3]]
    assert np.sqrt((x / 1.5) ** 2 + y**2 + z**2) == pytest.approx(0.3, abs=1e-4)
    outward = np.stack([x / 1.5**2, y, z])
    outward /= np.linalg.norm(outward, axis=0)
    assert eye.normal[:, ball] == pytest.approx(outward, abs=1e-3)
    off = np.abs(eye.world - ref.world).max(axis=0)[~ball & eye.valid & ref.valid]
    assert off.size > 4000 and np.mean(off > 1e-5) <= FEW
    # The lamp's own rays pass it by, and meet the instances.
    frame = scene.light_frame(eye)
    prim = scene.light_rays().light_buffer(frame, whole_image(frame, 48)).prim
    met = set(np.searchsorted(scene.geometry.first_prim, prim[prim >= 0], side="right") - 1)
    names = {scene.shape_names[k] for k in met}
    assert "bulb" not in names and {"first", "second", "third"} <= names


SCENE_FILE = """<scene version="3.0.0">
  <sensor type="perspective"/>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="5"/></transform>
  </shape>
  <shape type="sphere" id="bulb"><point name="center" x="0.5" y="-1" z="4"/>
    <float name="radius" value="0.2"/><emitter type="area"/></shape>
  <shape type="shapegroup" id="pair">
    <shape type="cube"><transform name="to_world">
      <scale x="0.5" y="0.3" z="0.5"/><translate z="0.5"/></transform></shape>
    <shape type="sphere"><point name="center" x="0" y="0" z="1.3"/>
      <float name="radius" value="0.3"/></shape>
  </shape>
  <shape type="shapegroup" id="single">
    <shape type="cube"><transform name="to_world">
      <scale x="0.5" y="0.3" z="0.5"/><translate z="0.5"/></transform></shape>
  </shape>
  <shape type="instance" id="first"><ref id="pair"/>
    <transform name="to_world"><translate x="-1.5"/></transform></shape>
  <shape type="instance" id="second"><ref id="pair"/>
    <transform name="to_world"><scale x="1.5"/><translate x="1" y="0.8"/></transform></shape>
  <shape type="instance" id="third"><ref id="single"/>
    <transform name="to_world"><translate y="2"/></transform></shape>
</scene>
"""


def alike(mi, **more) -> dict:
    """Two groups with one box and one number of primitives, and what shows them."""

    def group(bright: float) -> dict:
        reflectance = {"type": "rgb", "value": bright}
        cube = {"type": "cube", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
        return {"type": "shapegroup", "s": cube}

    blocks = {"g0": group(0.2), "g1": group(0.7)}
    return {"type": "scene", "eye": pinhole(mi), "lamp": {"type": "point"}, **blocks, **more}


def test_groups_that_look_alike():
    """What the scene says of an instance counts: its second group is the brighter one."""
    mi = activate()
    shown = {f"i{k}": {"type": "instance", "g": {"type": "ref", "id": f"g{1 - k}"}} for k in (0, 1)}
    scene = load_scene(alike(mi, **shown))
    assert scene._instancing.group.tolist() == [1, 0]
    eye = load_scene(alike(mi, i=shown["i0"])).eye(scene.view())
    assert eye.albedo[:, eye.valid] == pytest.approx(0.7)


def test_ready_instances_of_groups_that_look_alike_are_refused():
    """One that was made before does not say which it shows."""
    mi = activate()
    groups = {f"g{k}": mi.load_dict({"type": "shapegroup", "s": {"type": "cube"}}) for k in (0, 1)}
    shown = {f"i{k}": mi.load_dict({"type": "instance", "g": groups[f"g{k}"]}) for k in (0, 1)}
    with pytest.raises(UseError, match="2 shape groups of the same box.*write it out"):
        load_scene({"type": "scene", "eye": pinhole(mi), **groups, **shown})


def far_off(spec: SceneSpec, away: float, scale: float) -> SceneSpec:
    """The same scene, its groups modelled `scale` times as large and `away` from their origin."""
    centre = away * np.array([0.8, -0.5, 0.33])

    def moved(instances: Instances) -> Instances:
        places = instances.transforms / np.array([scale, scale, scale, 1.0])
        places[:, :, 3] -= places[:, :, :3] @ centre
        meshes = (transform(m, scale * np.eye(3), tuple(centre)) for m in instances.meshes)
        return replace(instances, meshes=tuple(meshes), transforms=places)

    return replace(spec, instances=tuple(moved(instances) for instances in spec.instances))


@pytest.mark.parametrize(("away", "scale"), [(1e5, 1.0), (1e5, 1e-3)])
def test_groups_far_from_their_own_origin(pair, away, scale):
    """As written out. Before groups had frames of their own, 4 % of truth was wrong, and places by
    0.02 units, or 7 % of what was seen."""
    _, ref, kind = pair
    spec = far_off(scene_of(EXACT if kind == "exact" else GENERAL), away, scale)
    ours = everything(spec, ref["frames"])
    same = (ours["eye"].prim == ref["eye"].prim) & ref["eye"].valid
    assert np.mean(ours["eye"].prim != ref["eye"].prim) <= FEW
    assert ours["eye"].world[:, same] == pytest.approx(ref["eye"].world[:, same], abs=2e-6)
    for name in ("sun", "lamp"):
        assert np.mean(ours[f"{name}_lit"] != ref[f"{name}_lit"]) <= FEW
        assert np.mean(ours[f"{name}_map"].prim != ref[f"{name}_map"].prim) <= FEW


def test_an_instance_without_a_size_is_refused(tmp_path):
    path = tmp_path / "flat.xml"
    path.write_text(SCENE_FILE.replace('<scale x="1.5"/>', '<scale x="0"/>'))
    with pytest.raises(UseError, match="instance 'second' has no inverse.*a size along each axis"):
        load_scene(path)


def test_wrong_instances_are_refused():
    """No mesh, wrong shapes, transforms without inverse: one line that says which."""
    good = EXACT.copy()
    with pytest.raises(UseError, match="'a' have 0 meshes"):
        Instances("a", (), good)
    with pytest.raises(UseError, match=r"shape \(4, 4\); allowed: .* \(k, 3, 4\)"):
        Instances("a", POST, np.eye(4))
    for spoilt in (np.nan, 0.0):
        bad = good.copy()
        bad[2, :, 1] = spoilt
        with pytest.raises(UseError, match="transform 2 of instances 'a' is not finite or has no"):
            Instances("a", POST, bad)


def test_more_primitives_than_ids():
    """Ids are int32: the last one that fits, and one more."""
    assert first_ids(np.array([5, MOST_PRIMITIVES - 5]))[-1] == MOST_PRIMITIVES
    with pytest.raises(UseError, match="2147483648 primitives.*leave some instances out"):
        first_ids(np.array([6, MOST_PRIMITIVES - 5]))


def test_cuda_refuses_instances():
    """Variants that were never tried with instances say so instead of giving wrong ids."""
    mi = types.SimpleNamespace(variant=lambda: "cuda_ad_rgb")
    assert not known_instances(mi, [], [-1, -1])
    with pytest.raises(UseError, match="cuda_ad_rgb.*choose `variant` llvm_ad_rgb"):
        known_instances(mi, [object()], [0])


def test_moving_beside_instances():
    """Instances stay where they are; what moves beside them moves, and shades them."""
    scene = load_scene(scene_of(EXACT))
    with pytest.raises(UseError, match="'arrow_1' is an instance.*another `object`"):
        MovingShapes(scene, "arrow_1")
    mover = MovingShapes(scene, "ball")
    eye = scene.eye(scene.view().resized(*SIZE))
    moved, boxes = mover.at(np.array([-1.0, 0.0, 0.4]))
    after = moved.eye(moved.view().resized(*SIZE))
    assert boxes is not None
    unchanged = (eye.shape != 1) & (after.shape != 1) & eye.valid
    assert np.array_equal(eye.prim[unchanged], after.prim[unchanged])
    mine = after.world[:, after.shape == 1]
    assert np.linalg.norm(mine - [[1.6], [0.3], [0.9]], axis=0) == pytest.approx(0.5, abs=1e-4)


CHILD = """
import sys
import numpy as np
from asmjax.render.variant import activate
activate("scalar_rgb")
from render.test_instances import GENERAL, everything, scene_of
found = everything(scene_of(GENERAL))
np.savez(sys.argv[1], prim=found["eye"].prim, shape=found["eye"].shape, albedo=found["eye"].albedo,
         world=found["eye"].world, lit=found["sun_lit"], light_prim=found["lamp_map"].prim,
         depth=found["lamp_map"].depth)
"""


def test_scalar_agrees(tmp_path):
    """The slow variant, in a process of its own: same ids, places and shadows."""
    fast = everything(scene_of(GENERAL))
    if not vectorised(fast["scene"]._mi):
        pytest.skip("no second variant: this process runs scalar_rgb itself")
    paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(tmp_path / "slow.npz")],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in paths if p)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    slow = np.load(tmp_path / "slow.npz")
    eye = fast["eye"]
    same = (eye.prim == slow["prim"]) & eye.valid
    assert np.mean(eye.prim != slow["prim"]) <= FEW
    assert np.array_equal(eye.shape[same], slow["shape"][same])
    assert eye.world[:, same] == pytest.approx(slow["world"][:, same], abs=2e-6)
    assert eye.albedo[:, same] == pytest.approx(slow["albedo"][:, same], abs=1e-5)
    assert np.mean(fast["sun_lit"] != slow["lit"]) <= FEW
    ours = fast["lamp_map"]
    assert np.mean(ours.prim != slow["light_prim"]) <= FEW
    near = ours.prim == slow["light_prim"]
    assert ours.depth[near] == pytest.approx(slow["depth"][near], rel=1e-5)


def test_transforms_are_those_of_the_renderer():
    """Written out from float64 transforms or placed by float32 ones: a rounding apart, no more."""
    spec = scene_of(GENERAL)
    geometry = load_scene(replace(spec, shapes=spec.shapes[:1])).geometry
    assert geometry.to_world is not None
    assert geometry.to_world[:, :, 0] == pytest.approx(np.eye(3, 4))
    placed_ = np.moveaxis(geometry.to_world[:, :, 1 : 1 + len(GENERAL)], 2, 0)
    assert placed_ == pytest.approx(GENERAL.astype(np.float32), abs=0)
