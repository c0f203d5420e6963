"""The points that a view sees, without the pixels that see nothing."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.registry import FAST

from asmjax.buffers import EyeBuffer, seen_points
from asmjax.buffers.points import SEEN_STEPS
from asmjax.experiment.traces import counted_traces
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap

SIDE = 24
SIZE = SIDE * SIDE


def with_valid(eye: EyeBuffer, valid: np.ndarray) -> EyeBuffer:
    """`eye` where only some of its valid pixels see anything."""
    assert not (valid & ~eye.valid).any()
    return eqx.tree_at(
        lambda e: (e.shape, e.points.valid),
        eye,
        (np.where(valid, eye.shape, -1).astype(np.int32), jnp.asarray(valid)),
    )


def some_valid(count: int, seed: int = 0) -> EyeBuffer:
    """A view of which the first pixel and `count - 1` random ones see something."""
    eye = analytic_case("a4_disc_light", SIDE).eye
    assert eye.valid.all()
    valid = np.zeros(SIZE, bool)
    others = 1 + np.random.default_rng(seed).permutation(SIZE - 1)
    valid[np.r_[0, others][:count]] = True
    return with_valid(eye, valid)


COUNTS = (0, 1, 71, 72, 73, 200, SIZE // 2, SIZE - 73, SIZE - 72, SIZE - 1, SIZE)


@pytest.mark.parametrize("count", COUNTS)
def test_the_first_points_are_the_valid_pixels_in_order(count):
    eye = some_valid(count)
    seen = seen_points(eye)
    chosen = np.asarray(seen.points.valid)
    assert chosen.sum() == count
    pixels = seen.pixels[chosen[: seen.pixels.size]]
    np.testing.assert_array_equal(pixels, np.flatnonzero(eye.valid))
    for name in ("position", "normal", "prim"):
        got, whole = (np.asarray(getattr(p, name)) for p in (seen.points, eye.points))
        np.testing.assert_array_equal(got[..., chosen], whole[..., eye.valid])
    np.testing.assert_array_equal(seen.points.origin, eye.points.origin)


@pytest.mark.parametrize("count", COUNTS)
def test_at_most_an_eighth_of_the_image_is_padding(count):
    seen = seen_points(some_valid(count))
    step = -(-SIZE // SEEN_STEPS)
    assert count <= seen.points.count < count + step
    assert seen.points.count in {min(k * step, SIZE) for k in range(SEEN_STEPS + 1)}


@pytest.mark.parametrize("count", COUNTS)
def test_an_image_has_every_value_at_its_pixel(count):
    """Each pixel's own number comes back to it; pixels that see nothing get 0, whatever stands in
    the padding."""
    eye = some_valid(count)
    seen = seen_points(eye)
    values = np.full(seen.points.count, 0.0, np.float32)
    values[: seen.pixels.size] = np.where(eye.valid, np.arange(SIZE) + 1, 0)[seen.pixels]
    values[seen.pixels.size :] = -7.0
    image = seen.image(jnp.asarray(values))
    assert image.shape == (SIZE,) and image.dtype == np.float32
    np.testing.assert_array_equal(image, np.where(eye.valid, np.arange(SIZE) + 1, 0))


@pytest.mark.parametrize(
    "algorithm",
    [UniformShadowMap(64), AdaptiveShadowMap(memory_bytes=2**18, cost_model=FAST)],
    ids=["uniform", "adaptive"],
)
def test_an_image_of_seen_points_is_the_image_of_all_points(algorithm):
    """And the padding, which repeats the first pixel, is not lit as that one is."""
    case = analytic_case("a4_disc_light", SIDE)
    state = algorithm.build(case.eye, case.frame, case.rays)
    for count in (0, 1, 100, SIZE - 100, SIZE):
        eye = some_valid(count)
        seen = seen_points(eye)
        lit = np.asarray(algorithm.visibility(state, seen.points))
        assert not lit[seen.pixels.size :].any()
        whole = np.asarray(algorithm.visibility(state, eye.points))
        np.testing.assert_array_equal(seen.image(lit), whole)
    assert whole[0] == 1 and whole.sum() < SIZE


def test_a_number_of_points_in_the_same_eighth_traces_nothing_again():
    """Any number of pixels that see something comes to eight shapes, and each is traced once."""
    case = analytic_case("a4_disc_light", SIDE)
    algorithm = UniformShadowMap(64)
    state = algorithm.build(case.eye, case.frame, case.rays)
    seen = [seen_points(some_valid(count, seed=count)) for count in range(1, SIZE, 5)]
    sizes = {s.points.count for s in seen}
    assert len(sizes) == SEEN_STEPS
    for size in sizes:
        first = next(s for s in seen if s.points.count == size)
        algorithm.visibility(state, first.points)
    with counted_traces() as traces:
        for each in seen[::4]:
            algorithm.visibility(state, each.points)
    assert traces == []


def test_a_view_that_sees_surfaces_everywhere_is_not_copied():
    eye = some_valid(SIZE)
    assert seen_points(eye).points is eye.points
