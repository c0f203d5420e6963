"""Blocks of pixels that are settled at once: exactly what each pixel is told one by one.

The oracle is `AdaptiveShadowMap.visibility`; for bounds and covers, loops over texels and squares.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import Case, analytic_case, kept_arrays, permuted
from helpers.effort import examples
from helpers.mitsuba_scenes import loaded
from helpers.registry import FAST
from helpers.slow_tree import (
    is_below,
    random_squares,
    requests_for,
    roots_of,
    squares_of,
    tree_shape,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from asmjax.buffers import EyeBuffer
from asmjax.errors import UseError
from asmjax.experiment.traces import counted_traces
from asmjax.geometry import fixed_frame
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.adaptive import blocks as blocks_file
from asmjax.shadow.adaptive.address import BITS
from asmjax.shadow.adaptive.blocks import (
    DARK,
    LIT,
    OPEN,
    decided,
    visibility_by_blocks,
)
from asmjax.shadow.adaptive.planar_blocks import blocks_of
from asmjax.shadow.adaptive.pool import NodePool

SIDE = 128
"""Pixels a side: 256 blocks."""


LARGE_PAGES = {"memory_bytes": 2**21, "node_resolution": 16, "cells": 8}
"""Another tree: larger pages, whose levels differ by a factor of 8 a side."""


def asm(**changes) -> AdaptiveShadowMap:
    """Looks take every pixel, so that one size of them is compiled."""
    known = AdaptiveShadowMap(
        memory_bytes=2**20, node_resolution=8, start_resolution=64, pixel_share=1, cost_model=FAST
    )
    return replace(known, **changes)


def counts(algorithm, state, *eyes: EyeBuffer) -> dict[int, int]:
    """Checks every pixel of every sample; how many blocks were found lit, dark and open."""
    blocks = blocks_of(*eyes)
    known = np.asarray(decided(algorithm, state, blocks))
    found = visibility_by_blocks(algorithm, state, blocks)
    for eye, visibility in zip(eyes, found, strict=True):
        expected = np.asarray(algorithm.visibility(state, eye.points))
        np.testing.assert_array_equal(visibility, expected)
    assert found.dtype == eyes[0].points.position.dtype
    return {kind: int((known == kind).sum()) for kind in (LIT, DARK, OPEN)}


def built(case: Case, algorithm: AdaptiveShadowMap):
    """Built, and at rest once more: only then are pages made where there is no edge."""
    state = algorithm.build(case.eye, case.frame, case.rays)
    return algorithm.update(state, case.eye, case.frame, case.rays)


def seen_from(case: Case, view: ViewSpec, offset=(0.0, 0.0)) -> EyeBuffer:
    """What the casters' scene looks like from elsewhere, `offset` pixels beside the centres: the
    view through a pinhole moved against the image, under the camera of the one that is not."""
    x, y = view.principal_point
    moved = (x - offset[0] / view.width, y - offset[1] / view.height)
    eye = analytic_eye(case.shapes, replace(view, principal_point=moved))
    return eqx.tree_at(lambda e: e.camera, eye, analytic_eye(case.shapes, view).camera)


def closer(name: str) -> Case:
    """An analytic scene whose shadow fills more of the image."""
    case = analytic_case(name, SIDE)
    narrower = 0.5 if name.startswith("a6") else 0.75
    view = replace(case.view, fov_x_deg=narrower * case.view.fov_x_deg)
    return replace(case, view=view, eye=seen_from(case, view))


@pytest.mark.parametrize(
    ("name", "wide"),
    [
        ("a4_disc_light", False),
        ("a6_sphere_sun", False),
        pytest.param("a6_sphere", False, marks=pytest.mark.slow),
        pytest.param("a6_sphere", True, marks=pytest.mark.slow),
        pytest.param("a6_sphere_sun", True, marks=pytest.mark.slow),
    ],
)
def test_blocks_are_what_their_pixels_are(name, wide):
    """A point light of one face, one of three, and parallel rays, in float32; rays from a point
    and parallel ones in float64."""
    with jax.enable_x64(wide):
        case = closer(name)
        algorithm = asm()
        found = counts(algorithm, built(case, algorithm), case.eye)
        assert case.eye.points.position.dtype == (jnp.float64 if wide else jnp.float32)
        assert min(found.values()) > 0, found


@pytest.mark.parametrize(("compare", "kinds"), [("id", {LIT, DARK}), ("depth", {DARK})])
def test_every_comparison(compare, kinds):
    """Depths alone never prove that a surface is lit: they are its own."""
    case = analytic_case("a4_disc_light", SIDE)
    algorithm = asm(compare=compare)
    found = counts(algorithm, built(case, algorithm), case.eye)
    assert {kind for kind in (LIT, DARK) if found[kind]} == kinds


@pytest.mark.slow
def test_another_tree():
    case = closer("a4_disc_light")
    algorithm = asm(**LARGE_PAGES)
    found = counts(algorithm, built(case, algorithm), case.eye)
    assert found[LIT], found


def test_moved_views_and_evictions():
    """A memory too small for the whole way: pages come and go, and their bounds with them."""
    case = analytic_case("a4_disc_light", SIDE)
    algorithm = asm(memory_bytes=3 * 2**15, start_resolution=32)
    state = built(case, algorithm)
    settled = evicted = 0
    for k in range(6):
        shift = np.array([0.5 * k, -0.3 * k, 0.0])
        origin, target = (
            tuple((np.asarray(p) + shift).tolist()) for p in (case.view.origin, case.view.target)
        )
        eye = seen_from(case, replace(case.view, origin=origin, target=target))
        state = algorithm.update(state, eye, case.frame, case.rays)
        found = counts(algorithm, state, eye)
        settled += found[LIT] + found[DARK]
        nodes = algorithm.cost(state).nodes
        assert nodes is not None
        evicted += nodes.evicted
    assert evicted > 0
    assert settled > 100


def test_moved_casters():
    case = analytic_case("a1_square", SIDE)
    algorithm = asm()
    state = built(case, algorithm)
    before = counts(algorithm, state, case.eye)
    square = replace(case.shapes[1], centre=(0.9, 0.4, 2.1))
    shapes = (case.shapes[0], square, *case.shapes[2:])
    box = scene_bounds([case.shapes[1], square])[None]
    eye = analytic_eye(shapes, case.view)
    state = algorithm.update(state, eye, case.frame, AnalyticRays(shapes), box)
    assert counts(algorithm, state, eye) != before


def number(low, high):
    return st.floats(low, high, allow_nan=False, width=32)


@given(
    x=number(-4, 4), y=number(-4, 4), height=number(0.0625, 6), aside=number(-3, 3),
    lamp=number(-2, 2), fov=number(5, 80),
)  # fmt: skip
@settings(max_examples=examples(8, 1_000))
def test_any_view_and_light(x, y, height, aside, lamp, fov):
    """From grazing views close to the plane to ones from above."""
    scene = ANALYTIC_SCENES["a4_disc_light"]()
    target = (x + 1.5, y + aside, 0.0)
    view = ViewSpec("any", (x, y, height), target, (0.0, 0.0, 1.0), fov, SIDE, SIDE)
    eye = analytic_eye(scene.spec.shapes, view)
    light = LightSpec("lamp", "point", (lamp, 0.5, 5.0), (0.0, 0.0, -1.0), fov_deg=100.0)
    frame = light_frame(light, eye, scene_bounds(scene.spec.shapes))
    algorithm = asm(max_passes=3, cover=False)
    state = algorithm.build(eye, frame, AnalyticRays(scene.spec.shapes))
    counts(algorithm, state, eye)


@pytest.mark.parametrize("cutoff_deg", [20.0, 50.0])
def test_a_spot_is_dark_outside_its_cone(cutoff_deg):
    """Blocks across the cone's border are left to their pixels."""
    case = analytic_case("a4_disc_light", SIDE)
    light = LightSpec("spot", "spot", (0.3, 0.2, 5.0), (0.1, 0.0, -1.0), cutoff_deg=cutoff_deg)
    frame = light_frame(light, case.eye, scene_bounds(case.shapes))
    algorithm = asm()
    state = algorithm.build(case.eye, frame, case.rays)
    found = counts(algorithm, state, case.eye)
    assert found[LIT] and found[OPEN]


