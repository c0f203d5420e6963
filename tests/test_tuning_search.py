"""Evidence against loops over pixels, searches against brute force, sensitivity in closed form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.tuning import BASE, EXPECTED, RULES, bench_of_shapes, disc_bench, made_model

from asmjax.buffers import Receivers
from asmjax.errors import UseError
from asmjax.scene.spec import LightSpec, Rectangle, ViewSpec
from asmjax.tuning import evidence as evidence_module
from asmjax.tuning import sensitivity as sensitivity_module
from asmjax.tuning.evidence import DEEPEST, GAPS, LEAST_SPAN, SPANS, evidence_of
from asmjax.tuning.front import trace_front
from asmjax.tuning.goal import Goal
from asmjax.tuning.search import Model, boxed, said_of, search, unboxed
from asmjax.tuning.sensitivity import direction, sensitivity
from asmjax.tuning.space import NAMES

SIDE = 48
"""Pixels a side."""

HEIGHT, LAMP = 0.2, 5.0
"""Of the square above the plane, and of the lamp."""

GROUND = Rectangle("ground", (0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
SQUARE = Rectangle("square", (0.0, 0.0, HEIGHT), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
VIEW = ViewSpec(
    "aside", (0.0, -3.5, 1.2), (0.0, -1.0, 0.0), fov_x_deg=50.0, width=SIDE, height=SIDE
)
OVERHEAD = LightSpec("lamp", "point", position=(0.0, 0.0, LAMP))
PRICE = 0.2


@pytest.fixture(scope="module")
def square():
    return bench_of_shapes((GROUND, SQUARE), VIEW, OVERHEAD)


@pytest.fixture(scope="module")
def evidence(square):
    return evidence_of(square, BASE)


def test_gaps_are_the_height_over_the_depth(evidence):
    """All shadow edges are of a square h above a plane H below the lamp: h / H, to a step of what
    is told apart, whatever the radius."""
    step = np.log(GAPS[1] / GAPS[0])
    gap = np.log(HEIGHT / LAMP)
    assert (evidence.log_gap <= gap + 1e-9).all()
    assert (evidence.log_gap[-1] > gap - step).all()
    # The sample itself may be a pixel that the reference has lit.
    assert np.mean(evidence.log_gap[0] > gap - step) > 0.9
    # Not so the sky beyond, which is as dark as can be: 32 pixels reach it.
    assert evidence.log_gap.max() < gap
    assert (np.diff(evidence.log_gap, axis=0) >= 0).all()


def test_evidence_says_what_it_stands_for(square, evidence):
    assert evidence.faces == square.frame.faces
    assert float(evidence.edges) == pytest.approx(square.edge_length, rel=0.1)
    assert evidence.crowd[0].max() <= float(evidence.edges) + 1e-9
    assert 0 < float(evidence.receivers) <= SIDE**2
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(evidence))
    # Finer grids hold fewer; at the finest an edge is alone or nearly so.
    for crowd in (evidence.crowd, evidence.all_crowd):
        assert (np.diff(crowd, axis=0) <= 1e-9).all()
    assert np.median(evidence.all_crowd[-1]) == 1


def test_the_seed_alone_decides_the_samples(square, evidence):
    again, other = evidence_of(square, BASE), evidence_of(square, BASE, seed=1)
    for one, two in zip(jax.tree.leaves(evidence), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, two)
    assert not np.array_equal(evidence.log2_ratio, other.log2_ratio)
    # Both stand for the same view.
    assert np.mean(evidence.log2_ratio) == pytest.approx(np.mean(other.log2_ratio), abs=0.05)


def receivers_at(uv: np.ndarray, face: np.ndarray) -> Receivers:
    """Receivers at given places; the rest does not count."""
    flat, one = jnp.zeros(face.size), jnp.ones(face.size)
    return Receivers(
        face=jnp.asarray(face),
        uv=jnp.asarray(uv),
        depth=one,
        slope=jnp.zeros((2, face.size)),
        secant=one,
        reach=one,
        prim=flat.astype(int),
        facing=one > 0,
    )


def nodes_by_loop(seen: Receivers, level: int) -> list[tuple[int, int, int]]:
    """Face, column and row of each one's node on a grid of 2^level a side."""
    side = 2**level
    return [
        (int(face), int(u * side), int(v * side))
        for face, u, v in zip(seen.face.tolist(), *seen.uv.tolist(), strict=True)
    ]


