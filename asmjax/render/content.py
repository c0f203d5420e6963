"""What a scene consists of, as a text: equal for equal content, wherever the scene's files are.

A digest of the bytes of all files that a scene file reads; for a built-in scene its name and the
version, which stands for its code.
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import asmjax
from asmjax.errors import UseError, file_errors
from asmjax.render.load import scene_file
from asmjax.render.untrusted import shipped_plugins
from asmjax.scene.builtin import is_builtin
from asmjax.scene.file_names import shown
from asmjax.scene.scan import scan

DIGITS = 32
"""Hexadecimal ones of a digest."""


def content_of(scene: str, trust: bool = False) -> str:
    """What the scene of that name or path consists of.

    Args:
        trust: as of `file_content`.

    Raises:
        UseError: as `scene_file` and `file_content`.
    """
    return builtin_content(scene) if is_builtin(scene) else file_content(scene_file(scene), trust)


def builtin_content(name: str) -> str:
    """What a built-in scene consists of: its code, which the version names."""
    return f"built-in {name} of asmjax {asmjax.__version__}"


def file_content(path: Path, trust: bool = False) -> str:
    """What the scene file at `path` consists of: a digest of all files that it reads.

    Args:
        trust: also of a scene that `asmjax.scene.scan` would refuse: of the files that it names.

    Raises:
        UseError: as `scan`, or a file cannot be read.
    """
    if trust:
        return f"files {_digest(path.parent, _named_files(path))}"
    files = scan(path, shipped_plugins())
    everything = {*files.documents, *(reference.path for reference in files.references)}
    return f"files {_digest(path.parent.resolve(), everything)}"


def _digest(folder: Path, files: Iterable[Path]) -> str:
    """Of names, from the scene's folder on, and bytes."""
    named = {}
    for file in files:
        inside = file.is_relative_to(folder)
        named[file.relative_to(folder).as_posix() if inside else file.name] = file
    state = hashlib.sha256()
    for name, file in sorted(named.items()):
        failed = f"file {shown(str(file))} of the scene cannot be read"
        with file_errors(failed, "make it readable"), file.open("rb") as content:
            part = hashlib.file_digest(content, "sha256").hexdigest()
        state.update(f"{len(name)}:{name}:{part}\n".encode(errors="surrogateescape"))
    return state.hexdigest()[:DIGITS]


def _named_files(path: Path) -> list[Path]:
    """The scene file, what it includes, and every file that one of them names.

    Files that only a plugin of its own knows of are not found.
    """
    found, waiting = [], [path]
    while waiting:
        document = waiting.pop()
        if document in found:
            continue
        found.append(document)
        try:
            elements = ElementTree.parse(document).iter()
        except (OSError, ElementTree.ParseError) as problem:
            raise UseError(
                f"scene file {shown(str(document))} cannot be read ({problem}); mend it."
            ) from problem
        for element in elements:
            for name in _names(element):
                file = path.parent / name
                if file.is_file():
                    (waiting if element.tag == "include" else found).append(file)
    return list(dict.fromkeys(found))


def _names(element: ElementTree.Element) -> list[str]:
    """What an element says that may be the name of a file."""
    said = [element.get("filename")]
    if element.tag == "string":
        said.append(element.get("value"))
    return [name for name in said if name and len(name) < 4096 and "\0" not in name]
