"""Ray-traced truth equals the closed form of scenes A1 to A9, except within 1e-5 of an edge."""

import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded

from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import ViewSpec

pytestmark = pytest.mark.mitsuba

EDGE_MARGIN = 1e-5
"""Scene units."""


def receiver(name: str, view: ViewSpec):
    """Plane points x, y that the view sees, and whether truth has them lit."""
    scene = loaded(name)
    eye = scene.eye(view)
    frame = scene.light_frame(eye)
    lit = scene.shadow_rays(eye, frame, scene.light_rays()).trace()
    on_plane = eye.shape == 0
    x, y, z = eye.world[:, on_plane]
    assert np.abs(z).max() < 1e-12
    return x, y, lit[on_plane]


def edge_point(analytic, x, y, lit, seed: int) -> np.ndarray:
    """A point of the plane on the shadow's edge, by bisection between a lit and a dark point."""
    rng = np.random.default_rng(seed)
    bright, dark = ((x[k], y[k]) for k in (rng.choice(np.flatnonzero(m)) for m in (lit, ~lit)))
    bright, dark = np.array(bright), np.array(dark)
    for _ in range(60):
        middle = 0.5 * (bright + dark)
        if analytic.hard_visibility(*middle[:, None])[0] == 1:
            bright = middle
        else:
            dark = middle
    return bright


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_whole_view(name):
    """All pixels of the scene's own view."""
    analytic = ANALYTIC_SCENES[name]()
    x, y, lit = receiver(name, loaded(name).view())
    assert x.size > 200_000 and 0.02 < np.mean(~lit) < 0.98
    judged = analytic.edge_distance(x, y) > EDGE_MARGIN
    assert np.array_equal(lit[judged], analytic.hard_visibility(x, y)[judged] == 1)
    assert judged.mean() > 0.999


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_edges_under_the_microscope(name):
    """Views 3.5e-4 wide around points of the shadow's edge, pixels of 2.7e-6: one in thirty lies
    within the margin, the others must be right. The boundary of truth is thus known to 1e-5."""
    analytic = ANALYTIC_SCENES[name]()
    view = loaded(name).view()
    x, y, lit = receiver(name, view.resized(128, 128))
    for seed in range(4):
        target = np.array([*edge_point(analytic, x, y, lit, seed), 0.0])
        back = np.asarray(view.origin) - target
        origin = target + 0.02 * back / np.linalg.norm(back)
        close = ViewSpec("close", tuple(origin), tuple(target), view.up, fov_x_deg=1.0, width=128,
                         height=128, near=1e-5)  # fmt: skip
        u, v, seen = receiver(name, close)
        assert 0.3 < seen.mean() < 0.7
        judged = analytic.edge_distance(u, v) > EDGE_MARGIN
        assert 0.85 < judged.mean() < 0.99
        assert np.array_equal(seen[judged], analytic.hard_visibility(u, v)[judged] == 1)
