"""Documents that promise a row per thing keep the promise, and what they show runs."""

import inspect
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.shadow import ALGORITHMS, choosing

ROOT = Path(__file__).parents[1]
CHOOSING = ROOT / "docs/choosing.md"


@pytest.mark.parametrize("family", ALGORITHMS)
def test_every_algorithm_has_a_row_in_the_table_of_choice(family):
    """The comparison table names class, family, reference and settings of every registered
    algorithm."""
    algorithm = ALGORITHMS[family]
    row = next(
        line
        for line in CHOOSING.read_text(encoding="utf-8").splitlines()
        if line.startswith(f"| `{algorithm.__name__}` (`{family}`)")
    )
    author = re.split(r"[ ,]", algorithm.reference)[0]
    year = re.findall(r"\b\d{4}\b", algorithm.reference)[0]
    assert author in row
    assert year in row
    assert all(f"`{name}`" in row for name in inspect.signature(algorithm).parameters)
    assert algorithm.__name__.lower().startswith(family.replace("-", ""))


def test_the_table_of_choice_is_up_to_date():
    """As the code writes it: `python -m asmjax.shadow.choosing docs/choosing.md`."""
    page = CHOOSING.read_text(encoding="utf-8")
    assert page == choosing.written_into(page)
    assert "`slide` 0," in page and "`across` perspective" in page


def test_an_algorithm_without_words_is_refused(monkeypatch):
    """And so are words without an algorithm, and a page without markers."""
    monkeypatch.setitem(choosing.ALGORITHMS, "newest", ALGORITHMS["uniform"])
    with pytest.raises(UseError, match="newest: .* give each registered family a row"):
        choosing.table()
    monkeypatch.delitem(choosing.ALGORITHMS, "newest")
    with pytest.raises(UseError, match="put the lines"):
        choosing.written_into("# Which shadow algorithm?\n")


@pytest.mark.parametrize("folder", ["notebooks", "experiments", "analysis"])
def test_every_script_has_a_row_in_its_readme(folder):
    """A folder's README lists each of its scripts, and nothing that is not there."""
    text = (ROOT / folder / "README.md").read_text(encoding="utf-8")
    scripts = {script.name for script in (ROOT / folder).glob("*.py")}
    rows = re.findall(r"^\| `([\w.]+\.py)`", text, re.M)
    assert all(f"`{script}`" in text for script in scripts)
    assert set(rows) <= scripts and len(set(rows)) == len(rows) > 0


def test_experiment_finds_first_order_convergence(capsys, monkeypatch):
    """The smoke size of the convergence experiment prints slopes near -1."""
    script = ROOT / "experiments/error_against_resolution.py"
    monkeypatch.setattr(sys, "argv", [str(script), "--smoke"])
    runpy.run_path(str(script), run_name="__main__")
    rows = capsys.readouterr().out.splitlines()[1:]
    slopes = [float(row.split()[1]) for row in rows]
    assert len(slopes) == 2
    assert all(-1.6 < slope < -0.7 for slope in slopes)


@pytest.mark.slow
@pytest.mark.mitsuba
def test_experiment_finds_what_mip_maps_get_wrong(capsys, monkeypatch):
    """Filtering a stretch of 2 halves the overview's error; reading alone stays within 6.15 %."""
    script = ROOT / "experiments/mip_map_areas.py"
    monkeypatch.setattr(sys, "argv", [str(script), "--smoke"])
    runpy.run_path(str(script), run_name="__main__")
    rows = [row for row in capsys.readouterr().out.splitlines() if row.startswith("overview")]
    reading, isotropic, twofold, *_ = (float(row.split()[-2]) for row in rows)
    assert reading < np.log2(1.0615)
    assert twofold < 0.6 * isotropic


@pytest.mark.slow
def test_kernel_times_are_a_table_with_a_column_for_each_device(tmp_path, monkeypatch):
    """The page names the device, and says so where there is no GPU; the one in docs/ is such a
    page."""
    import jax

    script = ROOT / "analysis/kernel_times.py"
    monkeypatch.setattr(sys, "argv", [str(script), "--quick", "--out", str(tmp_path)])
    runpy.run_path(str(script), run_name="__main__")
    pages = [
        path.read_text(encoding="utf-8")
        for path in (tmp_path / "benchmarks.md", ROOT / "docs/benchmarks.md")
    ]
    heads = [line for page in pages for line in page.splitlines() if line.startswith("| kernel")]
    assert len(heads) == 2 and all("CPU: " in head for head in heads)
    assert ("no column for a GPU" in pages[0]) is (jax.default_backend() != "gpu")
    for page in pages:
        assert "| project + footprint |" in page and "| visibility |" in page


def test_readme_has_no_blanks():
    """Numbers and pictures are filled in."""
    assert not re.search(r"@[A-Z]+@", (ROOT / "README.md").read_text(encoding="utf-8"))
