"""Charts: parameterizations and their inverses, layout, padding; and places on the device."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from hypothesis import given
from hypothesis import strategies as st

from asmjax.buffers import anchor, light_offset, project
from asmjax.errors import UseError
from asmjax.geometry import Chart, laid_out, padded
from asmjax.geometry.charts import image_to_plane, plane_to_image
from asmjax.shadow.warped.table import chart_of, place_in, table_of

logs = st.one_of(st.just(0.0), st.floats(-0.999, 1e6).filter(lambda c: abs(c) > 1e-3))


def homography(seed: int) -> np.ndarray:
    """A perspective of the unit square that keeps its orientation, and all of it in front."""
    rng = np.random.default_rng(seed)
    turn = np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3))
    return turn / turn[2, 2]


def forward(chart: Chart, u, v):
    """s, t of image coordinates, as the module's docstring says."""
    s, t, w = chart.to_chart @ np.stack([u, v, np.ones_like(u)])
    s, t = s / w, t / w
    return s, np.log1p(chart.log * t) / np.log1p(chart.log) if chart.log else t


@given(seed=st.integers(0, 2**32 - 1), log=logs)
def test_image_is_the_inverse_of_the_parameterization(seed, log):
    rng = np.random.default_rng(seed)
    s, t = rng.uniform(0, 1, (2, 50))
    chart = Chart(0, homography(seed), log)
    u, v = laid_out([chart], 64).image(0, s, t)
    np.testing.assert_allclose(forward(chart, u, v), (s, t), atol=1e-9)


def test_centres_are_row_by_row():
    charts = laid_out([Chart(0, np.eye(3), error=(2.0, 1.0))], 32)
    assert charts.size.tolist() == [[8, 4]]
    u, v = charts.centres(0)
    np.testing.assert_allclose(u.reshape(4, 8)[0], (np.arange(8) + 0.5) / 8)
    np.testing.assert_allclose(v.reshape(4, 8)[:, 0], (np.arange(4) + 0.5) / 4)


@given(
    errors=st.lists(st.tuples(st.floats(0.05, 20), st.floats(0.05, 20)), min_size=1, max_size=12),
    side=st.integers(64, 2048),
)
def test_texels_are_shared_out_in_proportion_to_errors(errors, side):
    """Equation 6 of TR05-024 in both directions: error per texel is the same in all charts, up to
    whole columns and rows; nothing overlaps and the limit is kept."""
    charts = laid_out([Chart(0, np.eye(3), error=error) for error in errors], side**2)
    assert charts.texels <= side**2
    ends = charts.first + charts.size.prod(axis=1)
    assert charts.first[0] == 0 and (charts.first[1:] == ends[:-1]).all()
    left = np.array(errors) / charts.size
    large = charts.size.min(axis=1) >= 20
    if large.all():
        np.testing.assert_allclose(left, np.broadcast_to(left.mean(), left.shape), rtol=0.11)
        assert charts.texels >= 0.88 * side**2


def test_one_chart_of_equal_errors_is_square():
    for side in (1, 7, 128, 2048):
        assert laid_out([Chart(0, np.eye(3))], side**2).size.tolist() == [[side, side]]


@pytest.mark.parametrize(
    ("charts", "texels", "message"),
    [
        ([], 16, "no charts"),
        ([Chart(0, np.eye(3), error=(0.0, 1.0))], 16, "above 0"),
        ([Chart(0, np.eye(3), error=(np.nan, 1.0))], 16, "finite"),
        ([Chart(0, np.eye(3))] * 3, 2, "do not suffice"),
    ],
)
def test_what_cannot_be_laid_out(charts, texels, message):
    with pytest.raises(UseError, match=message):
        laid_out(charts, texels)


def test_padding_holds_nothing():
    charts = laid_out([Chart(0, np.eye(3)), Chart(0, homography(3))], 50)
    grown = padded(charts, 4)
    assert (grown.count, grown.texels) == (4, charts.texels)
    assert np.isinf(grown.depths[2:]).all() and (grown.first[2:] == charts.texels).all()
    assert padded(charts, 2) is charts


def test_planes_and_images_are_inverse():
    frame = analytic_case("a6_sphere", 16).frame
    for face in range(frame.faces):
        there, back = plane_to_image(frame, face), image_to_plane(frame, face)
        np.testing.assert_allclose(there @ back, np.eye(3), atol=1e-12)


@eqx.filter_jit
def places(points, frame, offset, where, table, depth):
    """Receivers, the chart of each and whether there is one, and their places."""
    receivers = project(points, frame, offset)
    chart, found = chart_of(table, receivers, depth)
    place = place_in(table, chart, points, receivers, where, frame.perspective)
    return receivers, chart, found, place


