"""Light buffers formed on the device against their slow twin, and against closed forms."""

import dataclasses

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded

from asmjax.buffers import LightRays, TexelWindows, whole_image
from asmjax.geometry import LightFrame, fitted_point_frame, fixed_frame
from asmjax.render.load import load_scene
from asmjax.scene.shapes import quad
from asmjax.scene.spec import LightSpec, SceneSpec

pytestmark = pytest.mark.mitsuba

LEVEL_19 = 1.0 / 2**19


def frames(kind: str):
    """Scene, and the light frame of one kind."""
    if kind == "cube":
        scene = loaded("paper_room")
        inside = scene.eye(scene.view("overview").resized(64, 64)).world
        # A light low between the objects sees receivers all around: one face per direction.
        frame = fitted_point_frame((1.3, 3.1, 0.9), inside, 1e-5)
        assert frame.faces >= 4
        return scene, frame
    scene = loaded("letter_f")
    return scene, scene.light_frame(scene.eye(scene.view().resized(64, 64)), kind)


def windows_around(frame: LightFrame, texel: float, side: int, seed: int) -> TexelWindows:
    """Seven windows of a level, at places drawn from all faces and from [-0.2, 1.2]."""
    rng = np.random.default_rng(seed)
    return TexelWindows(
        face=np.arange(7) % frame.faces,
        corner=rng.uniform(-0.2, 1.2, (2, 7)),
        texel=np.full((2, 7), texel),
        side=side,
    )


def both(scene, frame, windows):
    """The device path and the generic one through `closest`, as NumPy arrays."""
    rays = scene.light_rays()
    fast, slow = rays.light_buffer(frame, windows), LightRays.light_buffer(rays, frame, windows)
    shape = (windows.count, windows.side, windows.side)
    for buffer in (fast, slow):
        assert buffer.depth.shape == buffer.prim.shape == shape
        assert buffer.depth.dtype == np.float32 and buffer.prim.dtype == np.int32
    return [np.asarray(a) for b in (fast, slow) for a in (b.depth, b.prim)]


def assert_twins(scene, frame, windows, differing: float):
    """Same primitives but for a share of texels at silhouettes, where a rounding decides."""
    depth, prim, ref_depth, ref_prim = both(scene, frame, windows)
    assert np.mean(prim != ref_prim) <= differing
    assert np.array_equal(np.isinf(depth), prim == -1)
    same = (prim == ref_prim) & (prim >= 0)
    assert same.mean() > 0.2
    # Rounding of a direction moves the depth by 1 / cosine more where a receiver is seen edge-on.
    error = np.abs(depth[same] / ref_depth[same] - 1)
    assert np.quantile(error, 0.999) < 1e-6 and error.max() < 1e-4


@pytest.mark.parametrize("kind", ["point", "spot", "directional", "cube"])
def test_whole_image_is_that_of_the_slow_twin(kind):
    """All faces at 128 x 128. The two paths form their rays independently."""
    scene, frame = frames(kind)
    assert_twins(scene, frame, whole_image(frame, 128), 5e-4)


@pytest.mark.parametrize("kind", ["point", "spot", "directional", "cube"])
@pytest.mark.parametrize("texel", [1 / 700, LEVEL_19], ids=["level 9", "level 19"])
def test_windows_inside_and_outside(kind, texel):
    """Windows at any place, also outside [0, 1]. At level 19 a texel is 2e-6 of the image and
    float32 rays still meet it: the rounding of a direction, 6e-8, is 3 % of it."""
    scene, frame = frames(kind)
    assert_twins(scene, frame, windows_around(frame, texel, 24, seed=3), 5e-3)


