"""The surrogate against central differences, closed forms and what physics demands."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.tuning import EXPECTED, RULES, made_evidence, made_space, random_fit
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asmjax.shadow.comparison import BIAS, texel_bytes
from asmjax.tuning.calibrate import WIDE, calibrated_fit
from asmjax.tuning.goal import KINDS, smooth_objective
from asmjax.tuning.search import TEMPERATURES
from asmjax.tuning.space import NAMES, values_at
from asmjax.tuning.surrogate import (
    COSTS,
    PAGE_OVERHEAD,
    START_LOG2,
    TEMPERATURE,
    Fit,
    Rules,
    _waves,
    predict,
)

COUNT = len(NAMES) + len(Fit._fields)
"""Numbers of a point and of a fit, which everything here is a function of."""

LOG_VALUES = {"price": np.log(0.2), "seconds": np.log(0.03), "error": np.log(0.1)}
"""Of the three goals: their walls are met by some points and not by others."""

SPACE = made_space()
FREE = {"memory_bytes": 1e12, "time_limit": 100.0, "least_profit": 1e-6, "discontinuity": BIAS}
"""Settings by which nothing limits a map."""

UNIT = st.floats(0, 1)

ERROR, SECONDS, NODES = range(3)

ROOM = 64
"""Settings in one call."""


@pytest.fixture(autouse=True, scope="module")
def double():
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def evidence():
    return jax.tree.map(jnp.asarray, made_evidence(0))


@pytest.fixture(scope="module")
def losses(evidence):
    """Of numbers (16, COUNT), a temperature and a goal's kind: log objective (16,) and its
    derivatives (16, COUNT); and the three objectives (3, 16) alone."""
    rules = Rules(*(jnp.asarray(number) for number in RULES))
    ends = tuple(jnp.asarray(end) for end in SPACE.ends)

    def of(evidence, numbers, temperature):
        point, fit = numbers[: len(NAMES)], Fit(*numbers[len(NAMES) :])
        found = predict(evidence, values_at(point, *ends), fit, temperature, rules)
        return jnp.stack([
            smooth_objective(kind, LOG_VALUES[kind], found.edge_px, found.seconds)
            for kind in KINDS
        ])  # fmt: skip

    # One after the other: batched derivatives take minutes to compile.
    @jax.jit
    def slopes(evidence, numbers, temperature, chosen):
        def one(numbers):
            return jax.value_and_grad(lambda x: of(evidence, x, temperature) @ chosen)(numbers)

        return jax.lax.map(one, numbers)

    alone = jax.jit(jax.vmap(of, (None, 0, None), 1))

    def both(numbers, temperature, kind):
        chosen = jnp.asarray([float(kind == one) for one in KINDS])
        return slopes(evidence, jnp.asarray(numbers), temperature, chosen)

    return both, lambda numbers, temperature: alone(evidence, jnp.asarray(numbers), temperature)


@pytest.fixture(scope="module")
def said(evidence):
    """(3, k) error, seconds and nodes of `ROOM` settings, a fit, a temperature and rules."""

    @jax.jit
    def compiled(values, fit, temperature, rules):
        def one(values):
            return jnp.stack(predict(evidence, values, fit, temperature, rules))

        return jax.vmap(one)(values).T

    def of(values, fit=EXPECTED, temperature=TEMPERATURE, rules=RULES):
        values = {name: jnp.broadcast_to(values[name], (ROOM,)) for name in NAMES}
        return np.asarray(compiled(values, fit, temperature, rules))

    return of


def drawn(seed: int, **fixed) -> dict[str, np.ndarray]:
    """Settings at `ROOM` random points of the box, but for those that are given."""
    low, high = (end[:, None] for end in SPACE.ends)
    points = np.random.default_rng(seed).random((len(NAMES), ROOM))
    return {**values_at(points, low, high), **fixed}


@pytest.mark.parametrize("temperature", [TEMPERATURES[0], TEMPERATURES[-1]])
def test_gradient_is_that_of_central_differences(losses, temperature):
    """Of each goal, to every setting and every fitted number, at 16 random points: to 1e-4 of the
    largest derivative there, at either end of the annealing."""
    rng = np.random.default_rng(1)
    points = rng.uniform(0.02, 0.98, (16, len(NAMES)))
    fits = 0.3 * rng.normal(size=(16, len(Fit._fields)))
    numbers = np.concatenate([points, fits], axis=1)
    both, alone = losses
    found = np.stack([both(numbers, temperature, kind)[1] for kind in KINDS])
    step = 1e-6
    central = np.empty(found.shape)
    for k in range(COUNT):
        push = step * np.eye(COUNT)[k]
        up, down = (alone(numbers + s * push, temperature) for s in (1, -1))
        central[..., k] = np.asarray(up - down) / (2 * step)
    scale = np.abs(central).max(axis=-1, keepdims=True)
    assert (scale > 1e-3).all()
    assert (np.abs(central - found) <= 1e-4 * scale).all()


@given(
    hnp.arrays(np.float64, (16, len(NAMES)), elements=st.sampled_from([0.0, 1.0]) | UNIT),
    hnp.arrays(np.float64, (16, len(Fit._fields)), elements=st.floats(-3, 3)),
    st.sampled_from(TEMPERATURES),
    st.sampled_from(KINDS),
)
def test_everything_is_finite(losses, points, fits, temperature, kind):
    """Value and gradient, at corners of the box too, with fits far beyond their priors."""
    value, slopes = losses[0](np.concatenate([points, fits], axis=1), temperature, kind)
    assert np.isfinite(value).all() and np.isfinite(slopes).all()


def ladder(said, name: str, values, column: int, **settings) -> np.ndarray:
    """(rungs, ROOM) error, seconds or nodes at random points along a range of one setting."""
    return np.stack([said(drawn(3, **{**settings, name: value}))[column] for value in values])


def rising(table: np.ndarray, slack: float) -> bool:
    """Whether rows never fall by more than that part."""
    return bool((table[1:] >= table[:-1] * (1 - slack)).all())


def test_finer_texels_help_and_cost_where_nothing_limits(said):
    """From coarse to fine edges: the error falls and the time grows, over the whole range."""
    fine = np.geomspace(1 / 64, 0.5, 12)
    free = {**FREE, "ratio_target": 1.0}
    error = ladder(said, "finest_ratio", fine, ERROR, **free)
    seconds = ladder(said, "finest_ratio", fine, SECONDS, **free)
    assert rising(error, 0.01) and rising(seconds[::-1], 0.01)
    assert (error[-1] > 1.5 * error[0]).all() and (seconds[0] > seconds[-1]).all()


def test_more_memory_never_hurts(said):
    """With the default's goals: to 5 %, for with more memory a map starts at finer texels, and by
    how much its levels overshoot what is asked for moves with that."""
    free = {name: value for name, value in FREE.items() if name != "memory_bytes"}
    free |= {"ratio_target": 1.0, "finest_ratio": 1 / 16, "node_resolution": 16.0, "cells": 2.0}
    error = ladder(said, "memory_bytes", np.geomspace(2**18, 2**26, 9), ERROR, **free)
    assert rising(error[::-1], 0.05)
    assert (error[0] > 5 * error[-1]).all()


def test_a_limit_of_time_never_takes_longer(said):
    """And a longer one never hurts."""
    limits = np.geomspace(1e-4, 10, 12)
    seconds = ladder(said, "time_limit", limits, SECONDS)
    error = ladder(said, "time_limit", limits, ERROR)
    assert rising(seconds, 1e-7) and rising(error[::-1], 1e-7)
    assert (seconds[-1] > 2 * seconds[0]).any()


@pytest.mark.parametrize("name", ["discontinuity", "least_profit"])
def test_what_leaves_edges_coarse_costs_error_and_saves_nodes(said, name):
    knob = SPACE.knobs[NAMES.index(name)]
    free = {k: v for k, v in FREE.items() if k != name}
    values = np.geomspace(knob.low, knob.high, 9)
    error = ladder(said, name, values, ERROR, **free)
    nodes = ladder(said, name, values, NODES, **free)
    assert rising(error, 1e-7) and rising(nodes[::-1], 1e-7)
    assert (error[-1] > 1.2 * error[0]).any() and (nodes[-1] < 0.5 * nodes[0]).any()


def test_without_refinement_it_is_the_uniform_map(said, evidence):
    """Texels of 512 a side that match already: only roots, whose edges move by their texels."""
    idle = {**FREE, "ratio_target": 2.0**8, "finest_ratio": 2.0**8, "node_resolution": 16.0}
    error, seconds, nodes = said({**drawn(4), **idle}, temperature=1e-2)
    roots = 2.0 ** (2 * (START_LOG2 - 4))
    # Decisions are soft: a pass with nothing to do still makes a few.
    assert (nodes >= roots).all() and (nodes < 1.15 * roots).all()
    size = np.asarray(evidence.spread) * 2 ** (np.asarray(evidence.log2_ratio) - START_LOG2)
    moved = np.mean(size / np.sqrt(1 + size))
    np.testing.assert_allclose(error, moved + 1e-3, rtol=0.1)
    # Roots are cast; then every pixel is looked at once.
    least = COSTS.fixed + COSTS.look + roots * (COSTS.texel * 18**2 + COSTS.node)
    assert (seconds > 0.99 * least).all() and (seconds < least + 0.1).all()


def test_nodes_fit_into_the_memory(said):
    """At hard decisions no more than there are pages, by their bytes."""
    nodes = said(drawn(5, memory_bytes=2.0**21, cells=2.0), temperature=1e-2)[NODES]
    side = drawn(5)["node_resolution"] + 2
    pages = 2.0**21 / (side**2 * texel_bytes("both") + PAGE_OVERHEAD)
    assert (nodes <= 1.02 * pages * np.exp(0.15)).all()


def test_decisions_harden(said):
    """Towards temperature 0 it converges: what is said changes less and less."""
    settings = drawn(6)
    hard = said(settings, temperature=1e-4)
    off = [
        np.median(np.abs(np.log(said(settings, temperature=t) / hard)), axis=1)
        for t in (1.0, 0.3, 0.1, 0.03, 0.01, 1e-3)
    ]  # fmt: skip
    assert (np.diff(off, axis=0) <= 0).all()
    assert (off[-1] < 0.01).all() and (off[0] > 3 * off[2]).all()


def test_maps_that_do_not_cover_make_no_nodes_for_it(said):
    """Where casters are nearer than counts, no edge is refined either: only the roots are left."""
    wide = {**FREE, "ratio_target": 0.5, "finest_ratio": 0.5, "node_resolution": 16.0}
    wide["discontinuity"] = 1e3
    roots = 2.0 ** (2 * (START_LOG2 - 4))
    cold = {"temperature": 1e-2}
    covering, bare = (
        said(drawn(4, **wide), rules=RULES._replace(cover=cover), **cold)[NODES]
        for cover in (1.0, 0.0)
    )
    np.testing.assert_allclose(bare, roots, rtol=1e-6)
    assert (covering > 1.5 * roots).all()


def test_nodes_that_profit_forbids_cover_no_edge(said):
    """A map that would cover its receivers, but whose nodes are not worth it, has the errors of one
    that does not cover."""
    wide = {**FREE, "ratio_target": 0.5, "finest_ratio": 0.5, "node_resolution": 16.0}
    wide["discontinuity"] = 1e3

    def gain(least: float) -> np.ndarray:
        """Error where receivers are covered / where not."""
        at = drawn(4, **{**wide, "least_profit": least})
        covering, bare = (
            said(at, rules=RULES._replace(cover=cover), temperature=1e-2)[ERROR]
            for cover in (1.0, 0.0)
        )
        return covering / bare

    assert (gain(1e-6) < 0.7).all()
    np.testing.assert_allclose(gain(1e12), 1.0, rtol=1e-6)


def test_texels_of_fewer_bytes_are_more_nodes(said):
    """Half the bytes of a texel are twice the memory, up to what a page needs besides."""
    limited = drawn(5, **{**FREE, "memory_bytes": 2.0**21, "ratio_target": 0.5})
    nodes, more = (
        said(limited, temperature=1e-2, rules=RULES._replace(texel_bytes=bytes))[NODES]
        for bytes in (6.0, 3.0)
    )
    assert (more >= nodes).all() and (more > 1.5 * nodes).any()


def test_coarse_texels_cost_more_where_profit_counts(said):
    """The map reckons with as many texels as the most demanding pixel asks for: of a node with
    texels sixteen times a pixel's size with 256 times as many as it has. So the same least profit
    leaves out coarse nodes where casting is dear, and fine ones not."""
    box = {**FREE, "node_resolution": 32.0, "cells": 2.0, "pixel_share": 8.0}
    rules = RULES._replace(per_texel=1e-5, launch=1e-6)

    def left(ratio: float) -> np.ndarray:
        """Part of the nodes beside the roots that profit leaves."""
        at = {**box, "ratio_target": ratio, "finest_ratio": ratio}
        with_profit, free = (
            said(drawn(4, **{**at, "least_profit": least}), temperature=1e-2, rules=rules)[NODES]
            for least in (2000.0, 1e-6)
        )
        roots = 2.0 ** (2 * (START_LOG2 - 5))
        return (with_profit - roots) / (free - roots)

    assert (left(1.0) < 0.5).all() and (left(1 / 32) > 0.9).all()


def trials_of(said, fit: Fit, seed: int = 7, count: int = 30):
    """Points of the box, errors and seconds as measured on a machine of that fit."""
    points = np.random.default_rng(seed).random((len(NAMES), ROOM)).T[:count]
    error, seconds, _ = said(drawn(seed), fit, WIDE)[:, :count]
    return points, error, seconds


@pytest.mark.slow
def test_known_fits_are_recovered(said, evidence):
    """From trials that a surrogate made, its predictions are found again to 3 %, also of new
    settings; not its numbers, some of which hardly matter. One search in six may get stuck."""
    real = [random_fit(np.random.default_rng(seed), 0.2) for seed in range(6)]
    fresh = drawn(9)
    close = []
    for fit in real:
        found = calibrated_fit(evidence, SPACE, *trials_of(said, fit))
        told, truth, before = (said(fresh, f, WIDE)[:2] for f in (found.fit, fit, EXPECTED))
        off, start = (np.median(np.abs(np.log(x / truth)), axis=1) for x in (told, before))
        close.append(off.max() < 0.03)
        assert found.trials == 30 and (start > 0.02).all()
        assert (off < 0.75 * start).all()
    assert sum(close) >= 5


def test_an_outlier_changes_little(said, evidence):
    """One time of sixty, ten times too long, moves predictions by less than a tenth."""
    points, error, seconds = trials_of(said, random_fit(np.random.default_rng(8)), count=60)
    spoilt = seconds.copy()
    spoilt[3] *= 10
    both = [
        calibrated_fit(evidence, SPACE, points, error, times).fit for times in (seconds, spoilt)
    ]
    calm, moved = (said(drawn(9), fit, WIDE)[SECONDS] for fit in both)
    assert np.median(np.abs(np.log(moved / calm))) < 0.1


def test_a_fit_that_cannot_settle_says_so(said, evidence):
    """A status, no exception, and the fit is of numbers: those it began with."""
    points, error, seconds = trials_of(said, EXPECTED)
    begun = random_fit(np.random.default_rng(2))
    lost = calibrated_fit(evidence, SPACE, points, error, np.full(30, np.nan), begun)
    assert not lost.settled
    assert [float(x) for x in lost.fit] == [float(x) for x in begun]
    assert np.isfinite(lost.correction.weights).all()
    calm = calibrated_fit(evidence, SPACE, points, error, seconds)
    assert calm.settled and all(abs(float(number)) < 0.01 for number in calm.fit)


def test_sines_of_multiples_are_those_of_the_angle(dtype):
    x = jnp.asarray(np.random.default_rng(0).uniform(-9, 9, (3, 20)), dtype)
    for k, wave in enumerate(_waves(x), start=1):
        expected = np.sin(2 * np.pi * k * np.asarray(x, np.float64))
        np.testing.assert_allclose(wave, expected, atol=300 * float(jnp.finfo(dtype).eps))
