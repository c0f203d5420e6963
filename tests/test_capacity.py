"""Every limit is loud: refused with a remedy, or told in the status; no wrong image in silence.

The oracle is the closed form: a map that could not be refined is still wrong only within one texel
of a shadow edge. Time limits are kept on a clock that only casting rays moves.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.analytic_cases import Case, analytic_case, case_of
from helpers.counting import CountingRays
from helpers.registry import FAST

from asmjax.errors import UseError
from asmjax.scene.analytic_rays import analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel, Status, UniformShadowMap, resolution_for
from asmjax.shadow.adaptive import asm, refiner, tree
from asmjax.shadow.comparison import check_test

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
    with pytest.raises(UseError, match="raise `(memory_bytes|bytes_limit)`") as problem:
        short()
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize("faces", [1, 3, 6])
@pytest.mark.parametrize("node", [8, 16, 64])
def test_least_memory_in_the_message_is_enough(faces, node):
    """The message says what is allowed: that much, rounded up, must work; less must not."""
    with pytest.raises(UseError) as problem:
        AdaptiveShadowMap(memory_bytes=1, node_resolution=node).tree_shape(faces)
    megabytes = float(str(problem.value).split("allowed is ")[1].split(" MB")[0])

    def shape(parts: float):
        memory = int(megabytes * 2**20 * parts)
        return AdaptiveShadowMap(memory_bytes=memory, node_resolution=node).tree_shape(faces)

    # The message prints three digits.
    assert shape(1.005).pages == faces
    with pytest.raises(UseError):
        shape(0.99)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"node_resolution": 4}, "8 to 512"),
        ({"node_resolution": 24}, "powers of two"),
        ({"node_resolution": 1024}, "8 to 512"),
        ({"cells": 1}, "2, 4, 8"),
        ({"cells": 3}, "2, 4, 8"),
        ({"cells": 16}, "2, 4, 8"),
        ({"time_limit": 0.0}, "more than 0"),
        ({"time_limit": -0.1}, "more than 0"),
        ({"pixel_share": 0}, "1 .every pixel., 2, 4, 8"),
        ({"pixel_share": 3}, "1 .every pixel., 2, 4, 8"),
        ({"pixel_share": 16}, "1 .every pixel., 2, 4, 8"),
        ({"start_resolution": 8}, "node resolution .16."),
        ({"start_resolution": 100}, "powers of two"),
        ({"start_resolution": 2**15}, "16384"),
        ({"finest_ratio": 0.0}, "above 0"),
        ({"finest_ratio": 2.0}, "ratio_target"),
        ({"max_passes": 0}, "1 or more"),
        ({"bias": -1.0}, "0 or more"),
        ({"bias": float("nan")}, "0 or more"),
    ],
)
def test_settings_that_are_not_supported_are_refused_with_what_is(settings, told):
    with pytest.raises(UseError, match=told) as problem:
        AdaptiveShadowMap(**settings)
    assert "\n" not in str(problem.value)
    value = next(iter(settings.values()))
    assert str(value) in str(problem.value), "what was given is not told"


def test_an_unknown_comparison_is_refused_with_the_known_ones():
    with pytest.raises(UseError, match="compare 'normal'; known: both, depth, id"):
        check_test("normal", 0.0)


def limited(case: Case, **settings):
    """Looks take every pixel, so that one size of them is compiled."""
    algorithm = AdaptiveShadowMap(pixel_share=1, cost_model=FAST, **settings)
    state = algorithm.build(case.eye, case.frame, case.rays)
    lit = algorithm.visibility(state, case.eye.points)
    log2 = algorithm.lookup(state, case.eye.points)[1]
    return algorithm.status(state), case.wrong(lit), case.texel_width(log2)


@pytest.mark.parametrize(
    ("settings", "status"),
    [
        ({"memory_bytes": TEXELS * 6}, Status.MEMORY_LIMIT),
        ({"memory_bytes": 3 * 2400}, Status.MEMORY_LIMIT),
        ({"memory_bytes": 3 * 2400, "cover": False}, Status.MEMORY_LIMIT),
        ({"memory_bytes": TEXELS * 6, "time_limit": 1e-6}, Status.TIME_LIMIT),
        ({"memory_bytes": 2**20, "max_passes": 1, "cover": False}, Status.PASS_LIMIT),
    ],
)
def test_every_limit_is_told_and_leaves_a_coarser_map(settings, status):
    """What was built answers every pixel: wrong only within a texel of a shadow edge."""
    case = analytic_case("a4_disc_light", SIDE)
    ended, wrong, width = limited(case, **settings)
    assert ended is status and ended.is_limit
    assert (case.edge_distance[wrong] < width[wrong]).all()


def test_full_page_tables_are_told():
    """Pages 16 levels down need five tables on the way, and there is one for four pages: the eye
    hovers above the shadow's edge, and the light's fixed field of view is 100 degrees wide."""
    scene = ANALYTIC_SCENES["a4_disc_light"]()
    edge = 5.0 / 3.0
    view = ViewSpec("near", (edge, 0.0, 0.004), (edge, 0.0, 0.0), (0.0, 1.0, 0.0), 20.0, SIDE, SIDE)
    light = LightSpec("centre", "point", (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), fov_deg=100.0)
    case = case_of(scene, scene.spec.shapes, view, light)
    status, wrong, width = limited(case, memory_bytes=3 * 2400)
    assert status is Status.NODE_CAPACITY and status.is_limit
    assert "`node_resolution`" in status.value
    assert (case.edge_distance[wrong] < width[wrong]).all()
    # With room for them the same pages exist, and the shadow is exact.
    status, wrong, width = limited(case, memory_bytes=2**20)
    assert status is not Status.NODE_CAPACITY
    assert (case.edge_distance[wrong] < width[wrong]).all() and wrong.mean() < 0.002


def test_addresses_that_do_not_fit_32_bits_are_refused():
    """Texels are addressed as one int32: a pool or map beyond that would wrap in silence."""
    with pytest.raises(UseError, match="lower `memory_bytes`"):
        AdaptiveShadowMap(memory_bytes=2**36).tree_shape(1)
    case = analytic_case("a6_sphere", SIDE)
    with pytest.raises(UseError, match="32768"):
        UniformShadowMap(2**15).build(case.eye, case.frame, case.rays)


# A light that nobody sees.


def empty_views(case: Case) -> list[ViewSpec]:
    """The sky; and the floor from below, which the light does not reach."""
    return [
        ViewSpec("sky", (0.0, 0.0, 1.0), (0.0, 0.1, 9.0), (0.0, 1.0, 0.0), 30.0, SIDE, SIDE),
        ViewSpec("below", (0.0, 0.0, -3.0), (0.0, 0.1, 0.0), (0.0, 1.0, 0.0), 30.0, SIDE, SIDE),
    ]


@pytest.mark.parametrize("look", [0, 1], ids=["sky", "below"])
def test_a_light_that_reaches_nothing_in_view_casts_level_0_alone(look):
    """Refused where a frame is to be fitted; with a frame of its own the map is as coarse as it
    starts, all is dark, and nothing is left to gain. The next view is refined as ever."""
    case = analytic_case("a4_disc_light", SIDE)
    eye = analytic_eye(case.shapes[:1], empty_views(case)[look])
    with pytest.raises(UseError, match="choose another `light` or `view`"):
        light_frame(case.light, eye, scene_bounds(case.shapes))
    algorithm = AdaptiveShadowMap(memory_bytes=TEXELS * 6, pixel_share=1, cost_model=FAST)
    rays = CountingRays(case.rays)
    state = algorithm.build(eye, case.frame, rays)
    assert algorithm.status(state) is Status.COMPLETE
    assert not np.asarray(algorithm.visibility(state, eye.points)).any()
    assert rays.launches == 1 and algorithm.max_level(state) == 0
    for _ in range(2):
        state = algorithm.update(state, eye, case.frame, rays)
    assert rays.launches == 1
    state = algorithm.update(state, case.eye, case.frame, rays)
    assert algorithm.max_level(state) > 0
    assert case.error(algorithm.visibility(state, case.eye.points)) < 0.02


# Time limits.


class Clock:
    """Stands for `time.perf_counter`: stands still but for what it is told."""

    def __init__(self):
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class SlowRays(CountingRays):
    """Every launch takes `launch` seconds and every texel `texel` more, on the clock."""

    def __init__(self, inner, clock: Clock, launch: float, texel: float):
        super().__init__(inner)
        self.clock, self.launch, self.texel = clock, launch, texel

    def light_buffer(self, frame, windows):
        self.clock.now += self.launch + self.texel * windows.texels
        return super().light_buffer(frame, windows)


TEXEL, LAUNCH = 1e-6, 2e-3
"""Seconds by the cost model."""


@pytest.fixture
def clock(monkeypatch) -> Clock:
    clock = Clock()
    for module in (asm, refiner):
        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=clock))
    return clock


def timed(limit: float | None) -> AdaptiveShadowMap:
    return AdaptiveShadowMap(
        memory_bytes=2**20,
        node_resolution=8,
        start_resolution=32,
        pixel_share=1,
        time_limit=limit,
        cost_model=CostModel(TEXEL, LAUNCH, 0.0),
    )


@pytest.mark.parametrize(
    ("launch", "texel"),
    [(LAUNCH, TEXEL), (10 * LAUNCH, 10 * TEXEL), (10 * LAUNCH, TEXEL)],
    ids=["as predicted", "10 times", "launches 10 times"],
)
def test_the_time_limit_is_kept_where_rays_are_10_times_slower(clock, launch, texel):
    """Level 0 is cast in any case, and shows how slow the rays are."""
    case = analytic_case("a4_disc_light", 128)
    rays = SlowRays(case.rays, clock, launch, texel)
    free = timed(None)
    begun = clock.now
    assert free.status(free.build(case.eye, case.frame, rays)) is not Status.TIME_LIMIT
    whole = clock.now - begun
    limit = 0.4 * whole
    algorithm = timed(limit)
    begun = clock.now
    state = algorithm.build(case.eye, case.frame, rays)
    assert algorithm.status(state) is Status.TIME_LIMIT
    took = clock.now - begun
    assert took <= limit + launch
    assert took > 0.4 * limit, "time was left"
    wrong = case.wrong(algorithm.visibility(state, case.eye.points))
    width = case.texel_width(algorithm.lookup(state, case.eye.points)[1])
    assert (case.edge_distance[wrong] < width[wrong]).all()
    # Each further update has the same time, and what is left to do gets done.
    before = wrong.sum()
    for _ in range(12):
        begun = clock.now
        state = algorithm.update(state, case.eye, case.frame, rays)
        assert clock.now - begun <= limit + launch
    assert algorithm.status(state) is not Status.TIME_LIMIT
    assert case.wrong(algorithm.visibility(state, case.eye.points)).sum() < before


def test_a_moving_view_keeps_the_time_limit(clock):
    case = analytic_case("a4_disc_light", 128)
    rays = SlowRays(case.rays, clock, 10 * LAUNCH, 10 * TEXEL)
    limit = 0.15
    algorithm = timed(limit)
    state = algorithm.build(case.eye, case.frame, rays)
    ended = []
    for x in (0.2, 0.9, 1.7):
        near = replace(case.view, origin=(x, -0.1, 2.0), target=(x, 0.0, 0.0))
        eye = analytic_eye(case.shapes, near)
        begun = clock.now
        state = algorithm.update(state, eye, case.frame, rays)
        assert clock.now - begun <= limit + 1e-9
        ended.append(algorithm.status(state))
    assert Status.TIME_LIMIT in ended


def test_without_a_time_limit_slow_rays_change_nothing(clock):
    """What is cast does not depend on the clock."""
    case = analytic_case("a4_disc_light", 128)
    windows = []
    for slow in (0.0, 1.0):
        rays = SlowRays(case.rays, clock, slow, slow)
        timed(None).build(case.eye, case.frame, rays)
        windows.append(rays.windows)
    assert len(windows[0]) == len(windows[1]) > 2
    for one, other in zip(*windows, strict=True):
        np.testing.assert_array_equal(one.corner, other.corner)


def test_memory_for_texels_grows_as_pages_are_made(monkeypatch):
    """The same pages and the same image as with all memory from the start."""
    case = analytic_case("a4_disc_light", SIDE)
    settings = AdaptiveShadowMap(memory_bytes=2**20, cost_model=FAST)
    whole = settings.build(case.eye, case.frame, case.rays)
    monkeypatch.setattr(tree, "FIRST_BYTES", 2**16)
    shape = settings.tree_shape(case.frame.faces)
    first = tree.empty_tree(shape, "both").capacity
    grown = settings.build(case.eye, case.frame, case.rays)
    assert first < grown.tree.capacity and first * tree.GROWTH < shape.pages
    assert grown.pool.used_pages <= grown.tree.capacity <= whole.tree.capacity == shape.pages
    np.testing.assert_array_equal(grown.pool.squares, whole.pool.squares)
    for old, new in zip(whole.tree[1:], grown.tree[1:], strict=True):
        held = grown.pool.held()
        np.testing.assert_array_equal(np.asarray(old)[held], np.asarray(new)[held])
    lit = settings.visibility(grown, case.eye.points)
    np.testing.assert_array_equal(lit, settings.visibility(whole, case.eye.points))
