"""`$parameters` mean to the scan what they mean to Mitsuba, whose own parser is the oracle."""

import random
from collections import Counter

import pytest

from asmjax.errors import UseError
from asmjax.render.untrusted import shipped_plugins
from asmjax.render.variant import activate
from asmjax.scene.scan import scan
from hostile.building import mesh_xml, parts_scene, ply

pytestmark = pytest.mark.mitsuba

NAMES = ("a", "ab", "abc", "b", "_", "a1")
PIECES = ("$a", "$ab", "$abc", "$b", "$_", "$a1", "\\$a", "\\$", "x", "-", "&#36;a", "")
ODD = ("$", "\\\\$ab", "&#x5c;$b", "$c", "$A", "\\")


def text(chance: random.Random, most: int) -> str:
    """Pieces that mostly mean something."""
    pieces = ODD if chance.random() < 0.1 else PIECES
    return "".join(chance.choices(pieces, k=chance.randint(0, most)))


def test_file_names_with_parameters(tmp_path):
    """Whatever the scan lets through, Mitsuba fills in to the very file that the scan found."""
    mi = activate()
    chance = random.Random(16)
    config = mi.parser.ParserConfig(mi.variant())
    ends = Counter()
    for number in range(300):
        folder = tmp_path / str(number)
        folder.mkdir()
        defaults = [
            f'<default name="{chance.choice(NAMES)}" value="{text(chance, 2)}"/>'
            for _ in range(chance.randint(1, 6))
        ]
        # The first default of a name counts; these make sure that there is one, early or late.
        place = chance.randint(0, len(defaults))
        defaults[place:place] = [f'<default name="{name}" value="{name}"/>' for name in NAMES]
        path = parts_scene(folder, *defaults, mesh_xml(f"m{text(chance, 4)}.ply"))
        try:
            state = mi.parser.parse_file(config, str(path))
            names = [
                node.props["filename"] for node in state.nodes if node.props.plugin_name() == "ply"
            ]
            (folder / names[0]).write_bytes(ply())
        except RuntimeError:
            names = []
        try:
            found = [file.path.name for file in scan(path, shipped_plugins()).references]
        except UseError:
            ends["refused by the scan" if names else "refused by both"] += 1
            continue
        assert found == names, path.read_text()
        ends["the same"] += 1
    assert ends["the same"] > 50 and ends["refused by both"] > 50, ends