@pytest.fixture(scope="module")
def seen():
    """Receivers on two faces, some of them near each other, and what each asks for."""
    rng = np.random.default_rng(3)
    uv = np.concatenate([rng.random((2, 60)), 0.3 + 1e-4 * rng.random((2, 60))], axis=1)
    return (
        receivers_at(uv, rng.integers(0, 2, 120)),
        rng.uniform(4, 14, 120),
        rng.uniform(0.5, 1, 120),
    )


def test_crowds_are_those_of_a_loop(seen):
    places, _, weight = seen
    pixels = np.arange(0, 120, 2)
    keys = evidence_module._keys(places, pixels)
    found = evidence_module._crowd(keys, weight[pixels])
    some = receivers_at(np.asarray(places.uv)[:, pixels], np.asarray(places.face)[pixels])
    for level in range(DEEPEST + 1):
        nodes = nodes_by_loop(some, level)
        expected = [
            sum(w for w, node in zip(weight[pixels], nodes, strict=True) if node == mine)
            for mine in nodes
        ]
        np.testing.assert_allclose(found[level], expected)


def test_served_levels_are_those_of_a_loop(seen):
    """The finest level that the map gets to beneath each pixel: down from the root as long as any
    pixel of the node asks for more, the last node only as far as it is asked for."""
    places, ratio, _ = seen
    found = evidence_module._served(evidence_module._keys(places, np.arange(120)), ratio)
    nodes = [nodes_by_loop(places, level) for level in range(DEEPEST + 1)]
    for k in range(SPANS):
        asked = ratio - (LEAST_SPAN + k)
        for pixel in range(120):
            best = asked[pixel]
            for level, of_level in enumerate(nodes):
                beneath = [asked[i] for i in range(120) if of_level[i] == of_level[pixel]]
                best = max(best, min(level, max(beneath)))
            assert found[k, pixel] == pytest.approx(best)


def test_samples_are_drawn_as_often_as_they_weigh():
    """A tenth of the items with nine tenths of the weight is nine tenths of the samples."""
    order, weight = np.arange(1000.0), np.where(np.arange(1000) < 100, 81.0, 1.0)
    chosen = evidence_module._spread(order, weight, np.random.default_rng(0))
    assert np.mean(chosen < 100) == pytest.approx(0.9, abs=0.01)
    # Evenly over their order: no gap is much larger than a sample's share.
    assert np.diff(np.sort(chosen[chosen < 100])).max() <= 2


def test_a_view_without_a_shadow_edge_is_refused():
    empty = bench_of_shapes((GROUND,), VIEW, OVERHEAD)
    with pytest.raises(UseError, match="no edge of a shadow") as refused:
        evidence_of(empty, BASE)
    assert "\n" not in str(refused.value)


def test_a_disc_is_evidence_too():
    """A round shadow: its edge points every way, and all of it at one gap; above what is told
    apart, the largest that is."""
    found = evidence_of(disc_bench(SIDE), BASE)
    assert np.exp(found.log_gap[-1]) == pytest.approx(GAPS[-1])


