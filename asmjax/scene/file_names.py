"""Names of files that a scene file gives: whether they stay inside its folder, how to show them.

Mitsuba looks a relative name up in the scene's folder first. It looks for its own plugins and data
there too, so a folder may not hold anything of their names.
"""

import os
import stat
import time
from collections.abc import Set
from pathlib import Path
from typing import NamedTuple

from asmjax.errors import UseError, require

SHADOWING = ("plugins", "data/ior", "data/sunsky", "data/srgb.coeff")
"""What in a scene's folder would take the place of the renderer's own code and data."""

LONGEST_SHOWN = 60
"""Characters of a text of unknown length in a message."""

LONGEST_NAME = 4095
"""Characters of a file's name with its folders: Linux opens none of more bytes."""

MOST_FOLDERS = 64
"""Folders of a name, and those around a file: the system looks them all up for each."""

MOST_LOOKS = 20_000
"""Names of files, each counted once in each folder in which it is looked for."""

MOST_SECONDS = 5.0
"""Processor time to look for files; `MOST_LOOKS` take less than 1 s, but for long ways of links."""

TRUST = "or give `trust=True` if you trust the scene"
"""A remedy where an honest scene may be refused too."""


def shown(text: str) -> str:
    """`text` in quotes for a message: on one line, without control characters, not long."""
    whole = text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."
    return repr(whole)


def has_control(name: str) -> bool:
    """Whether `name` has a character below the space, as a NUL or a line break."""
    return any(character < " " for character in name)


def _followed(path: Path) -> Path | None:
    """Where `path` leads by its links, whether or not there is a file; None where that cannot be
    told."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError, RecursionError):  # the last of a long chain of links
        return None


class Folder:
    """A scene's folder, outside which nothing is opened."""

    def __init__(self, path: Path):
        self._given = path.absolute()
        self._real = Path(os.path.realpath(path))
        # A `..` after a link leads elsewhere than the text of the path says.
        plain = Path(os.path.abspath(path))
        self.path = plain if Path(os.path.realpath(plain)) == self._real else self._real

    def real_path(self, name: str) -> Path | None:
        """The file that `name` stands for, links followed, or None where it is outside.

        Links and `..` are followed as the system does it. What is outside by its name alone is not
        even looked for there.
        """
        if Path(name).is_relative_to(self._given):
            name = str(Path(name).relative_to(self._given))
        # To follow a name takes time by the square of its length.
        if len(name) > LONGEST_NAME or has_control(name):
            return None
        named = Path(os.path.normpath(self.path / name))
        if not named.is_relative_to(self.path) and not named.is_relative_to(self._real):
            return None
        real = _followed(self.path / name)
        if real is None or real == self._real or not real.is_relative_to(self._real):
            return None
        return real

    def relative(self, path: Path) -> str:
        """The name of a file inside the folder, from the folder on."""
        return str(path.relative_to(self._real))

    def is_named_by(self, name: str, value: str) -> bool:
        """Whether a text called `name` is the name of a file: by what it is called, by its slashes,
        or because there is such a file."""
        if name.replace("_", "").lower().endswith("filename"):
            return True
        if "/" in value or "\\" in value:
            return True
        there = self.path / value
        return len(value) < 256 and os.path.lexists(there) and not os.path.isdir(there)

    def check_nothing_shadows(self) -> None:
        """Raise `UseError` where the folder holds what Mitsuba would take for its own."""
        for name in SHADOWING:
            if os.path.lexists(self.path / name):
                raise UseError(
                    f"{shown(name)} stands beside the scene file in {shown(self.path.name)}, and "
                    "Mitsuba would take code or data from there in place of its own; move it away, "
                    f"{TRUST}."
                )


class Found(NamedTuple):
    """A file that a scene names.

    Attributes:
        path: of the file, links followed.
        folders: in which it stands, and where links to it stand that Mitsuba may come by.
    """

    path: Path
    folders: frozenset[Path]


class Names:
    """The files that a scene names, each looked for once."""

    def __init__(self, folder: Folder):
        self._folder = folder
        self._known: dict[tuple[str, Set[Path]], Found] = {}
        self._looks, self._seconds = 0, 0.0

    def file(self, name: str, before: Set[Path]) -> Found:
        """The regular file inside the scene's folder that `name` stands for.

        Args:
            before: folders in which Mitsuba looks first. There may be no other file of that name.

        Raises:
            UseError: there is none, or too much was looked for; without the place in the scene.
        """
        key = name, before
        if key not in self._known:
            # Other threads may be at work meanwhile.
            begun = time.thread_time()
            self._known[key] = self._found(name, before)
            self._seconds += time.thread_time() - begun
        return self._known[key]

    def _found(self, name: str, before: Set[Path]) -> Found:
        require(
            len(name) <= LONGEST_NAME and name.count("/") <= MOST_FOLDERS,
            f"names a file in {len(name):,} characters and {name.count('/'):,} folders, "
            f"{shown(name)}; allowed are {LONGEST_NAME:,} and {MOST_FOLDERS}; mend the scene.",
        )
        self._looks += 1 + len(before)
        require(
            self._looks <= MOST_LOOKS,
            f"makes Mitsuba look for more than {MOST_LOOKS:,} files; merge meshes, {TRUST}.",
        )
        require(
            self._seconds <= MOST_SECONDS,
            f"names files that take more than {MOST_SECONDS:g} s to be found; take out links, "
            f"{TRUST}.",
        )
        require(name != "", "names a file without giving its name; mend the scene.")
        require(
            not has_control(name),
            f"names the file {shown(name)}, which has a line break or another control character; "
            "give it another name.",
        )
        real = self._folder.real_path(name)
        if real is None:
            raise UseError(
                f"names the file {shown(name)}, which is outside the scene's folder; put it inside "
                f"and mend the name, {TRUST}."
            )
        require(
            self._folder.relative(real).count("/") <= MOST_FOLDERS,
            f"names the file {shown(name)}, which is deeper than {MOST_FOLDERS} folders; move it.",
        )
        try:
            mode = real.stat().st_mode
        except (OSError, ValueError) as problem:
            raise UseError(
                f"names the file {shown(name)}, which is not in the scene's folder; put it there, "
                "or mend the scene."
            ) from problem
        require(
            stat.S_ISREG(mode),
            f"names {shown(name)}, which is no regular file; name a file, or mend the scene.",
        )
        others = [folder / name for folder in before if os.path.lexists(folder / name)]
        for other in others:
            require(
                _followed(other) == real,
                f"names {shown(name)}, which is in the scene's folder and beside an included file "
                "too; give one of them another name.",
            )
        ways = (real, self._folder.path / name, *others)
        return Found(real, frozenset(way.parent for way in ways))
