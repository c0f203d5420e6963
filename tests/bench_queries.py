"""Benchmarks of ways to query an adaptive map, each with and without; `make bench` runs them.

512 x 512 pixels, 16 MB. Both sides of a comparison are timed in turn, so that a busy machine slows
both alike; `extra_info` holds medians of wall and processor time. docs/benchmarks.md, "Queries:
what pays", says what became of each.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded, real_scene
from helpers.registry import FAST

from asmjax.buffers import EyeBuffer, anchor, light_offset, project, seen_points
from asmjax.preparation import sample_offsets
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.adaptive import AdaptiveState
from asmjax.shadow.adaptive.address import BITS, address_of
from asmjax.shadow.adaptive.blocks import DARK, LIT, decided, visibility_by_blocks
from asmjax.shadow.adaptive.bounds import page_bounds, pyramid
from asmjax.shadow.adaptive.page_table import find_entries, level_of, page_of, take
from asmjax.shadow.adaptive.planar_blocks import blocks_of
from asmjax.shadow.adaptive.tree import page_outcome, serve
from asmjax.shadow.comparison import pack_prim

pytestmark = [pytest.mark.mitsuba, pytest.mark.timeout(900)]

SIDE = 512
HOUSE = "victorian_house"
VIEWS = ("overview", "closeup", "macro", HOUSE)
ROUNDS = 15


class Scene(NamedTuple):
    """A view of a scene, its samples, and an adaptive map built for it."""

    sample: Callable[[tuple[float, float]], EyeBuffer]
    eye: EyeBuffer
    algorithm: AdaptiveShadowMap
    state: AdaptiveState


@pytest.fixture(scope="module", params=VIEWS)
def scene(request) -> Scene:
    """Three views of the paper's room, of few large triangles and many small ones, and a house of
    small triangles under an empty sky."""
    view = request.param
    loaded_scene = loaded(real_scene(view) if view == HOUSE else "paper_room")
    spec: ViewSpec = loaded_scene.view(None if view == HOUSE else view).resized(SIDE, SIDE)
    eye = loaded_scene.eye(spec)
    frame = loaded_scene.light_frame(eye, None)
    algorithm = AdaptiveShadowMap(cost_model=FAST)
    state = algorithm.build(eye, frame, loaded_scene.light_rays(None))
    return Scene(lambda offset: loaded_scene.eye(spec, offset), eye, algorithm, state)


def in_turn(benchmark, rounds=ROUNDS, **calls: Callable) -> None:
    """Times the calls alternately after a warm-up and tells medians in ms: wall, processor."""
    times = {name: np.zeros((rounds, 2)) for name in calls}
    for k in range(-2, rounds):
        for name, call in calls.items():
            wall, processor = time.perf_counter(), time.process_time()
            jax.block_until_ready(call())
            spent = time.perf_counter() - wall, time.process_time() - processor
            times[name][max(k, 0)] = 1e3 * np.array(spent)
    for name, spent in times.items():
        wall, processor = np.median(spent, axis=0)
        benchmark.extra_info[name] = {"wall_ms": wall, "processor_ms": processor}
        print(f"\n  {name:24s} {wall:8.2f} ms wall {processor:8.2f} ms processor", end="")
    print()
    benchmark.pedantic(lambda: jax.block_until_ready(list(calls.values())[-1]()), rounds=3)


@pytest.mark.parametrize("samples", [1, 16])
def test_blocks(benchmark, scene, samples):
    """All pixels that see something against the pixels that no block settles."""
    eye, algorithm, state = scene.eye, scene.algorithm, scene.state
    eyes = [eye, *map(scene.sample, sample_offsets(samples, 0)[1:])]
    seen, blocks = [seen_points(e) for e in eyes], blocks_of(*eyes)
    known = np.asarray(decided(algorithm, state, blocks))

    def each_pixel():
        return [s.image(algorithm.visibility(state, s.points)) for s in seen]

    def by_blocks():
        return list(visibility_by_blocks(algorithm, state, blocks))

    np.testing.assert_array_equal(by_blocks(), each_pixel())
    shares = {"planar": blocks.planar, "lit": known == LIT, "dark": known == DARK}
    benchmark.extra_info.update({name: float(share.mean()) for name, share in shares.items()})
    print({name: round(float(share.mean()), 3) for name, share in shares.items()}, end="")
    in_turn(
        benchmark, ROUNDS if samples == 1 else 5,
        each_pixel=each_pixel,
        by_blocks=by_blocks,
        classification=lambda: decided(algorithm, state, blocks),
        bounds_of_subtrees=lambda: pyramid(
            page_bounds(state.tree), state.pool.held(), state.pool.ends()
        ),
        preparing_blocks=lambda: len(blocks_of(*eyes).eyes),
        preparing_seen=lambda: len([seen_points(e) for e in eyes]),
    )  # fmt: skip


def projected(points, frame, offset, anchor):
    receivers = project(points, frame, offset)
    return receivers, address_of(points, anchor, receivers, frame.perspective)


@partial(jax.jit, static_argnames="shape")
def plain(tree, points, frame, offset, anchor, bias, *, shape):
    """As `AdaptiveShadowMap.visibility`."""
    receivers, address = projected(points, frame, offset, anchor)
    entry = serve(shape, tree, receivers, address)
    return page_outcome(
        shape, tree, receivers, address, entry, None, bias=bias, perspective=frame.perspective
    )


@partial(jax.jit, static_argnames="shape")
def culled(tree, points, frame, offset, anchor, bias, only, *, shape):
    """`only` (pages,) is the only primitive of a page, or -1: pixels of that primitive need no
    texel. They all read the same one: lanes cannot be left out, but that costs no cache miss."""
    receivers, address = projected(points, frame, offset, anchor)
    entry = serve(shape, tree, receivers, address)
    own = pack_prim(receivers.prim).astype(jnp.int32)
    sure = (take(only, page_of(entry)) == own) & (receivers.prim >= 0)
    lit = page_outcome(
        shape, tree, receivers, address, jnp.where(sure, 0, entry), None,
        bias=bias, perspective=frame.perspective,
    )  # fmt: skip
    return receivers.facing & (sure | lit)


@partial(jax.jit, static_argnames="shape")
def known_entries(tree, points, frame, offset, anchor, bias, entry, *, shape):
    """What is left of a query if a pixel's page were known for nothing."""
    receivers, address = projected(points, frame, offset, anchor)
    return page_outcome(
        shape, tree, receivers, address, entry, None, bias=bias, perspective=frame.perspective
    )


