"""Benchmarks of the JAX kernels on a 512 x 512 view; `make bench` runs them.

The bound: footprint, area ratio, n_required and benefit take at most 10
times a copy of the bytes that they read and write. `extra_info` holds the ratio. Both are timed
here in turn, so that a busy machine slows both alike.
"""

import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from asmjax.buffers import light_offset, project
from asmjax.footprint import (
    cell_benefit,
    cell_index,
    log2_linear_ratio,
    log2_m,
    n_required,
    uv_jacobian,
)
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import a1_square
from asmjax.scene.lights import light_frame
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.look import analyse, audience_of

SIDE, RESOLUTION, CELLS = 512, 2048, 128


@eqx.filter_jit
def footprints(points, camera, frame, offset, straddles):
    """Per-pixel area ratio, m, n_required and benefit, from points and normals."""
    receivers = project(points, frame, offset)
    jacobian = uv_jacobian(points, camera, frame, receivers)
    axis = log2_m(jacobian, RESOLUTION)
    area = jnp.exp2(2 * log2_linear_ratio(jacobian, RESOLUTION))
    index = cell_index(receivers.uv, receivers.face, CELLS)
    counted = straddles & (axis > 0) & receivers.facing
    benefit = cell_benefit(index, counted, frame.faces * CELLS**2)
    return area, jnp.exp2(axis), n_required(float(RESOLUTION) ** 2, area), benefit[index]


@jax.jit
def copied(arrays):
    """New arrays of the same bytes; adding 1 keeps XLA from handing back the old ones."""
    return [~a if a.dtype == bool else a + 1 for a in arrays]


@pytest.fixture(scope="module")
def scene():
    """Eye, frame, rays and the flat map of a square over a plane that fills the image."""
    spec = a1_square().spec
    eye = analytic_eye(spec.shapes, next(iter(spec.views.values())).resized(SIDE, SIDE))
    light = next(iter(spec.lights.values()))
    return eye, light_frame(light, eye, scene_bounds(spec.shapes)), AnalyticRays(spec.shapes)


def in_turn(first, second, rounds=60):
    """Median and least seconds of two calls, timed alternately after a warm-up: (2, 2)."""
    times = np.zeros((2, rounds))
    for k in range(-3, rounds):
        for i, call in enumerate((first, second)):
            start = time.perf_counter()
            jax.block_until_ready(call())
            times[i, max(k, 0)] = time.perf_counter() - start
    return np.stack([np.median(times, axis=1), times.min(axis=1)])


def test_footprints_against_a_copy(benchmark, scene):
    eye, frame, _ = scene
    straddles = jnp.asarray(np.random.default_rng(0).random(SIDE**2) < 0.3)
    args = (eye.points, eye.camera, frame, light_offset(eye.points, frame), straddles)
    points = eye.points
    read = [points.position, points.normal, points.prim, points.valid, straddles]
    moved = read + list(footprints(*args))
    times = in_turn(lambda: footprints(*args), lambda: copied(moved))
    for name, (kernel, copy) in zip(("median", "least"), times * 1e3, strict=True):
        benchmark.extra_info[f"copy_ms_{name}"] = copy
        benchmark.extra_info[f"times_a_copy_{name}"] = kernel / copy
        print(
            f"\nfootprints {kernel:.2f} ms, copy {copy:.2f} ms: {kernel / copy:.1f} times ({name})"
        )
    benchmark(lambda: jax.block_until_ready(footprints(*args)))


def test_uniform_query(benchmark, scene):
    eye, frame, rays = scene
    algorithm = UniformShadowMap(resolution=512)
    state = algorithm.build(eye, frame, rays)
    benchmark(lambda: jax.block_until_ready(algorithm.visibility(state, eye.points)))


@pytest.fixture(scope="module")
def adaptive(scene):
    algorithm = AdaptiveShadowMap(memory_bytes=2**21, cost_model=CostModel(1e-8, 1e-4, 0.0))
    return algorithm, algorithm.build(*scene)


def test_adaptive_query(benchmark, scene, adaptive):
    algorithm, state = adaptive
    benchmark(lambda: jax.block_until_ready(algorithm.visibility(state, scene[0].points)))


def test_adaptive_analysis(benchmark, scene, adaptive):
    """One look at all pixels: page tables, four taps, straddling, target levels."""
    (eye, frame, _), (algorithm, state) = scene, adaptive
    looking = audience_of(eye, frame, "axis")

    def call():
        return analyse(
            state.tree, looking, 0.0, -4.0, algorithm.bias,
            shape=state.shape, perspective=frame.perspective,
        )  # fmt: skip

    benchmark(lambda: jax.block_until_ready(call()))
