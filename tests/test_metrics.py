"""Metrics against closed forms, slow twins, and the properties that define them."""

import numpy as np
import pytest
from helpers.soft_cases import soft_case
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import distance_transform_edt

from asmjax.errors import UseError
from asmjax.metrics import (
    CAP_PX,
    boundary_displacement,
    boundary_edges,
    boundary_length,
    edge_midpoints,
    error_summary,
    signed_error,
    soft_error,
    surface_pairs,
    visibility_error,
)
from asmjax.metrics.windows import box_sum
from asmjax.scene.soft_visibility import analytic_soft_visibility

IMAGES = arrays(bool, (7, 9))
DEPTHS = arrays(
    np.float64,
    (7, 9),
    elements=st.sampled_from((5e-324, 1e-310, 1e-45, 1e-6, 1.0, 1e6)) | st.floats(1e-6, 1e6),
)
MASKS = arrays(bool, (7, 9))


def grid(height, width=None):
    """Pixel centres (x, y)."""
    rows, columns = np.mgrid[:height, : width or height]
    return columns + 0.5, rows + 0.5


def displacement(truth, visibility, valid=None):
    valid = np.ones(truth.shape, bool) if valid is None else valid
    return boundary_displacement(truth, visibility, valid, surface_pairs(valid))


def ref_distances(truth, visibility, valid):
    """Pooled distances by a distance transform on the half-pixel lattice that holds all edges."""
    pairs = surface_pairs(valid)
    height, width = truth.shape
    marks = []
    for image in (truth, visibility):
        lattice = np.zeros((2 * height + 1, 2 * width + 1), bool)
        x, y = (2 * edge_midpoints(boundary_edges(image, pairs)).T).astype(int)
        lattice[y, x] = True
        marks.append(lattice)
    pooled = []
    for one, other in (marks, marks[::-1]):
        if other.any():
            pooled.append(np.asarray(distance_transform_edt(~other, sampling=0.5))[one])
        else:
            pooled.append(np.full(one.sum(), np.inf))
    return np.concatenate(pooled)


@pytest.mark.parametrize("side", [1, 2, 3, 6, 20])
def test_box_sum_equals_a_loop(side):
    image = np.random.default_rng(0).random((8, 11))
    expected = np.zeros_like(image)
    for row in range(8):
        for column in range(11):
            top, left = row - side // 2, column - side // 2
            window = image[max(top, 0) : top + side, max(left, 0) : left + side]
            expected[row, column] = window.sum() if top + side > 0 and left + side > 0 else 0
    np.testing.assert_allclose(box_sum(image, side), expected, atol=1e-12)


def test_visibility_error_counts_each_kind():
    truth = np.array([[1, 1, 0, 0, 1]], float)
    ours = np.array([[1, 0, 1, 0, np.nan]], float)
    error = visibility_error(truth, ours, np.array([[True, True, True, True, False]]))
    assert (error.misclassified_fraction, error.false_lit_fraction) == (0.5, 0.25)
    assert (error.false_dark_fraction, error.count) == (0.25, 4)


def test_visibility_error_of_sub_sampled_truth_is_the_mean_difference():
    truth, ours = np.array([[0.25, 0.75]]), np.array([[1.0, 0.0]])
    error = visibility_error(truth, ours, np.ones((1, 2), bool))
    assert error.false_lit_fraction == error.false_dark_fraction == 0.375


def test_nothing_valid_gives_zero_with_count_zero():
    nothing = np.zeros((4, 4), bool)
    error = visibility_error(np.full((4, 4), np.nan), np.full((4, 4), np.inf), nothing)
    assert error == type(error)(0.0, 0.0, 0.0, 0)
    edges = displacement(np.eye(4), 1 - np.eye(4), nothing)
    assert set(vars(edges).values()) == {0}


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.1, 1.1])
def test_a_visibility_out_of_range_is_refused(bad):
    image = np.ones((2, 2))
    with pytest.raises(UseError, match=r"visibility holds a value outside \[0, 1\]"):
        signed_error(image, image * bad, image > 0)


def test_unequal_shapes_are_refused():
    with pytest.raises(UseError, match="truth has shape"):
        visibility_error(np.ones((2, 3)), np.ones((3, 2)), np.ones((3, 2), bool))
    pairs = surface_pairs(np.ones((3, 3), bool))
    with pytest.raises(UseError, match="does not fit pairs"):
        boundary_displacement(np.ones((3, 2)), np.ones((3, 2)), np.ones((3, 2), bool), pairs)


@given(IMAGES, IMAGES, MASKS)
def test_visibility_error_properties(truth, ours, valid):
    error, back = visibility_error(truth, ours, valid), visibility_error(ours, truth, valid)
    assert error.misclassified_fraction == back.misclassified_fraction
    assert error.false_lit_fraction == back.false_dark_fraction
    assert (error.misclassified_fraction == 0) == bool((truth == ours)[valid].all())