def placed(name: str, charts: list[Chart], side: int = 24):
    """Receivers of an analytic scene, the charts with texels, and the places of the former."""
    case = analytic_case(name, side)
    held, points = laid_out(charts, 64**2), case.eye.points
    depth = jnp.asarray(np.where(case.eye.valid, case.eye.depth, 0.0), points.position.dtype)
    receivers, chart, found, place = places(
        points, case.frame, light_offset(points, case.frame), anchor(points, case.frame),
        table_of(padded(held, len(charts) + 1)), depth,
    )  # fmt: skip
    return held, receivers, np.asarray(chart), np.asarray(found), place


@pytest.mark.parametrize("name", ["a4_disc_light", "a6_sphere_sun"])
@pytest.mark.parametrize("log", [0.0, 30.0, -0.9])
@pytest.mark.parametrize("seed", [0, 1])
def test_places_are_those_of_the_loop_over_receivers(name, log, seed):
    """Texel, offset to its centre and motion per texel against float64 and differences."""
    face_of = analytic_case(name, 24).frame
    charts = [Chart(face, homography(seed), log) for face in range(face_of.faces)]
    held, receivers, chart, found, place = placed(name, charts)
    facing = np.asarray(receivers.facing)
    assert found[facing].all()
    uv = np.asarray(receivers.uv, np.float64)
    judged = 0
    for k in np.flatnonzero(facing)[::7]:
        mine = int(chart[k])
        columns, rows = held.size[mine]
        straight = np.array(forward(replace(charts[mine], log=0.0), *uv[:, k]))
        if (straight <= 0).any() or (straight >= 1).any():
            continue  # not what the chart was made for
        s, t = forward(charts[mine], *uv[:, k])
        column, row = (
            int(np.clip(x, 0, n - 1)) for x, n in ((s * columns, columns), (t * rows, rows))
        )
        near = np.array([s * columns % 1, t * rows % 1])
        if (np.minimum(near, 1 - near) < 1e-2).any():
            continue  # within rounding of a texel's border
        judged += 1
        assert place.flat[k] == held.first[mine] + row * columns + column
        at = np.array([[(column + 0.5) / columns], [(row + 0.5) / rows]])

        def image(place, mine=mine):
            return np.concatenate(held.image(mine, *place))

        centre = image(at)
        np.testing.assert_allclose(place.offset[:, k], centre - uv[:, k], atol=3e-7)
        for i, step in enumerate(np.diag([0.5 / columns, 0.5 / rows])[:, :, None] * 1e-3):
            right, left = image(at + step), image(at - step)
            np.testing.assert_allclose(
                place.per_texel[:, i, k], (right - left) * 1e3, rtol=2e-4, atol=1e-7
            )
    assert judged > 10


def test_the_first_chart_that_holds_a_receiver_counts():
    """Lines and eye depths: against a loop; what none holds is not found."""
    case = analytic_case("a4_disc_light", 24)
    middle = float(np.median(case.eye.depth[case.eye.valid]))
    charts = [
        Chart(0, np.eye(3), lines=((1.0, 0.0, -0.6),)),
        Chart(0, np.eye(3), depths=(middle, np.inf)),
        Chart(0, np.eye(3), lines=((0.0, -1.0, 0.4), (-1.0, 0.0, 0.5))),
    ]
    _, receivers, chart, found, _ = placed("a4_disc_light", charts)
    u, v = np.asarray(receivers.uv, np.float64)
    depth = case.eye.depth
    holds = np.stack([u >= 0.6, depth >= middle, (v <= 0.4) & (u <= 0.5)])
    facing = np.asarray(receivers.facing)
    border = np.min(np.abs([u - 0.6, v - 0.4, u - 0.5, (depth - middle) / middle]), axis=0) < 1e-5
    judged = np.asarray(facing & ~border)
    held = np.asarray(holds.any(axis=0))
    np.testing.assert_array_equal(found[judged], held[judged])
    np.testing.assert_array_equal(chart[judged & found], holds.argmax(axis=0)[judged & found])
    assert 0 < found[facing].mean() < 1


def test_places_have_gradients_of_positions_without_nan():
    """Where receivers face no light, too."""
    case = analytic_case("a6_sphere_sun", 12)
    offset, where = light_offset(case.eye.points, case.frame), anchor(case.eye.points, case.frame)
    table = table_of(laid_out([Chart(0, homography(1), 5.0)], 400))

    @jax.jit
    def total(position):
        points = eqx.tree_at(lambda p: p.position, case.eye.points, position)
        depth = jnp.ones(points.count, position.dtype)
        place = places(points, case.frame, offset, where, table, depth)[3]
        return jnp.sum(place.offset) + jnp.sum(place.per_texel)

    gradient = jax.jit(jax.grad(total))(case.eye.points.position)
    assert np.isfinite(np.asarray(gradient)).all() and np.abs(np.asarray(gradient)).max() > 0
