"""The figure of the tree: where it looks, what it draws, and the relief beneath."""

import dataclasses

import numpy as np
import pytest
from helpers.figures import box_on_floor, run_pictures, texels_over, words

from asmjax.report.figures import TreePicture, draw_tree
from asmjax.report.figures.relief import relief, structure
from asmjax.report.figures.tree_windows import Window, seen_nodes, tree_windows


def test_tree_is_drawn_whole_and_where_its_nodes_are():
    pictures = run_pictures()
    tree = pictures.tree
    assert tree is not None
    calls = []

    def cast(*arguments):
        calls.append(arguments)
        return box_on_floor(*arguments)

    figure = draw_tree(dataclasses.replace(pictures, tree=dataclasses.replace(tree, cast=cast)))
    face, windows = tree_windows(tree)
    assert face == 0 and len(windows) == 2
    panels = texels_over(figure)
    assert len(panels) == 3
    assert panels[0].get_xlim() == (0, 1) and panels[0].get_ylim() == (1, 0)
    for axes, call, window in zip(panels, calls, [Window(0, 0, 1), *windows], strict=True):
        assert call[:4] == (0, *window)
        # Cast for this very window at the panel's own pixels.
        assert axes.get_window_extent().width == pytest.approx(call[4])
        assert np.asarray(axes.get_images()[0].get_array()).shape == (call[4], call[4], 3)
        u, v, size = window
        assert axes.get_xlim() == pytest.approx((u, u + size))
        assert axes.get_ylim() == pytest.approx((v + size, v))
    # Nodes of at least 4.5 pixels, without the root, whose outline is the panel's.
    paths = panels[0].collections[0].get_paths()
    assert [np.shape(path.vertices) for path in paths] == [(5, 2)] * 7
    np.testing.assert_allclose(paths[0].get_extents().size, 0.5)
    labels = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert labels[0].split() == ["0", "2⁶"] and labels[-1].split() == ["8", "2¹⁴"]


def test_levels_have_one_colour_each_and_the_key_names_those_that_exist():
    pictures = run_pictures()
    tree = TreePicture(
        level=[0, 4, 4, 9],
        face=np.zeros(4),
        lo=[[0, 0.5, 0.5625, 0.5], [0, 0.5, 0.5, 0.5]],
        size=[1, 1 / 16, 1 / 16, 1 / 512],
        node_resolution=16,
        faces=1,
        cast=box_on_floor,
    )
    figure = draw_tree(dataclasses.replace(pictures, tree=tree))
    labels = [text.get_text().split() for text in figure.axes[-1].get_yticklabels()]
    assert labels == [["0", "2⁴"], ["4", "2⁸"], ["9", "2¹³"]]
    for axes in texels_over(figure)[1:]:
        outlines = np.atleast_2d(axes.collections[0].get_edgecolor())
        assert len(np.unique(outlines, axis=0)) > 1


def test_windows_hold_the_refined_nodes_and_many_levels():
    """A cloud of level 2 in one place, a nest of all levels in another, and an outlier."""
    rng = np.random.default_rng(1)
    cloud = 0.25 + rng.integers(0, 32, (2, 400)) / 128
    nest = np.full((2, 12), 0.5 - 2.0**-13) // 2.0 ** -np.arange(1, 13) * 2.0 ** -np.arange(1, 13)
    tree = TreePicture(
        level=[0, *[7] * 400, *range(1, 13), 7],
        face=np.zeros(414),
        lo=np.concatenate([[[0], [0]], cloud, nest, [[0.99], [0.99]]], axis=1),
        size=[1, *[1 / 128] * 400, *2.0 ** -np.arange(1, 13), 1 / 128],
        node_resolution=16,
        faces=1,
        cast=box_on_floor,
    )
    face, (wide, close) = tree_windows(tree)
    assert face == 0
    assert 0.25 <= wide.size < 0.4
    centres = cloud + 1 / 256
    for axis, corner in enumerate(wide[:2]):
        held = (centres[axis] >= corner) & (centres[axis] <= corner + wide.size)
        assert held.mean() > 0.95
    assert close.size <= wide.size / 5
    seen = tree.level[seen_nodes(tree.lo, tree.size, close, 0.011)]
    assert np.unique(seen).size >= 4


def test_outlines_of_nodes_that_cross_a_window_are_seen():
    window = Window(0.5, 0.5, 0.25)
    lo = np.array([[0.0, 0.5, 0.6, 0.75, 0.4], [0.0, 0.5, 0.6, 0.75, 0.4]])
    size = np.array([1.0, 0.125, 0.001, 0.1, 0.2])
    seen = seen_nodes(lo, size, window, 0.01)
    assert seen.tolist() == [False, True, False, False, True]


def test_tree_without_depth_or_with_many_faces():
    pictures = run_pictures()
    assert pictures.tree is not None
    roots = TreePicture(
        level=[0, 0, 0],
        face=[0, 1, 2],
        lo=np.zeros((2, 3)),
        size=np.ones(3),
        node_resolution=64,
        faces=3,
        cast=box_on_floor,
    )
    figure = draw_tree(dataclasses.replace(pictures, tree=roots))
    assert len(texels_over(figure)) == 3
    assert any(text.startswith("3 nodes on the 3 faces") for text in words(figure))
    # Of two faces refined alike, the one with something to see.
    refined = dataclasses.replace(
        roots,
        level=[0, 0, 0, 1, 1],
        face=[0, 1, 2, 1, 2],
        lo=np.zeros((2, 5)),
        size=[1, 1, 1, 0.5, 0.5],
        cast=lambda face, *rest: box_on_floor(face, *rest) if face == 2 else np.ones((1, 1)),
    )
    assert tree_windows(refined, [0.1, 0.1, 0.5])[0] == 2
    assert tree_windows(refined)[0] == 1
    with pytest.raises(ValueError, match="no tree"):
        draw_tree(dataclasses.replace(pictures, tree=None))


def test_relief_is_pale_near_and_dark_far_and_darkest_at_nothing():
    depth = box_on_floor(0, 0.0, 0.0, 1.0, 200)
    image = relief(depth)[..., 0].astype(int)
    box, floor, nothing = image[100, 100], image[160, 100], image[5, 195]
    assert box > floor + 20 and floor > nothing + 20
    # The box's outline is darker than what it separates.
    assert image[100, 55:65].min() < min(box, image[100, 50]) - 10
    assert relief(np.full((2, 2), np.inf)).std() == 0
    assert relief(np.ones((4, 4))).std() == 0
    assert structure(depth) > structure(np.full((9, 9), 2.0)) == 0
    assert structure(np.full((9, 9), np.inf)) == 0


def test_relief_has_contrast_however_little_depth_varies():
    """A step of a few millionths of the depth, as in a window of a deep node."""
    column = np.tile(np.arange(64), (64, 1))
    image = relief(7.0 * (1 + 4e-6 * (column > 30)))[..., 0].astype(int)
    assert image[:, 10].mean() > image[:, 50].mean() + 20
    # A plane has one slope, and rises smoothly: no creases inside.
    plane = relief(3.0 + column / 640)[..., 0].astype(int)
    assert np.abs(np.diff(plane, axis=1)).max() <= 3