def test_backs_are_dark_at_once():
    """The light is below the plane that the eye sees from above."""
    case = analytic_case("a1_square", SIDE)
    frame = fixed_frame((0.1, 0.2, -3.0), (0.0, 0.0, 1.0), 100.0, np.float64(1e-4))
    algorithm = asm()
    state = algorithm.build(case.eye, frame, case.rays)
    found = counts(algorithm, state, case.eye)
    assert found[DARK] > 100 and not found[LIT], found


@pytest.mark.parametrize("size", [(61, 83), (7, 40)])
def test_samples_and_sizes(size):
    """Four samples a pixel are classified once; strips beside whole blocks are looked up."""
    case = closer("a4_disc_light")
    view = replace(case.view.resized(*size[::-1]), fov_x_deg=0.6 * case.view.fov_x_deg)
    offsets = [(0.0, 0.0), (-0.5, 0.25), (0.499, -0.5), (0.1, 0.4)]
    eyes = [seen_from(case, view, offset) for offset in offsets]
    algorithm = asm()
    found = counts(algorithm, built(case, algorithm), *eyes)
    assert sum(found.values()) == (size[0] // 8) * (size[1] // 8)
    assert found[LIT] or min(size) < 61


def test_pixels_that_see_nothing_are_dark():
    """A view over the plane's end; and a block of which one pixel is masked."""
    case = analytic_case("a4_disc_light", SIDE)
    x, y, _ = case.view.origin
    eye = seen_from(case, replace(case.view, origin=(x, y, 0.8), target=(0.0, 0.0, 0.8)))
    algorithm = asm()
    state = algorithm.build(eye, case.frame, case.rays)
    assert 0.1 < eye.valid.mean() < 0.9
    counts(algorithm, state, eye)
    masked = np.asarray(case.eye.points.valid).copy()
    masked[0] = False
    partly = eqx.tree_at(
        lambda e: (e.shape, e.points.valid),
        case.eye,
        (np.where(masked, case.eye.shape, -1).astype(np.int32), jnp.asarray(masked)),
    )
    assert blocks_of(case.eye).planar[0, 0] and not blocks_of(partly).planar[0, 0]
    counts(algorithm, algorithm.build(partly, case.frame, case.rays), partly)


def test_points_beside_the_plane_are_allowed_for():
    """Positions that are off the plane by rounding of float32, as a renderer's may be."""
    case = analytic_case("a1_square", SIDE)
    rng = np.random.default_rng(0)
    rough = case.eye.world + 1e-6 * rng.normal(size=case.eye.world.shape)
    position = rough - case.eye.camera.origin[:, None]
    eye = eqx.tree_at(
        lambda e: (e.world, e.points.position),
        case.eye,
        (rough, jnp.asarray(position, case.eye.points.position.dtype)),
    )
    off = np.asarray(blocks_of(eye).off)[blocks_of(eye).planar.reshape(-1)]
    assert (np.asarray(blocks_of(case.eye).off) < 1e-12).all()
    assert (off > 1e-6).all() and (off < 1e-3).all()
    algorithm = asm()
    counts(algorithm, built(case, algorithm), eye)


def test_queries_of_known_sizes_trace_nothing():
    case = analytic_case("a4_disc_light", SIDE)
    algorithm = asm()
    state = built(case, algorithm)
    blocks = blocks_of(case.eye)
    first = visibility_by_blocks(algorithm, state, blocks)
    with counted_traces() as traced:
        again = visibility_by_blocks(algorithm, state, blocks_of(case.eye))
    np.testing.assert_array_equal(again, first)
    assert not traced


def test_bounds_are_counted_and_fit_into_the_memory():
    case = analytic_case("a4_disc_light", SIDE)
    algorithm = asm()
    state = built(case, algorithm)
    without = algorithm.cost(state).bytes
    visibility_by_blocks(algorithm, state, blocks_of(case.eye))
    cost = algorithm.cost(state)
    assert cost.bytes == without + 8 * state.shape.pages
    assert cost.bytes == sum(array.nbytes for array in kept_arrays(state))
    assert cost.bytes <= algorithm.memory_bytes


def test_wrong_use_is_refused():
    case = analytic_case("a4_disc_light", SIDE)
    other = analytic_eye(case.shapes, replace(case.view, fov_x_deg=30.0))
    with pytest.raises(UseError, match="no eye was given"):
        blocks_of()
    with pytest.raises(UseError, match="different cameras"):
        blocks_of(case.eye, other)
    with pytest.raises(UseError, match="outside their pixels"):
        blocks_of(permuted(case.eye, np.arange(SIDE**2)[::-1]))
    with pytest.raises(UseError, match="outside their pixels"):
        blocks_of(case.eye, seen_from(case, case.view, (0.6, 0.0)))
    algorithm = asm()
    state = built(case, algorithm)
    algorithm.update(state, case.eye, case.frame, case.rays)
    with pytest.raises(UseError, match="handed to update"):
        visibility_by_blocks(algorithm, state, blocks_of(case.eye))


def test_bounds_are_those_of_the_texels_below():
    """After evictions; the twin looks at every texel of every page below each page."""
    case = analytic_case("a4_disc_light", SIDE)
    algorithm = asm(memory_bytes=3 * 2**15, start_resolution=32)
    state = built(case, algorithm)
    corner = replace(case.view, target=(2.0, 1.0, 0.0))
    state = algorithm.update(state, seen_from(case, corner), case.frame, case.rays)
    nodes = algorithm.cost(state).nodes
    assert nodes is not None and nodes.evicted > 0
    pages = state.pool.held()
    squares = squares_of(state.pool.squares[:, pages])
    depth, prim = np.asarray(state.tree.depth), np.asarray(state.tree.prim)
    found = state.pyramid()
    assert found.farthest is not None
    assert found.least is not None and found.most is not None
    for page, square in zip(pages, squares, strict=True):
        below = [p for p, s in zip(pages, squares, strict=True)
                 if s == square or is_below(state.shape, s, square)]  # fmt: skip
        assert found.farthest[page] == depth[below].max()
        assert (found.least[page], found.most[page]) == (prim[below].min(), prim[below].max())


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=examples(40))
def test_pages_that_cover_leave_no_gap(seed):
    """Where they are said to cover a rectangle, whatever serves a place in it lies in their
    squares; places are tried on a grid finer than the finest page."""
    rng = np.random.default_rng(seed)
    shape = tree_shape(pages=60, tables=60)
    pool = NodePool(shape)
    for squares in (roots_of(shape), random_squares(rng, shape, 40)):
        pool.admit(requests_for(squares), 1, 0, False)
    low = rng.integers(0, 1 << BITS, (2, 64))
    size = (2.0 ** rng.uniform(BITS - 8, BITS - 1, (2, 64))).astype(np.int64)
    high = np.minimum(low + size, (1 << BITS) - 1)
    entries = jnp.asarray(pool.table.entries)
    found, levels, covered = jax.jit(blocks_file._pages_over, static_argnums=0)(
        shape, entries, jnp.zeros(64, jnp.int32),
        jnp.asarray(low, jnp.int32), jnp.asarray(high, jnp.int32),
    )  # fmt: skip
    for k in np.flatnonzero(covered):
        face, level, column, row = pool.squares[:, np.asarray(found)[:, k]].astype(np.int64)
        np.testing.assert_array_equal(level, np.asarray(levels)[:, k])
        assert (face == 0).all()
        x, y = np.linspace(low[:, k], high[:, k], 40).astype(np.int64).T
        shift = BITS - shape.log2_nodes_at(level)[:, None, None]
        inside = (x[None, :] >> shift == column[:, None, None]) & (
            y[:, None] >> shift == row[:, None, None]
        )
        assert inside.any(axis=0).all()


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    "view",
    [pytest.param("overview", marks=pytest.mark.slow), "closeup",
     pytest.param("macro", marks=pytest.mark.slow)],
)  # fmt: skip
def test_blocks_of_a_rendered_room(view):
    """Triangles, a wide light, 31,000 primitives; then a step of the eye."""
    scene = loaded("paper_room")
    spec = scene.view(view).resized(SIDE, SIDE)
    eye = scene.eye(spec)
    frame, rays = scene.light_frame(eye, None), scene.light_rays(None)
    algorithm = asm(**LARGE_PAGES)
    state = algorithm.build(eye, frame, rays)
    found = counts(algorithm, state, eye, scene.eye(spec, (0.3, -0.4)))
    assert found[LIT] and found[LIT] + found[DARK] > 20, found
    aside = tuple((0.98 * np.asarray(spec.origin) + 0.02 * np.asarray(spec.target)).tolist())
    eye = scene.eye(replace(spec, origin=aside))
    state = algorithm.update(state, eye, frame, rays)
    assert counts(algorithm, state, eye)[LIT]
