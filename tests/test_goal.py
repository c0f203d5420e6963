"""What is asked of a map: objectives, limits, order, and the smooth stand-in."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.tuning.goal import LEAST_PX, SLOPE, Goal, smooth_objective


@pytest.mark.parametrize(
    ("goal", "edge_px", "seconds", "expected"),
    [
        (Goal(price=2.0), 0.03, 0.05, 0.13),
        (Goal(seconds=0.1), 0.03, 0.1, 0.03),
        (Goal(seconds=0.1), 0.03, 0.101, math.inf),
        (Goal(error=0.05), 0.05, 0.2, 0.2),
        (Goal(error=0.05), 0.0501, 0.2, math.inf),
    ],
)
def test_objective_is_what_was_asked(goal, edge_px, seconds, expected):
    """A limit may be reached, and not passed."""
    assert goal.objective(edge_px, seconds) == pytest.approx(expected)
    assert goal.met(edge_px, seconds) is math.isfinite(expected)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "got none"),
        ({"price": 1.0, "error": 1.0}, r"got \['error', 'price'\]"),
        ({"price": 0.0}, "price is 0.0; allowed"),
        ({"seconds": -1.0}, "seconds is -1.0; allowed"),
        ({"error": math.inf}, "error is inf; allowed"),
        ({"price": math.nan}, "price is nan; allowed"),
    ],
)
def test_wrong_goals_are_refused(given, said):
    with pytest.raises(UseError, match=said):
        Goal(**given)


def test_order_puts_kept_limits_first():
    """Rationale: where nothing keeps a limit, the nearest is the best so far."""
    measured = [(0.01, 0.3), (0.04, 0.09), (0.02, 0.1), (0.5, 0.11), (0.0, 0.2)]
    by_time = sorted(measured, key=lambda pair: Goal(seconds=0.1).rank(*pair))
    assert by_time == [(0.02, 0.1), (0.04, 0.09), (0.5, 0.11), (0.0, 0.2), (0.01, 0.3)]
    by_error = sorted(measured, key=lambda pair: Goal(error=0.02).rank(*pair))
    assert by_error == [(0.02, 0.1), (0.0, 0.2), (0.01, 0.3), (0.04, 0.09), (0.5, 0.11)]
    by_price = sorted(measured, key=lambda pair: Goal(price=0.1).rank(*pair))
    assert by_price == sorted(measured, key=lambda pair: pair[0] + 0.1 * pair[1])


def test_a_goal_tells_itself():
    goals = [Goal(price=0.25), Goal(seconds=0.04), Goal(error=0.02)]
    assert [goal.kind for goal in goals] == ["price", "seconds", "error"]
    assert [goal.value for goal in goals] == [0.25, 0.04, 0.02]
    assert [goal.words for goal in goals] == [
        "edge error + 0.25 px/s x seconds",
        "least edge error within 40 ms",
        "least time within 0.02 px of edge error",
    ]


def test_smooth_objective_is_the_real_one_far_from_a_limit(x64):
    """Of a price always; of a limit where it is kept by far, and beyond it as steep as said."""
    smooth = smooth_objective("price", math.log(0.5), jnp.asarray(0.02), jnp.asarray(0.06))
    assert float(smooth) == pytest.approx(math.log(0.05))
    within = smooth_objective("seconds", math.log(0.1), jnp.asarray(0.02), jnp.asarray(0.06))
    assert float(within) == pytest.approx(math.log(0.02 + LEAST_PX), abs=1e-3)
    beyond = smooth_objective("seconds", math.log(0.1), jnp.asarray(0.02), jnp.asarray(0.2))
    steep = math.log(0.02 + LEAST_PX) + SLOPE * math.log(2)
    assert float(beyond) == pytest.approx(steep, rel=1e-3)
    error = smooth_objective("error", math.log(0.01), jnp.asarray(0.02), jnp.asarray(0.06))
    assert float(error) > math.log(0.06) + 0.9 * SLOPE * math.log(2)


@pytest.mark.parametrize("kind", ["price", "seconds", "error"])
@pytest.mark.parametrize("edge_px", [0.0, 0.004, 0.05])
def test_smooth_objective_has_the_slopes_of_differences(kind, edge_px, x64):
    """Central differences in all three arguments, on both sides of a limit and without error."""

    def at(x):
        return smooth_objective(kind, x[0], x[1], x[2])

    start = np.array([math.log(0.02), edge_px, 0.018])
    slopes = np.asarray(jax.grad(at)(jnp.asarray(start)))
    for k, step in enumerate((1e-5, 1e-8, 1e-7)):
        ends = [start + sign * step * np.eye(3)[k] for sign in (1, -1)]
        high, low = (float(at(jnp.asarray(end))) for end in ends)
        assert slopes[k] == pytest.approx((high - low) / (2 * step), rel=1e-4, abs=1e-6)
