"""Charts of error against cost: fronts, zeros, yardsticks, and labels that can be read."""

import matplotlib
import numpy as np
import pytest
from helpers.figures import words
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from asmjax.report.figures.fronts import (
    FrontPanel,
    FrontPoint,
    Mark,
    draw_fronts,
    significant_tick,
    zero_line,
)
from asmjax.report.figures.labels import Label, write_labels
from asmjax.report.figures.style import style


def panel(points, front, marks=()) -> FrontPanel:
    return FrontPanel("In time", "small", "time, milliseconds", points, front, marks)


def point(family: str, name: str, cost: float, error: float) -> FrontPoint:
    return FrontPoint(family, name, name, cost, error, 0.9 * cost, 1.2 * cost)


POINTS = [
    point("uniform", "a", 1.0, 1.0),
    point("uniform", "b", 10.0, 0.1),
    point("adaptive", "c", 100.0, 0.0),
    point("adaptive", "d", 500.0, 0.5),
]


def labels_of(figure: Figure) -> list[Annotation]:
    found = [text for text in figure.axes[0].texts if isinstance(text, Annotation)]
    return [text for text in found if text.get_text()]


def test_front_is_labelled_and_zero_has_a_place():
    """Only the front's points get labels; a point without error stands, open, on the line of 0."""
    figure = draw_fronts([panel(POINTS, "abc", [Mark("1 ray per pixel", 5.0)])], "wall")
    axes = figure.axes[0]
    texts = [text.get_text() for text in labels_of(figure)]
    assert texts == ["1 ray per pixel", "uniform, a", "uniform, b", "adaptive, c"]
    floor = zero_line(np.array([p.error for p in POINTS]))
    assert floor == pytest.approx(0.1 / 3)
    places = [(line, np.asarray(line.get_xydata())) for line in axes.get_lines()]
    single = {at[0, 0]: (line, at[0, 1]) for line, at in places if at.shape == (1, 2)}
    assert single[100.0][1] == floor
    faces = {cost: line.get_markerfacecolor() for cost, (line, _) in single.items()}
    assert faces[100.0] == "white" != faces[10.0]
    ticks = dict(
        zip(axes.get_yticks(), [t.get_text() for t in axes.get_yticklabels()], strict=True)
    )
    assert ticks[floor] == "0"
    assert (axes.get_xlabel(), axes.get_xscale()) == ("time, milliseconds", "log")
    assert "edge" in axes.get_ylabel()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["uniform", "adaptive"]
    assert any("wall" in text for text in words(figure))


def test_staircase_has_no_point_below_it():
    """Its corners are those of the front, from top to right."""
    figure = draw_fronts([panel(POINTS[:2] + POINTS[3:], "ab")])
    stairs = max(figure.axes[0].get_lines(), key=lambda line: line.get_linewidth())
    corners = np.asarray(stairs.get_xydata())
    assert corners[1].tolist() == [1.0, 1.0] and corners[2].tolist() == [10.0, 1.0]
    assert corners[3].tolist() == [10.0, 0.1] and corners[4, 1] == 0.1


def test_colours_and_markers_tell_families_apart():
    figure = draw_fronts([panel(POINTS, "abc")])
    handles = figure.legends[0].legend_handles
    looks = {(h.get_marker(), h.get_color()) for h in handles}  # type: ignore[union-attr]
    assert len(looks) == 2 == len({marker for marker, _ in looks})


def test_nothing_to_draw_is_no_error():
    assert draw_fronts([panel([], [])]).axes
    only = [point("uniform", "a", 1.0, 0.0)]
    assert draw_fronts([panel(only, "a")]).axes


def test_labels_do_not_cover_each_other():
    """Twelve points of a front at random: no two labels share a pixel as they are drawn, and none
    leaves the chart."""
    rng = np.random.default_rng(0)
    for _ in range(3):
        costs = np.sort(10 ** rng.uniform(0, 2, 12))
        errors = np.sort(10 ** rng.uniform(-2, 0, 12))[::-1]
        points = [
            FrontPoint("uniform", f"{k} MB, parts 4", f"{k}", c, e, c, c)
            for k, (c, e) in enumerate(zip(costs, errors, strict=True))
        ]
        figure = draw_fronts([panel(points, [p.name for p in points])])
        renderer = FigureCanvasAgg(figure).get_renderer()
        with style():
            boxes = [text.get_window_extent(renderer) for text in labels_of(figure)]
            frame = figure.axes[0].get_window_extent()
        assert len(boxes) >= 8
        for i, box in enumerate(boxes):
            assert frame.x0 - 1 <= box.x0 and box.x1 <= frame.x1 + 1
            assert not any(box.overlaps(other) for other in boxes[:i])


def test_labels_keep_off_points_and_lines():
    """A point on the right sends the label to the left, and a line there above."""
    with style():
        figure = Figure(figsize=(6, 4), dpi=100)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0, 600), ylim=(0, 400))
        one = Label(300.0, 200.0, "label", "black")
        write_labels(axes, [one], np.array([[300.0, 200.0], [330.0, 200.0]]), [])
        (text,) = [t for t in axes.texts if t.get_text()]
        assert text.get_position()[0] < 290
        line = np.array([[0.0, 200.0], [290.0, 200.0]])
        write_labels(axes, [one], np.array([[300.0, 200.0], [330.0, 200.0]]), [line])
        assert abs([t for t in axes.texts if t.get_text()][-1].get_position()[1] - 200) >= 20


def test_ticks_are_plain_numbers():
    assert [significant_tick(v) for v in (0.002, 0.5, 20.0, 1000.0)] == [
        "0.002",
        "0.5",
        "20",
        "1000",
    ]
    assert "text.usetex" in matplotlib.rcParams
