"""What cannot be loaded or seen ends in one line; what can, loads: real scenes and raw meshes."""

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded, pinhole, real_scene

from asmjax.errors import UseError
from asmjax.memory import Limit
from asmjax.render.load import load_scene
from asmjax.render.variant import activate
from asmjax.scene.builtin import asked_triangles
from asmjax.scene.spec import MAX_SIDE

pytestmark = pytest.mark.mitsuba

EYE = '<sensor type="perspective"/>'
LAMP = '<emitter type="point"/>'
BALL = '<shape type="sphere"><point name="center" x="0" y="0" z="4"/></shape>'


def scene_xml(*parts: str) -> str:
    return f'<scene version="3.0.0">{"".join(parts)}</scene>'


def refusal(action) -> str:
    """The message of the `UseError` that `action` ends in: one line with a remedy."""
    with pytest.raises(UseError) as problem:
        action()
    message = str(problem.value)
    assert message and "\n" not in message and len(message) < 700
    return message


def everything(source):
    """All that a run asks of a scene before the first map."""
    scene = load_scene(source)
    eye = scene.eye(scene.view().resized(16, 16))
    frame = scene.light_frame(eye)
    return scene.shadow_rays(eye, frame, scene.light_rays()).trace()


def test_the_smallest_scene_works(tmp_path):
    """The parts that the bad scenes below are made of are good ones."""
    path = tmp_path / "good.xml"
    path.write_text(scene_xml(EYE, LAMP, BALL))
    assert everything(path).any()


BAD_FILES = {
    "nothing in the file": ("", "Mitsuba can load.*mend the scene"),
    "no XML": ("a scene with a tree", "Mitsuba can load.*mend the scene"),
    "tag left open": ('<scene version="3.0.0"><shape type="sphere">', "line 1.*mend the scene"),
    "unknown plugin": (
        scene_xml('<shape type="spherre"/>'),
        "unknown plugin type 'spherre'.*Did you mean 'sphere'",
    ),
    "unknown parameter": (
        scene_xml('<shape type="sphere"><float name="radiuss" value="2"/></shape>'),
        "radiuss.*mend the scene",
    ),
    "missing mesh": (
        scene_xml('<shape type="ply"><string name="filename" value="no.ply"/></shape>'),
        "no.ply.*mend the scene",
    ),
    "empty scene": (scene_xml(), "no shapes; asmjax needs surfaces"),
    "not a scene": ('<shape version="3.0.0" type="sphere"/>', "no shapes"),
    "no shape": (scene_xml(EYE, LAMP), "no shapes"),
    "no sensor": (scene_xml(LAMP, BALL), "no view .sensor.*add a view"),
    "no emitter": (scene_xml(EYE, BALL), "no light .emitter.*add a light"),
    "sees nothing": (
        scene_xml(LAMP, '<shape type="sphere"><point name="center" x="0" y="0" z="-9"/></shape>',
                  EYE),
        "sees no surface; choose another `view` or `sensor`",
    ),
    "camera not finite": (
        scene_xml(LAMP, BALL, '<sensor type="perspective"><transform name="to_world">'
                              '<translate x="nan"/></transform></sensor>'),
        "not finite; give a camera with finite numbers",
    ),
    "shape not finite": (
        scene_xml(EYE, LAMP, '<shape type="sphere"><float name="radius" value="nan"/></shape>'),
        "finite|surface|Mitsuba can load",
    ),
    "film without pixels": (
        scene_xml(LAMP, BALL, '<sensor type="perspective"><film type="hdrfilm">'
                              '<integer name="width" value="0"/></film></sensor>'),
        "mend the scene",
    ),
    "film too large": (
        scene_xml(LAMP, BALL, '<sensor type="perspective"><film type="hdrfilm">'
                              '<integer name="width" value="16385"/></film></sensor>'),
        "16385.*allowed is 1 to 16384",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_file(case, tmp_path):
    """One line that says what is wrong and what to do."""
    import re

    content, expected = BAD_FILES[case]
    path = tmp_path / "bad.xml"
    path.write_text(content)
    message = refusal(lambda: everything(path))
    assert re.search(expected, message), message


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("no_such_file.xml", "no scene file 'no_such_file.xml'; give the path"),
        ("no/such/folder/scene", "no scene file"),
        ("paper_rom", "Did you mean 'paper_room'"),
        ("zzz", "known: .*letter_f.*A path of a Mitsuba scene file"),
        ("", "no scene file"),
        ({}, "no shapes"),
        ({"type": "scene"}, "no shapes"),
        ({"type": "sphere"}, "no shapes"),
        ({"type": "scene", "x": {"type": "nonsense"}}, "scene dictionary.*nonsense"),
        ({"type": "scene", "x": {"type": "ply", "filename": "no.ply"}}, "no.ply"),
    ],
    ids=str,
)
def test_bad_name_or_dictionary(source, expected):
    """Unknown built-in names get the nearest one suggested; missing files are named."""
    import re

    assert re.search(expected, refusal(lambda: load_scene(source)))


