"""Growth curves, requirements, and the document of the 2001 paper's section 5; no renderer."""

import numpy as np
import pytest
from asm2001.paper import (
    PAPER,
    bounds_of,
    bounds_table,
    document,
    figure,
    growth_table,
    timing_table,
    view_table,
)

from asmjax.errors import UseError
from asmjax.experiment.bounds import Bound
from asmjax.experiment.growth import SERIES, Growth, GrowthPoint, fitted_slope
from asmjax.report.figures import RunPictures
from asmjax.report.figures.beside import draw_beside
from asmjax.report.figures.growth import draw_growth
from asmjax.report.figures.style import FALSE_DARK, FALSE_LIT, hex_rgb

MB = 2**20


def grown(axis: str, sizes, exponent: float, short: int = 0) -> Growth:
    """A power law for every series; the first `short` points did not converge."""
    points = [
        GrowthPoint(size, dict.fromkeys(SERIES, 1e-3 * size**exponent), k >= short, 10, 100)
        for k, size in enumerate(sizes)
    ]
    return Growth(axis, tuple(points))


@pytest.mark.parametrize("exponent", [-0.5, 0.0, 1.0, 1.7])
def test_slope_of_a_power_law_is_its_exponent(exponent):
    """Exact for a law, whatever its factor."""
    sizes = np.array([3.0, 10.0, 700.0, 2e6])
    assert fitted_slope(sizes, 7e-4 * sizes**exponent) == pytest.approx(exponent, abs=1e-12)


@pytest.mark.parametrize(
    ("sizes", "seconds", "message"),
    [([2], [1], "two different sizes"), ([2, 2], [1, 1], "two different"),
     ([1, 2], [1], "a time each"), ([1, 2], [0, 1], "positive"), ([-1, 2], [1, 1], "positive")],
)  # fmt: skip
def test_slope_of_what_has_none(sizes, seconds, message):
    """One line of what is wrong."""
    with pytest.raises(UseError, match=message):
        fitted_slope(sizes, seconds)


def test_growth_tells_converged_points_apart():
    """Slopes over all points and over those that did not end at a limit; None where too few."""
    growth = grown("memory", [MB, 2 * MB, 4 * MB], 0.5, short=2)
    assert growth.slope("warm") == pytest.approx(0.5)
    assert growth.slope("warm", converged_only=True) is None
    assert growth.series == SERIES
    record = growth.record()
    assert record["slopes_converged"]["cold"] is None
    assert [point["size"] for point in record["points"]] == [MB, 2 * MB, 4 * MB]
    again = Growth("memory", tuple(GrowthPoint(**point) for point in record["points"]))
    assert again == growth


def test_a_map_that_more_memory_would_change_has_not_converged():
    """It ended at no limit, yet larger limits hold more nodes; other axes change nodes anyway."""
    points = tuple(
        GrowthPoint(size, dict.fromkeys(SERIES, seconds), True, nodes, 100)
        for size, seconds, nodes in ((1, 1.0, 500), (2, 3.0, 930), (4, 3.0, 1000))
    )
    growth = Growth("memory", points)
    assert growth.converged() == points[1:]
    assert growth.slope("cold", converged_only=True) == pytest.approx(0, abs=1e-12)
    assert growth.record()["converged"] == [2, 4]
    assert Growth("pixels", points).converged() == points


def test_bounds_know_pass_fail_and_nothing_measured():
    """Equal to the limit passes; what was not measured is neither, and reaches no aim."""
    assert Bound("a", "", 0.35, 0.35, 0.2).verdict == "pass"
    assert Bound("a", "", 0.35, 0.35, 0.2).reaches_aim is False
    assert Bound("a", "", 0.36, 0.35).verdict == "fail"
    assert Bound("a", "", 0.36, 0.35).reaches_aim is None
    for nothing in (None, float("nan")):
        assert Bound("a", "", nothing, 1.0, 0.5).record()["verdict"] == "skipped"
        assert Bound("a", "", nothing, 1.0, 0.5).reaches_aim is None


def walk_record(adaptive: float, uniform: float, rays: float) -> dict:
    """What the record keeps of a walkthrough with those totals in seconds."""
    stages = {"build": 0.0, "analysis": 0.0, "query": 0.0, "id_pass": 0.0}
    totals = {"uniform-2048": uniform, "uniform-2048-kept": 0.001,
              "adaptive-16MB": adaptive, "rays-1": rays}  # fmt: skip
    methods = [
        {"name": name, "seconds": stages | {"total": total}, "bytes": 15 * MB,
         "time_ratio": adaptive / total}
        for name, total in totals.items()
    ]  # fmt: skip
    return {"summary": {"methods": methods}, "memory_limit_bytes": 16 * MB}


def view_record(wrong: float) -> dict:
    """What the record keeps of a view: the uniform map errs in 10 %."""
    return {
        "methods": [
            {"name": name, "seconds": {"total": seconds}, "bytes": 16 * MB,
             "settings": {"memory_bytes": 16 * MB}, "effective_resolution": 2048,
             "status": "memory_limit",
             "error": {"misclassified_fraction": error}}
            for name, seconds, error in (
                ("uniform-2048", 0.05, 0.1), ("adaptive-8MB", 9.0, 0.09),
                ("adaptive-16MB", 0.15, wrong),
            )
        ]
    }  # fmt: skip


