"""Which folder is a scene's, and the time in which files are looked for."""

import hashlib
import time
from pathlib import Path
from threading import Event, Thread

import pytest

from asmjax.errors import UseError
from asmjax.render.load import load_scene
from asmjax.render.untrusted import shipped_plugins
from asmjax.scene import file_names
from asmjax.scene.file_names import Folder, Names
from asmjax.scene.scan import scan
from hostile.building import BALL, mesh_xml, parts_scene, ply

WAY = Path("link/../scene.xml")


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder; `link/..` of the current folder leads there, though its text does not say so."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    (there / "sub").mkdir(parents=True)
    (here / "link").symlink_to(there / "sub")
    monkeypatch.chdir(here)
    return there


def test_plugins_behind_a_link_are_seen(elsewhere):
    """Beside the file that is read, not beside the one that the text of the path means."""
    (elsewhere / "plugins").mkdir()
    parts_scene(elsewhere, BALL)
    for path in (WAY, WAY.absolute()):
        with pytest.raises(UseError, match="'plugins' stands beside the scene file in 'there'"):
            scan(path, shipped_plugins())


@pytest.mark.mitsuba
@pytest.mark.timeout(120)
def test_an_honest_scene_behind_a_link_loads(elsewhere):
    """With its mesh, by a relative path and by an absolute one."""
    (elsewhere / "mesh.ply").write_bytes(ply())
    path = parts_scene(elsewhere, mesh_xml("mesh.ply"))
    for given in (WAY, WAY.absolute()):
        files = scan(given, shipped_plugins())
        assert files.documents == (path,) and files.references[0].path == elsewhere / "mesh.ply"
        assert load_scene(given).geometry.triangles == 1


@pytest.mark.mitsuba
@pytest.mark.timeout(120)
def test_a_folder_with_a_tab_in_its_name(tmp_path):
    """Is as good as another one."""
    folder = tmp_path / "a\tb"
    folder.mkdir()
    assert load_scene(parts_scene(folder, BALL)).geometry.first_prim[-1] == 1


def test_time_of_other_threads_does_not_count(tmp_path, monkeypatch):
    """They may be at work while files are looked for."""
    (tmp_path / "a.ply").touch()
    names, most, ended = Names(Folder(tmp_path)), 0.1, Event()
    monkeypatch.setattr(file_names, "MOST_SECONDS", most)
    followed = Folder.real_path

    def slow(folder, name):
        begun = time.process_time()
        while time.process_time() < begun + 2 * most:
            time.sleep(0.01)
        return followed(folder, name)

    monkeypatch.setattr(Folder, "real_path", slow)

    def work():
        while not ended.is_set():
            hashlib.sha256(bytes(2**20))

    worker = Thread(target=work)
    worker.start()
    try:
        for name in ("a.ply", "./a.ply"):
            assert names.file(name, frozenset()).path == tmp_path / "a.ply"
    finally:
        ended.set()
        worker.join()


def test_too_much_time(tmp_path, monkeypatch):
    """An honest scene on a slow disk has a way out too."""
    monkeypatch.setattr(file_names, "MOST_SECONDS", -1.0)
    with pytest.raises(UseError, match="take out links, or give `trust=True`"):
        Names(Folder(tmp_path)).file("a.ply", frozenset())
