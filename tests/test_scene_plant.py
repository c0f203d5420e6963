"""The plant and the statues: counts, closed bodies, closed forms of their parts, names, views."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.geometry import fixed_frame
from asmjax.render.load import load_scene
from asmjax.scene import builtin, mesh_tools, plant, plant_parts, statue, statues
from asmjax.scene.spec import Mesh

GREY = (0.5, 0.5, 0.5)
ROOT = Path(__file__).parents[1]


def meshes(scene) -> list[Mesh]:
    return [shape for shape in scene.shapes if isinstance(shape, Mesh)]


@pytest.mark.parametrize("triangles", [10_000, 11_154, 33_333, 100_000, 1_000_000])
def test_as_many_triangles_as_asked_for(triangles):
    """The last bars of the gratings make up what the rest leaves."""
    assert plant.make_plant(triangles).triangles == pytest.approx(triangles, rel=0.01)


@pytest.mark.parametrize("triangles", [10_000, 100_000])
def test_bodies_are_closed_and_outward(triangles):
    """All but the ground; many of them, none without area, and all above the stack's foot."""
    bodies = meshes(plant.make_plant(triangles))[1:]
    assert len(bodies) >= 20
    for mesh in bodies:
        assert mesh_tools.is_closed(mesh), mesh.name
        assert mesh_tools.signed_volume(mesh) > 0.0
        assert mesh_tools.face_areas(mesh).min() > 0.0
        assert mesh.vertices[2].min() >= -3.0


def test_twice_the_same():
    """Nothing but the number of triangles decides."""
    for a, b in zip(
        meshes(plant.make_plant(50_000)), meshes(plant.make_plant(50_000)), strict=True
    ):
        assert a.name == b.name and np.array_equal(a.vertices, b.vertices)
        assert np.array_equal(a.faces, b.faces)


def test_a_larger_plant_begins_alike():
    """The first bay's steel stands where it does in the small one."""
    small, large = ({m.name: m for m in meshes(plant.make_plant(n))} for n in (10_000, 300_000))
    for name in ("steel_0", "steel_3", "stairs"):
        some = {tuple(v) for v in large[name].vertices.T.round(9)}
        mine = small[name].vertices.T
        mine = mine[mine[:, 0] < 0.5 * plant.BAY]
        assert len(mine) > 100 and all(tuple(v) in some for v in mine.round(9))


def test_more_triangles_make_it_longer_rounder_and_finer():
    """Bays, sides of pipes and bars of gratings all grow."""
    sizes = [plant.make_plant(n) for n in (10_000, 100_000, 1_000_000)]
    lengths, pipes, bars = [], [], []
    for scene in sizes:
        found = {m.name: m for m in meshes(scene)}
        lengths.append(found["steel_0"].vertices[0].max())
        pipes.append(found["pipes_0_1"].faces.shape[1])
        bars.append(sum(m.faces.shape[1] for n, m in found.items() if n.startswith("grates")))
    for grown in (lengths, pipes, bars):
        assert grown[0] < grown[1] < grown[2]


def test_twelve_million():
    """How long that takes is for `bench_scenes` to say."""
    scene = plant.make_plant(12_000_000)
    assert scene.triangles == pytest.approx(12_000_000, rel=1e-3)


