"""The slow `scalar_rgb` path, in a process of its own, gives the same hits as the fast one (R6)."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.effort import effort
from helpers.mitsuba_scenes import loaded, real_scene, vectorised

from asmjax.buffers import TexelWindows, whole_image
from asmjax.scene.other_scenes import OTHER_SCENES, other_scene

pytestmark = pytest.mark.mitsuba

FEW = 5e-4
"""Share of pixels that may differ where silhouettes of coplanar walls meet."""

SIZE = (90, 74)
"""No view has a wall's diagonal, where two triangles tie, run through its pixel centres."""


def everything(source: str, light: str | None) -> dict[str, np.ndarray]:
    """Eye buffer, whole and partial light images, and shadow rays of one scene and light."""
    scene = loaded(source)
    eye = scene.eye(scene.view().resized(*SIZE))
    frame, rays = scene.light_frame(eye, light), scene.light_rays(light)
    at = np.arange(frame.faces)
    part = TexelWindows(at, np.full((2, at.size), 0.4), np.full((2, at.size), 1 / 2048), 32)
    whole, part = (rays.light_buffer(frame, w) for w in (whole_image(frame, 67), part))
    return {
        "eye_prim": eye.prim,
        "eye_shape": eye.shape,
        "eye_depth": eye.depth,
        "eye_world": eye.world,
        "eye_normal": eye.normal,
        "eye_albedo": eye.albedo,
        "whole_prim": np.asarray(whole.prim),
        "whole_depth": np.asarray(whole.depth),
        "part_prim": np.asarray(part.prim),
        "part_depth": np.asarray(part.depth),
        "lit": scene.shadow_rays(eye, frame, rays).trace(),
    }


GENERIC = effort(200_000, 2_000_000)
"""Rays in no special position: no two surfaces tie, and none runs along an edge."""


def generic_rays(source: str) -> dict[str, np.ndarray]:
    """Whether rays between random points of a scene's box are blocked, and by what."""
    scene = loaded(source)
    bounds = np.asarray(scene.geometry.bounds, np.float64)
    low, size = bounds[:, :1], np.ptp(bounds, axis=1)[:, None]
    rng = np.random.default_rng(0)
    start, target = (low + size * rng.random((3, GENERIC)) for _ in range(2))
    rays = scene.light_rays(None)
    t, prim = rays.closest(start, target - start)
    return {"blocked": rays.occluded(start, target - start, 1.0), "prim": prim, "t": t}


CORNELL = "cornell_box"
CASES = [("letter_f", "point"), ("letter_f", "directional"), ("a6_sphere", None), (CORNELL, None)]

FINE = "terrain"
"""Many small triangles: rays pass as near to edges as they ever do, and many are blocked."""

CHILD = """
import sys
import numpy as np
from asmjax.render.variant import activate
activate("scalar_rgb")
from render.test_variants import FINE, everything, generic_rays
out, *cases = sys.argv[1:]
np.savez(f"{out}/generic.npz", **generic_rays(FINE))
for case in cases:
    index, source, light = case.split("|")
    np.savez(f"{out}/{index}.npz", **everything(source, light or None))
"""


def path_of(source: str) -> str:
    return str(other_scene(source)) if source in OTHER_SCENES else source


@pytest.fixture(scope="module")
def slow(tmp_path_factory) -> Path:
    """Folder with what the scalar variant makes of all cases; its process starts but once."""
    if not vectorised(loaded("letter_f")._mi):
        pytest.skip("no second variant: this process runs scalar_rgb itself")
    out = tmp_path_factory.mktemp("scalar")
    cases = [f"{i}|{path_of(s)}|{light or ''}" for i, (s, light) in enumerate(CASES)
             if s != CORNELL or other_scene(s)]  # fmt: skip
    paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(out), *cases],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in paths if p)},
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.parametrize("case", range(len(CASES)), ids=["-".join(filter(None, c)) for c in CASES])
def test_scalar_and_llvm_agree(case, slow):
    """Same primitives, depths to 1e-6, same shadows; a handful of pixels may differ."""
    source, light = CASES[case]
    if source == CORNELL:
        real_scene(source)
    slow, fast = np.load(slow / f"{case}.npz"), everything(path_of(source), light)
    assert set(slow) == set(fast)
    for image in ("eye", "whole", "part"):
        ours, theirs = fast[f"{image}_prim"], slow[f"{image}_prim"]
        assert ours.shape == theirs.shape and ours.dtype == theirs.dtype
        assert np.mean(ours != theirs) <= FEW
        same = (ours == theirs) & (ours >= 0)
        assert same.mean() > 0.3
        depth, ref = fast[f"{image}_depth"][same], slow[f"{image}_depth"][same]
        assert np.quantile(np.abs(depth / ref - 1), 0.999) < 1e-6
        assert depth == pytest.approx(ref, rel=1e-5)
    same = (fast["eye_prim"] == slow["eye_prim"]) & (fast["eye_prim"] >= 0)
    assert np.array_equal(fast["eye_shape"][same], slow["eye_shape"][same])
    for name in ("eye_normal", "eye_albedo"):
        assert fast[name][:, same] == pytest.approx(slow[name][:, same], abs=1e-5)
    scale = np.abs(slow["eye_world"][:, same]).max()
    assert fast["eye_world"][:, same] == pytest.approx(slow["eye_world"][:, same], abs=1e-6 * scale)
    assert np.mean(fast["lit"] != slow["lit"]) <= FEW and 0.2 < fast["lit"].mean() < 1.0


def test_generic_rays_are_blocked_alike(slow):
    """R6: not one of 200,000 is blocked in one variant and free in the other; the first surface is
    another one where two are a rounding apart only."""
    slow, fast = np.load(slow / "generic.npz"), generic_rays(FINE)
    assert 0.1 < fast["blocked"].mean() < 0.9
    assert np.count_nonzero(slow["blocked"] != fast["blocked"]) == 0
    hit = np.isfinite(fast["t"])
    np.testing.assert_array_equal(hit, np.isfinite(slow["t"]))
    assert fast["t"][hit] == pytest.approx(slow["t"][hit], rel=1e-5)
    assert np.mean(slow["prim"] != fast["prim"]) <= FEW
