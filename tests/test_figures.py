"""Figures: their data, limits, labels and files; what they look like is for people to judge."""

import dataclasses
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from helpers.figures import HEIGHT, WIDTH, run_pictures, texels_over, words
from hypothesis import given
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.report.figures import (
    draw_accuracy_time,
    draw_errors,
    draw_levels,
    draw_maps,
    draw_shadows,
    write_figures,
)
from asmjax.report.figures.accuracy_time import zero_line
from asmjax.report.figures.board import DPI, panel_size
from asmjax.report.figures.errors import error_image
from asmjax.report.figures.shadows import worst_spots
from asmjax.report.figures.spots import Spot, densest_spots
from asmjax.report.figures.style import BACKGROUND, FALSE_DARK, FALSE_LIT, hex_rgb


def test_every_figure_is_written_at_its_own_size(tmp_path):
    from PIL import Image

    before = dict(matplotlib.rcParams)
    files = write_figures(run_pictures(), tmp_path)
    names = ["shadows", "errors", "maps", "tree", "levels", "accuracy_time"]
    assert [file.name for file in files] == [f"{name}.png" for name in names]
    for file in files:
        with Image.open(file) as image:
            assert 600 < image.width < 2200 and 400 < image.height < 2200
    assert dict(matplotlib.rcParams) == before
    assert "matplotlib.pyplot" not in sys.modules or matplotlib.get_backend().lower() == "agg"


def test_the_same_pictures_give_the_same_bytes(tmp_path):
    contents = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        contents.append([f.read_bytes() for f in write_figures(run_pictures(), tmp_path / name)])
    assert contents[0] == contents[1]


def test_only_what_there_is_data_for_is_written(tmp_path):
    bare = dataclasses.replace(
        run_pictures(), visibilities={}, methods=(), maps={}, log2_resolution=None, tree=None
    )
    assert [file.name for file in write_figures(bare, tmp_path)] == ["shadows.png"]


def test_an_image_in_which_nothing_is_seen_can_be_drawn(tmp_path):
    pictures = run_pictures()
    nothing = np.zeros((HEIGHT, WIDTH))
    blind = dataclasses.replace(
        pictures,
        valid=nothing > 0,
        maps={name: nothing * np.nan for name in pictures.maps},
        log2_resolution=nothing * np.nan,
    )
    assert len(write_figures(blind, tmp_path)) == 6


def test_pictures_take_jax_arrays_and_refuse_wrong_shapes():
    import jax.numpy as jnp

    pictures = run_pictures()
    taken = dataclasses.replace(
        pictures, truth=jnp.zeros((HEIGHT, WIDTH)), maps={"m": jnp.ones((HEIGHT, WIDTH))}
    )
    assert type(taken.truth) is type(taken.maps["m"]) is np.ndarray
    with pytest.raises(UseError, match=r"'m' has shape \(2, 2\); allowed is \(48, 64\)"):
        dataclasses.replace(pictures, maps={"m": np.ones((2, 2))})
    with pytest.raises(UseError, match="unknown map"):
        dataclasses.replace(pictures, maps={"n": np.ones((HEIGHT, WIDTH))})
    with pytest.raises(UseError, match="'direct' must be"):
        dataclasses.replace(pictures, direct=np.ones((HEIGHT, WIDTH)))
    with pytest.raises(UseError, match="a tree of 9 nodes"):
        assert pictures.tree is not None
        dataclasses.replace(pictures.tree, lo=np.zeros((9, 2)))
    with pytest.raises(UseError, match="faces must be 0 to 0"):
        assert pictures.tree is not None
        dataclasses.replace(pictures.tree, face=np.arange(9))


def test_methods_to_draw_are_one_of_each_kind_and_no_rays():
    image = np.zeros((HEIGHT, WIDTH))
    names = ["warped", "uniform-a", "uniform-b", "rays-1", "adaptive-a"]
    pictures = dataclasses.replace(run_pictures(), visibilities=dict.fromkeys(names, image))
    assert pictures.drawn_methods() == ["uniform-a", "uniform-b", "adaptive-a", "warped"]
    assert pictures.drawn_methods(2) == ["uniform-a", "adaptive-a"]
    assert pictures.drawn_methods(3) == ["uniform-a", "adaptive-a", "warped"]


def test_shadows_shows_truth_and_methods_with_the_same_insets():
    figure = draw_shadows(run_pictures())
    panels = texels_over(figure)
    big = [axes for axes in panels if axes.patches]
    assert len(big) == 3
    assert len(panels) == 3 + 3 * len(big[0].patches) // 2
    squares = [[patch.get_extents().bounds for patch in axes.patches] for axes in big]
    offsets = [axes.get_window_extent().x0 for axes in big]
    for others, offset in zip(squares, offsets, strict=True):
        moved = np.array(others) - np.array(squares[0])
        np.testing.assert_allclose(moved[:, 0], offset - offsets[0], atol=1e-6)
        np.testing.assert_allclose(moved[:, 1:], 0, atol=1e-6)
    # The uniform map's edge is at column 32 instead of 30.2: squares must hold it.
    for left, _, width, _ in squares[0]:
        assert left <= offsets[0] + 8 * 30 and left + width >= offsets[0] + 8 * 32
    found = words(figure)
    assert "Ray-traced truth" in found
    assert any(text.startswith("uniform-16: 3.12 % wrong") for text in found)
    assert any(text.startswith("adaptive-1MB: 0 % wrong") for text in found)
    assert "1,024 texels a side, 1.00 MB" in found