def test_bars_have_the_volume_of_their_sizes():
    """Bars in any direction are boxes: length x width x height; a beam is two flanges and a web."""
    rng = np.random.default_rng(3)
    start, end = rng.normal(size=(2, 3, 40))
    end[:2, :4] = start[:2, :4]
    parts = plant_parts.bars(start, end, rng.uniform(0.1, 0.3, 40), rng.uniform(0.1, 0.3, 40))
    mesh = plant_parts.bar_mesh("bars", parts, GREY)
    assert mesh.faces.shape[1] == plant_parts.BAR_TRIANGLES * 40 and mesh_tools.is_closed(mesh)
    volume = np.sum(np.linalg.norm(end - start, axis=0) * parts.width * parts.height)
    assert mesh_tools.signed_volume(mesh) == pytest.approx(volume)
    beam = plant_parts.beams([[0.0], [0.0], [2.0]], [[5.0], [0.0], [2.0]], 0.2, 0.4)
    x, y, z = plant_parts.bar_mesh("beam", beam, GREY).vertices
    assert (x.min(), x.max()) == pytest.approx((0.0, 5.0))
    assert (y.min(), y.max()) == pytest.approx((-0.1, 0.1))
    assert (z.min(), z.max()) == pytest.approx((1.8, 2.2))


def test_pipes_lie_on_cylinders_and_tori():
    """Every vertex is a radius away from a leg's axis or an elbow's circle; volume by Pappus."""
    corners = np.array([[0.0, 2, 2, 5], [0, 0, 3, 3], [1, 1, 1, 1]])[:, None, :]
    radius, sides, arc = 0.1, 32, 12
    mesh = plant_parts.pipe_mesh("pipe", corners, np.array([radius]), sides, arc, GREY)
    assert mesh.faces.shape[1] == plant_parts.pipe_triangles(3, sides, arc)
    assert mesh_tools.is_closed(mesh)
    bend = plant_parts.BEND * radius
    x, y, z = mesh.vertices
    ways = [np.hypot(y, z - 1.0) + np.where(x <= 2.0 - bend + 1e-9, 0, 9),
            np.hypot(x - 2.0, z - 1.0) + np.where(np.abs(y - 1.5) <= 1.5 - bend + 1e-9, 0, 9),
            np.hypot(y - 3.0, z - 1.0) + np.where(x >= 2.0 + bend - 1e-9, 0, 9)]  # fmt: skip
    for cx, cy in ((2.0 - bend, bend), (2.0 + bend, 3.0 - bend)):
        ways.append(np.hypot(np.hypot(x - cx, y - cy) - bend, z - 1.0))
    assert np.min(np.abs(np.array(ways) - radius), axis=0).max() < 1e-12
    length = 2.0 + 3.0 + 3.0 - 4.0 * bend + math.pi * bend
    section = 0.5 * sides * radius**2 * math.sin(2.0 * math.pi / sides)
    assert mesh_tools.signed_volume(mesh) == pytest.approx(section * length, rel=2e-3)


@pytest.mark.parametrize("sides", [12, 48, 96])
def test_vessels_are_cylinders_with_flat_ellipsoids_as_heads(sides):
    """Volume pi r^2 (L - 2 h) + 4/3 pi r^2 h with heads of height h = r / 3, in the limit."""
    mesh = plant_parts.vessel("tank", (1.0, 2.0, 0.5), (1.0, 2.0, 9.5), 1.5, sides, GREY)
    assert mesh.faces.shape[1] == plant_parts.vessel_triangles(sides)
    assert mesh_tools.is_closed(mesh) and mesh_tools.face_areas(mesh).min() > 0.0
    volume = math.pi * 1.5**2 * (9.0 - 2.0 * 0.5) + 4.0 / 3.0 * math.pi * 1.5**2 * 0.5
    assert mesh_tools.signed_volume(mesh) == pytest.approx(volume, rel=9.0 / sides**2)
    x, y, z = mesh.vertices
    assert np.hypot(x - 1.0, y - 2.0).max() == pytest.approx(1.5)
    assert (z.min(), z.max()) == pytest.approx((0.5, 9.5), abs=2e-3)


