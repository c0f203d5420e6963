"""Scenes that the project did not make: some of its numbers are of them, where they are at hand.

docs/other_scenes.md says whose they are, where to get them, and how they are laid out.
"""

import os
from pathlib import Path

from asmjax.errors import require

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "scenes"
"""Where they are looked for without `ASMJAX_SCENES`: beside the project's folder."""

OTHER_SCENES = {
    "breakfast_room": "breakfast_room/breakfast_room.xml",
    "cornell_box": "cornell_box/cornell_box.xml",
    "japanese_classroom": "japanese_classroom/japanese_classroom.xml",
    "munich": "munich/munich.xml",
    "munich_merged": "munich/munich_merged.xml",
    "victorian_house": "victorian_house/victorian_house.xml",
    "radio_tower": "meshes/radio_tower.ply",
    "shadow_columns": "meshes/shadow_columns.ply",
    "stanford_bunny_16k": "meshes/stanford_bunny_16k.ply",
    "utah_teapot": "meshes/utah_teapot.ply",
}
"""Names to files, in the folder of all of them."""


def scenes_dir() -> Path:
    """The folder of these scenes: `ASMJAX_SCENES` if set, else `BESIDE`, which may not be there.

    Raises:
        UseError: `ASMJAX_SCENES` is set, and no folder.
    """
    named = os.environ.get("ASMJAX_SCENES")
    if not named:
        return BESIDE
    require(
        Path(named).is_dir(),
        f"ASMJAX_SCENES is '{named}', which is no folder; name the one with the scenes of "
        "docs/other_scenes.md, or unset it.",
    )
    return Path(named)


def other_scene(name: str) -> Path | None:
    """The file of one of `OTHER_SCENES`; None where it is not there.

    Raises:
        UseError: as `scenes_dir`.
    """
    path = scenes_dir() / OTHER_SCENES[name]
    return path if path.is_file() else None


def why_left_out(name: str) -> str:
    """What is told of one that is not there."""
    return f"there is no {OTHER_SCENES[name]} in the folder of other scenes (docs/other_scenes.md)"