def test_insets_show_edges_of_truth_and_of_the_method():
    """A method wrong by more than a square: its largest errors are squares without any edge."""
    pictures = run_pictures()
    size = (200, 200)
    column = np.tile(np.arange(200), (200, 1))
    truth, method = (column > 60) * 1.0, (column > 150) * 1.0
    method[100:] = (column[100:] > 66) * 1.0
    ones = np.ones((*size, 3))
    pictures = dataclasses.replace(
        pictures,
        direct=ones,
        ambient=ones,
        valid=np.ones(size),
        truth=truth,
        visibilities={"uniform-16": method},
        maps={},
        log2_resolution=None,
    )
    for spot in worst_spots(pictures, ["uniform-16"], [20, 40], 3)[:1]:
        assert spot.side == 20
        for image in (truth, method):
            assert 0.2 < spot.crop(image).mean() < 0.8
    # Where the method has no edge near truth's, squares grow.
    method = (column > 90) * 1.0
    pictures = dataclasses.replace(pictures, visibilities={"uniform-16": method})
    spots = worst_spots(pictures, ["uniform-16"], [20, 60], 2)
    assert all(spot.side == 60 and 0 < spot.crop(method).mean() < 1 for spot in spots)
    # Errors that shading hides count less than others.
    seen = ones * (np.arange(200) > 100)[:, None, None]
    pictures = dataclasses.replace(pictures, direct=seen)
    (spot, *_) = worst_spots(pictures, ["uniform-16"], [20], 1)
    assert spot.row >= 80


def test_panels_show_images_pixel_for_pixel():
    figure = draw_shadows(run_pictures())
    width, height = figure.get_size_inches() * DPI
    for axes in texels_over(figure)[:1]:
        box = axes.get_position()
        assert box.width * width == pytest.approx(8 * WIDTH)
        assert box.height * height == pytest.approx(8 * HEIGHT)
        assert box.x0 * width == pytest.approx(round(box.x0 * width), abs=1e-6)


@pytest.mark.parametrize(
    ("image", "panel"),
    [((512, 512), (512, 512)), ((64, 64), (512, 512)), ((300, 400), (300, 400)),
     ((1080, 1920), (292, 520)), ((1000, 250), (728, 182)), ((1, 1), (520, 520))],
)  # fmt: skip
def test_panel_size(image, panel):
    height, width = image
    assert panel_size(height, width, 520) == panel


def test_spots_are_the_densest_squares_and_keep_apart():
    weight = np.zeros((60, 80))
    weight[10:14, 20:24] = 1
    weight[40:43, 60:63] = 1
    first, second = densest_spots(weight, 8, 3)
    assert first.crop(weight).sum() == 16
    assert second.crop(weight).sum() == 9
    assert densest_spots(weight * 0, 8, 3) == []
    assert densest_spots(np.ones((5, 7)), 20, 3) == [Spot(0, 0, 5)]


@given(st.integers(1, 30), st.integers(0, 39), st.integers(0, 49))
def test_a_single_wrong_pixel_is_in_its_square(side, row, column):
    weight = np.zeros((40, 50))
    weight[row, column] = 1
    (spot,) = densest_spots(weight, side, 2)
    assert spot.crop(weight).shape == (side, side)
    assert spot.crop(weight).sum() == 1


def test_errors_are_coloured_by_kind():
    pictures = run_pictures()
    image = error_image([[1.0, 0.0, 1.0, 0.0]], [[0.0, 1.0, 1.0, 0.0]], [[True, True, True, False]])
    np.testing.assert_array_equal(image[0, 0], hex_rgb(FALSE_DARK))
    np.testing.assert_array_equal(image[0, 1], hex_rgb(FALSE_LIT))
    np.testing.assert_array_equal(image[0, 3], hex_rgb(BACKGROUND))
    assert image[0, 2].min() > 240
    figure = draw_errors(pictures)
    assert len(texels_over(figure)) == 2
    assert "uniform-16: 3.12 % wrong" in words(figure)
    assert "0 % false lit, 3.12 % false dark" in words(figure)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][:2] == ["false lit", "false dark"]
    assert "wall." in words(figure)


