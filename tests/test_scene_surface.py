"""The surface of any size: its triangles, its shape at every size, its names."""

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.folders import results_folder
from asmjax.geometry import fixed_frame, in_domain
from asmjax.options import RunOptions
from asmjax.render.load import load_scene
from asmjax.scene import builtin, mesh_tools, surface
from asmjax.scene.spec import Mesh


def meshes(triangles: int) -> dict[str, Mesh]:
    shapes = surface.make_surface(triangles).shapes
    return {shape.name: shape for shape in shapes if isinstance(shape, Mesh)}


@pytest.mark.parametrize("triangles", [4_000, 7_777, 10_000, 100_000, 1_000_000])
def test_as_many_triangles_as_asked_for(triangles):
    """Within 2 %, none of them without area, and the rings closed and outward."""
    scene = surface.make_surface(triangles)
    assert scene.triangles == pytest.approx(triangles, rel=0.02)
    for mesh in meshes(triangles).values():
        assert mesh_tools.face_areas(mesh).min() > 0.0
        if mesh.name != "sand" and triangles <= 10_000:
            assert mesh_tools.is_closed(mesh) and mesh_tools.signed_volume(mesh) > 0.0


def test_sand_is_the_same_at_every_size():
    """Vertices lie on the closed form, and cells of a finer sand on those of a coarse one."""
    gaps = []
    for triangles in (10_000, 40_000, 160_000):
        x, y, z = meshes(triangles)["sand"].vertices
        assert z == pytest.approx(surface.height(x, y), abs=1e-12)
        assert np.abs([x, y]).max() == pytest.approx(surface.HALF)
        columns = np.flatnonzero(np.diff(x) < 0)[0] + 1
        rows = x.size // columns
        corners = [a.reshape(rows, columns) for a in (x, y, z)]
        middle = [0.25 * (a[1:, 1:] + a[:-1, 1:] + a[1:, :-1] + a[:-1, :-1]) for a in corners]
        far = np.hypot(middle[0], middle[1])
        off = np.abs(middle[2] - surface.height(middle[0], middle[1])) / np.maximum(far, 0.1)
        gaps.append(np.sqrt(np.mean(off**2)))
    # Second order in the width of a cell, which halves each time.
    assert gaps[1] < 0.4 * gaps[0] and gaps[2] < 0.4 * gaps[1]


def test_rings_are_the_same_at_every_size():
    """Volume and box of all rings approach a limit, in the second order of the cells too."""
    volumes, boxes = [], []
    for triangles in (10_000, 40_000, 160_000, 640_000):
        rings = [m for name, m in meshes(triangles).items() if name != "sand"]
        volumes.append([mesh_tools.signed_volume(m) for m in rings])
        boxes.append([np.stack([m.vertices.min(axis=1), m.vertices.max(axis=1)]) for m in rings])
    change = np.abs(np.diff(volumes, axis=0)).max(axis=1) / np.max(volumes)
    # A ring of 10,000 triangles' scene has 5 sides, which inscribe 24 % less than a circle.
    assert change[0] < 0.3 and change[1] < 0.15 and change[2] < 0.05
    assert np.abs(np.subtract(boxes[-1], boxes[-2])).max() < 0.05


def test_light_shines_on_the_whole_sand():
    """Its field of view is fixed, so its frame rests while the eye walks, and holds everything."""
    light = surface.make_surface(10_000).lights["lamp"]
    assert light.kind == "point" and light.fov_deg is not None
    frame = fixed_frame(light.position, light.direction, light.fov_deg, 1e-3)
    for mesh in meshes(10_000).values():
        assert in_domain(frame, mesh.vertices).all()


def test_twelve_million():
    """How long that takes is for `bench_scenes` to say."""
    scene = surface.make_surface(12_000_000)
    assert scene.triangles == pytest.approx(12_000_000, rel=0.001)


@pytest.mark.parametrize(
    ("text", "triangles"),
    [("250000", 250_000), ("10k", 10_000), ("12m", 12_000_000), ("2.5M", 2_500_000),
     (" 7.25K ", 7_250)],
)  # fmt: skip
def test_sizes_that_are_read(text, triangles):
    """Thousands and millions, upper or lower case, with or without a fraction."""
    assert surface.SIZES.parse(text) == triangles


@pytest.mark.parametrize("text", ["", "m", "-5k", "1e6", "12x", "nan", "1,000", "10 k", "1" * 40])
def test_sizes_that_are_not(text):
    """One line with the allowed form; it does not repeat a long text."""
    with pytest.raises(UseError, match="write for example surface:10k") as problem:
        surface.SIZES.parse(text)
    assert len(str(problem.value)) < 250


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("surface:", "'' is no number of triangles"),
        ("surface:3999", "3999 triangles is not possible; allowed is 4000"),
        ("surface:101m", "101000000 triangles is not possible"),
        ("paper_room:10k", "'paper_room' has one size.*leave ':10k' out"),
        ("surfaces:10k", "Did you mean 'surface'"),
    ],
)
def test_names_that_are_not(name, message):
    """Sizes belong to the one scene that has them."""
    with pytest.raises(UseError, match=message):
        builtin.load_builtin(name)


def test_names_that_are():
    """The size belongs to the name; whatever begins with a scene's name and a colon is one."""
    assert builtin.load_builtin("surface:10k").name == "surface:10k"
    assert builtin.load_builtin("surface").triangles == surface.make_surface().triangles
    assert builtin.is_builtin("surface:anything") and builtin.is_builtin("paper_room")
    assert not builtin.is_builtin("scene.xml") and not builtin.is_builtin("C:scene.xml")


@pytest.mark.parametrize(
    ("scene", "folder"),
    [("surface:2.5m", "run-surface-2.5m"), ("paper_room", "run-paper_room"),
     ("some/where/house.xml", "run-house"), ("my.house.XML", "run-my.house"),
     ("some/villa/scene.xml", "run-villa")],
)  # fmt: skip
def test_results_are_kept_apart_by_size(scene, folder):
    """Each size has a folder of its own, and its name suits a file system."""
    assert results_folder(RunOptions(scene=scene)).path.name == folder


@pytest.mark.mitsuba
def test_loads_and_casts_shadows_at_every_scale():
    """Ten thousand triangles through the renderer: both light and shadow in every view."""
    scene = load_scene("surface:10k")
    assert scene.name == "surface:10k"
    assert scene.geometry.triangles == pytest.approx(10_000, rel=0.02)
    assert list(scene.views) == ["overview", "rings", "focus"]
    for view in scene.views.values():
        eye = scene.eye(view.resized(64, 64))
        lit = scene.shadow_rays(eye, scene.light_frame(eye), scene.light_rays()).trace()
        assert eye.valid.mean() > 0.7 and 0.3 < lit[eye.valid].mean() < 0.9


@pytest.mark.mitsuba
def test_a_wrong_size_is_one_line():
    """The scene's loader teaches too: it does not look for a file of that name."""
    with pytest.raises(UseError, match="write for example surface:10k"):
        load_scene("surface:12y")