def record_of(**parts) -> dict:
    """A record as the script begins it, with some steps done."""
    return {
        "title": "t", "command": "python x", "steps": {}, "figures": {}, "skipped": {},
        "settings": {"pixels": 512, "memory_mb": 16.0}, **parts,
    }  # fmt: skip


def test_an_empty_record_measures_nothing_and_still_reads():
    """Before the first step every bound is skipped, and no table is shown."""
    record = record_of(skipped={"victorian_house": "no file"})
    bounds = bounds_of(record)
    assert {bound.verdict for bound in bounds} == {"skipped"}
    assert len({bound.name for bound in bounds}) == len(bounds) == 16
    text = document(record)
    assert "not measured" in text and "(no file)" in text
    assert "## Growth" not in text and "## Frames" not in text
    assert timing_table(record) == view_table(record) == growth_table(record) == ""


def test_bounds_read_the_figures_that_were_measured():
    """Each ratio is of the right pair: the map of all the memory, the flat map drawn anew."""
    record = record_of(
        walkthroughs={"paper_room": walk_record(0.02, 0.1, 0.01),
                      "victorian_house": walk_record(0.03, 0.1, 0.01)},
        views={"overview": view_record(0.01), "macro": view_record(0.0)},
        retraces={"frames": 7, "count": 2, "names": ["f", "f"]},
        growth={
            "pixels": grown("pixels", [1, 2, 4], 0.9).record() | {"memory_bytes": 200},
            "memory": grown("memory", [MB, 2 * MB, 4 * MB], 0.5, short=1).record(),
        },
    )  # fmt: skip
    found = {bound.name: bound for bound in bounds_of(record)}
    expected = {
        "warm frame": (0.2, "pass"), "cold start": (3.0, "pass"),
        "victorian_house": (3.0, "fail"), "surface:12m": (None, "skipped"),
        "error, overview": (0.1, "pass"), "error, closeup": (None, "skipped"),
        "error, macro": (0.0, "pass"), "retraces": (2.0, "fail"), "memory": (1.0, "pass"),
        "growth with pixels, warm frame": (0.9, "pass"),
        "growth with triangles, warm frame": (None, "skipped"),
        "growth with memory, warm frame": (0.5, "fail"),
    }  # fmt: skip
    for name, (measured, verdict) in expected.items():
        assert found[name].measured == (None if measured is None else pytest.approx(measured))
        assert found[name].verdict == verdict, name
    assert found["warm frame"].reaches_aim
    assert found["cold start"].reason == "ended: memory limit"
    assert found["retraces"].reason == "f"
    assert "converged at 2, 4 MB" in found["growth with memory, warm frame"].reason
    table = bounds_table(list(found.values()))
    assert table.count("\n") == 1 + len(found) and "**fail**" in table


def test_document_has_the_papers_numbers_beside_ours():
    """8.5 against 4.9 frames per second, and the split of the 86 milliseconds."""
    assert sum(PAPER["extra_seconds"].values()) == pytest.approx(
        PAPER["adaptive_seconds"] - PAPER["uniform_seconds"]
    )
    record = record_of(walkthroughs={"paper_room": walk_record(0.02, 0.1, 0.01)})
    text = document(record)
    for words in ("117 (8.5 fps)", "203 (4.9 fps)", "| 1.74 | 0.200 |", "20.0 (50 fps)"):
        assert words in text
    assert figure(-0.25) == "−0.250" and figure(None) == "–"


def test_growth_figure_draws_every_axis():
    """Also a single point, which has no slope and no line."""
    drawn = draw_growth(
        [grown("pixels", [256**2, 512**2], 1.0), grown("triangles", [10_000], 0.3),
         grown("memory", [MB, 4 * MB, 16 * MB], 0.0, short=1)],
        "title",
    )  # fmt: skip
    panels = drawn.axes[:3]
    assert [axes.get_xlabel() for axes in panels] == [
        "eye pixels", "triangles of the scene", "memory limit, MB",
    ]  # fmt: skip
    assert [t.get_text() for t in panels[0].texts] == ["+1.00"] * len(SERIES)
    assert not panels[1].texts


@pytest.mark.parametrize("wrong", [True, False])
def test_beside_marks_what_is_wrong(wrong):
    """Two pictures, two squares each, and those again with the wrong pixels in colour."""
    side = 40
    truth = np.zeros((side, side))
    truth[:, : side // 2] = 1.0
    other = np.roll(truth, 2, axis=1) if wrong else truth
    pictures = RunPictures(
        title="t", direct=np.full((side, side, 3), 0.8), ambient=np.full((side, side, 3), 0.1),
        valid=np.ones((side, side), bool), truth=truth,
        visibilities={"uniform-8": other, "adaptive-1MB": truth},
    )  # fmt: skip
    drawn = draw_beside(pictures, ["uniform-8", "adaptive-1MB"])
    images = [axes.images[0].get_array() for axes in drawn.axes]
    assert len(images) == 2 * (1 + 2 * 2)

    def near(image, colour):
        return np.abs(np.asarray(image, float) - hex_rgb(colour)).max(axis=-1) < 70

    marked = [images[3], images[4]]
    count = sum(near(image, c).sum() for image in marked for c in (FALSE_LIT, FALSE_DARK))
    assert (count > 0) == wrong