@partial(jax.jit, static_argnames="shape")
def remembered(points, frame, offset, anchor, entry, leaves, *, shape):
    """Receivers, and whether the page that served the pixel last serves it again: whether it has
    nothing below it and its square, `leaves` (2, pages), holds the pixel still."""
    receivers, address = projected(points, frame, offset, anchor)
    shift = BITS - shape.log2_nodes_at(level_of(entry))
    page = page_of(entry)
    hit = (take(leaves[0], page) == address.x >> shift) & (
        take(leaves[1], page) == address.y >> shift
    )
    return receivers, address, hit & (receivers.face == 0)


@partial(jax.jit, static_argnames=("shape", "perspective"))
def mended(tree, receivers, address, entry, missed, bias, *, shape, perspective):
    """The query with the remembered entries, those of the pixels `missed` looked up again."""
    x, y = take(address.x, missed), take(address.y, missed)
    found = find_entries(shape, tree.entries, take(receivers.face, missed), (x, y))
    entry = entry.at[missed].set(found)
    return page_outcome(
        shape, tree, receivers, address, entry, None, bias=bias, perspective=perspective
    )


def test_last_leaf_cache(benchmark, scene):
    """Each pixel tries the page that served it in the frame before; the eye turns by 2 pixels."""
    state, bias = scene.state, scene.algorithm.bias
    shape, tree, frame, pool = state.shape, state.tree, state.frame, state.pool
    before, points = scene.eye.points, scene.sample((2.0, 1.0)).points

    def arguments(points):
        return points, frame, light_offset(points, frame), anchor(points, frame)

    entries = jax.jit(lambda p, *a: serve(shape, tree, *projected(p, *a)))
    last, now = entries(*arguments(before)), entries(*arguments(points))
    pages = pool.held()
    leaf = pages[pool.ends() - np.arange(pages.size) == 1]
    squares = np.full((2, shape.pages), -1, np.int32)
    squares[:, leaf] = pool.squares[2:, leaf]
    leaves = jnp.asarray(squares)
    step = -(-scene.eye.valid.size // 8)

    def cached():
        receivers, address, hit = remembered(*arguments(points), last, leaves, shape=shape)
        missed = np.flatnonzero(~np.asarray(hit)).astype(np.int32)
        padded = np.zeros(step * -(-missed.size // step), np.int32)
        padded[: missed.size] = missed
        return mended(
            tree, receivers, address, last, padded, bias,
            shape=shape, perspective=frame.perspective,
        )  # fmt: skip

    def without():
        return plain(tree, *arguments(points), bias, shape=shape)

    # Compiled otherwise, a pixel on a texel's border may be rounded to its other side.
    assert np.mean(np.asarray(cached()) != np.asarray(without())) < 1e-4
    hits = float(np.mean(remembered(*arguments(points), last, leaves, shape=shape)[2]))
    along_rows = float(np.mean(np.asarray(now)[1:] == np.asarray(now)[:-1]))
    benchmark.extra_info.update(hits=hits, same_page_as_left_pixel=along_rows)
    print(f"hits {hits:.3f}, same page as the pixel on the left {along_rows:.3f}", end="")
    in_turn(
        benchmark,
        without=without,
        checked_only=lambda: remembered(*arguments(points), last, leaves, shape=shape),
        known_for_nothing=lambda: known_entries(tree, *arguments(points), bias, now, shape=shape),
        cached=cached,
    )


def test_culling_by_page(benchmark, scene):
    """Pixels on pages of one primitive, their own, are lit without looking at a texel."""
    state, bias = scene.state, scene.algorithm.bias
    shape, tree, frame = state.shape, state.tree, state.frame
    _, least, most = map(np.asarray, page_bounds(tree))
    points = seen_points(scene.eye).points
    arguments = points, frame, light_offset(points, frame), anchor(points, frame), bias
    only = jnp.asarray(np.where(least == most, least.astype(np.int32), -1))
    without = partial(plain, tree, *arguments, shape=shape)
    by_page = partial(culled, tree, *arguments, only, shape=shape)
    assert np.mean(np.asarray(by_page()) != np.asarray(without())) < 1e-4
    entry = jax.jit(lambda p, *a: serve(shape, tree, *projected(p, *a)))(*arguments[:-1])
    own = np.asarray(points.prim)
    sure = (np.asarray(only)[page_of(np.asarray(entry))] == own & 0xFFFF) & (own >= 0)
    benchmark.extra_info["sure"] = float(sure.mean())
    print(f"sure {sure.mean():.3f}", end="")
    in_turn(benchmark, without=without, culled=by_page)
