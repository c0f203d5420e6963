"""Every limit is loud: refused with a remedy, or told in the status; no wrong image in silence.

The oracle is the closed form: a map that could not be refined is still wrong only within one texel
of a shadow edge.
"""

import pytest
from helpers.analytic_cases import analytic_case, case_of
from helpers.registry import FAST

from asmjax.errors import UseError
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, Status, UniformShadowMap, resolution_for

SIDE = 64
"""Pixels a side."""

TEXELS = 4**7


@pytest.mark.parametrize(
    "short",
    [
        lambda: AdaptiveShadowMap(memory_bytes=1500).tree_shape(1),
        lambda: AdaptiveShadowMap(memory_bytes=6 * 2200).tree_shape(6),
        lambda: AdaptiveShadowMap(memory_bytes=2**16, start_resolution=512).tree_shape(1),
        lambda: resolution_for(3, 1),
        lambda: resolution_for(4 * 3 - 1, 3),
    ],
)
def test_memory_below_one_node_is_refused_with_a_remedy(short):
    with pytest.raises(UseError, match="raise --memory-mb") as problem:
        short()
    assert "\n" not in str(problem.value)


def test_least_memory_in_the_message_is_enough():
    """The message says what is allowed: that much, rounded up, must work; less must not."""
    with pytest.raises(UseError) as problem:
        AdaptiveShadowMap(memory_bytes=1).tree_shape(3)
    megabytes = float(str(problem.value).split("allowed is ")[1].split(" MB")[0])
    # The message prints three digits.
    assert AdaptiveShadowMap(memory_bytes=int(megabytes * 2**20 * 1.005)).tree_shape(3).pages == 3
    with pytest.raises(UseError):
        AdaptiveShadowMap(memory_bytes=int(megabytes * 2**20 * 0.99)).tree_shape(3)


def limited(case, **settings):
    algorithm = AdaptiveShadowMap(cost_model=FAST, **settings)
    state = algorithm.build(case.eye, case.frame, case.rays)
    lit = algorithm.visibility(state, case.eye.points)
    log2 = algorithm.lookup(state, case.eye.points)[1]
    return algorithm.status(state), case.wrong(lit), case.texel_width(log2)


@pytest.mark.parametrize(
    ("settings", "status"),
    [
        ({"memory_bytes": TEXELS * 6}, Status.MEMORY_LIMIT),
        ({"memory_bytes": 3 * 2200}, Status.MEMORY_LIMIT),
        ({"memory_bytes": 3 * 2200, "cover": False}, Status.MEMORY_LIMIT),
        ({"time_limit": 1e-6}, Status.TIME_LIMIT),
        ({"max_passes": 1, "cover": False}, Status.PASS_LIMIT),
    ],
)
def test_every_limit_is_told_and_leaves_a_coarser_map(settings, status):
    """What was built answers every pixel: wrong only within a texel of a shadow edge."""
    case = analytic_case("a4_disc_light", SIDE)
    ended, wrong, width = limited(case, **settings)
    assert ended is status and ended.is_limit
    assert (case.edge_distance[wrong] < width[wrong]).all()


def test_full_node_table_is_told():
    """Pages 16 levels down need 16 nodes each on the way, and the table has 4 a page: the eye
    hovers above the shadow's edge, and the light's fixed field of view is 100 degrees wide."""
    scene = ANALYTIC_SCENES["a4_disc_light"]()
    edge = 5.0 / 3.0
    view = ViewSpec("near", (edge, 0.0, 0.004), (edge, 0.0, 0.0), (0.0, 1.0, 0.0), 20.0, SIDE, SIDE)
    light = LightSpec("centre", "point", position=(0.0, 0.0, 5.0), fov_deg=100.0)
    case = case_of(scene, scene.spec.shapes, view, light)
    status, wrong, width = limited(case, memory_bytes=3 * 2100)
    assert status is Status.NODE_CAPACITY and status.is_limit
    assert "--node-resolution" in status.value
    assert (case.edge_distance[wrong] < width[wrong]).all()
    # With room for them the same pages exist, and the shadow is exact.
    status, wrong, width = limited(case, memory_bytes=2**20)
    assert status is not Status.NODE_CAPACITY
    assert (case.edge_distance[wrong] < width[wrong]).all() and wrong.mean() < 0.002


def test_addresses_that_do_not_fit_32_bits_are_refused():
    """Texels are addressed as one int32: a pool or map beyond that would wrap in silence."""
    with pytest.raises(UseError, match="--memory-mb"):
        AdaptiveShadowMap(memory_bytes=2**36).tree_shape(1)
    case = analytic_case("a6_sphere", SIDE)
    with pytest.raises(UseError, match="32768"):
        UniformShadowMap(2**15).build(case.eye, case.frame, case.rays)
