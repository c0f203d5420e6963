"""The child process in which scenes are loaded first: its end is one line, and the next begins."""

import os
import signal
import struct
import subprocess
import sys
import types
import zlib
from pathlib import Path

import numpy as np
import pytest

from asmjax import cli
from asmjax.errors import UseError
from asmjax.machine import process_bytes
from asmjax.memory import Limit
from asmjax.render import untrusted
from asmjax.render.load import load_scene
from asmjax.render.untrusted import Trial, admit, examine
from asmjax.scene import mesh_files
from hostile.building import BALL, mesh_scene, mesh_xml, obj, parts_scene, ply, text_ply
from hostile.corpus import nested

pytestmark = pytest.mark.timeout(120)

WILD = ply(faces=[(0, 1, 2**30)])
"""A mesh that makes Mitsuba read far outside its vertices."""


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path):
    """Each test remembers for itself."""
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(tmp_path / "cache"))


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "scene"
    path.mkdir()
    return path


def refusal(action) -> str:
    with pytest.raises(UseError) as problem:
        action()
    message = str(problem.value)
    assert message.isprintable() and len(message) < 700
    return message


def test_the_child_reads_for_itself(folder):
    """Plugins and files are looked at once more where Mitsuba's reader has found them."""
    cases = {
        '<shape type="../evil"/>': "unknown plugin type '../evil'",
        '<shape type="blender"/>': "unknown plugin type 'blender'",
        mesh_xml("/etc/passwd"): "'/etc/passwd', which is outside",
    }
    with Trial() as trial:
        for part, says in cases.items():
            assert says in refusal(lambda p=part: trial.load(parts_scene(folder, p), 1000))


def test_more_than_the_memory(folder):
    """A file of holes, small on disk, is not read to its end."""
    (folder / "mesh.ply").write_bytes(ply())
    os.truncate(folder / "mesh.ply", 2**43)
    assert "8,192.0 GiB, more than" in refusal(
        lambda: admit(parts_scene(folder, mesh_xml("mesh.ply")))
    )


@pytest.mark.parametrize("kind", ["ply", "obj"])
def test_text_too_large_for_this_process_is_left_to_the_child(kind, folder, monkeypatch):
    """An index beyond the vertices is found there."""
    monkeypatch.setattr(mesh_files, "MOST_TEXT", 10)
    wild = {"ply": text_ply(faces="3 0 1 1073741824\n"), "obj": obj(faces="f 1 2 1073741824\n")}
    path = mesh_scene(folder, wild[kind], kind)
    with Trial() as trial:
        message = refusal(lambda: examine(path, trial))
    assert "crashed Mitsuba's loader" in message or "invalid vertex" in message, message


def test_a_crash_is_one_line_and_the_next_scene_loads(folder):
    """A face index that crashes Mitsuba, were it not checked before."""
    with Trial() as trial:
        wild = mesh_scene(folder, WILD)
        for _ in range(2):
            message = refusal(lambda: trial.load(wild, 1000))
            assert "'scene.xml' crashed Mitsuba's loader (signal 11, SIGSEGV)" in message
        trial.load(parts_scene(folder, BALL), 1000)


def test_mitsubas_reader_crashes_where_the_scan_refuses(folder):
    """Why the scan limits the depth: Mitsuba alone does not survive it."""
    with Trial() as trial:
        message = refusal(lambda: trial.load(parts_scene(folder, nested(200_000)), 1000))
        assert "crashed Mitsuba's loader" in message


def test_an_index_slightly_too_large_is_found_after_loading(folder):
    """Mitsuba takes it; the child looks at what was loaded, in shape groups too."""
    (folder / "mesh.ply").write_bytes(ply(faces=[(0, 1, 3)]))
    # Without normals to compute, for which Mitsuba would write beyond its vertices.
    flat = '<boolean name="face_normals" value="true"/></shape>'
    mesh = mesh_xml("mesh.ply").replace("</shape>", flat)
    group = f'<shape type="shapegroup" id="g">{mesh}</shape>'
    instance = '<shape type="instance"><ref id="g"/></shape>'
    with Trial() as trial:
        for parts in ((mesh,), (group, instance)):
            message = refusal(lambda p=parts: trial.load(parts_scene(folder, *p), 1000))
            assert "mesh with vertex 3 of 3" in message


def test_time_runs_out(folder):
    """A loader that does not end in time is ended, and another one begins."""
    path = parts_scene(folder, BALL)
    with Trial() as trial:
        trial.load(path, 1000)
        assert "took Mitsuba's loader more than" in refusal(lambda: trial.load(path, 0, seconds=0))
        trial.load(path, 1000)