def test_folder_is_no_scene(tmp_path):
    """A folder is told from a missing file."""
    assert "is a folder" in refusal(lambda: load_scene(tmp_path))
    assert "is a folder" in refusal(lambda: load_scene(str(tmp_path)))


@pytest.mark.parametrize("size", [(0, 16), (16, 0), (-1, 16), (16_385, 16), (16, 16_385)])
def test_bad_size(size):
    """Sizes outside 1 to 16,384 are refused before anything is cast; the borders are not."""
    view = loaded("letter_f").view()
    message = refusal(lambda: view.resized(*size))
    assert f"{size[0]} x {size[1]}" in message and "1 to 16384" in message and "`size`" in message
    assert view.resized(1, MAX_SIDE).height == MAX_SIDE


def test_smallest_image():
    """One pixel is an image."""
    scene = loaded("letter_f")
    eye = scene.eye(scene.view().resized(1, 1))
    assert eye.size == (1, 1) and eye.valid.all()


REAL = {
    # Triangles as counted in the files.
    "munich_merged": (38_938, 5, "sun"),
    "munich": (38_938, 2_367, "sun"),
    "breakfast_room": (269_538, None, "sun"),
    "victorian_house": (1_011_600, None, "sun"),
    "japanese_classroom": (103_832, None, "sun"),
    "cornell_box": (38, 8, None),
}


@pytest.mark.parametrize("name", REAL)
def test_real_scene(name):
    """Every triangle arrives, shapes stay apart, and the sun casts a shadow that is seen."""
    scene = loaded(real_scene(name))
    triangles, shapes, light = REAL[name]
    assert scene.geometry.triangles == triangles
    assert shapes in (None, len(scene._scene.shapes()))
    assert light is None or (light in scene.lights and "ambient" in " ".join(scene.notices))
    eye = scene.eye(scene.view().resized(96, 72))
    frame = scene.light_frame(eye, light)
    lit = scene.shadow_rays(eye, frame, scene.light_rays(light)).trace()
    assert eye.valid.mean() > 0.4 and 0.02 < lit[eye.valid].mean() < 0.98
    assert set(np.unique(eye.shape[eye.valid])) <= set(range(len(scene._scene.shapes())))


@pytest.mark.parametrize(
    ("name", "triangles"),
    [("utah_teapot", 6_320), ("radio_tower", 4_892), ("stanford_bunny_16k", 16_301)],
)
def test_raw_mesh_through_a_dictionary(name, triangles):
    """A PLY file of any scale, seen whole and lit from the eye's side, shows all it has."""
    mi = activate()
    filename = real_scene(name)
    box = mi.load_dict({"type": "ply", "filename": filename}).bbox()
    low, high = np.array(box.min).ravel(), np.array(box.max).ravel()
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    origin = (middle + size * np.array([0.7, 0.5, 1.2])).tolist()
    lamp = (middle + size * np.array([0.9, 0.6, 1.2])).tolist()
    scene = load_scene({
        "type": "scene", "m": {"type": "ply", "filename": filename, "face_normals": True},
        "lamp": {"type": "point", "position": lamp},
        "eye": pinhole(mi, origin, middle.tolist(), (64, 64), fov=40.0, near_clip=1e-3 * size),
    })  # fmt: skip
    assert scene.geometry.triangles == triangles
    eye = scene.eye(scene.view())
    frame = scene.light_frame(eye)
    lit = scene.shadow_rays(eye, frame, scene.light_rays()).trace()
    assert 0.02 < eye.valid.mean() < 0.8
    assert 0.4 < lit[eye.valid].mean() <= 1.0


def test_an_eye_takes_a_view_its_name_its_index_or_nothing():
    """As the light's frame and rays do."""
    scene = load_scene("letter_f")
    first, *_ = scene.views
    seen = scene.eye(scene.view(first))
    for wanted in (first, 0, "0", None):
        assert np.array_equal(scene.eye(wanted).prim, seen.prim)
    assert np.array_equal(scene.eye().depth, seen.depth)
    assert "unknown view" in refusal(lambda: scene.eye("no view"))


@pytest.mark.parametrize("name", ["surface:2m", "plant:2m"])
def test_a_scene_of_any_size_is_refused_before_it_is_made(name, monkeypatch):
    """Two million triangles are 340 MB, which ten do not hold."""
    monkeypatch.setattr("asmjax.render.load.load_builtin", pytest.fail)
    with pytest.raises(UseError, match=f"scene '{name}'"):
        load_scene(name, limit=Limit(2 * 10**7, 10**7, "test"))


@pytest.mark.parametrize("size", ["0", "abc"])
def test_no_size_of_a_scene_of_copies(size):
    """Refused as that of any other scene, though its size takes no memory."""
    with pytest.raises(UseError, match="triangles"):
        asked_triangles(f"statues:{size}")
    assert asked_triangles("statues:82m") == 0
    assert asked_triangles("surface:10k") == 10_000