def test_boxed_and_unboxed_are_inverse():
    """Up to where the bend ends; beyond it every point is as near to the end as there is."""
    point = np.linspace(0.03, 0.97, 48)
    with jax.enable_x64(True):
        np.testing.assert_allclose(boxed(unboxed(point)), point, rtol=1e-12)
        ends = np.asarray(boxed(unboxed(np.array([0.0, 1.0]))))
        far = np.asarray(boxed(jnp.asarray([-1e9, 1e9])))
    np.testing.assert_allclose(ends, far, atol=1e-3)
    assert (far > 0).all() and (far < 1).all()


@pytest.fixture
def model():
    with jax.enable_x64(True):
        yield made_model()


def drawn(count: int) -> np.ndarray:
    return np.random.default_rng(11).random((count, len(NAMES)))


def starts_of(model, goal: Goal, count: int = 20) -> list[np.ndarray]:
    """The best four of so many random points, as the tuner starts from."""
    points = drawn(count)
    ranks = [goal.rank(*pair) for pair in said_of(model, points).T.tolist()]
    return [points[k] for k in sorted(range(count), key=ranks.__getitem__)[:4]]


@pytest.mark.slow
def test_search_is_as_good_as_brute_force(model):
    """4,000 random points of the box have none that is better by 2 %."""
    goal = Goal(price=PRICE)
    found = search(model, goal, starts_of(model, goal))
    assert (np.diff(found.losses) >= 0).all()
    assert ((found.points > 0) & (found.points < 1)).all()
    edge, seconds = np.concatenate(
        [said_of(model, part) for part in np.split(drawn(4000), 40)], axis=1
    )
    mine = goal.objective(*said_of(model, found.points[:1])[:, 0].tolist())
    assert mine == pytest.approx(np.exp(found.losses[0]))
    assert mine <= 1.02 * (edge + PRICE * seconds).min()
    assert found.settled[0]
    # What has come to rest is not improved by steps to any side.
    aside = [found.points[0] + s * 0.01 * np.eye(9)[k] for k in range(9) for s in (1, -1)]
    there = said_of(model, np.clip(aside, 0.02, 0.98))
    assert (there[0] + PRICE * there[1]).min() >= 0.98 * mine


def test_what_is_no_number_comes_last(model):
    """A start that leads nowhere does not hide the others, and alone is a status, no exception."""
    goal = Goal(price=PRICE)
    start = drawn(1)[0]
    alone = search(model, goal, [start])
    both = search(model, goal, [np.full(9, np.nan), start])
    np.testing.assert_array_equal(alone.points, both.points[:1])
    assert both.losses[1] == np.inf and not both.settled[1]
    nowhere = search(model, goal, [np.full(9, np.nan)])
    assert nowhere.losses[0] == np.inf and not nowhere.settled[0]


@pytest.mark.parametrize("views", [1, 2])
def test_views_count_alike(views):
    """What is said of several views is the mean of what is said of each."""
    with jax.enable_x64(True):
        together = said_of(made_model(range(views)), drawn(5))
        each = [said_of(made_model([seed]), drawn(5)) for seed in range(views)]
        np.testing.assert_allclose(together, np.mean(each, axis=0))


KNOBS = np.arange(9)
FALL, CLIMB = 2.0 + 0.2 * KNOBS, 3.0 - 0.1 * KNOBS
WEIGHT = np.exp(0.5 * np.cos(KNOBS))
"""A stand-in: error sum(w exp(-a x)) against seconds sum(exp(b x)), convex in each knob, whose
optimum x = log(w a / (p b)) / (a + b) moves by -1 / (a + b) with log p."""


def _stand_in(model, point, temperature):
    return (WEIGHT * jnp.exp(-FALL * point)).sum(), jnp.exp(CLIMB * point).sum()


@pytest.fixture
def stand_in(monkeypatch):
    """The stand-in in place of the surrogate, as a model that nothing was compiled for."""

    def loss(model, kind, log_value, point, temperature):
        edge, seconds = _stand_in(model, point, temperature)
        assert kind == "price"
        return jnp.log(edge + jnp.exp(log_value) * seconds)

    def said_of(model, points):
        return np.array([_stand_in(model, point, None) for point in points]).T

    monkeypatch.setattr(sensitivity_module, "said_of", said_of)
    monkeypatch.setattr(sensitivity_module, "loss", loss)
    with jax.enable_x64(True):
        yield Model((), (), (), jnp.ones(0), jnp.ones(9), jnp.full(9, np.e**2), RULES)