@pytest.mark.parametrize("shift", [1, 3, 17])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_half_plane_moved_by_whole_pixels_gives_that_distance(shift, axis):
    along = grid(96)[axis]
    found = displacement(along > 40, along > 40 + shift)
    assert found.mean == found.p95 == found.hausdorff == shift
    assert found.per_edge_length == pytest.approx(shift, rel=1e-12)
    assert found.truth_length == pytest.approx(96)
    assert found.unmatched_fraction == 0


def test_a_diagonal_staircase_counts_perpendicular_distance():
    x, y = grid(128)
    found = displacement(x > y, x > y + 6)
    assert found.mean == pytest.approx(6 / np.sqrt(2), rel=0.03)
    assert found.per_edge_length == pytest.approx(6 / np.sqrt(2), rel=0.05)


@pytest.mark.parametrize(
    ("shift", "mean_within", "per_length_within"),
    # Midpoints of staircases lie up to half a pixel off the line: a few percent of a pixel.
    [(0.25, 0.12, 0.05), (0.5, 0.05, 0.05), (1, 0.1, 0.05), (5, 0.05, 0.03), (12, 0.04, 0.03)],
)
def test_half_planes_in_all_directions(shift, mean_within, per_length_within):
    x, y = grid(200)
    means, ratios = [], []
    for angle in np.linspace(0.03, 2 * np.pi, 24, endpoint=False):
        along = (x - 99.3) * np.cos(angle) + (y - 101.1) * np.sin(angle)
        found = displacement(along > 0, along > shift)
        means.append(found.mean)
        ratios.append(found.per_edge_length)
    assert np.mean(means) == pytest.approx(shift, rel=mean_within)
    assert np.mean(ratios) == pytest.approx(shift, rel=per_length_within)


@pytest.mark.parametrize(("radius", "grown"), [(30, 2), (40, 7), (60, 0.5)])
def test_a_disc_that_grows(radius, grown):
    x, y = grid(160)
    distance = np.hypot(x - 80.2, y - 79.7)
    found = displacement(distance > radius, distance > radius + grown)
    assert found.truth_length == pytest.approx(2 * np.pi * radius, rel=0.01)
    assert found.mean == pytest.approx(grown, rel=0.08)
    ring = np.pi * ((radius + grown) ** 2 - radius**2)
    assert found.per_edge_length == pytest.approx(ring / (2 * np.pi * radius), rel=0.1)
    assert abs(found.hausdorff - grown) < 1.5


def test_a_boundary_without_partner_is_capped_and_counted():
    x, _ = grid(200)
    found = displacement(x > 100, np.ones((200, 200)))
    assert found.mean == found.p95 == found.hausdorff == CAP_PX
    assert found.unmatched_fraction == 1
    assert found.per_edge_length == CAP_PX
    invented = displacement(np.ones((200, 200)), x > 100)
    assert invented.unmatched_fraction == 1
    assert invented.per_edge_length == CAP_PX
    # As near as the cap is no partner either: one rule, whether or not there is another edge.
    assert displacement(x > 20, x > 20 + CAP_PX + 1).unmatched_fraction == 1
    assert displacement(x > 20, x > 20 + CAP_PX - 1).unmatched_fraction == 0


@given(IMAGES, IMAGES, MASKS)
def test_distances_equal_a_distance_transform(truth, ours, valid):
    raw = ref_distances(truth, ours, valid)
    found = displacement(truth, ours, valid)
    assert found.edges == raw.size
    if raw.size:
        capped = np.minimum(raw, CAP_PX)
        assert found.mean == pytest.approx(capped.mean(), abs=1e-12)
        assert found.p95 == pytest.approx(np.percentile(capped, 95), abs=1e-12)
        assert found.hausdorff == pytest.approx(capped.max(), abs=1e-12)
        assert found.unmatched_fraction == np.isinf(raw).mean()


@given(IMAGES, IMAGES, MASKS)
def test_displacement_properties(truth, ours, valid):
    found, back = displacement(truth, ours, valid), displacement(ours, truth, valid)
    for name in ("mean", "p95", "hausdorff", "unmatched_fraction"):
        assert getattr(found, name) == pytest.approx(getattr(back, name), abs=1e-12)
    assert all(np.isfinite(value) and value >= 0 for value in vars(found).values())
    pairs = surface_pairs(valid)
    same = all(
        np.array_equal(a, b)
        for a, b in zip(boundary_edges(truth, pairs), boundary_edges(ours, pairs), strict=True)
    )
    assert (found.hausdorff == 0) == same
    assert (found.mean == 0) == same
    flips = (
        lambda image: image[::-1], lambda image: image[:, ::-1], lambda image: image.T
    )  # fmt: skip
    for flip in flips:
        flipped = displacement(flip(truth), flip(ours), flip(valid))
        for name, value in vars(found).items():
            assert getattr(flipped, name) == pytest.approx(value, abs=1e-9), name


