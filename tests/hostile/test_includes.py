"""Files that a harmless scene includes do not keep it from being loaded, whatever they hold."""

import pytest

from asmjax.errors import UseError
from asmjax.render.load import load_scene
from asmjax.render.parsed import ParsedScene
from asmjax.render.variant import activate
from hostile.building import BALL, parts_scene
from hostile.makers import include

pytestmark = [pytest.mark.mitsuba, pytest.mark.timeout(120)]

EMPTY = '<scene version="3.0.0"/>'
RADIUS = '<scene version="3.0.0"><default name="r" value="0.5"/></scene>'
BALL_OF_RADIUS = BALL.replace("</shape>", '<float name="radius" value="$r"/></shape>')

CASES = {
    "parameters only": ({"a.xml": RADIUS}, 0.5),
    "nothing": ({"a.xml": EMPTY}, 1.0),
    "a comment": ({"a.xml": '<scene version="3.0.0"><!-- later --></scene>'}, 1.0),
    "an include of parameters": (
        {"a.xml": f'<scene version="3.0.0">{include("sub/b.xml")}</scene>', "sub/b.xml": RADIUS},
        0.5,
    ),
    "an include of nothing, and a material": (
        {
            "a.xml": f'<scene version="3.0.0">{include("b.xml")}<bsdf type="diffuse"/></scene>',
            "b.xml": EMPTY,
        },
        1.0,
    ),
}
"""Files of a scene that includes the first of them, and the radius of its ball afterwards."""


@pytest.mark.parametrize("name", CASES)
def test_loads(name, tmp_path):
    """Mitsuba lists no files that make no node; the scan knows them all."""
    files, radius = CASES[name]
    for file, content in files.items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(content)
    rest = '<default name="r" value="1"/>'
    scene = load_scene(parts_scene(tmp_path, include("a.xml"), rest, BALL_OF_RADIUS))
    sides = scene.geometry.bounds[:, 1] - scene.geometry.bounds[:, 0]
    assert sides == pytest.approx(2 * radius, rel=1e-5)


def test_a_file_that_was_not_checked_is_refused(tmp_path):
    """What Mitsuba read beyond the files of the scan."""
    (tmp_path / "a.xml").write_text(f'<scene version="3.0.0">{BALL}</scene>')
    path = parts_scene(tmp_path, include("a.xml"))
    parsed = ParsedScene(activate(), path, "the scene")
    parsed.check_documents([path, tmp_path / "a.xml", tmp_path / "more.xml"])
    with pytest.raises(UseError, match="includes 1 files that were not checked"):
        parsed.check_documents([path])