NEAR_THE_END = 0.01
"""A price at which some optima are near 0.95."""


def optimum(price: float) -> np.ndarray:
    return np.log(WEIGHT * FALL / (price * CLIMB)) / (FALL + CLIMB)


@pytest.mark.parametrize("price", [0.1, NEAR_THE_END])
def test_sensitivity_is_that_of_the_closed_form(stand_in, price):
    """By implicit differentiation; the ends of the box bend the coordinates, not the answer."""
    x = optimum(price)
    assert ((x > 0.03) & (x < 0.97)).all()
    found = sensitivity(stand_in, price, x)
    assert found.settled
    moved = -1 / (FALL + CLIMB)
    log_settings = np.array([found.log_settings[name] for name in NAMES])
    np.testing.assert_allclose(log_settings, 2 * moved, rtol=1e-6)
    falls = WEIGHT * np.exp(-FALL * x)
    climbs = np.exp(CLIMB * x)
    assert found.log_edge == pytest.approx((-FALL * falls * moved).sum() / falls.sum())
    assert found.log_seconds == pytest.approx((CLIMB * climbs * moved).sum() / climbs.sum())
    # And of optima on either side, found anew.
    ahead, behind = (optimum(price * np.exp(s * 1e-4)) for s in (1, -1))
    np.testing.assert_allclose(log_settings, 2 * (ahead - behind) / 2e-4, rtol=1e-6)


def test_what_does_nothing_does_not_move(stand_in, monkeypatch):
    """A knob without effect has no best value: the others move as ever, and it stays."""

    def loss(model, kind, log_value, point, temperature):
        edge = (WEIGHT * jnp.exp(-FALL * point))[:8].sum()
        return jnp.log(edge + jnp.exp(log_value) * jnp.exp(CLIMB * point)[:8].sum())

    monkeypatch.setattr(sensitivity_module, "loss", loss)

    # Of another structure, so that it is compiled anew.
    step, settled = direction(stand_in._replace(fits=(EXPECTED,)), 0.1, optimum(0.1))
    assert settled
    assert abs(step[8]) < 1e-12 and (np.abs(step[:8]) > 1e-3).all()


@pytest.mark.slow
def test_the_front_is_as_good_as_searching_anew(model):
    """At each price within 5 % of the search that tuning does at it, and a front it is:
    who pays more for time gets less of it, and more error."""
    bending, points = trace_front(model, PRICE, drawn(20))
    prices = np.array([one.price for one in points])
    assert (np.diff(prices) > 0).all() and PRICE == pytest.approx(np.median(prices))
    assert max(one.gap for one in points) < 0.05
    seconds = np.array([one.seconds for one in points])
    edge = np.array([one.edge_px for one in points])
    assert (np.diff(seconds) <= 0.02 * seconds[1:]).all()
    assert (np.diff(edge) >= -0.02 * edge[1:]).all()
    for one in points:
        assert set(one.settings) == set(NAMES)
        best = min(one.loss, one.loss_again)
        assert best == pytest.approx(np.log(one.edge_px + one.price * one.seconds), abs=1e-6)
        assert one.taken_over == (one.gap > 0)
    # Time falls and error grows with the price, by what it is worth: d edge = -price d seconds.
    assert bending.price == PRICE and bending.log_seconds <= 0 <= bending.log_edge
    middle = points[len(points) // 2]
    worth = middle.edge_px * bending.log_edge + PRICE * middle.seconds * bending.log_seconds
    assert abs(worth) < 0.05 * (middle.edge_px + PRICE * middle.seconds)