@given(IMAGES, MASKS)
def test_an_image_equals_itself_and_its_negative_has_its_boundary(image, valid):
    assert displacement(image, image, valid).hausdorff == 0
    assert displacement(image, ~image, valid).hausdorff == 0


def test_boundary_length_of_a_line_does_not_depend_on_its_direction():
    x, y = grid(300)
    disc = np.hypot(x - 150, y - 150) < 140
    pairs = surface_pairs(disc)
    for angle in np.linspace(0, np.pi, 13):
        along = (x - 150) * np.cos(angle) + (y - 150) * np.sin(angle)
        length = boundary_length(boundary_edges(along > 0.3, pairs))
        assert length == pytest.approx(280, rel=0.02)


def test_depth_jumps_do_not_pair_but_slopes_and_creases_do():
    x, y = grid(60)
    # A floor towards the horizon (inverse depth linear in rows) that meets a wall, and a box
    # that floats in front of both.
    inverse = np.where(y > 25, 0.02 + 0.01 * (y - 25), 0.02)
    floats = (np.abs(x - 30) < 8) & (np.abs(y - 28) < 9)
    depth = 1 / np.where(floats, 0.9, inverse)
    valid = np.ones((60, 60), bool)
    pairs = surface_pairs(valid, depth)
    np.testing.assert_array_equal(pairs.right, floats[:, :-1] == floats[:, 1:])
    np.testing.assert_array_equal(pairs.down, floats[:-1] == floats[1:])


@pytest.mark.parametrize("pattern", [[0, 0, 1, 0, 0], [0, 1, 1, 0, 0], [0, 1, 0, 1, 0, 1]])
def test_things_of_one_pixel_are_jumps_too(pattern):
    depth = np.where(np.array([pattern, pattern], bool), 1.0, 10.0)
    pairs = surface_pairs(np.ones(depth.shape, bool), depth)
    np.testing.assert_array_equal(pairs.right[0], np.diff(depth[0]) == 0)


def test_a_sphere_pairs_with_itself_up_to_its_silhouette():
    x, y = (v - 50 for v in grid(100))
    inside = np.hypot(x, y) < 40
    depth = np.where(inside, 10 - np.sqrt(np.maximum(40**2 - x**2 - y**2, 0)) / 40, 30.0)
    pairs = surface_pairs(np.ones((100, 100), bool), depth)
    np.testing.assert_array_equal(pairs.right, inside[:, :-1] == inside[:, 1:])


@given(DEPTHS, IMAGES, IMAGES, MASKS)
def test_everything_is_finite(depth, truth, ours, valid):
    """R1: for depths down to the smallest number there is, whose inverse is infinite; and the unit
    of length does not count."""
    pairs = surface_pairs(valid, depth)
    found = error_summary(truth, ours, valid, pairs)
    length = boundary_length(boundary_edges(truth, pairs))
    assert error_summary(truth, ours, valid, pairs, length) == found
    numbers = [*found["boundary_displacement_px"].values(), found["misclassified_fraction"]]
    assert np.isfinite(numbers).all()
    if depth.min() > 1e-300:
        for one, other in zip(surface_pairs(valid, depth * 2.0**40), pairs, strict=True):
            np.testing.assert_array_equal(one, other)


def test_depth_must_be_positive_where_valid():
    valid = np.array([[True, False]])
    assert not surface_pairs(valid, np.array([[1.0, np.inf]])).right.any()
    with pytest.raises(UseError, match="depth of a valid pixel must be positive"):
        surface_pairs(valid, np.array([[0.0, 1.0]]))


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1)])
def test_images_of_one_row_or_column(shape):
    valid = np.ones(shape, bool)
    pairs = surface_pairs(valid, np.ones(shape))
    found = boundary_displacement(np.zeros(shape), np.ones(shape), valid, pairs)
    assert found.mean == 0 and found.edges == 0


def test_error_summary_has_the_keys_of_the_report():
    x, _ = grid(20)
    valid = np.ones((20, 20), bool)
    error = error_summary(x > 10, x > 11, valid, surface_pairs(valid))
    assert error["misclassified_fraction"] == error["false_dark_fraction"] == 0.05
    assert error["boundary_displacement_px"]["mean"] == 1
    assert type(error["boundary_displacement_px"]["p95"]) is float


def ramp(width: float, size: int = 64, middle: float = 32.0) -> np.ndarray:
    """(size, size) visibility that rises from 0 to 1 over so many columns."""
    x, _ = grid(size)
    return np.clip(0.5 + (x - middle) / width, 0, 1)


