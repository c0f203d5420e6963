"""What a sweep found, as rows, CSV, datasets and files of other formats."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.sweep_trials import fake_trials, outcome

from asmjax.errors import UseError
from asmjax.sweep.ended import End, Ended, attempt
from asmjax.sweep.results import results
from asmjax.sweep.store import Store

KEYS = [trial.key for trial in fake_trials(7)]


@pytest.fixture
def swept(tmp_path) -> Path:
    """Six trials on a grid of number and view, and one that failed."""
    with Store.open(tmp_path / "swept") as store:
        for k, trial in enumerate(fake_trials(6)):
            config = {"memory_mb": float(k // 2 + 1), "view": "ab"[k % 2], "name": "first"}
            store.add(trial.key, config, attempt(outcome, {"number": k}))
        config = {"memory_mb": 4.0, "view": "a", "name": "first"}
        store.add(fake_trials(1, first=6)[0].key, config, Ended(End.TIMEOUT, error="too late"))
    return tmp_path / "swept"


def test_rows_are_flat_and_name_settings_and_results_apart(swept):
    found = results(swept)
    assert len(found) == 7
    assert found.varied == ("memory_mb", "view")
    rows = {row["key"]: row for row in found.rows()}
    row = rows[KEYS[3]]
    assert (row["memory_mb"], row["view"], row["name"]) == (2.0, "b", "first")
    assert (row["error.wrong"], row["result.name"], row["status"]) == (0.75, "no. 3", "done")
    late = next(row for row in rows.values() if row["status"] == "timeout")
    assert late["cause"] == "too late" and "error.wrong" not in late


def test_csv_has_a_line_for_each_trial(swept, tmp_path):
    found = results(swept)
    found.to_csv(tmp_path / "all.csv")
    with (tmp_path / "all.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 7
    assert sorted(line["error.wrong"] for line in lines) == [
        "", "0.0", "0.25", "0.5", "0.75", "1.0", "1.25",
    ]  # fmt: skip
    with pytest.raises(UseError, match="cannot write .*absent"):
        found.to_csv(tmp_path / "absent" / "all.csv")


def test_an_export_without_its_library_names_the_extra(swept, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(UseError, match="needs xarray.*make extras EXTRA=analysis"):
        results(swept).to_xarray()


def extra(module: str):
    """A library of the extra `analysis`."""
    return pytest.importorskip(module, reason=f"{module} is not installed: extra `analysis`")


def test_a_dataset_of_trials_or_on_a_grid(swept):
    extra("xarray")
    found = results(swept)
    flat = found.to_xarray(arrays=("lit",))
    assert flat.sizes["trial"] == 7 and flat["lit"].shape == (7, 2, 3)
    assert set(flat.coords) >= {"memory_mb", "view"}
    grid = found.to_xarray(dims=("memory_mb", "view"))
    wrong = grid["error.wrong"]
    assert wrong.dims == ("memory_mb", "view") and wrong.shape == (4, 2)
    assert wrong.sel(memory_mb=2.0, view="b") == 0.75
    assert np.isnan(wrong.sel(memory_mb=4.0)).all()
    assert grid["status"].sel(memory_mb=4.0).values.tolist() == ["timeout", ""]
    with pytest.raises(UseError, match="7 trials share 4 values of memory_mb.*differ in view"):
        found.to_xarray(dims=("memory_mb",))
    with pytest.raises(UseError, match="unknown dimension 'memory'.*Did you mean 'memory_mb'"):
        found.to_xarray(dims=("memory",))


def test_netcdf_comes_back(swept, tmp_path):
    xarray = extra("xarray")
    for module in ("h5netcdf", "h5py"):
        extra(module)
    found = results(swept)
    found.to_netcdf(tmp_path / "all.nc")
    with xarray.open_dataset(tmp_path / "all.nc", engine="h5netcdf") as back:
        assert np.nansum(back["error.wrong"]) == 3.75
        assert back["key"].values.tolist() == [row["key"] for row in found.rows()]


def test_parquet_comes_back(swept, tmp_path):
    parquet = extra("pyarrow.parquet")
    results(swept).to_parquet(tmp_path / "all.parquet")
    table = parquet.read_table(tmp_path / "all.parquet")
    assert table.num_rows == 7 and table["view"].to_pylist().count("a") == 4