def png(side: int) -> bytes:
    """A black image of `side` x `side` pixels, small as a file."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        body = kind + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    pixels = zlib.compress(b"\0" * (side * (3 * side + 1)), 9)
    head = struct.pack(">2I5B", side, side, 8, 2, 0, 0, 0)
    begin = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head)
    return begin + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def test_a_small_file_that_needs_much_memory(folder, monkeypatch):
    """A compressed image whose pixels do not fit the address space is refused, not swapped."""
    (folder / "a.png").write_bytes(png(8000))
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/>'
    path = parts_scene(folder, f'<bsdf type="diffuse">{texture}</texture></bsdf>', BALL)
    assert (folder / "a.png").stat().st_size < 2**20
    monkeypatch.setattr(untrusted, "LEAST_MEMORY", 2**29)
    with Trial() as trial:
        message = refusal(lambda: examine(path, trial))
        assert "Mitsuba can load" in message or "memory" in message or "crashed" in message
        examine(parts_scene(folder, BALL), trial)


def test_an_unchanged_scene_is_loaded_twice_only_once(folder, monkeypatch):
    """Its verdict hangs on the contents of all its files, and a refusal is not remembered."""
    children = []
    original = subprocess.Popen
    monkeypatch.setattr(
        subprocess, "Popen", lambda *a, **k: (children.append(a), original(*a, **k))[1]
    )
    path = mesh_scene(folder, ply())
    for _ in range(3):
        admit(path)
    assert len(children) == 1
    (folder / "mesh.ply").write_bytes(ply(vertices=((0, 0, 4), (2, 0, 4), (0, 1, 4))))
    admit(path)
    assert len(children) == 2
    (folder / "mesh.ply").write_bytes(WILD)
    for _ in range(2):
        assert "vertex 1073741824" in refusal(lambda: admit(path))
    assert len(children) == 2


def test_a_cache_that_cannot_be_written_is_done_without(folder, monkeypatch):
    monkeypatch.setenv("ASMJAX_CACHE_DIR", "/dev/null/cache")
    admit(parts_scene(folder, BALL))


def test_a_child_that_does_not_start(folder, monkeypatch):
    """One line too, and no scene is let through."""
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert "does not start" in refusal(lambda: admit(parts_scene(folder, BALL)))
    monkeypatch.setattr(sys, "executable", "/no/python")
    assert "no process could be started" in refusal(lambda: admit(parts_scene(folder, BALL)))


def test_a_child_ends_with_its_parent(folder):
    """Which closes its input by ending."""
    code = (
        "import os, sys; from pathlib import Path; from asmjax.render.untrusted import Trial\n"
        "trial = Trial(); trial.load(Path(sys.argv[1]), 1000)\n"
        "print(trial._child.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    path = parts_scene(folder, BALL)
    parent = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert parent.returncode == -signal.SIGKILL
    child = Path(f"/proc/{int(parent.stdout)}/stat")
    for _ in range(100):
        if not child.exists() or child.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            return
        import time

        time.sleep(0.1)
    os.kill(int(parent.stdout), signal.SIGKILL)
    pytest.fail("the child still runs")


def test_the_command_line_says_it_in_one_line(folder, monkeypatch, capsys):
    """Exit code 2, and no traceback."""
    monkeypatch.setattr(cli, "prepare_to_measure", lambda: None)
    job = types.ModuleType("asmjax.main_job")
    vars(job)["run_main_job"] = lambda options: admit(Path(options.scene))
    monkeypatch.setitem(sys.modules, "asmjax.main_job", job)
    path = parts_scene(folder, BALL.replace("sphere", "../evil&#x85;"))
    assert cli.main(["run", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith("asmjax: error: ") and "'../evil" in said


LOAD = """
import sys
from asmjax import cli
from asmjax.errors import UseError
from asmjax.render.load import load_scene
for trust in (True, False):
    try:
        load_scene(sys.argv[1], "scalar_rgb", trust=trust)
    except UseError as problem:
        print(problem)
"""


def test_a_trusted_scene_is_not_checked(folder):
    """Mitsuba itself says what is wrong, once it has tried."""
    path = parts_scene(folder, BALL.replace("sphere", "../evil"))
    end = subprocess.run(
        [sys.executable, "-c", LOAD, path], capture_output=True, text=True, check=True
    )
    trusted, checked = end.stdout.splitlines()
    assert "Mitsuba can load" in trusted and "unknown plugin type '../evil'" in checked


def test_messages_are_one_printable_line():
    """Whatever they quote: no escape sequence reaches a terminal."""
    assert str(UseError("a\nb\x1b[2J\x00\udc80 é")) == "a b\\x1b[2J\\x00\\udc80 é"


def test_secrets_stay_in_this_process(monkeypatch):
    """A child gets what it needs of the environment, and no more."""
    monkeypatch.setenv("MY_PASSWORD", "xyz")
    given = untrusted._environment()
    assert "MY_PASSWORD" not in given and given["PATH"] == os.environ["PATH"]


def test_loading_keeps_to_the_limit_of_memory(folder):
    """What loading took is measured in the child and compared with the limit, the second time from
    the record; a child that would take more than is left is refused there."""
    count = 200
    grid = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2)
    vertices = [(float(x), float(y), 4.0) for x, y in grid.tolist()]
    corner = [k for k in range(count * (count - 1)) if k % count < count - 1]
    path = mesh_scene(folder, ply(vertices, [(k, k + 1, k + count) for k in corner]))
    took = admit(path).bytes
    assert 2**20 < took < 2**28
    assert admit(path).bytes == took
    held = process_bytes()
    load_scene(path, limit=Limit(held + took + 2**20, held, "the test"))
    message = refusal(lambda: load_scene(path, limit=Limit(held + took // 2, held, "the test")))
    assert "renderer memory for scene 'scene.xml'" in message and "raise `max_memory_mb`" in message
    (folder / "a.png").write_bytes(png(8000))
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/>'
    path = parts_scene(folder, f'<bsdf type="diffuse">{texture}</texture></bsdf>', BALL)
    message = refusal(lambda: admit(path, room=2**20))
    assert "Mitsuba can load" in message or "memory" in message or "crashed" in message
    admit(path)
