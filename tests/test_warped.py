"""Warped, partitioned and subdivided maps: against theory, against the loop, and where they break.

The eye looks along a plane from a known height, light falls across the view: the configuration of
Lloyd et al. 2005, section 3, whose errors are known in closed form.
"""

import functools

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case, case_of
from helpers.poses import projected

from asmjax.errors import UseError
from asmjax.footprint import uv_jacobian
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import (
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    PerspectiveShadowMap,
    Status,
    SubdividedShadowMap,
    TrapezoidalShadowMap,
)
from asmjax.shadow.warped.body import bodies
from asmjax.shadow.warped.frustum import frustum_regions
from asmjax.shadow.warped.strength import n_of_strength, shaped_strength
from asmjax.shadow.warped.z_partition import split_depths
from asmjax.theory import practical_splits, u_from_xi

FAMILIES = [
    PerspectiveShadowMap,
    LightSpaceShadowMap,
    TrapezoidalShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    SubdividedShadowMap,
]


@functools.cache
def along_a_plane(side: int = 96, tilt: float = 0.12, toward=(0.0, 0.0, -1.0)):
    """An eye a little above a plane, which looks along it; light from above."""
    scene = ANALYTIC_SCENES["a5_half_plane"]()
    view = ViewSpec(
        "along", (0.0, -6.0, 0.5), (0.0, 0.0, 0.5 - 6 * tilt), (0, 0, 1), 60.0, side, side
    )
    light = LightSpec("sun", "directional", direction=toward)
    return case_of(scene, scene.spec.shapes, view, light)


def beams(case, algorithm, state) -> np.ndarray:
    """(2, n) width of a texel's beam along and across the view, over that of a pixel's beam."""
    density = np.moveaxis(np.asarray(algorithm.density(state, case.eye.points), np.float64), -1, 0)
    lit = np.abs(np.linalg.det(density)) > 0
    texel = np.linalg.inv(np.where(lit[:, None, None], density, np.eye(2)))
    frame = case.frame
    # Columns: world motion in the light's plane per texel step.
    step = np.einsum("ki,nij->nkj", np.diag(frame.extent[0]), texel)
    width = np.linalg.norm(step, axis=1)
    pixel = case.eye.depth / case.eye.camera.focal[0]
    return np.where(lit, width.T / pixel, np.nan)


def test_theory_of_warps_along_the_view():
    """Across the view m_x is constant for the perspective map; along it the light-space map errs as
    much at both ends, and the logarithmic one the same everywhere."""
    case = along_a_plane()
    body = bodies(case.eye, case.frame)[0]
    assert body.far / body.near > 5
    found = {
        algorithm.family: beams(case, algorithm, algorithm.build(case.eye, case.frame, case.rays))
        for algorithm in (
            PerspectiveShadowMap(256),
            LightSpaceShadowMap(256),
            LogarithmicShadowMap(256),
        )
    }
    lit = np.isfinite(found["perspective"][0])
    order = np.argsort(np.where(lit, case.eye.depth, np.inf))[: lit.sum()]
    near, far = order[:100], order[-100:]
    across, _ = found["perspective"]
    assert np.nanmax(across) / np.nanmin(across) < 1.2
    _, along = found["light-space"]
    assert np.nanmean(along[near]) == pytest.approx(np.nanmean(along[far]), rel=0.15)
    _, along = found["logarithmic"]
    assert np.nanmax(along) / np.nanmin(along) < 1.35
    _, along = found["perspective"]
    alpha = body.far / body.near
    assert np.nanmean(along[far]) / np.nanmean(along[near]) == pytest.approx(alpha, rel=0.25)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("toward", [(0.0, 0.3, -1.0), (0.0, -0.5, -1.0), (0.0, 1.0, -0.12)])
def test_every_visible_receiver_lies_inside_its_chart(family, toward):
    """Whatever the light's direction: nothing is clamped into a border texel by more than half."""
    case = along_a_plane(64, toward=toward)
    algorithm = family(128)
    state = algorithm.build(case.eye, case.frame, case.rays)
    receivers = projected(case.eye.points, case.frame)
    density = np.asarray(algorithm.density(state, case.eye.points), np.float64)
    facing = np.asarray(receivers.facing)
    assert (np.abs(np.linalg.det(np.moveaxis(density, -1, 0)))[facing] > 0).all()
    assert np.isfinite(density).all()
    lit = np.asarray(algorithm.visibility(state, case.eye.points))
    wrong = case.wrong(lit)
    texel = 1 / np.linalg.norm(np.moveaxis(density, -1, 0), ord=-2, axis=(1, 2))[wrong]
    assert (case.edge_distance[wrong] < texel * case.frame.extent.max() * 1.1).all()


