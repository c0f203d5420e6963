"""Benchmarks of the adaptive map in the paper's room, 512 x 512 pixels; `make bench` runs them.

Frames are those of a walk back and forth, one step apart: their eye buffers are cast before, for
every method needs them. What is timed ends with the visibility of all pixels on the device.
"""

import itertools
import os
from contextlib import nullcontext
from functools import partial
from typing import NamedTuple

import drjit
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mitsuba_scenes import loaded

from asmjax.buffers import EyeBuffer, LightRays, anchor, light_offset, project, whole_image
from asmjax.geometry import LightFrame
from asmjax.render import caster
from asmjax.scene.path import CameraPath, orbit_keys
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap, calibrate
from asmjax.shadow.adaptive.address import BITS, address_of
from asmjax.shadow.adaptive.look import first_look
from asmjax.shadow.adaptive.page_table import LEVEL_BITS, find_entries, take
from asmjax.shadow.adaptive.shape import page_windows

pytestmark = pytest.mark.mitsuba

SIDE, FRAMES, WARM_UP = 512, 12, 24


class Walk(NamedTuple):
    """The frames of a walk, their one light frame, and what casts its rays."""

    eyes: list[EyeBuffer]
    frame: LightFrame
    rays: LightRays
    shadow_rays: list


@pytest.fixture(scope="module")
def walk() -> Walk:
    scene = loaded("paper_room")
    view = scene.view().resized(SIDE, SIDE)
    path = CameraPath(orbit_keys(view))
    eyes = [scene.eye(path.view(k)) for k in range(FRAMES)]
    rays, frame = scene.light_rays(), scene.kept_light_frame(None, eyes[0])
    for eye in eyes:
        frame = scene.kept_light_frame(frame, eye)
    return Walk(eyes, frame, rays, [scene.shadow_rays(eye, frame, rays) for eye in eyes])


@pytest.fixture(scope="module")
def settings(walk) -> AdaptiveShadowMap:
    return AdaptiveShadowMap(cost_model=calibrate(walk.rays, walk.frame))


@pytest.fixture(scope="module")
def built(walk, settings):
    return settings.build(walk.eyes[0], walk.frame, walk.rays)


def back_and_forth(walk: Walk):
    """Numbers of frames without end, one step apart."""
    there = range(len(walk.eyes))
    return itertools.cycle([*there, *there[-2:0:-1]])


def wait(value):
    return jax.block_until_ready(value)


@pytest.mark.parametrize("still", [False, True], ids=["moving", "still"])
def test_warm_frame(benchmark, walk, settings, still):
    """Update and query."""
    state = settings.build(walk.eyes[0], walk.frame, walk.rays)
    frames = itertools.repeat(0) if still else back_and_forth(walk)
    made = []

    def frame():
        nonlocal state
        eye = walk.eyes[next(frames)]
        state = settings.update(state, eye, walk.frame, walk.rays)
        wait(settings.visibility(state, eye.points))
        made.append(settings.cost(state).nodes.made)

    benchmark.pedantic(frame, rounds=60, warmup_rounds=WARM_UP)
    benchmark.extra_info["nodes_made_per_frame"] = float(np.mean(made[WARM_UP:]))
    benchmark.extra_info["nodes_held"] = settings.cost(state).nodes.held


def test_query(benchmark, walk, settings, built):
    benchmark(lambda: wait(settings.visibility(built, walk.eyes[0].points)))


@pytest.mark.parametrize("workers", ["end", "stay"])
def test_query_after_a_launch_two_pools(benchmark, walk, settings, built, workers, monkeypatch):
    """With Dr.Jit's workers gone after each launch, and with them looking for more work."""
    if workers == "stay":
        drjit.set_thread_count(os.cpu_count() or 1)
        monkeypatch.setattr(caster, "all_threads", nullcontext)
    pages = built.pool.held()[-64:]
    windows = page_windows(built.shape, built.pool.squares[:, pages])

    def launch():
        walk.rays.light_buffer(walk.frame, windows)

    benchmark.pedantic(
        lambda: wait(settings.visibility(built, walk.eyes[0].points)),
        setup=launch, rounds=100, warmup_rounds=5,
    )  # fmt: skip
    drjit.set_thread_count(1)


@pytest.mark.parametrize("which", ["coarse", "edges", "uniform"])
def test_light_rays(benchmark, walk, built, which):
    """Nodes of the first levels, those of the last ones, which follow the edges, and a flat map."""
    pool, shape = built.pool, built.shape
    pages = pool.held()
    level = pool.squares[1, pages]
    windows = {
        "coarse": page_windows(shape, pool.squares[:, pages[level <= 1]]),
        "edges": page_windows(shape, pool.squares[:, pages[level >= 6]]),
        "uniform": whole_image(walk.frame, 2048),
    }[which]
    benchmark.pedantic(
        lambda: walk.rays.light_buffer(walk.frame, windows), rounds=20, warmup_rounds=3
    )
    ns = 1e9 * benchmark.stats.stats.median / windows.texels
    benchmark.extra_info.update(rays=windows.texels, ns_per_ray=ns)
    print(f" {windows.texels} rays, {ns:.1f} ns each", end="")


