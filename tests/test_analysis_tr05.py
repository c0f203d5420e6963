"""The script of TR05-024 at small sizes: all files, every bound, the numbers of the record."""

import json
import runpy
import sys
from pathlib import Path

import jax.numpy as jnp
import pytest

from asmjax.report.paper_tr05 import bounds_table, document, four_digits, last_digits

SCRIPT = Path(__file__).parents[1] / "analysis/subdivided_shadow_maps_tr05.py"


@pytest.fixture(scope="module")
def script():
    """The names of the script, which runs nothing by being read."""
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def quick(script, tmp_path_factory):
    """Folder and record of a quick run."""
    folder = tmp_path_factory.mktemp("analysis")
    return folder, script["run"](folder, script["QUICK"], quiet=True)


def test_quick_run_writes_everything(quick):
    """Every step done; the record on disk is the one returned; every figure is a file."""
    folder, record = quick
    assert {step["status"] for step in record["steps"].values()} == {"done"}
    stored = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert stored["bounds"] == record["bounds"] and set(stored) == set(record)
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert set(record["figures"]) == {"figure_4", "figure_7", "light_directions"}
    for name in record["figures"]:
        assert (folder / f"{name}.png").stat().st_size > 10_000
        assert f"]({name}.png)" in text
    assert jnp.result_type(float) == jnp.float32, "64 bits are for the run only"


def test_quick_run_passes_every_bound(quick):
    """Sizes change how many numbers are compared, not which: none is skipped, none fails."""
    _, record = quick
    assert {bound["verdict"] for bound in record["bounds"]} == {"pass"}
    assert len(record["bounds"]) == 14
    assert record["crossing_deg"] == pytest.approx(25.5, abs=0.5)
    gains = record["figure_9"]
    assert gains["0"] == pytest.approx(1.74, abs=0.005)
    assert gains["1"] == pytest.approx(5.5, abs=0.005)
    lispsm = next(row for row in record["figure_4"]["curves"] if abs(row["xi"]) < 1e-12)
    assert lispsm["near"] == pytest.approx(10**-0.5) == lispsm["far"]
    by_angle = {row["gamma_deg"]: row["value"] for row in record["directions"]
                if row["words"] == "LiSPSM"}  # fmt: skip
    assert by_angle[10] > 1e7 > 900 > by_angle[90]


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


def test_command_line(script, tmp_path, monkeypatch, capsys):
    """--out and --quick reach the run; the table of bounds is printed."""
    names = script["main"].__globals__
    seen = []
    monkeypatch.setitem(names, "run", lambda folder, sizes: seen.append((folder, sizes)) or {})
    monkeypatch.setitem(names, "enable_compilation_cache", lambda: None)
    monkeypatch.setattr(sys, "argv", ["x", "--quick", "--out", str(tmp_path)])
    script["main"]()
    assert seen == [(tmp_path, script["QUICK"])]
    assert bounds_table([]).splitlines()[0] in capsys.readouterr().out
