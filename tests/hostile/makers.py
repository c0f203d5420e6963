"""Makers of hostile scenes.

A maker gets an empty folder for the scene and another one outside it, and returns the scene's path.
Outside stand `secret.txt`, `mesh.ply` and `pipe`, a FIFO that would block whoever opens it.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from hostile.building import BALL, mesh_scene, parts_scene, scene_xml, text_scene

Maker = Callable[[Path, Path], Path]

NO_FILES: Mapping[str, str | bytes] = MappingProxyType({})


class Hostile(NamedTuple):
    """A maker, and a pattern that the message has."""

    make: Maker
    says: str


def text(content: str | bytes) -> Maker:
    """The whole scene file."""
    return lambda folder, outside: text_scene(folder, content)


def parts(*given: str) -> Maker:
    """What the scene has besides eye and lamp; OUTSIDE stands for the folder outside."""
    return lambda folder, outside: parts_scene(
        folder, *(part.replace("OUTSIDE", str(outside)) for part in given)
    )


def with_files(files: Mapping[str, str | bytes], *given: str) -> Maker:
    """As `parts`, with other files in the scene's folder."""

    def make(folder: Path, outside: Path) -> Path:
        for name, content in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
        return parts_scene(folder, *given)

    return make


def with_link(
    name: str, target: str, *given: str, files: Mapping[str, str | bytes] = NO_FILES
) -> Maker:
    """As `with_files`, with a symbolic link; OUTSIDE of its target as in `parts`."""

    def make(folder: Path, outside: Path) -> Path:
        path = with_files(files, *given)(folder, outside)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).symlink_to(target.replace("OUTSIDE", str(outside)))
        return path

    return make


def with_pipe(*given: str) -> Maker:
    """As `parts`, with a FIFO `pipe` in the scene's folder."""

    def make(folder: Path, outside: Path) -> Path:
        os.mkfifo(folder / "pipe")
        return parts_scene(folder, *given)

    return make


def mesh(content: bytes, kind: str = "ply") -> Maker:
    """One mesh file."""
    return lambda folder, outside: mesh_scene(folder, content, kind)


def scene_is_a_link(folder: Path, outside: Path) -> Path:
    (outside / "scene.xml").write_text(scene_xml(BALL))
    (folder / "scene.xml").symlink_to(outside / "scene.xml")
    return folder / "scene.xml"


def scene_is_a_link_to_plugins(folder: Path, outside: Path) -> Path:
    (folder / "sub/plugins").mkdir(parents=True)
    (folder / "scene.xml").symlink_to(text_scene(folder / "sub", scene_xml(BALL)))
    return folder / "scene.xml"


def scene_is_a_pipe(folder: Path, outside: Path) -> Path:
    os.mkfifo(folder / "scene.xml")
    return folder / "scene.xml"


def scene_cannot_be_read(folder: Path, outside: Path) -> Path:
    path = text_scene(folder, scene_xml(BALL))
    path.chmod(0)
    if os.access(path, os.R_OK):  # as the superuser: a folder cannot be read by anyone
        path.unlink()
        path.mkdir()
    return path


def include_bomb(folder: Path, outside: Path) -> Path:
    """Each file includes the next one twice, which makes 2^13 of the last."""
    for k in range(13):
        twice = f'<include filename="level{k + 1}.xml"/>' * 2
        (folder / f"level{k}.xml").write_text(f'<scene version="3.0.0">{twice}</scene>')
    (folder / "level13.xml").write_text(f'<scene version="3.0.0">{BALL}</scene>')
    return parts_scene(folder, '<include filename="level0.xml"/>')


def nested(depth: int) -> str:
    return '<bsdf type="twosided">' * depth + "</bsdf>" * depth


def include(name: str) -> str:
    return f'<include filename="{name}"/>'


def shape(kind: str) -> str:
    return f'<shape type="{kind}"/>'
