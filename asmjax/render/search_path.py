"""Where Mitsuba looks for plugins and files: in its own package first, so that nothing of the same
name in the current folder or beside a scene file runs in its place.

Mitsuba 3.9 begins with the current folder, for native plugins too: a file `plugins/sphere.so` there
would be loaded and run.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def look_in_package_first(mi) -> None:
    """Put Mitsuba's own package before all other folders, for the rest of the process."""
    mi.file_resolver().prepend(str(Path(mi.__file__).parent))


@contextmanager
def only_beside(mi, scene_file: Path) -> Iterator[None]:
    """Within, files are those of Mitsuba's package and of the scene's folder, never of the current
    one. Scenes must be parsed and made in here: `mi.parser` knows no folder of its own."""
    resolver = mi.file_resolver()
    before = [str(folder) for folder in resolver]
    resolver.clear()
    resolver.append(str(Path(mi.__file__).parent))
    resolver.append(str(scene_file.absolute().parent))
    try:
        yield
    finally:
        resolver.clear()
        for folder in before:
            resolver.append(folder)