def test_cold_build(benchmark, walk, settings):
    """Nothing is kept but compiled code and the cost model."""
    benchmark.pedantic(
        lambda: wait(settings.build(walk.eyes[0], walk.frame, walk.rays).tree),
        rounds=8, warmup_rounds=1,
    )  # fmt: skip


def test_uniform_frame(benchmark, walk):
    """A flat map of 2048 x 2048, 16 MB: drawn and queried."""
    flat, frames = UniformShadowMap(2048), back_and_forth(walk)

    def frame():
        eye = walk.eyes[next(frames)]
        wait(flat.visibility(flat.build(eye, walk.frame, walk.rays), eye.points))

    benchmark.pedantic(frame, rounds=30, warmup_rounds=3)


def test_uniform_query(benchmark, walk):
    flat, eye = UniformShadowMap(2048), walk.eyes[0]
    state = flat.build(eye, walk.frame, walk.rays)
    benchmark(lambda: wait(flat.visibility(state, eye.points)))


def test_shadow_rays(benchmark, walk):
    """One ray a pixel, put on the device before."""
    frames = back_and_forth(walk)
    benchmark.pedantic(
        lambda: walk.shadow_rays[next(frames)].trace(), rounds=60, warmup_rounds=WARM_UP
    )


@pytest.mark.parametrize("share", [1, 8])
def test_look(benchmark, walk, settings, built, share):
    """At every pixel, or at one in eight: receivers, addresses, ratios, four taps."""
    turns = itertools.count()

    def look():
        return first_look(
            built.tree, walk.eyes[0], walk.frame, settings.goals,
            shape=built.shape, measure=settings.measure, share=share, turn=next(turns),
        )  # fmt: skip

    benchmark(lambda: wait(look()))


class Descent(NamedTuple):
    """A tree to be walked down node by node.

    Attributes:
        child: (nodes * c * c,) number of the node in each cell, -1 for none.
        entry: (nodes,) page << 5 | level of each node's page, -1 for none.
    """

    child: jax.Array
    entry: jax.Array


def descent_of(state) -> Descent:
    """The nodes of a state's pages and those on the way to them, level-0 nodes first."""
    shape, pool = state.shape, state.pool
    c, side = 1 << shape.log2_cells, 1 << shape.log2_roots
    child, entry = [[-1] * c * c for _ in range(shape.roots)], [-1] * shape.roots
    for page in pool.held():
        face, level, column, row = pool.squares[:, page].tolist()
        up = shape.log2_cells * level
        node = (face * side + (row >> up)) * side + (column >> up)
        for below in range(1, level + 1):
            shift = shape.log2_cells * (level - below)
            cell = (row >> shift) % c * c + (column >> shift) % c
            if child[node][cell] < 0:
                child[node][cell] = len(child)
                child.append([-1] * c * c)
                entry.append(-1)
            node = child[node][cell]
        entry[node] = (page << LEVEL_BITS) | level
    return Descent(jnp.array(child, jnp.int32).reshape(-1), jnp.array(entry, jnp.int32))


@partial(jax.jit, static_argnames="shape")
def descend(descent: Descent, face, at, *, shape):
    """The entry of the deepest page over each place: as `find_entries`, one level a step."""
    log2_c = shape.log2_cells
    column, row = at >> (BITS - shape.log2_roots)
    node = (((face << shape.log2_roots) + row) << shape.log2_roots) + column
    found = take(descent.entry, node)
    for level in range(1, shape.levels + 1):
        column, row = (at >> (BITS - shape.log2_nodes_at(level))) & ((1 << log2_c) - 1)
        cell = (jnp.maximum(node, 0) << (2 * log2_c)) + (row << log2_c) + column
        node = jnp.where(node < 0, -1, take(descent.child, cell))
        here = take(descent.entry, jnp.maximum(node, 0))
        found = jnp.where((node >= 0) & (here >= 0), here, found)
    return found


@pytest.mark.parametrize("way", ["page-tables", "descent"])
def test_finding_pages(benchmark, walk, built, way):
    """The two ways give the same pages."""
    points, frame, shape = walk.eyes[0].points, walk.frame, built.shape
    receivers = project(points, frame, light_offset(points, frame))
    at = address_of(points, anchor(points, frame), receivers, frame.perspective).at
    by_tables = partial(jax.jit(find_entries, static_argnums=0), shape, built.tree.entries)
    by_descent = partial(descend, descent_of(built), shape=shape)
    expected = by_tables(receivers.face, at)
    np.testing.assert_array_equal(by_descent(receivers.face, at), expected)
    find = by_tables if way == "page-tables" else by_descent
    benchmark(lambda: wait(find(receivers.face, at)))
    benchmark.extra_info["deepest_level"] = int(built.pool.squares[1, built.pool.held()].max())
