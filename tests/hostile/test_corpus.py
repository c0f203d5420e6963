"""Hostile scenes end in one line, with nothing opened outside their folder; harmless ones load."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.mitsuba_scenes import REAL_SCENES

from asmjax.errors import UseError
from asmjax.render import untrusted
from asmjax.render.untrusted import Trial, check_meshes, examine, shipped_plugins
from asmjax.scene.scan import scan
from hostile.building import BALL, mesh_scene, mesh_xml, obj, parts_scene, ply, text_ply
from hostile.corpus import CORPUS
from hostile.watching import Opens, listener, opened_files

pytestmark = pytest.mark.timeout(60)  # what waits for a FIFO waits for ever


@pytest.fixture(scope="module")
def opens(tmp_path_factory):
    """What native code of the child opens; None where nothing can listen."""
    folder = tmp_path_factory.mktemp("listener")
    environment = listener(folder)
    if environment is None:
        yield None
        return
    before = untrusted._environment
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(untrusted, "_environment", lambda: before() | environment)
        yield Opens(folder / "opens")


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


def foreign(opened: list[str], outside: Path) -> list[str]:
    """What of these no scene may have opened."""
    places = (str(outside), "/etc", "/dev", "/proc")
    own = (os.devnull, "/proc/self", "/proc/meminfo")
    return [path for path in opened if path.startswith(places) and not path.startswith(own)]


def test_native_opens_are_heard(places, trial, opens):
    """A child that was let loose on a file outside is found: what the tests above rely on."""
    if opens is None:
        pytest.skip("no C compiler: gcc or cc")
    folder, outside = places
    opens.forget()
    path = mesh_scene(folder, ply())
    trial.load(path, 1000)
    assert str(folder / "mesh.ply") in opens.paths()
    text = path.read_text().replace("mesh.ply", str(outside / "mesh.ply"))
    code = f"import mitsuba as mi; mi.set_variant('scalar_rgb'); mi.load_string({text!r})"
    subprocess.run(
        [sys.executable, "-c", code], env=untrusted._environment(), check=True, capture_output=True
    )
    assert str(outside / "mesh.ply") in foreign(opens.paths(), outside)


HARMLESS = {
    "a ball": lambda folder: parts_scene(folder, BALL),
    "a ball in comments": lambda folder: parts_scene(folder, "<!-- <path> -->", BALL),
    "binary mesh": lambda folder: mesh_scene(folder, ply()),
    "big-endian mesh": lambda folder: mesh_scene(folder, ply(order=">")),
    "double mesh": lambda folder: mesh_scene(folder, ply(kind="d")),
    "text mesh": lambda folder: mesh_scene(folder, text_ply()),
    "OBJ mesh": lambda folder: mesh_scene(folder, obj(), "obj"),
    "OBJ mesh of quads": lambda folder: mesh_scene(
        folder, obj("v 0 0 4\nv 1 0 4\nv 1 1 4\nv 0 1 4\n", "f 1 2 3 4 # all\n"), "obj"
    ),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_harmless_scene(name, tmp_path, trial):
    """What the hostile ones differ from is let through."""
    examine(HARMLESS[name](tmp_path), trial)


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
