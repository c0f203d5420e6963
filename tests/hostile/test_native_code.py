"""No native library of a stranger is loaded: neither beside the scene nor in the current folder."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from asmjax.errors import UseError
from asmjax.render.untrusted import Trial, examine
from hostile.building import BALL, parts_scene, text_scene
from hostile.corpus import shape

pytestmark = pytest.mark.timeout(120)

SOURCE = """
#include <stdio.h>
__attribute__((constructor)) static void loaded(void) {
    FILE *mark = fopen("%s", "w");
    if (mark) fclose(mark);
}
"""


@pytest.fixture(scope="module")
def evil(tmp_path_factory):
    """A library that leaves a mark when it is loaded, and the mark."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: gcc or cc")
    folder = tmp_path_factory.mktemp("evil")
    mark, source, library = folder / "mark", folder / "evil.c", folder / "evil.so"
    source.write_text(SOURCE % mark)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
    return library, mark


@pytest.fixture
def mark(evil):
    """The mark, removed before and after."""
    evil[1].unlink(missing_ok=True)
    yield evil[1]
    evil[1].unlink(missing_ok=True)


LOAD = """
import sys
import mitsuba as mi
mi.set_variant("scalar_rgb")
try:
    mi.load_file(sys.argv[1])
except Exception:
    pass
"""

ACTIVATE = """
from asmjax.render.variant import activate
mi = activate("scalar_rgb")
mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
"""

PROBE = "from asmjax.render import llvm; llvm.probe(refresh=True)"


def run(code: str, folder: Path, *arguments: str | Path) -> None:
    subprocess.run(
        [sys.executable, "-P", "-c", code, *arguments], cwd=folder, check=True, capture_output=True
    )


def with_plugin(folder: Path, evil) -> Path:
    (folder / "plugins").mkdir()
    shutil.copy(evil[0], folder / "plugins/sphere.so")
    return folder


def test_mitsuba_alone_would_load_it(tmp_path, evil, mark):
    """What the other tests try is a real attack."""
    with_plugin(tmp_path, evil)
    run(LOAD, Path("/"), parts_scene(tmp_path, BALL))
    assert mark.exists()


def attacks(folder: Path, library: Path) -> list[Path]:
    """Scenes that name the library in every way that Mitsuba knows."""
    beside, above, by_path = folder / "beside", folder / "above", folder / "by_path"
    for place in (beside, above, by_path):
        place.mkdir()
    (beside / "plugins").mkdir()
    shutil.copy(library, beside / "plugins/sphere.so")
    shutil.copy(library, above / "evil.so")
    (by_path / "elsewhere/plugins").mkdir(parents=True)
    shutil.copy(library, by_path / "elsewhere/plugins/sphere.so")
    whole = library.with_suffix("")
    return [
        parts_scene(beside, BALL),
        parts_scene(above, shape("../evil")),
        text_scene(folder, f'<scene version="3.0.0" type="{whole}"/>'),
        parts_scene(by_path, '<path value="elsewhere"/>', BALL),
    ]


def test_it_is_not_loaded_by_a_scene(tmp_path, evil, mark):
    """Each way is refused, in the parent and before the child."""
    with Trial() as trial:
        for path in attacks(tmp_path, evil[0]):
            with pytest.raises(UseError):
                examine(path, trial)
    assert not mark.exists()


def test_the_child_does_not_load_it_either(tmp_path, evil, mark):
    """Were the scan to let a folder of plugins through, the child would take Mitsuba's own."""
    with_plugin(tmp_path, evil)
    with Trial() as trial:
        trial.load(parts_scene(tmp_path, BALL), 1000)
    assert not mark.exists()


@pytest.mark.parametrize("code", [ACTIVATE, PROBE], ids=["scene", "probe"])
def test_it_is_not_loaded_from_the_current_folder(code, tmp_path, evil, mark):
    """Where Mitsuba looks first: in a folder of downloads, even a built-in scene would run it."""
    with_plugin(tmp_path, evil)
    for name in ("hdrfilm", "direct", "perspective", "constant", "diffuse"):
        shutil.copy(evil[0], tmp_path / f"plugins/{name}.so")
    (tmp_path / "mitsuba.py").write_text("raise SystemExit('a stranger is imported')")
    run(code, tmp_path)
    assert not mark.exists()