@pytest.mark.parametrize("kind", ["point", "spot", "directional"])
def test_windows_at_level_19_on_an_edge(kind):
    """Windows that straddle the silhouette of the F hold both sides of it, and agree with the
    twin in all but the texels that the rounding of their rays moves over the edge."""
    scene, frame = frames(kind)
    prim = np.asarray(scene.light_rays().light_buffer(frame, whole_image(frame, 256)).prim)[0]
    row, column = np.argwhere((prim[:, 1:] < 2) & (prim[:, :-1] >= 2))[4]
    # Bisect along the row for the edge.
    low, high = (column + 0.5) / 256, (column + 1.5) / 256
    v = (row + 0.5) / 256
    for _ in range(24):
        middle = 0.5 * (low + high)
        hit = scene.light_rays().closest(*frame.ray(0, np.array([middle]), np.array([v])))[1][0]
        low, high = (middle, high) if hit >= 2 else (low, middle)
    corner = np.array([[low], [v]]) - 16 * LEVEL_19
    windows = TexelWindows(np.zeros(1, int), corner, np.full((2, 1), LEVEL_19), 32)
    depth, prim, _, ref_prim = both(scene, frame, windows)
    assert 0.2 < np.mean(prim >= 2) < 0.8
    assert np.mean(prim != ref_prim) < 0.02
    assert depth[prim < 2].min() > 1.02 * depth[prim >= 2].max()


def tilted_sheet() -> tuple[SceneSpec, np.ndarray, np.ndarray]:
    """A large tilted quadrilateral with a point on it and its normal."""
    corners = [(-40.0, -40.0, -8.0), (40.0, -40.0, 12.0), (40.0, 40.0, 4.0), (-40.0, 40.0, -16.0)]
    a, b, c = (np.array(corner) for corner in corners[:3])
    lamp = LightSpec("lamp", "point", position=(0.0, 0.0, 9.0))
    spec = SceneSpec("sheet", "", (quad("sheet", corners),), lights={"lamp": lamp})
    return spec, a, np.cross(b - a, c - b)


@pytest.mark.parametrize("perspective", [True, False], ids=["perspective", "orthographic"])
def test_depth_is_linear_and_axial(perspective):
    """Depth counts along the light's axis in scene units: n . (a - o) / n . d where the axial
    part of d is 1. A range would be up to 1.56 times that at the corner of 80 degrees."""
    spec, point, normal = tilted_sheet()
    frame = fixed_frame((1.0, 2.0, 30.0), (0.1, -0.2, -1.0), 80.0, 1e-5)
    if not perspective:
        rectangle = {"corner": np.array([[-7.0, -6.0]]), "extent": np.array([[15.0, 11.0]])}
        frame = dataclasses.replace(frame, perspective=False, **rectangle)
    scene = load_scene(spec)
    depth = np.asarray(scene.light_rays().light_buffer(frame, whole_image(frame, 64)).depth)[0]
    centre = (np.arange(64) + 0.5) / 64
    origins, directions = frame.ray(0, np.tile(centre, 64), np.repeat(centre, 64))
    expected = normal @ (point[:, None] - origins) / (normal @ directions)
    assert depth.ravel() == pytest.approx(expected, rel=2e-6)
    assert depth.max() > 1.1 * depth.min()


def test_flat_floor_below_has_one_depth():
    """Straight above a floor every texel has the light's height, not a range that grows."""
    scene = loaded("letter_f")
    frame = fixed_frame((5.0, 0.0, 5.0), (0.0, 0.0, -1.0), 40.0, 1e-5)
    depth = np.asarray(scene.light_rays().light_buffer(frame, whole_image(frame, 32)).depth)
    floor = np.isfinite(depth)
    assert 0.02 < floor.mean() < 0.5
    assert depth[floor] == pytest.approx(5.0, rel=1e-6)


@pytest.mark.parametrize("lanes", [100, 1000])
def test_cutting_into_launches_changes_nothing(monkeypatch, lanes):
    """A request above the limit is cut anywhere, in the middle of a window too: same bits."""
    scene, frame = frames("cube")
    windows = windows_around(frame, 1 / 64, 16, seed=9)
    rays = scene.light_rays()
    whole = rays.light_buffer(frame, windows)
    monkeypatch.setattr("asmjax.render.caster.LANES", lanes)
    calls = []
    launch = type(rays)._launch
    monkeypatch.setattr(type(rays), "_launch", lambda *a: calls.append(a[-1]) or launch(*a))
    cut = rays.light_buffer(frame, windows)
    assert np.array_equal(whole.depth, cut.depth) and np.array_equal(whole.prim, cut.prim)
    if rays.vectorised:
        assert sum(calls) == windows.texels and max(calls) <= lanes
