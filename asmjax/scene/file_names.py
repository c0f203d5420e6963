"""Names of files that a scene file gives: whether they stay inside its folder, how to show them.

Mitsuba looks a relative name up in the scene's folder first. It looks for its own plugins and data
there too, so a folder may not hold anything of their names.
"""

import os
from pathlib import Path

from asmjax.errors import UseError

SHADOWING = ("plugins", "data/ior", "data/sunsky", "data/srgb.coeff")
"""What in a scene's folder would take the place of the renderer's own code and data."""

LONGEST_SHOWN = 60
"""Characters of a text of unknown length in a message."""

TRUST = "or give `trust=True` if you trust the scene"
"""A remedy where an honest scene may be refused too."""


def shown(text: str) -> str:
    """`text` in quotes for a message: on one line, without control characters, not long."""
    whole = text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."
    return repr(whole)


class Folder:
    """A scene's folder, outside which nothing is opened."""

    def __init__(self, path: Path):
        self.path = Path(os.path.abspath(path))
        self._real = Path(os.path.realpath(path))

    def real_path(self, name: str) -> Path | None:
        """The file that `name` stands for, links followed, or None where it is outside.

        Links and `..` are followed as the system does it. What is outside by its name alone is not
        even looked for there.
        """
        if any(character < " " for character in name):
            return None
        named = Path(os.path.normpath(self.path / name))
        if not named.is_relative_to(self.path) and not named.is_relative_to(self._real):
            return None
        try:
            real = Path(os.path.realpath(self.path / name))
        except (OSError, ValueError):
            return None
        return real if real.is_relative_to(self._real) and real != self._real else None

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
