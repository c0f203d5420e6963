"""Hostile scenes end in one line, with nothing opened outside their folder; harmless ones load."""

import json
import os
import re
import subprocess
import sys

import pytest
from helpers.mitsuba_scenes import REAL_SCENES

from asmjax.errors import UseError
from asmjax.render import untrusted
from asmjax.render.untrusted import Trial, check_meshes, examine, shipped_plugins
from asmjax.scene.scan import scan
from hostile.building import BALL, mesh_scene, mesh_xml, obj, parts_scene, ply, text_ply
from hostile.corpus import CORPUS
from hostile.loading import loaded_apart
from hostile.watching import foreign, opened_files

pytestmark = pytest.mark.timeout(60)  # what waits for a FIFO waits for ever

MOST_SECONDS = 2.0
"""Of processor time for a hostile scene in the process that asks, besides the child's."""


@pytest.fixture(scope="module")
def trial(opens):
    with Trial() as child:
        yield child


@pytest.fixture
def places(tmp_path):
    """The scene's folder, and one outside it with a secret, a mesh and a FIFO."""
    folder, outside = tmp_path / "scene", tmp_path / "outside"
    folder.mkdir()
    outside.mkdir()
    (outside / "secret.txt").write_text("the secret")
    (outside / "mesh.ply").write_bytes(ply())
    os.mkfifo(outside / "pipe")
    return folder, outside


def test_there_are_enough():
    assert len(CORPUS) >= 60


@pytest.mark.parametrize("name", CORPUS)
def test_hostile_scene(name, places, trial, opens):
    """Refused in one line that names what is wrong, tells no content, and opens nothing outside,
    neither here nor in the child."""
    folder, outside = places
    case = CORPUS[name]
    path = case.make(folder, outside)
    if opens is not None:
        opens.forget()
    with opened_files() as opened, pytest.raises(UseError) as problem:
        examine(path, trial)
    message = str(problem.value)
    assert re.search(case.says, message), message
    assert "\n" not in message and len(message) < 700 and message.isprintable()
    assert "the secret" not in message
    assert not foreign(opened, outside)
    if opens is not None:
        assert not foreign(opens.paths(), outside)


SECONDS = """
import json, sys, tempfile, time
from pathlib import Path
from asmjax.errors import UseError
from asmjax.render.untrusted import check_meshes, shipped_plugins
from asmjax.scene.scan import scan
from hostile.corpus import CORPUS
plugins, seconds = shipped_plugins(), {}
for name, case in CORPUS.items():
    with tempfile.TemporaryDirectory() as folder:
        places = Path(folder) / "scene", Path(folder) / "outside"
        for place in places:
            place.mkdir()
        path = case.make(*places)
        begun = time.process_time()
        try:
            check_meshes(scan(path, plugins))
        except UseError:
            pass
        seconds[name] = time.process_time() - begun
print(json.dumps(seconds))
"""


@pytest.mark.timeout(300)
def test_hostile_scenes_take_little_time():
    """In a process of its own, whose code no test instruments."""
    end = subprocess.run(
        [sys.executable, "-c", SECONDS],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        check=True,
    )
    seconds = json.loads(end.stdout)
    assert len(seconds) == len(CORPUS)
    slow = {name: took for name, took in seconds.items() if took > MOST_SECONDS}
    assert not slow
    print(sorted(((round(took, 2), name) for name, took in seconds.items()), reverse=True)[:5])


def test_native_opens_are_heard(places, trial, opens):
    """A child that was let loose on a file outside is found: what the tests above rely on."""
    if opens is None:
        pytest.skip("no C compiler: gcc or cc")
    folder, outside = places
    opens.forget()
    path = mesh_scene(folder, ply())
    trial.load(path, 1000)
    assert str(folder / "mesh.ply") in opens.paths()
    for secret in (outside / "mesh.ply", "/proc/self/mem", "/proc/self/environ"):
        text = path.read_text().replace("mesh.ply", str(secret))
        code = f"import mitsuba as mi; mi.set_variant('scalar_rgb'); mi.load_string({text!r})"
        subprocess.run(
            [sys.executable, "-c", code], env=untrusted._environment(), capture_output=True
        )
        assert str(secret) in foreign(opens.paths(), outside)


