"""Figures: their data, limits, labels and files; what they look like is for people to judge."""

import dataclasses
import subprocess
import sys
from functools import cache

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import Normalize

from asmjax.errors import UseError
from asmjax.metrics import error_summary, surface_pairs
from asmjax.report import method_record
from asmjax.report.figures import (
    RunPictures,
    TreePicture,
    draw_accuracy_time,
    draw_errors,
    draw_levels,
    draw_maps,
    draw_shadows,
    draw_tree,
    linear_parts,
    shade,
    write_figures,
)
from asmjax.report.figures.accuracy_time import zero_line
from asmjax.report.figures.board import DPI, panel_size
from asmjax.report.figures.errors import error_image
from asmjax.report.figures.scales import (
    colours_of,
    exponent_ticks,
    factor,
    log2_or_nan,
    power_of_two,
    scale_limits,
)
from asmjax.report.figures.shading import tone
from asmjax.report.figures.spots import Spot, densest_spots
from asmjax.report.figures.style import BACKGROUND, FALSE_DARK, FALSE_LIT, SKY, hex_rgb
from asmjax.report.figures.tree import depth_image, zoom_windows

HEIGHT, WIDTH = 48, 64
ADAPTIVE = {"nodes": 9, "passes": 3, "max_level": 8, "status": "converged"}


def texels_over(pictures):
    """Panels of a figure that hold an image, without its colour bars."""
    return [axes for axes in pictures.axes if axes.get_images()]


def words(figure):
    return [text.get_text() for text in figure.texts]


