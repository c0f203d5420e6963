"""Which texel a step beside a point is, and where its centre lies: of pages and of charts."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.registry import SIBLINGS
from helpers.slow_tree import address_at, deepest_over, held_by, receivers_at
from test_adaptive_tree import SHAPES, grown, probes
from test_charts import homography, placed

from asmjax.geometry import Chart
from asmjax.numerics import scalar
from asmjax.shadow.adaptive.address import BITS
from asmjax.shadow.adaptive.around import PagedNeighbourhood
from asmjax.shadow.adaptive.page_table import level_of
from asmjax.shadow.adaptive.shape import GUARD
from asmjax.shadow.adaptive.tree import Tree, serve
from asmjax.shadow.comparison import BIAS
from asmjax.shadow.warped.around import step_to

FAR = ((2, 0), (-3, 2), (0, -5))
"""Steps beyond the guard band."""

_serve = eqx.filter_jit(serve)
_step_to = eqx.filter_jit(step_to)
_own = eqx.filter_jit(lambda around: around.lit())
_lit = eqx.filter_jit(lambda around, step: around.lit(step, step))
_near = eqx.filter_jit(lambda around: around.lit(1, -1, most=1))
_searched = eqx.filter_jit(lambda around: around.lit(1, -1))


@pytest.mark.parametrize("shape", SHAPES[:2], ids=["c2", "c4"])
def test_far_taps_are_answered_by_whatever_page_serves_their_place(shape):
    """All texels are dark but those that the slow search says the places lie in, of any level; the
    places are those of the points and so many of their own texels on, inside the image."""
    pool = grown(shape, 0)
    numbers = dict(zip(held_by(pool), pool.held().tolist(), strict=True))
    face, uv = probes(shape, list(numbers), np.random.default_rng(0))
    receivers, address = receivers_at(face, uv.astype(np.float32)), address_at(uv)
    entries = jnp.array(pool.table.entries)
    nothing = jnp.zeros((shape.pages + 1, shape.side**2), jnp.float32)
    entry = _serve(shape, Tree(entries, nothing, None), receivers, address)
    own = zip(face, uv.T, strict=True)
    levels = [deepest_over(shape, numbers, int(f), *at)[1] for f, at in own]
    crossed = 0
    for columns, rows in FAR:
        own = np.zeros((shape.pages + 1, shape.side, shape.side), np.float32)
        for f, (x, y), level in zip(face, uv.T.tolist(), levels, strict=True):
            texels = 2 ** int(shape.log2_resolution(level))
            x, y = (
                z + (int(np.clip(int(z * texels) + step, 0, texels - 1)) - int(z * texels)) / texels
                for z, step in ((x, columns), (y, rows))
            )
            square = deepest_over(shape, numbers, int(f), x, y)
            crossed += square[1] != level
            texels = 2 ** int(shape.log2_resolution(square[1]))
            local = [
                int(z * texels) - (first << shape.log2_node) + GUARD
                for z, first in zip((x, y), square[2:], strict=True)
            ]
            own[numbers[square], local[1], local[0]] = 2.0
        for depth, lit in ((own, True), (2.0 - own, False)):
            tree = Tree(entries, jnp.array(depth.reshape(shape.pages + 1, -1)), None)
            around = PagedNeighbourhood(
                receivers, receivers.uv, address, entry, tree, scalar(BIAS), shape, False
            )
            got = eqx.filter_jit(lambda around, c=columns, r=rows: around.lit(c, r))(around)
            assert (np.asarray(got) == lit).all(), (columns, rows)
    assert crossed > 10, "no tap was in a page of another level"


def test_near_taps_are_of_the_points_own_page():
    """Its guard band is cast at its own resolution, so no search is needed; where the same page
    serves the place beside, a search finds the same."""
    case = analytic_case("a4_disc_light", 64)
    algorithm = SIBLINGS[1].of_budget(4**7, 1)
    state = algorithm.build(case.eye, case.frame, case.rays)
    around = algorithm.around(state, case.eye.points)
    assert isinstance(around, PagedNeighbourhood)
    near, found = _near(around), _searched(around)
    log2 = state.shape.log2_resolution(level_of(around.entry))
    place = around.address._replace(
        x=jnp.minimum(around.address.x + (1 << (BITS - log2)), 2**BITS - 1),
        y=jnp.maximum(around.address.y - (1 << (BITS - log2)), 0),
    )
    same = np.asarray(_serve(state.shape, state.tree, around.receivers, place) == around.entry)
    assert 0.5 < same.mean() < 1
    assert (near == found)[same].all() and (near != found).mean() < 0.05


@pytest.mark.parametrize("name", ["a4_disc_light", "a6_sphere_sun"])
@pytest.mark.parametrize("log", [0.0, 30.0, -0.9])
def test_steps_in_charts_end_at_centres(name, log):
    """The step in float32 against the two centres in float64 by the inverse parameterization: a
    millionth of the step off."""
    faces = analytic_case(name, 24).frame.faces
    charts = [Chart(face, homography(1), log) for face in range(faces)]
    held, receivers, chart, found, place = placed(name, charts)
    judged = np.asarray(receivers.facing) & found & np.asarray(place.inside)
    assert judged.sum() > 50
    columns, rows = np.asarray(place.size)
    for right, down in ((1, 0), (0, -1), (-2, 2), (5, 7)):
        steps = (jnp.full(chart.shape, step) for step in (right, down))
        offset = np.asarray(_step_to(place, *steps))
        column, row = np.asarray(place.texel)
        inside = judged & (column + right >= 0) & (column + right < columns)
        inside &= (row + down >= 0) & (row + down < rows)
        for k in np.flatnonzero(inside):
            s, t = ((x + 0.5 + np.array([0.0, d])) / n for x, d, n in (
                (column[k], right, columns[k]), (row[k], down, rows[k])))  # fmt: skip
            u, v = held.image(int(chart[k]), s, t)
            expected = np.array([np.diff(u)[0], np.diff(v)[0]])
            np.testing.assert_allclose(offset[:, k], expected, atol=3e-6 * np.abs(expected).max())


@pytest.mark.parametrize(
    "sibling",
    [s for s in SIBLINGS if s.name in ("uniform", "adaptive", "logarithmic")],
    ids=lambda s: s.name,
)
def test_no_step_is_what_the_map_says(sibling):
    """Fractions lie within a texel, and steps beyond the image end at its border."""
    case = analytic_case("a4_disc_light", 64)
    algorithm = sibling.of_budget(4**7, 1)
    state = algorithm.build(case.eye, case.frame, case.rays)
    around = algorithm.around(state, case.eye.points)
    lit = np.asarray(algorithm.visibility(state, case.eye.points))
    assert np.sum(np.asarray(_own(around)) != lit) <= 1
    fraction = np.asarray(around.fraction)
    assert fraction.min() >= 0 and fraction.max() <= 1 and 0.2 < fraction.mean() < 0.8
    far = [_lit(around, jnp.full(lit.shape, step, jnp.int32)) for step in (2**24, 2**20)]
    np.testing.assert_array_equal(*far)
    assert far[0].any() and not np.asarray(_lit(turned_away(around), far[0] * 3)).any()


def turned_away(around):
    """The neighbourhood with no point that faces the light."""
    receivers = around.receivers
    return eqx.tree_at(
        lambda a: a.receivers, around, replace(receivers, facing=jnp.zeros_like(receivers.facing))
    )