def test_frustum_regions_cover_without_overlap():
    """Each receiver lies in one region, or in none: what is left belongs to the near face."""
    for toward in [(0.0, 0.3, -1.0), (0.6, -0.5, -1.0), (0.2, 0.9, -0.3), (0.1, -0.9, -0.3)]:
        case = along_a_plane(48, toward=toward)
        body = bodies(case.eye, case.frame)[0]
        for parts in (1, 3):
            regions = frustum_regions(case.eye, case.frame, body, parts)
            assert regions is not None
            held = np.sum([region.holds(body.plane) for region in regions], axis=0)
            # Neighbours share their border.
            assert np.mean(held > 1) < 0.02, toward
            assert 1 <= len(regions) <= 4 * parts


def test_subdivision_wins_where_light_comes_along_the_view():
    """10 degrees: where one warp is none, the perspective error of the subdivided map is at most a
    third of the trapezoidal one's."""
    case = along_a_plane(96, tilt=0.3, toward=(0.0, 0.985, -0.42))
    worst = {}
    for algorithm in (TrapezoidalShadowMap(256), SubdividedShadowMap(256, parts=2)):
        state = algorithm.build(case.eye, case.frame, case.rays)
        worst[algorithm.family] = np.nanmax(beams(case, algorithm, state))
    assert worst["subdivided"] < worst["trapezoidal"] / 3, worst


def test_strengths_and_splits():
    """Equation 4 at its three anchors; Lloyd's shaping is continuous and ends at -1 and 0."""
    alpha = 50.0
    assert n_of_strength(-1, alpha) == np.inf
    assert n_of_strength(0, alpha) == pytest.approx(1 + np.sqrt(alpha))
    assert n_of_strength(1, alpha) == pytest.approx(1)
    gamma = np.linspace(0, np.pi / 2, 20_001)
    eta = np.array([shaped_strength(g, np.radians(30)) for g in gamma.tolist()])
    assert eta[0] == -1 and eta[-1] == 0
    assert np.abs(np.diff(eta)).max() < 1e-3 and (np.diff(eta) >= -1e-12).all()
    np.testing.assert_allclose(split_depths(1, 16, 4, 1.0), [1, 2, 4, 8, 16])
    np.testing.assert_allclose(split_depths(1, 16, 3, 0.0), [1, 6, 11, 16])
    np.testing.assert_allclose(split_depths(1, 16, 2, 0.5), [1, 6.25, 16])


@pytest.mark.parametrize("alpha", [1.5, 50.0, 1e4])
def test_strengths_and_splits_are_the_theory_s(alpha, x64):
    """The host's numbers against the differentiable ones."""
    for xi in (-0.9, -0.3, 0.0, 0.4, 1.0):
        expected = 1 / float(u_from_xi(xi, alpha))
        assert n_of_strength(xi, alpha) == pytest.approx(expected, rel=1e-12)
    for blend in (0.0, 0.5, 1.0):
        theirs = np.asarray(practical_splits(1.0, alpha, 5, blend), np.float64)
        np.testing.assert_allclose(split_depths(1.0, alpha, 5, blend), theirs, rtol=1e-12)


def test_a_camera_in_the_light_has_no_axis():
    """Light exactly along the view: no warp, nothing undefined."""
    case = along_a_plane(48, tilt=0.5, toward=(0.0, 1.0, -0.5))
    for family in FAMILIES:
        algorithm = family(64)
        state = algorithm.build(case.eye, case.frame, case.rays)
        assert np.isfinite(np.asarray(algorithm.visibility(state, case.eye.points))).all()
        assert algorithm.effective_resolution(state) >= 1


def test_charts_of_several_faces():
    """A lamp within the scene has three faces here, each with charts of its own."""
    case = analytic_case("a6_sphere", 48)
    assert case.frame.faces == 3
    for family in FAMILIES:
        faces = {chart.face for chart in family(64).charts(case.eye, case.frame)}
        assert faces == {0, 1, 2}