@cache
def run_pictures() -> RunPictures:
    """A wall whose shadow edge is at column 30.2, answered by maps of 4 and 0.5 pixels a texel."""
    x = np.tile(np.arange(WIDTH) + 0.5, (HEIGHT, 1))
    valid = np.ones((HEIGHT, WIDTH), bool)
    valid[:6] = False
    truth = np.where(valid, (x > 30.2) * 1.0, np.nan)
    shadows = {"uniform-16": (x // 4 * 4 + 2 > 30.2) * 1.0, "adaptive-1MB": (x > 30.2) * 1.0}
    shadows["rays-1"] = shadows["adaptive-1MB"]
    methods = [
        method_record(
            name,
            settings={},
            effective_resolution=None if name == "rays-1" else 1024,
            bytes=2**20,
            rays=10,
            seconds={"build": 0.002 * (i + 1)},
            error=error_summary(truth, image, valid, surface_pairs(valid)),
            **(ADAPTIVE if name.startswith("adaptive") else {}),
        )
        for i, (name, image) in enumerate(shadows.items())
    ]
    ratio = np.exp2((x - 32) / 8)
    ratio[:, 0] = np.inf
    direct, ambient = linear_parts(np.full((3, HEIGHT, WIDTH), 0.5), np.full((HEIGHT, WIDTH), 0.8))
    level = np.arange(9)
    return RunPictures(
        title="wall",
        direct=direct,
        ambient=ambient,
        valid=valid,
        truth=truth,
        visibilities=shadows,
        methods=methods,
        maps={
            "area_ratio": ratio,
            "m": np.sqrt(ratio),
            "n_required": 2.0**20 * ratio,
            "benefit": np.where(np.abs(x - 30) < 2, 100.0, 0.0),
        },
        log2_resolution=np.where(x < 40, 8.0, 12.0),
        tree=TreePicture(
            level=level,
            face=np.zeros(9),
            lo=np.stack([0.6 - 0.6 * 0.5**level, 0.3 - 0.3 * 0.5**level]),
            size=0.5**level,
            node_resolution=64,
            light_depth=np.where(np.eye(32) > 0, np.inf, 3.0)[None],
        ),
    )


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
    assert "1,024² texels, 1.00 MB" in found


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


def test_maps_have_scales_in_powers_of_two():
    pictures = run_pictures()
    figure = draw_maps(pictures)
    panels = {axes.get_label(): axes for axes in texels_over(figure) if axes.get_label()}
    assert set(panels) == {"area_ratio", "m", "n_required", "benefit"}
    bars = [axes for axes in figure.axes if axes.get_yticklabels()]
    ticks = [[text.get_text() for text in axes.get_yticklabels()] for axes in bars]
    assert "1×" in ticks[0] and "1/4×" in ticks[0] and "4×" in ticks[0]
    low, high = bars[0].get_ylim()
    assert low == -high
    assert all(text.startswith("2") for text in ticks[2])
    # Matched is white, and pixels without a value are the background.
    area = np.asarray(panels["area_ratio"].get_images()[0].get_array())
    assert area[20, 31:33].min() > 235
    np.testing.assert_array_equal(area[20, 0], hex_rgb(BACKGROUND))
    np.testing.assert_array_equal(area[2, 30], hex_rgb(BACKGROUND))


def test_tree_zooms_to_the_deepest_nodes():
    pictures = run_pictures()
    tree = pictures.tree
    assert tree is not None
    face, windows = zoom_windows(tree)
    assert face == 0 and len(windows) == 2
    for u, v, size in windows:
        assert u < tree.lo[0, -1] < u + size and v < tree.lo[1, -1] < v + size
        assert 0 <= u <= 1 - size and 0 <= v <= 1 - size
    assert windows[0][2] == pytest.approx(np.sqrt(windows[1][2]))
    figure = draw_tree(pictures)
    panels = texels_over(figure)
    assert len(panels) == 3
    assert panels[0].get_xlim() == (0, 1) and panels[0].get_ylim() == (1, 0)
    assert panels[2].get_xlim() == pytest.approx((windows[1][0], sum(windows[1][::2])))
    # The whole shows nodes of at least 4 pixels: sizes down to 560 / 2^7.
    assert len(panels[0].collections[0].get_paths()) == 8
    labels = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert labels[0].split() == ["0", "2⁶"] and labels[-1].split() == ["8", "2¹⁴"]


def test_tree_without_depth_or_with_many_faces():
    pictures = run_pictures()
    assert pictures.tree is not None
    root = TreePicture(
        level=[0, 0, 0],
        face=[0, 1, 2],
        lo=np.zeros((2, 3)),
        size=np.ones(3),
        node_resolution=64,
        light_depth=np.ones((3, 8, 8)),
    )
    figure = draw_tree(dataclasses.replace(pictures, tree=root))
    assert len(texels_over(figure)) == 3
    assert any(text.startswith("3 nodes on 3 faces") for text in words(figure))
    with pytest.raises(ValueError, match="no tree"):
        draw_tree(dataclasses.replace(pictures, tree=None))


def test_depth_is_pale_near_and_dark_far():
    image = depth_image([[1.0, 10.0, 100.0, np.inf]])[0, :, 0].astype(int)
    assert image[0] > image[1] > image[2] > image[3]
    assert image[0] - image[1] == pytest.approx(image[1] - image[2], abs=3)
    assert depth_image(np.full((2, 2), np.inf)).std() == 0


def test_levels_share_one_scale():
    figure = draw_levels(run_pictures())
    panels = texels_over(figure)
    assert [axes.get_label() for axes in panels[:2]] == ["Resolution used", "Resolution needed"]
    bar = figure.axes[-1]
    assert bar.get_ylim() == (8, 12)
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
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "milliseconds" in axes.get_xlabel() and "%" in axes.get_ylabel()
    named = [text.get_text() for text in axes.texts]
    assert "uniform-16  3.12 %" in named and "one shadow ray per pixel" in named


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


def test_shading_keeps_shape_in_shadow_and_exposes_for_the_lit_picture():
    albedo = np.full((3, 4, 6), 0.5)
    cosine = np.tile(np.linspace(-0.5, 1, 6), (4, 1))
    lit = shade(albedo, cosine, np.ones((4, 6)))
    dark = shade(albedo, cosine, np.zeros((4, 6)))
    assert (lit >= dark).all()
    np.testing.assert_array_equal(lit[:, :2], dark[:, :2])
    assert lit[0, -1, 0] > 200
    assert (np.diff(dark[0, :, 0].astype(int)) > 0).all()
    masked = shade(albedo, cosine, np.full((4, 6), np.nan), np.zeros((4, 6), bool))
    np.testing.assert_array_equal(masked[0, 0], hex_rgb(SKY))
    assert shade(albedo * 0, cosine, np.ones((4, 6))).max() == 0
    steps = tone(np.linspace(0, 50, 200))
    assert (np.diff(steps.astype(int)) >= 0).all() and steps[0] == 0 and steps[-1] == 255


def test_labels_of_powers():
    assert [power_of_two(k) for k in (-3, 0, 3, 11)] == ["1/8", "1", "8", "2¹¹"]
    assert [factor(k) for k in (-2, 0, 3, 12, -20)] == ["1/4×", "1×", "8×", "2¹²×", "2⁻²⁰×"]


@given(st.floats(-100, 100), st.floats(0, 200))
def test_ticks_are_few_inside_and_evenly_spaced(low, span):
    ticks = exponent_ticks(low, low + span)
    assert len(ticks) <= 8
    assert all(low - 1e-6 <= k <= low + span + 1e-6 for k in ticks)
    assert len(set(np.diff(ticks))) <= 1
    if span >= 1:
        assert ticks or span < 101


@given(st.lists(st.floats(-60, 60) | st.just(np.nan), max_size=20), st.booleans())
def test_scales_hold_most_values_and_are_never_empty(values, centred):
    exponents = np.array(values, float)
    low, high = scale_limits(exponents, centred)
    assert high - low >= 2 - 1e-9
    if centred:
        assert low == -high
    finite = exponents[np.isfinite(exponents)]
    assert finite.size == 0 or low - 1e-9 <= np.median(finite) <= high + 1e-9


def test_values_without_a_logarithm_are_background():
    exponents = log2_or_nan([[4.0, 0.0, -1.0, np.inf, np.nan]])
    np.testing.assert_array_equal(exponents[0], [2, *[np.nan] * 4])
    norm = Normalize(0, 4)
    image = colours_of(exponents, matplotlib.colormaps["viridis"], norm)
    assert (image[0, 1:] == hex_rgb(BACKGROUND)).all()
    assert (image[0, 0] != hex_rgb(BACKGROUND)).any()


def test_importing_the_figures_loads_neither_pyplot_nor_jax():
    code = (
        "import sys, asmjax.report.figures;"
        "print([n for n in ('matplotlib.pyplot', 'jax', 'scipy') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