def test_pipe_runs_turn_within_their_block():
    """Legs are parallel to the axes, turn at right angles, and leave room for both elbows."""
    layout = plant._layout(300_000)
    for block, y in enumerate(plant._BLOCKS):
        corners = plant._routes(layout, block, y)
        assert corners.shape == (3, layout.runs, plant.LEGS + 1)
        legs = np.diff(corners, axis=2)
        assert np.all(np.sum(np.abs(legs) > 1e-9, axis=0) == 1)
        assert np.abs(np.sum(legs[:, :, 1:] * legs[:, :, :-1], axis=0)).max() == 0.0
        room = 2.0 * plant.BEND * plant._RADII[-1]
        assert np.linalg.norm(legs, axis=0).min() >= room
        assert corners[1].min() >= y and corners[1].max() <= y + plant.DEPTH
        assert corners[0].min() >= 0.0 and corners[0].max() <= layout.length


def test_splitting_a_closed_mesh():
    """Four faces for one in the same planes: closed, of the same volume and area."""
    ball = mesh_tools.move(statue.make_statue(0)[1], (0.3, 0.0, 0.0))
    split = statue.split_all(ball)
    assert split.faces.shape[1] == 4 * ball.faces.shape[1] and mesh_tools.is_closed(split)
    assert mesh_tools.signed_volume(split) == pytest.approx(mesh_tools.signed_volume(ball))
    assert mesh_tools.face_areas(split).sum() == pytest.approx(mesh_tools.face_areas(ball).sum())


def test_the_figure_is_one_body_at_every_fineness():
    """Closed and outward, four times the triangles a step, and less change with each."""
    volumes = []
    for steps in range(4):
        plinth, figure = statue.make_statue(steps)
        for mesh in (plinth, figure):
            assert mesh_tools.is_closed(mesh) and mesh_tools.signed_volume(mesh) > 0.0
        assert plinth.vertices[2].min() == 0.0
        assert figure.vertices[2].max() == pytest.approx(2.9, abs=0.03)
        assert mesh_tools.face_areas(figure).min() > 0.0
        volumes.append(mesh_tools.signed_volume(figure))
        assert figure.faces.shape[1] == 4**steps * statue.make_statue(0)[1].faces.shape[1]
    change = np.abs(np.diff(volumes))
    assert change[0] > 2.0 * change[1] > 0.0 and change[2] < change[0]


@pytest.mark.parametrize("triangles", [100_000, 1_000_000, 5_000_000])
def test_statues_are_kept_once(triangles):
    """Counted as often as they stand, apart from one another on the terrace, none like the next."""
    scene = statues.make_statues(triangles)
    (group,) = scene.instances
    assert scene.triangles == pytest.approx(triangles, rel=0.02)
    assert group.count >= statues.FEWEST_STATUES
    assert group.triangles == group.count * sum(m.faces.shape[1] for m in group.meshes)
    at = group.transforms[:, :, 3]
    gaps = np.linalg.norm(at[:, None] - at[None], axis=2) + 9.0 * np.eye(group.count)
    assert gaps.min() == pytest.approx(statues.SPACING)
    top = next(s for s in meshes(scene) if s.name == "step_0")
    assert np.abs(at[:, :2]).max() < top.vertices[0].max() and np.all(at[:, 2] == 0.0)
    turned = group.transforms[:, 0, 0] + 1j * group.transforms[:, 1, 0]
    assert np.unique(turned.round(6)).size == group.count
    size = np.linalg.det(group.transforms[:, :, :3]) ** (1 / 3)
    assert 0.9 < size.min() and size.max() < 1.1


def test_counts_of_the_largest():
    """The sizes that the names promise, without making the figure so fine."""
    for triangles in (82_000_000, 370_000_000, statues.SIZES.most):
        steps, count = statues.division(triangles)
        assert steps == statue.FINEST and count >= statues.FEWEST_STATUES
        figure = 4**steps * statue.make_statue(0)[1].faces.shape[1] + 44
        assert count * figure == pytest.approx(triangles, rel=0.02) and count * figure < 2**31


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("plant:", "'' is no number of triangles.*write for example plant:10k or plant:12m"),
        ("plant:9999", "'plant' with 9999 triangles is not possible; allowed is 10000"),
        ("plant:101m", "101000000 triangles is not possible"),
        ("statues:99k", "99000 triangles is not possible; allowed is 100000.*statues:100k"),
        ("statues:3000m", "3000000000 triangles is not possible"),
        ("statue:1m", "Did you mean 'statues'"),
        ("terrain:1m", "one size.*surface, plant, statues with a number"),
    ],
)
def test_names_that_are_not(name, message):
    """One line with what is allowed."""
    with pytest.raises(UseError, match=message):
        builtin.load_builtin(name)