def test_few_errors_are_drawn_larger():
    truth, wrong = np.zeros((9, 20)), np.zeros((9, 20))
    wrong[4, 5] = wrong[4, 7] = 1
    image = error_image(truth, wrong, truth == 0, 5)
    lit = (image == hex_rgb(FALSE_LIT)).all(axis=-1)
    assert lit[2:7, 3:10].all() and lit.sum() == 5 * 7
    truth[4, 7], wrong[4, 7] = 1, 0
    image = error_image(truth, wrong, np.ones((9, 20)), 5)
    np.testing.assert_array_equal(image[4, 5], hex_rgb(FALSE_LIT))
    np.testing.assert_array_equal(image[4, 7], hex_rgb(FALSE_DARK))
    pictures = run_pictures()
    large = {
        "direct": np.ones((500, 500, 3)),
        "ambient": np.ones((500, 500, 3)),
        "valid": np.ones((500, 500)),
        "truth": np.zeros((500, 500)),
        "maps": {},
        "log2_resolution": None,
    }
    for share, drawn in ((0.001, True), (0.2, False)):
        shadow = np.random.default_rng(0).random((500, 500)) < share
        methods = dict.fromkeys(["uniform-16", "adaptive-1MB"], shadow * 1.0)
        few = dataclasses.replace(pictures, visibilities=methods, **large)
        said = any("drawn 3 × 3 pixels large" in text for text in words(draw_errors(few)))
        assert said == drawn


def test_maps_have_scales_in_powers_of_two():
    pictures = run_pictures()
    figure = draw_maps(pictures)
    panels = {axes.get_label(): axes for axes in texels_over(figure) if axes.get_label()}
    assert set(panels) == {"area_ratio", "m", "n_required", "benefit"}
    bars = [axes for axes in figure.axes if axes.get_yticklabels()]
    ticks = [[text.get_text() for text in axes.get_yticklabels()] for axes in bars]
    assert "1×" in ticks[0] and "1/4×" in ticks[0] and "4×" in ticks[0]
    low, high = bars[0].get_ylim()
    assert low < -1 < 1 < high
    assert all(text.startswith("2") for text in ticks[2])
    # Benefit counts pixels, from 1 on.
    assert ticks[3][0] == "1" and bars[3].get_ylim()[0] == 0
    assert any(text.endswith("median 1.04×") for text in words(figure))
    # Matched is white, and pixels without a value are the background.
    area = np.asarray(panels["area_ratio"].get_images()[0].get_array())
    assert area[20, 31:33].min() > 235
    np.testing.assert_array_equal(area[20, 0], hex_rgb(BACKGROUND))
    np.testing.assert_array_equal(area[2, 30], hex_rgb(BACKGROUND))


def test_levels_share_one_scale():
    figure = draw_levels(run_pictures())
    panels = texels_over(figure)
    assert [axes.get_label() for axes in panels[:2]] == ["Resolution used", "Resolution needed"]
    bar = figure.axes[-1]
    assert bar.get_ylim() == (8, 12)
    assert "of the node that answered the pixel" in words(figure)
    # A handful of pixels at grazing light does not stretch the scale.
    used = np.where(np.arange(WIDTH) < 40, 8.0, 12.0) + np.zeros((HEIGHT, 1))
    used[10, :5] = 24
    few = dataclasses.replace(run_pictures(), log2_resolution=used, maps={})
    assert draw_levels(few).axes[-1].get_ylim() == (8, 12)
    with pytest.raises(ValueError, match="no adaptive map"):
        draw_levels(dataclasses.replace(run_pictures(), log2_resolution=None))


def test_zero_errors_stand_on_their_own_line():
    pictures = run_pictures()
    pixels = int(pictures.valid.sum())
    figure = draw_accuracy_time(pictures.methods, pixels, "wall")
    (axes,) = figure.axes
    points = {
        line.get_label(): (np.asarray(line.get_xdata())[0], np.asarray(line.get_ydata())[0])
        for line in axes.lines
        if line.get_marker() != "None"
    }
    floor = zero_line(np.array([3.125, 0, 0]), pixels)
    assert points["uniform-16"] == pytest.approx([2, 3.125])
    assert points["adaptive-1MB"] == pytest.approx([4, floor])
    assert points["rays-1"] == pytest.approx([6, floor])
    assert floor < 100 / pixels
    low, high = axes.get_ylim()
    assert low < floor and high > 3.125
    labels = [text.get_text() for text in axes.get_yticklabels()]
    assert labels[0] == "0" and "1" in labels
    assert min(t for t in axes.yaxis.get_minorticklocs()) > 1.5 * floor
    assert any("rays-1 traces shadow rays from every pixel" in text for text in words(figure))
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "milliseconds" in axes.get_xlabel() and "%" in axes.get_ylabel()
    named = [text.get_text() for text in axes.texts]
    assert "uniform-16  3.12 %" in named and "time of tracing every pixel" in named


def test_names_of_close_points_do_not_overlap():
    base = dict(run_pictures().methods[0])
    methods = [
        base | {"name": f"uniform-{i}", "seconds": {"total": 0.01 + 0.0002 * i}} for i in range(6)
    ]
    (axes,) = draw_accuracy_time(methods, 1000).axes
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) == 6
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:i])
    assert draw_accuracy_time([], 0).axes


def test_importing_the_figures_loads_neither_pyplot_nor_jax():
    code = (
        "import sys, asmjax.report.figures;"
        "print([n for n in ('matplotlib.pyplot', 'jax', 'scipy') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
