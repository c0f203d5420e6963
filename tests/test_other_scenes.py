"""Scenes that the project did not make: where they are looked for, and what is said of them."""

import re
from pathlib import Path

import pytest

from asmjax.errors import UseError
from asmjax.scene.other_scenes import BESIDE, OTHER_SCENES, other_scene, scenes_dir, why_left_out

ROOT = Path(__file__).parents[1]


def test_they_are_beside_the_project_or_where_a_variable_says(tmp_path, monkeypatch):
    monkeypatch.delenv("ASMJAX_SCENES", raising=False)
    assert scenes_dir() == BESIDE == ROOT.resolve().parent / "shared/scenes"
    monkeypatch.setenv("ASMJAX_SCENES", str(tmp_path))
    assert other_scene("munich") is None and "munich/munich.xml" in why_left_out("munich")
    (tmp_path / "munich").mkdir()
    (tmp_path / "munich/munich.xml").touch()
    assert other_scene("munich") == tmp_path / "munich/munich.xml"


def test_a_wrong_folder_is_told(tmp_path, monkeypatch):
    """And nothing is looked for elsewhere."""
    monkeypatch.setenv("ASMJAX_SCENES", str(tmp_path / "absent"))
    with pytest.raises(UseError, match="ASMJAX_SCENES is '.*absent', which is no folder; name"):
        other_scene("munich")


def test_the_page_has_all_of_them():
    """One row each, with its file; and nothing else."""
    page = (ROOT / "docs/other_scenes.md").read_text(encoding="utf-8")
    files = re.findall(r"^\| `([\w/]+\.\w+)` \|", page, re.MULTILINE)
    assert sorted(files) == sorted(OTHER_SCENES.values())
