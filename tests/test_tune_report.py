"""The report, the tables and the figures of tuning, from results made of numbers."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from helpers.figures import words
from helpers.tune_results import HELD_OUT, YARDSTICK, tuning_result

from asmjax.errors import UseError
from asmjax.report import InvalidReport, validate_report
from asmjax.report.figures.tuning import equal_objective
from asmjax.report.keys import key_paths
from asmjax.report.outputs import Outputs
from asmjax.report.schema import RUN_KEYS
from asmjax.report.table import MAX_WIDTH
from asmjax.report.tune_files import write_tuning
from asmjax.report.tune_record import report_of_tuning
from asmjax.report.tune_schema import OUTCOMES, ROLES, TUNING_KEYS
from asmjax.report.tune_table import verdict
from asmjax.report.tune_words import setting_words
from asmjax.shadow import read_settings
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Outcome
from asmjax.tuning.space import NAMES

PRICE = Goal(price=0.1)
ADVICE = "no settings met the limit: see the nearest ones"


@pytest.fixture(scope="module")
def result():
    return tuning_result(PRICE)


@pytest.fixture(scope="module")
def report(result) -> dict:
    return report_of_tuning(result, 3)


def test_the_report_has_the_numbers(result, report):
    """Objectives by hand; intervals and ratios over the views."""
    validate_report(report)
    rivals = report["objective"]
    assert list(rivals) == ["default", "tuned", "grid_best", "random_best"]
    expected = {"default": 0.026, "tuned": 0.015, "grid_best": 0.02, "random_best": 0.034}
    for name, objective in expected.items():
        assert rivals[name]["objective"] == pytest.approx(objective)
        assert rivals[name]["gain"] == pytest.approx(1 - 0.015 / objective)
        assert [view["view"] for view in rivals[name]["views"]] == list(HELD_OUT)
    tuned = rivals["tuned"]
    assert tuned["seconds"]["median"] == pytest.approx(0.05)
    assert tuned["seconds"]["low"] == pytest.approx(0.045)
    assert tuned["seconds"]["high"] == pytest.approx(0.055)
    # Three turns, each the mean of both views: 0.9 to 1.1 of 12.5.
    assert tuned["ratio"]["median"] == pytest.approx(12.5)
    assert (tuned["ratio"]["low"], tuned["ratio"]["high"]) == pytest.approx((11.25, 13.75))
    assert tuned["seconds"]["coverage"] == 0.75
    assert tuned["views"][0]["error"]["boundary_displacement_px"]["per_edge_length"] == 0.012
    assert report["tried"][4]["predicted"]["edge_px"] == pytest.approx(
        1.1 * report["tried"][4]["edge_px"]
    )
    assert len(report["tried"]) == 25 and len(report["finalists"]) == 4
    assert report["goal"] == {"kind": "price", "value": 0.1, "words": PRICE.words}
    assert report["front"][0]["gap"] == pytest.approx(math.expm1(0.01))
    assert result.yardstick == pytest.approx(YARDSTICK)


def test_everything_is_written_and_can_be_used(result, tmp_path):
    """The settings file gives the tuned map again; the CSV has a row for each that was tried."""
    outputs = Outputs(tmp_path, "tuning")
    write_tuning(result, report_of_tuning(result, 3), outputs)
    report = outputs.report
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8")) == report
    again = read_settings(tmp_path / "tuned.toml")
    for name in NAMES:
        assert getattr(again, name) == result.settings[name]
    with (tmp_path / "tried.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["role"] for row in rows] == [one.role for one in result.found.tried]
    assert float(rows[7]["total_ms"]) == pytest.approx(1e3 * result.found.tried[7].seconds)
    assert float(rows[7]["least_profit"]) == result.found.tried[7].algorithm.least_profit
    written = {path.name for path in tmp_path.iterdir()}
    figures = {"tried.png", "surrogate.png", "sensitivity.png"}
    assert written == {"report.json", "tuned.toml", "tried.csv"} | figures


def test_a_limit_has_no_sensitivity(tmp_path):
    """Rationale: nothing is traded, so there is no price to ask about."""
    result = tuning_result(Goal(seconds=0.055))
    report = report_of_tuning(result, 0)
    write_tuning(result, report, Outputs(tmp_path, "tuning"))
    assert report["sensitivity"] is None and report["front"] == []
    # 60 ms break the limit.
    default = report["objective"]["default"]
    assert default["met"] is False and default["objective"] is None and default["gain"] is None
    assert report["objective"]["tuned"]["objective"] == pytest.approx(0.01)
    assert not (tmp_path / "sensitivity.png").exists()
    with pytest.raises(UseError, match="no sensitivity to a price is known"):
        result.plot("sensitivity")
    assert "within the limit, which the default is not" in verdict(result)


def test_the_table_tells_rivals_and_settings(result):
    lines = result.table().splitlines()
    assert max(map(len, lines[2:-1])) <= MAX_WIDTH
    rows = {line[:15].strip(): line for line in lines}
    for name in ("default", "tuned", "best of a grid", "best at random"):
        assert name[:15] in rows
    assert "42.3 % better" in rows["default"] and "50.0" in rows["tuned"]
    assert "as default" in result.table() and rows["time_limit"].split()[1] == "none"
    assert lines[-1] == (
        "tuned is 42.3 % better than the default, 25.0 % better than the best of a grid and "
        "55.9 % better than the best of a random search, on views that were not tuned on."
    )
    assert "<pre>" in result._repr_html_()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"grid": (0.008, 0.05)}, "15.4 % worse than the best of a grid"),
        ({"grid": None, "drawn": None}, "tuned is 42.3 % better than the default, on views"),
        ({"outcome": Outcome.DEFAULT_STANDS, "advice": "keep it."}, "tuned is the default. Keep"),
        ({"outcome": Outcome.TIME_SPENT, "advice": "give more."}, "tuned on. Give more."),
    ],
)
def test_the_verdict_is_honest(changes, said):
    assert said in verdict(tuning_result(PRICE, **changes))


def test_what_nothing_meets_is_said():
    result = tuning_result(Goal(error=0.005), outcome=Outcome.NOT_MET, advice=ADVICE)
    assert verdict(result) == ADVICE
    report = report_of_tuning(result, 0)
    assert report["outcome"] == "not_met" and report["notices"] == [ADVICE]
    assert all(rival["objective"] is None for rival in report["objective"].values())
    assert "over limit" in result.table()
    assert result.plot().axes


def test_objectives_of_a_limit_on_the_error_are_times():
    result = tuning_result(Goal(error=0.5))
    assert result.gain_over("default") == pytest.approx(1 - 0.05 / 0.06)
    assert result.gain_over("random_best") == pytest.approx(1 - 0.05 / 0.04)
    tuned = next(line for line in result.table().splitlines() if line.startswith("tuned "))
    assert tuned.split()[1] == "50.0"


def test_best_keeps_to_limits(result):
    best = {
        "tuned": result.best(),
        "error": result.best(error=0.02),
        "seconds": result.best(seconds=0.045),
        "both": result.best(error=0.016, seconds=0.055),
    }
    assert best["tuned"] is best["error"] is best["both"] is result.found.tuned
    assert best["seconds"] is result.found.random_best
    with pytest.raises(UseError, match=r"least error was 0.01 px .* least time 40 ms"):
        result.best(error=0.001)
    with pytest.raises(UseError, match="allowed: tried, surrogate, sensitivity"):
        result.plot("everything")


def test_lines_of_equal_objective_are_equal():
    """Error + price x time is the same all along, up to where time alone costs it all."""
    ms, error = equal_objective(0.02, 0.1, 10.0, 1e4)
    assert np.allclose(error + 0.1 * ms / 1e3, 0.02) and (error > 0).all()
    assert ms[0] == pytest.approx(10) and ms[-1] == pytest.approx(200, rel=1e-4)
    assert equal_objective(0.02, 0.1, 250.0, 1e4).size == 0
    assert equal_objective(math.inf, 0.1, 250.0, 1e4).size == 0


def test_figures_show_what_was_measured(result):
    """Every tried setting is a marker of the first panel, at its place."""
    figure = result.plot()
    first, second = figure.axes
    dots = [line for line in first.lines if line.get_marker() not in ("None", "", None)]
    placed = sorted((float(d.get_xdata()[0]), float(d.get_ydata()[0])) for d in dots)
    expected = sorted((1e3 * one.seconds, one.edge_px) for one in result.found.tried)
    assert np.allclose(placed, expected)
    said = {text.get_text() for text in second.texts}
    assert {"default", "tuned", "best of a grid", "best at random", "1 ray per pixel"} <= said
    assert first.get_xlim() == second.get_xlim() and first.get_ylim() == second.get_ylim()
    agreement = words(result.plot("surrogate"))
    # The made surrogate is in order: 1.1 times the error, half the time.
    assert "Error: Spearman 1.00" in agreement
    assert "typically off by a factor of 2.00; 25 settings" in agreement
    assert any("not fitted to: 0.90" in text for text in agreement)
    bars, *small = result.plot("sensitivity").axes
    assert len(small) == len(NAMES)
    widths = [patch.get_width() for patch in bars.patches]
    assert widths == pytest.approx([0.2 * (k - 4) for k in range(len(NAMES))] + [0.6, -0.4])


def test_no_error_at_all_can_be_drawn():
    """A logarithm has no 0: such settings stand on a line of their own."""
    result = tuning_result(PRICE, tuned=(0.0, 0.05))
    labels = [tick.get_text() for tick in result.plot().axes[1].get_yticklabels()]
    assert "0" in labels
    assert result.plot("surrogate").axes


def test_equal_rivals_share_a_mark():
    """Where the default stands, it is the tuned one too, under one mark with both names."""
    result = tuning_result(PRICE, outcome=Outcome.DEFAULT_STANDS)
    said = [text.get_text() for text in result.plot().axes[1].texts]
    assert said.count("default = tuned") == 1 and "tuned" not in said
    assert said.count("default") == 1


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("memory_bytes", 4 * 2**20, "4 MB"),
        ("time_limit", 0.0254, "25.4 ms"),
        ("time_limit", None, "none"),
        ("least_profit", 123456.0, "1.2e+05"),
        ("finest_ratio", 0.0625, "0.0625"),
        ("discontinuity", 0.0, "0"),
    ],
)
def test_settings_have_the_units_of_people(name, value, expected):
    assert setting_words(name, value) == expected


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: r.update(outcome="lost"), "outcome: expected one of found"),
        (lambda r: r["objective"]["tuned"]["views"].pop(), "objective.tuned.views: expected"),
        (lambda r: r["objective"].update(tuned=None), "objective.tuned: expected"),
        (lambda r: r["tried"][2].update(role="guess"), "tried[2].role: expected one of"),
        (lambda r: r["finalists"][0].update(met=False), "finalists[0].objective: a number"),
        (lambda r: r["front"][0].pop("gap"), "front[0].gap: missing"),
        (lambda r: r.update(outcome="interrupted"), "objective.default.views: expected"),
    ],
)
def test_broken_reports_are_refused(report, change, said):
    found = json.loads(json.dumps(report))
    change(found)
    with pytest.raises(InvalidReport) as problem:
        validate_report(found)
    assert said in str(problem.value)


def test_names_are_those_of_the_code():
    """The schema may not import them: it loads no JAX."""
    assert tuple(outcome.name.lower() for outcome in Outcome) == OUTCOMES
    from asmjax.report.figures.tuning import ROLES as DRAWN

    assert tuple(DRAWN) == ROLES


TOLD_ONCE = ("objective.", "tried[].", "finalists[].", "cost_model.")
"""Keys below these are those of another entry, and the page says so."""


def test_every_key_is_documented():
    text = (Path(__file__).parents[1] / "docs/tunings.md").read_text(encoding="utf-8")
    common = {path for path, _ in key_paths(RUN_KEYS)} - {"seconds"}
    for path, key in key_paths(TUNING_KEYS):
        assert key.means
        if path in common or path.startswith(TOLD_ONCE):
            continue
        assert f"`{path.removesuffix('[]')}" in text, path
    for path, _ in key_paths(TUNING_KEYS):
        if path.startswith("objective.tuned.") and path.count(".") == 2:
            assert f"`{path.removesuffix('[]')}`" in text, path
    for name in ("tuned.toml", "tried.csv", "tried.png", "surrogate.png", "sensitivity.png"):
        assert f"`{name}`" in text