HARMLESS = {
    "a ball": lambda folder: parts_scene(folder, BALL),
    "a ball in comments": lambda folder: parts_scene(folder, "<!-- <path> -->", BALL),
    "binary mesh": lambda folder: mesh_scene(folder, ply()),
    "big-endian mesh": lambda folder: mesh_scene(folder, ply(order=">")),
    "double mesh": lambda folder: mesh_scene(folder, ply(kind="d")),
    "text mesh": lambda folder: mesh_scene(folder, text_ply()),
    "OBJ mesh": lambda folder: mesh_scene(folder, obj(), "obj"),
    "20,000 parameters filled in": lambda folder: parts_scene(
        folder,
        '<default name="x" value="1"/>',
        BALL.replace("</shape>", '<float name="radius" value="$x"/></shape>') * 20,
        '<bsdf type="diffuse"><rgb name="reflectance" value="$x $x $x"/></bsdf>' * 20_000,
    ),
    "OBJ mesh of quads": lambda folder: mesh_scene(
        folder, obj("v 0 0 4\nv 1 0 4\nv 1 1 4\nv 0 1 4\n", "f 1 2 3 4 # all\n"), "obj"
    ),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_harmless_scene(name, tmp_path, trial):
    """What the hostile ones differ from is let through."""
    examine(HARMLESS[name](tmp_path), trial)


@pytest.mark.mitsuba
def test_harmless_scenes_are_loaded(tmp_path):
    """Not only by the child, but as a job loads them."""
    scenes = []
    for number, make in enumerate(HARMLESS.values()):
        (tmp_path / str(number)).mkdir()
        scenes.append(make(tmp_path / str(number)))
    assert loaded_apart(scenes) == ["loaded"] * len(scenes)


def test_files_inside_by_any_way(tmp_path, trial):
    """Folders, `..` and links that stay inside, absolute names, parameters and includes."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub/mesh.ply").write_bytes(ply())
    (tmp_path / "link.ply").symlink_to("sub/mesh.ply")
    inner = f'<scene version="3.0.0">{mesh_xml("sub/mesh.ply")}</scene>'
    (tmp_path / "sub/inner.xml").write_text(inner)
    path = parts_scene(
        tmp_path,
        '<default name="where" value="sub"/>',
        mesh_xml("$where/mesh.ply"),
        mesh_xml("sub/../sub/mesh.ply"),
        mesh_xml("link.ply"),
        mesh_xml(str(tmp_path / "sub/mesh.ply")),
        '<include filename="$where/inner.xml"/>',
    )
    examine(path, trial)
    files = scan(path, shipped_plugins())
    assert [file.name for file in files.documents] == ["scene.xml", "inner.xml"]
    assert [(file.path.name, file.kind) for file in files.references] == [("mesh.ply", "ply")]


def test_parameters_are_filled_in_as_mitsuba_does(tmp_path):
    """First default counts, longest name first, an escaped dollar stays."""
    for name in ("one", "two-long", "$one"):
        (tmp_path / f"{name}.ply").write_bytes(ply())
    path = parts_scene(
        tmp_path,
        '<default name="a" value="one"/><default name="a" value="three"/>',
        '<default name="ab" value="two-long"/>',
        mesh_xml("$a.ply"),
        mesh_xml("$ab.ply"),
        mesh_xml("\\$one.ply"),
    )
    found = [file.path.name for file in scan(path, shipped_plugins()).references]
    assert found == ["one.ply", "two-long.ply", "$one.ply"]


def test_the_renderer_names_the_plugins():
    """Those of the installed package, without importing it."""
    plugins = shipped_plugins()
    assert {"sphere", "ply", "obj", "perspective", "hdrfilm", "direct"} <= plugins
    assert "prb" not in plugins  # registered by Python code


@pytest.mark.skipif(not REAL_SCENES.is_dir(), reason="not here: docs/other_scenes.md")
def test_real_scenes_pass():
    """All of them, with their thousands of mesh files."""
    paths = sorted(REAL_SCENES.glob("*/*.xml"))
    assert paths
    for path in paths:
        files = scan(path, shipped_plugins())
        check_meshes(files)
        assert files.references and files.bytes() > 5_000