def test_faces_that_cannot_be_subdivided_are_told():
    """Behind a lamp's plane corners of the frustum have no image; parallel light has no such
    plane, and without parts nothing is asked for."""
    lamp, sun = analytic_case("a6_sphere", 48), along_a_plane(48)
    for case, parts, expected in (
        (lamp, 2, Status.FALLBACK),
        (lamp, 0, Status.COMPLETE),
        (sun, 2, Status.COMPLETE),
    ):
        algorithm = SubdividedShadowMap(64, parts=parts)
        state = algorithm.build(case.eye, case.frame, case.rays)
        assert algorithm.status(state) is expected
    assert Status.FALLBACK.is_limit


def test_predicted_jacobian_is_texels_per_pixel():
    """`density` times `uv_jacobian` is how far a receiver moves in texels from pixel to pixel: on
    a plane, differences between neighbours."""
    case = along_a_plane(64, toward=(0.3, 0.2, -1.0))
    algorithm = LightSpaceShadowMap(512)
    state = algorithm.build(case.eye, case.frame, case.rays)
    points = case.eye.points
    receivers = projected(points, case.frame)
    jacobian = uv_jacobian(points, case.eye.camera, case.frame, receivers)
    texels = jnp.einsum("ikn,kjn->ijn", algorithm.density(state, points), jacobian)
    u, v = np.asarray(receivers.uv, np.float64)
    chart = algorithm.charts(case.eye, case.frame)[0]
    s, t, w = chart.to_chart @ np.stack([u, v, np.ones_like(u)])
    place = (np.stack([s, t]) / w * 512).reshape(2, 64, 64)
    right = (place[:, 40:60, 2:] - place[:, 40:60, :-2]) / 2
    expected = np.asarray(texels)[:, 0].reshape(2, 64, 64)[:, 40:60, 1:-1]
    np.testing.assert_allclose(right, expected, rtol=0.02, atol=0.02)


@pytest.mark.parametrize(
    ("family", "settings", "message"),
    [
        (PerspectiveShadowMap, {"resolution": 0}, "1 to"),
        (PerspectiveShadowMap, {"slide": -1.0}, "slide"),
        (TrapezoidalShadowMap, {"focus": 0.0}, "focus"),
        (LogarithmicShadowMap, {"ratio": 0.5}, "ratio"),
        (PartitionedShadowMap, {"partitions": 0}, "1 to 16"),
        (PartitionedShadowMap, {"blend": 1.5}, "blend"),
        (PartitionedShadowMap, {"near": -1.0}, "above 0"),
        (PartitionedShadowMap, {"near": 2.0, "far": 1.0}, "far"),
        (PartitionedShadowMap, {"near": np.inf}, "finite"),
        (PartitionedShadowMap, {"far": np.inf}, "finite"),
        (SubdividedShadowMap, {"parts": 9}, "0 to 8"),
        (SubdividedShadowMap, {"strength": 2.0}, "-1 to 1"),
        (SubdividedShadowMap, {"bias": -1.0}, "bias"),
    ],
)
def test_wrong_settings(family, settings, message):
    with pytest.raises(UseError, match=message):
        family(**settings)


def test_names_say_the_family_and_its_main_setting():
    warped = PartitionedShadowMap(512, partitions=3, warp="light-space")
    assert warped.name == "partitioned-512-3-warped"
    assert SubdividedShadowMap(1024, parts=4).name == "subdivided-1024-4"
    assert TrapezoidalShadowMap(64, compare="both").name == "trapezoidal-64-both"


def test_sample_distribution_ignores_what_is_given_beyond():
    """Splits for a given range and for the visible one are other charts."""
    case = along_a_plane(48)
    seen = PartitionedShadowMap(64, partitions=4).charts(case.eye, case.frame)
    given = PartitionedShadowMap(64, partitions=4, near=0.01, far=1e4).charts(case.eye, case.frame)
    assert len(seen) == 4 and len(given) < 4


def test_splits_where_nothing_is_seen_are_told():
    """One slab is left, and the status says that it is not what was asked for."""
    case = along_a_plane(48)
    for near, far in ((None, 1e-3), (1e6, None)):
        algorithm = PartitionedShadowMap(64, partitions=4, near=near, far=far)
        state = algorithm.build(case.eye, case.frame, case.rays)
        assert len(algorithm.charts(case.eye, case.frame)) == 1
        assert algorithm.status(state) == Status.FALLBACK
    whole = PartitionedShadowMap(64, partitions=4)
    assert whole.status(whole.build(case.eye, case.frame, case.rays)) == Status.COMPLETE
