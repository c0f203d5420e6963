"""Thousands of mutations of real XML, PLY and OBJ: each loads or is refused in one line.

`ASMJAX_TEST_HARD=1` tries ten times as many.
"""

import random
import shutil
from collections import Counter
from pathlib import Path

import pytest
from helpers.effort import effort
from helpers.mitsuba_scenes import REAL_SCENES

from asmjax.errors import UseError
from asmjax.render.untrusted import Trial, examine
from hostile.building import BALL, film_xml, mesh_xml, obj, parts_scene, ply, text_ply
from hostile.loading import loaded_apart
from hostile.mutations import mutated
from hostile.watching import foreign, opened_files

pytestmark = pytest.mark.timeout(1800)

COUNT = effort(2_000, 20_000)

FAN = [(float(k), float(k * k % 7), 4.0) for k in range(12)]
TRIANGLES = [(0, k, k + 1) for k in range(1, 11)]
LOADED = effort(6, 60)
"""Mutations of each scene that are loaded as a job loads them."""

CORNELL = REAL_SCENES / "cornell_box"
MUNICH = REAL_SCENES / "munich/meshes"
REAL = CORNELL.is_dir() and MUNICH.is_dir()

RICH_OBJ = (
    "# all that an OBJ file may have\nmtllib none.mtl\no box\ng side\nusemtl red\ns off\n"
    + "".join(f"v {x} {y} {z}\n" for x, y, z in FAN)
    + "vt 0 0\nvt 1 0\nvt 0.5 1\nvn 0 0 1\nvn 0 1 0\n"
    + "".join(f"f {a + 1}/1/1 {b + 1}/2/1 {c + 1}/3/2\n" for a, b, c in TRIANGLES)
    + "f 1//1 2//1 3//2\nf 1/1 2/2 3/3\nf 1 2 3 4\n"
)


def made_scene(folder: Path) -> Path:
    """One of each that the project can read, with an include, parameters and a material."""
    words = "".join(f"{x} {y} {z}\n" for x, y, z in FAN)
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in TRIANGLES)
    (folder / "text.ply").write_bytes(text_ply(words, faces))
    (folder / "little.ply").write_bytes(ply(FAN, TRIANGLES))
    (folder / "big.ply").write_bytes(ply(FAN, TRIANGLES, order=">", kind="d"))
    (folder / "plain.obj").write_bytes(obj())
    (folder / "rich.obj").write_text(RICH_OBJ)
    inner = (
        '<scene version="3.0.0">\n<bsdf type="diffuse" id="grey">\n'
        '<rgb name="reflectance" value="$shade, 0.5, 0.5"/>\n</bsdf>\n</scene>\n'
    )
    (folder / "inner.xml").write_text(inner)
    return parts_scene(
        folder,
        '<default name="shade" value="0.5"/>',
        '<include filename="inner.xml"/>',
        '<shape type="sphere"><ref id="grey"/><transform name="to_world">'
        '<scale value="2"/><rotate x="1" angle="30"/><translate x="1" y="2" z="9"/>'
        '<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform></shape>',
        BALL,
        film_xml("width", "64"),
        *(mesh_xml(name) for name in ("text.ply", "little.ply", "big.ply")),
        *(mesh_xml(name, "obj") for name in ("plain.obj", "rich.obj")),
    )


def real_scene(folder: Path) -> Path:
    """The Cornell box: one scene file and eight OBJ files."""
    shutil.copytree(CORNELL / "meshes", folder / "meshes")
    shutil.copy(CORNELL / "cornell_box.xml", folder / "scene.xml")
    return folder / "scene.xml"


def real_meshes(folder: Path) -> Path:
    """A few small meshes of the city, as their makers wrote them."""
    small = sorted(path for path in MUNICH.glob("*.ply") if path.stat().st_size < 1000)[::40][:8]
    for path in small:
        shutil.copyfile(path, folder / path.name)
    return parts_scene(folder, *(mesh_xml(path.name) for path in small))


@pytest.mark.parametrize(
    ("make", "share"), [(made_scene, 0.5), (real_scene, 0.25), (real_meshes, 0.25)]
)
def test_mutations(make, share, tmp_path, opens):
    """No mutation ends this process, takes more than a line to refuse, or makes this process or the
    child open files elsewhere; what is let through can be loaded, or is refused in one line."""
    if make is not made_scene and not REAL:
        pytest.skip("not here: docs/other_scenes.md; the made scene has their share")
    count = int(COUNT * (share if REAL else 1.0))
    folder = tmp_path / "scene"
    folder.mkdir()
    path = make(folder)
    originals = {file: file.read_bytes() for file in sorted(folder.rglob("*.*"))}
    # The scene itself as often as all meshes together.
    weights = [1.0 if file.suffix == ".xml" else 1 / len(originals) for file in originals]
    chance = random.Random(20260406)
    ends, mutations, let_through = Counter(), Counter(), []
    with Trial() as trial, opened_files() as opened:
        examine(path, trial)
        for number in range(count):
            file = chance.choices(list(originals), weights)[0]
            content = mutated(originals[file], chance)
            file.write_bytes(content)
            mutations[file.suffix] += 1
            try:
                examine(path, trial)
                ends["loaded"] += 1
                if content != originals[file] and len(let_through) < LOADED:
                    copy = shutil.copytree(folder, tmp_path / f"copy{number}")
                    let_through.append(copy / path.name)
            except UseError as problem:
                message = str(problem)
                assert message.isprintable() and len(message) < 700, (number, file.name, message)
                ends["crashed" if "crashed" in message else "refused"] += 1
            file.write_bytes(originals[file])
        examine(path, trial)
    assert ends.total() == count
    assert ends["loaded"] > 0.05 * count and ends["refused"] > 0.2 * count, ends
    assert not foreign(opened)
    if opens is not None:
        assert str(path) in opens.paths() and not foreign(opens.paths())
    told = loaded_apart(let_through)
    assert all(line.isprintable() and len(line) < 700 for line in told)
    ends["loaded as by a job"] = told.count("loaded")
    assert ends["loaded as by a job"] > 0
    print(make.__name__, dict(ends), dict(mutations), [x for x in told if x != "loaded"])
