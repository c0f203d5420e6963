"""The script of TR05-024 at small sizes: all files, every bound, the numbers of the record."""

import json
import runpy
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from tr05.paper import (
    bounds_of,
    bounds_table,
    document,
    four_digits,
    last_digits,
)

SCRIPT = Path(__file__).parents[1] / "analysis/subdivided_shadow_maps_tr05.py"

pytestmark = pytest.mark.mitsuba


@pytest.fixture(scope="module")
def script():
    """The names of the script, which runs nothing by being read; its folder is on the path, as it
    is for a script that Python runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPT.parent))
        yield runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def quick(script, tmp_path_factory):
    """Folder and record of a quick run."""
    folder = tmp_path_factory.mktemp("analysis")
    return folder, script["run"](folder, script["QUICK"], quiet=True)


@pytest.mark.slow
def test_quick_run_writes_everything(quick):
    """Every step done; the record on disk is the one returned; every figure is a file."""
    folder, record = quick
    assert {step["status"] for step in record["steps"].values()} == {"done"}
    stored = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert stored["bounds"] == record["bounds"] and set(stored) == set(record)
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert set(record["figures"]) == {
        "figure_4", "figure_7", "light_directions", "alley_sun", "alley_along", "figure_10",
        "displacements",
    }  # fmt: skip
    for name in record["figures"]:
        assert (folder / f"{name}.png").stat().st_size > 10_000
        assert f"]({name}.png)" in text
    assert jnp.result_type(float) == jnp.float32, "64 bits are for the run only"


@pytest.mark.slow
def test_quick_run_passes_every_bound_of_the_theory(quick):
    """Sizes change how many numbers are compared, not which: none is skipped, none of the theory
    fails; what is measured at such sizes says nothing."""
    _, record = quick
    verdicts = [bound["verdict"] for bound in record["bounds"]]
    assert set(verdicts[:16]) == {"pass"}
    assert len(verdicts) == 24
    # So small images may have no edge that stands alone.
    skipped = {bound["name"] for bound in record["bounds"] if bound["verdict"] == "skipped"}
    assert skipped <= {"displacement, log-log", "displacement, linear"}
    assert record["crossing_deg"] == pytest.approx(25.5, abs=0.5)
    gains = record["figure_9"]
    assert gains["0"] == pytest.approx(1.74, abs=0.005)
    assert gains["1"] == pytest.approx(5.5, abs=0.005)
    lispsm = next(row for row in record["figure_4"]["curves"] if abs(row["xi"]) < 1e-12)
    assert lispsm["near"] == pytest.approx(10**-0.5) == lispsm["far"]
    by_angle = {row["gamma_deg"]: row["value"] for row in record["directions"]
                if row["words"] == "LiSPSM"}  # fmt: skip
    assert by_angle[10] > 1e7 > 900 > by_angle[90]


@pytest.mark.slow
def test_measured_numbers_are_of_one_run(quick):
    """What must hold at any size: angles as asked for, sums of stages, maps within their bytes."""
    _, record = quick
    along = record["alley"]["along"]
    assert along["angle_deg"] == pytest.approx(10)
    assert [row["label"] for row in along["rows"]] == ["TSM 32", "TSM 128", "SSM 32", "SSM* 32"]
    trapezoidal, _, subdivided, _ = (row["max_perspective"] for row in along["rows"])
    assert subdivided < trapezoidal / 2
    assert all(row["worst_depth"] >= 1 for row in along["rows"])
    for row in record["figure_10"]["rows"]:
        assert row["total"] == pytest.approx(sum(row["seconds"].values()))
        assert 0 < row["texels_cast"] <= row["side"] ** 2
    for row in record["overdraw"]:
        assert 1 <= row["factor"] <= row["parts"]
        assert row["drawn"] <= row["objects"]
    for entry in record["equal_bytes"].values():
        assert all(row["bytes"] <= 0.082 * 2**20 for row in entry["rows"])
    assert len(record["displacements"]) == 6
    alone = [row for row in record["displacements"] if row["edge_share"] >= 0.1]
    assert record["explained"]["points"] == len(alone)


def test_bounds_of_measured_numbers(script):
    """Made-up rows: the ratios that the bounds are of, and R^2 against the formula."""
    labels = {"TSM 1K": 50.0, "TSM 4K": 12.0, "SSM 1K": 4.0, "SSM* 1K": 2.0}
    rows = [{"label": label, "max_perspective": value} for label, value in labels.items()]
    times = [{"name": name, "side": 8, "label": name, "total": total}
             for name, total in (("TSM", 2.0), ("SSM", 5.0), ("SSM*", 6.0))]  # fmt: skip
    record = {
        "alley": {"along": {"rows": rows}},
        "figure_10": {"rows": times},
        "equal_bytes": {"a": {"rows": [{"label": "ASM", "wrong": 0.02},
                                       {"label": "SSM*", "wrong": 0.04},
                                       {"label": "SDSM", "wrong": 0.01}]}},
        "explained": {"log-log, identity": 0.99, "linear, identity": 0.9},
    }  # fmt: skip
    bounds = {bound.name: bound for bound in bounds_of(record)}
    measured = {name: bound.measured for name, bound in bounds.items()}
    assert measured["along the view"] == pytest.approx(0.08)
    assert measured["figure 1"] == pytest.approx(1 / 3)
    assert measured["figure 10"] == 2.5 and bounds["figure 10"].verdict == "fail"
    assert measured["equal bytes, a"] == 2.0
    assert bounds["displacement, log-log"].verdict == "pass"
    assert bounds["displacement, linear"].verdict == "fail"

    explained = script["accuracy_steps"].explained
    rng = np.random.default_rng(2)
    predicted = rng.uniform(0.1, 3, 50)
    measured = 0.8 * predicted + rng.normal(0, 0.02, 50)
    found = explained(predicted, measured)
    assert found["linear, fitted line"] == pytest.approx(
        np.corrcoef(predicted, measured)[0, 1] ** 2
    )
    assert found["linear, slope"] == pytest.approx(0.8, abs=0.02)
    assert found["linear, identity"] < found["linear, fitted line"]
    assert explained(predicted, predicted)["log-log, identity"] == 1


def test_missing_scene_is_left_out_with_a_reason(script, tmp_path, monkeypatch):
    """One of others that is not there: a line in the record and in the document."""
    analysis = script["Analysis"](tmp_path, script["QUICK"], quiet=True)
    setting = sys.modules["tr05.setting"]
    monkeypatch.setenv("ASMJAX_SCENES", str(tmp_path))
    assert setting.scene_of(analysis, "munich") is None
    assert "munich/munich.xml" in analysis.record["skipped"]["munich"]
    assert "## Left out" in document(analysis.record)


def test_document_of_nothing_yet(script, tmp_path):
    """Before any step: no tables, and bounds that say so."""
    record = script["Analysis"](tmp_path, script["QUICK"], quiet=True).record
    text = document(record)
    assert "not computed" in text and "pass" not in text and "## Figure" not in text


@pytest.mark.parametrize(
    ("text", "value", "halves"),
    [("1.5e3", 1549, 0.98), ("1.5e3", 1551, 1.02), ("12", 12.4, 0.8), ("3.00", 2.996, 0.8)],
)
def test_last_digits(text, value, halves):
    assert last_digits(text, value) == pytest.approx(halves)


def test_four_digits():
    assert [four_digits(v) for v in (1.23456, 25721, 865159, 8.66e11)] == [
        "1.235", "25720", "8.652e5", "8.66e11",
    ]  # fmt: skip


@pytest.mark.parametrize("status", ["done", "failed"])
def test_command_line(script, tmp_path, monkeypatch, capsys, status):
    """--out and --quick reach the run; the table of bounds is printed; 1 where a step failed."""
    names = script["main"].__globals__
    seen, record = [], {"steps": {"a step": {"status": status, "reason": "", "seconds": 0.0}}}
    monkeypatch.setitem(names, "run", lambda folder, sizes: seen.append((folder, sizes)) or record)
    monkeypatch.setitem(names, "enable_compilation_cache", lambda: None)
    monkeypatch.setattr(sys, "argv", ["x", "--quick", "--out", str(tmp_path)])
    assert script["main"]() == (status == "failed")
    assert seen == [(tmp_path, script["QUICK"])]
    assert bounds_table([]).splitlines()[0] in capsys.readouterr().out
