"""Measurements are of a scene's content: an edited file is another scene, whatever its name."""

from pathlib import Path

import pytest
from test_main_job import scene_file

from asmjax.errors import UseError
from asmjax.options import CompareOptions
from asmjax.preparation import bench_of
from asmjax.render.content import content_of
from asmjax.render.load import load_scene


@pytest.mark.mitsuba
def test_an_edited_scene_is_measured_anew(tmp_path):
    """A cube that moves within the scene's box: the same name, triangles, bounds, view and light,
    but other shadows. The same text again is the same scene."""
    path = Path(scene_file(tmp_path))
    first = path.read_text(encoding="utf-8")
    moved = first.replace('<translate x="0" y="0" z="1"/>', '<translate x="0.3" y="0" z="1"/>')
    assert moved != first
    facts, bounds = [], []
    for text in (first, moved, first):
        path.write_text(text, encoding="utf-8")
        options = CompareOptions(scene=str(path), size=(8, 8))
        scene = load_scene(options.scene)
        bench = bench_of(scene, scene.view(None).resized(8, 8), options, 1)
        facts.append(bench.facts)
        bounds.append(scene.geometry.bounds.tolist())
    assert bounds[0] == bounds[1]
    different = {name for name in facts[0] if facts[0][name] != facts[1][name]}
    assert different == {"content"}
    assert facts[0] == facts[2]


def test_a_mesh_beside_the_scene_is_content_too(tmp_path):
    """Its bytes count, not its place; a built-in scene is its code."""
    text = (
        '<scene version="3.0.0"><shape type="obj"><string name="filename" value="a.obj"/></shape>'
    )
    known = []
    for name, corner in (("one", 1), ("two", 1), ("three", 2)):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "scene.xml").write_text(f"{text}</scene>", encoding="utf-8")
        (folder / "a.obj").write_text(f"v 0 0 0\nv {corner} 0 0\nv 0 1 0\nf 1 2 3\n")
        known.append(content_of(str(folder / "scene.xml")))
    assert known[0] == known[1] != known[2]
    assert content_of("paper_room") != content_of("letter_f")
    with pytest.raises(UseError, match="no scene file"):
        content_of(str(tmp_path / "none.xml"))