def test_names_that_are():
    """The size belongs to the name."""
    assert builtin.load_builtin("plant:20k").name == "plant:20k"
    assert builtin.load_builtin("statues:100k").name == "statues:100k"


@pytest.mark.mitsuba
@pytest.mark.parametrize("name", ["plant:10k", "plant:100k", "statues:100k"])
def test_every_view_has_light_and_shadow(name):
    """Under the sun in every view, and under the lamp in those that are near it."""
    scene = load_scene(name)
    for view in scene.views.values():
        eye = scene.eye(view.resized(64, 64))
        lit = scene.shadow_rays(eye, scene.light_frame(eye), scene.light_rays()).trace()
        assert eye.valid.mean() > 0.5 and 0.1 < lit[eye.valid].mean() < 0.96
    inside = list(scene.views)[1]
    eye = scene.eye(scene.view(inside).resized(64, 64))
    lit = scene.shadow_rays(eye, scene.light_frame(eye, "lamp"), scene.light_rays("lamp")).trace()
    assert 0.1 < lit[eye.valid].mean() < 0.95


@pytest.mark.mitsuba
def test_the_alley_is_deep():
    """Far surfaces are more than 100 times as far as near ones, and most hide several others."""
    scene = load_scene("plant:100k")
    depth = scene.eye(scene.view("alley")).depth
    assert depth[np.isfinite(depth)].max() > 100.0 * depth.min()
    eye = scene.eye(scene.view("alley").resized(64, 64))
    bodies = eye.valid & (eye.world[2] > 0.2)
    along = eye.camera.directions(*eye.camera.centres())[:, bodies]
    start = np.repeat(eye.camera.origin[:, None], along.shape[1], axis=1)
    met = np.zeros(along.shape[1])
    for _ in range(40):
        t, prim, _ = scene.light_rays().hits(start, along)
        met += prim >= 0
        start = start + np.where(prim >= 0, t + 1e-3, 999.0) * along
    assert met.mean() > 5.0


def test_lamps_stand_free():
    """Each lamp is in no body: a ray from it goes some way before it meets one."""
    for scene in (plant.make_plant(10_000), plant.make_plant(100_000)):
        place = scene.lights["lamp"].position
        frame = fixed_frame(place, (0.0, 0.0, -1.0), 90.0, 1e-3)
        for mesh in meshes(scene)[1:]:
            gap = mesh.vertices - frame.origin[:, None]
            assert np.linalg.norm(gap, axis=0).min() > 0.4, mesh.name


@pytest.mark.mitsuba
def test_benchmark_of_large_scenes():
    """The script measures and prints what it says, here for the smallest plant."""
    script = runpy.run_path(str(ROOT / "experiments/large_scenes.py"))
    found = script["measured"]("plant:10k", 16, 32, 1)
    assert found["triangles"] == found["kept_triangles"] == 9_998
    assert found["peak_bytes"] >= found["before_bytes"] > 1e8
    assert [view["view"] for view in found["views"]] == ["overview", "alley"]
    for view in found["views"]:
        assert min(view["eye_ms"], view["map_ms"], view["rays_ms"]) > 0.0
    head, rule, *rows = script["table"]([found]).splitlines()
    assert {line.count("|") for line in (head, rule, *rows)} == {len(script["HEAD"]) + 1}
    assert len(rows) == 2 and "`plant:10k`" in rows[0]
