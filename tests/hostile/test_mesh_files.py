"""Mesh files are read in pieces: little memory, and the verdict of one piece."""

import tracemalloc

import pytest

from asmjax.errors import UseError
from asmjax.scene import mesh_files
from asmjax.scene.mesh_files import check_mesh_file
from hostile.building import CORNERS, obj, ply, text_ply
from hostile.corpus import OBJ_FILES, PLY_FILES

MOST_BYTES = {"text": 16 * 2**20, "binary": 2 * 2**20}

MANY = 300_000

LARGE = {
    "PLY": ("text", "ply", text_ply(faces="3 0 1 2\n" * MANY)),
    "PLY of vertices": ("text", "ply", text_ply(vertices="0 0 1\n1 0 0\n" * MANY)),
    "OBJ": ("text", "obj", obj(faces="f 1 2 3\n" * MANY)),
    "OBJ of vertices": ("text", "obj", obj(vertices="v 0 0 1\nv 1 0 0\n" * MANY)),
    "binary PLY of vertices": ("binary", "ply", ply(CORNERS * MANY, kind="d")),
}
"""Of short words, which take the most memory for their bytes; and of numbers to be rounded."""


@pytest.mark.parametrize("name", LARGE)
def test_files_take_little_memory(name, tmp_path):
    """Whatever their size: whole, those of text would take 18 times of it."""
    form, kind, content = LARGE[name]
    path = tmp_path / f"mesh.{kind}"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        check_mesh_file(path, kind, path.name)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < MOST_BYTES[form] < 10 * len(content), (peak, len(content))


def verdict(path, kind: str) -> str:
    try:
        check_mesh_file(path, kind, path.name)
    except UseError as problem:
        return str(problem)
    return "let through"


LONG = ("a very long line", "a PLY file")
"""Lines longer than the pieces here, which would be refused for that."""

SMALL = {
    f"{kind}: {name}": (kind, case)
    for kind, cases in (("ply", PLY_FILES), ("obj", OBJ_FILES))
    for name, case in cases.items()
    if name not in LONG
}


@pytest.mark.parametrize("name", SMALL)
def test_pieces_change_no_verdict(name, tmp_path, monkeypatch):
    """Words and lines that are cut by the end of a piece are put together again."""
    kind, case = SMALL[name]
    case.make(tmp_path, tmp_path)
    path = tmp_path / f"mesh.{kind}"
    whole = verdict(path, kind)
    monkeypatch.setattr(mesh_files, "ROWS", 1)
    monkeypatch.setattr(mesh_files, "SLICE", 1)
    for piece in range(32, 48):
        monkeypatch.setattr(mesh_files, "PIECE", piece)
        assert verdict(path, kind) == whole


@pytest.mark.parametrize("kind", ["ply", "obj"])
def test_pieces_of_harmless_text(kind, tmp_path, monkeypatch):
    """Of a file with many records, and of one that ends without a line break."""
    faces = {"ply": "3 0 1 2\n" * 50, "obj": "f 1/1/1 2/2/2 3/3/3 # x\n" * 50}[kind]
    content = {"ply": text_ply, "obj": obj}[kind](faces=faces)
    path = tmp_path / f"mesh.{kind}"
    monkeypatch.setattr(mesh_files, "ROWS", 7)
    for piece in range(32, 64):
        monkeypatch.setattr(mesh_files, "PIECE", piece)
        for given in (content, content.rstrip()):
            path.write_bytes(given)
            assert verdict(path, kind) == "let through"