def test_errors_of_ramps_in_closed_form():
    """Ramps a and b > a wide about one middle: off by the area between them, (b - a) / 4 in the
    mean over the columns, and the widths by the parts of them that are neither dark nor lit."""
    valid = np.ones((64, 64), bool)
    pairs = surface_pairs(valid)
    narrow, wide = ramp(8.0), ramp(24.0)
    found = soft_error(narrow, wide, valid, pairs)
    assert found.mae == pytest.approx((24 - 8) / 4 / 64, rel=0.02)
    assert found.max == pytest.approx(1 / 3, abs=0.03)
    assert found.rmse**2 == pytest.approx(((narrow - wide) ** 2).mean())
    assert found.penumbra_width_px == pytest.approx(24 - 8, abs=2)
    assert soft_error(wide, narrow, valid, pairs).penumbra_width_px == -found.penumbra_width_px
    assert soft_error(wide, wide, valid, pairs) == (0.0,) * 6


def test_a_face_that_is_partly_lit_is_no_penumbra():
    """Beyond the reach of an edge all of a face may be lit to 60 %, in truth or in the image."""
    x, _ = grid(160)
    valid, pairs = np.ones((160, 160), bool), surface_pairs(np.ones((160, 160), bool))
    truth, wide = (np.clip(0.5 + (x - 40) / width, 0, 1) for width in (8.0, 24.0))
    face = x > 110
    for in_truth, in_image in ((True, True), (True, False), (False, True)):
        found = soft_error(
            np.where(face & in_truth, 0.6, truth), np.where(face & in_image, 0.6, wide),
            valid, pairs,
        )  # fmt: skip
        assert found.penumbra_width_px == pytest.approx(24 - 8, abs=2)


def test_right_answers_are_no_leaks_in_a_truth_of_64_rays():
    """Whose standard error is 1/32 where an edge halves its cells (`soft_rays.SOFT_STRATA`), and
    pi / 128 in the mean over the penumbra. What is left by chance are pixels whose samples agree
    within each cell, so that their error is told too small."""
    case = soft_case("a5_square", 128, 1.5)
    size = case.eye.size
    found = analytic_soft_visibility(case.shapes, case.eye, case.frame, 4, 4)
    truth, error = found.visibility.reshape(size), found.error.reshape(size)
    valid = case.judged.reshape(size)
    expected = np.where(valid, case.expected.reshape(size), 0)
    ramp = valid & (expected > 0) & (expected < 1)
    assert np.sqrt(np.mean(error[ramp] ** 2)) == pytest.approx(np.sqrt(1 / 6) / 16, rel=0.1)
    halves = ramp & (np.abs(np.modf(4 * expected)[0] - 0.5) < 0.1)
    assert np.sqrt(np.mean(error[halves] ** 2)) == pytest.approx(1 / 32, rel=0.1)
    pairs = surface_pairs(valid)
    unsure = soft_error(truth, expected, valid, pairs)
    sure = soft_error(truth, expected, valid, pairs, error)
    part = np.count_nonzero(ramp) / np.count_nonzero(valid)
    assert unsure.leak_fraction > 0.005 * part
    assert max(sure.leak_fraction, sure.acne_fraction) < 0.002 * part


def test_leaks_are_lighter_and_acne_is_darker():
    """A lit patch in the umbra, a dark one in the light, and a darker one in the penumbra, which
    is neither; what is not valid counts for nothing."""
    truth, valid = ramp(16.0), np.ones((64, 64), bool)
    valid[:, 60:] = False
    seen = truth.copy()
    seen[:8, :4], seen[8:12, 50:54], seen[20:22, 30:32], seen[:, 62] = 1.0, 0.5, 0.3, 0.0
    found = soft_error(truth, seen, valid, surface_pairs(valid))
    assert found.leak_fraction == 32 / (64 * 60) and found.acne_fraction == 16 / (64 * 60)
    nothing = soft_error(truth, seen, np.zeros((64, 64), bool), surface_pairs(valid & False))
    assert nothing == (0.0,) * 6


@given(IMAGES, IMAGES, MASKS)
def test_soft_errors_of_hard_images_are_the_hard_ones(truth, visibility, valid):
    """Of 0 and 1 the mean is what is misclassified, its square too, leaks are false light, acne
    false dark, and there is no penumbra."""
    hard = visibility_error(truth, visibility, valid)
    soft = soft_error(truth, visibility, valid, surface_pairs(valid))
    assert soft.mae == pytest.approx(hard.misclassified_fraction)
    assert soft.rmse**2 == pytest.approx(hard.misclassified_fraction)
    assert soft.leak_fraction == pytest.approx(hard.false_lit_fraction)
    assert soft.acne_fraction == pytest.approx(hard.false_dark_fraction)
    assert soft.penumbra_width_px == 0
