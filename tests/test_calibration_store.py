"""Kept calibrations: used again for the same thing, never for another, and never when torn."""

import dataclasses
import json
import os
import re
import threading
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.counting import CountingRays

from asmjax import paths
from asmjax.shadow.adaptive import (
    Calibrated,
    calibration_dir,
    cost_model,
    kept_or_measured,
    on_this_machine,
)

BOUNDS = np.array([[-1.0, 1.0], [-2.0, 2.0], [0.0, 3.0]])


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path):
    """Each test keeps for itself, and times three small sizes only."""
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(cost_model, "LONGEST", 0.0)


@pytest.fixture(scope="module")
def case():
    return analytic_case("a4_disc_light", 16)


@pytest.fixture
def rays(case):
    return CountingRays(case.rays)


def room(**changes) -> Calibrated:
    facts = {"scene": "a room", "triangles": 12, "bounds": BOUNDS, "light": "point"}
    return on_this_machine(**({**facts, "variant": "llvm_ad_rgb"} | changes))


def test_a_second_run_uses_what_the_first_measured(case, rays):
    first = kept_or_measured(rays, case.frame, room())
    launches = rays.launches
    assert launches > 0 and not first.kept
    second = kept_or_measured(rays, case.frame, room())
    assert rays.launches == launches, "a kept calibration casts nothing"
    assert second == dataclasses.replace(first, kept=True)
    age = datetime.now(UTC) - datetime.fromisoformat(second.measured_at or "")
    assert -1 <= age.total_seconds() < 120


def test_recalibrating_measures_and_keeps_the_new_one(case, rays):
    kept_or_measured(rays, case.frame, room())
    launches = rays.launches
    again = kept_or_measured(rays, case.frame, room(), recalibrate=True)
    assert rays.launches == 2 * launches and not again.kept
    assert kept_or_measured(rays, case.frame, room()) == dataclasses.replace(again, kept=True)


def test_the_file_tells_people_what_was_measured(case, rays):
    model = kept_or_measured(rays, case.frame, room())
    (file,) = calibration_dir().iterdir()
    assert re.fullmatch(r"a_room-point-llvm_ad_rgb-[0-9a-f]{12}\.json", file.name)
    record = json.loads(file.read_text(encoding="utf-8"))
    assert record["texels"] == [16.0**2, 32.0**2, 64.0**2]
    assert len(record["seconds"]) == 3 and min(record["seconds"]) > 0
    assert record["residual"] == model.residual
    assert record["belongs_to"]["scene"] == "a room"
    assert record["belongs_to"]["cores"] >= 1


OTHERS = {
    "scene": {"scene": "another room"},
    "triangles": {"triangles": 13},
    "bounds": {"bounds": np.nextafter(BOUNDS, 9.0)},
    "light": {"light": "spot"},
    "variant": {"variant": "scalar_rgb"},
}


@pytest.mark.parametrize("changed", OTHERS)
def test_anything_else_is_measured_for_itself(case, rays, changed):
    kept_or_measured(rays, case.frame, room())
    launches = rays.launches
    assert not kept_or_measured(rays, case.frame, room(**OTHERS[changed])).kept
    assert rays.launches == 2 * launches
    assert len(list(calibration_dir().iterdir())) == 2


@pytest.mark.parametrize("fact", ["cpu", "cores", "system"])
def test_another_machine_measures_for_itself(fact):
    """A home folder may be shared by unlike machines."""
    here = room()
    other = dataclasses.replace(here, **{fact: 99 if fact == "cores" else "another"})
    assert other.file != here.file


def test_bounds_of_any_layout_and_precision_of_storage_are_the_same_scene():
    assert room(bounds=np.asfortranarray(BOUNDS)).bounds == room().bounds
    assert room(bounds=BOUNDS.astype(np.float32)).bounds == room().bounds


def _changed(**changes):
    return lambda record: json.dumps(record | changes)


TORN = {
    "empty": lambda record: "",
    "half": lambda record: json.dumps(record)[:100],
    "not JSON": lambda record: "a = 1",
    "a list": lambda record: "[]",
    "another format": _changed(format="asmjax/calibration/0"),
    "another scene's": lambda record: json.dumps(
        record | {"belongs_to": record["belongs_to"] | {"triangles": 7}}
    ),
    "nothing of it": lambda record: json.dumps({"format": record["format"]}),
    "negative": _changed(b_seconds=-1e-3),
    "NaN": _changed(a_seconds_per_texel=float("nan")),
    "text": _changed(residual="small"),
    "free": _changed(a_seconds_per_texel=0.0, b_seconds=0.0),
    "no date": _changed(measured_at=None),
    "no day": _changed(measured_at="yesterday"),
    "no zone": _changed(measured_at="2026-01-01T00:00:00"),
}


@pytest.mark.parametrize("torn", TORN)
def test_a_torn_or_foreign_file_is_ignored_with_a_warning_and_written_anew(
    case, rays, torn, caplog
):
    kept_or_measured(rays, case.frame, room())
    file = room().file
    file.write_text(TORN[torn](json.loads(file.read_text())), encoding="utf-8")
    model = kept_or_measured(rays, case.frame, room())
    assert not model.kept
    (record,) = caplog.records
    assert str(file) in record.getMessage() and "measuring again" in record.getMessage()
    assert kept_or_measured(rays, case.frame, room()) == dataclasses.replace(model, kept=True)
    assert len(caplog.records) == 1


def test_bytes_that_are_no_text_and_a_folder_in_the_way(case, rays, caplog):
    file = room().file
    file.parent.mkdir(parents=True)
    file.write_bytes(b"\xff\xfe\x00")
    kept_or_measured(rays, case.frame, room())
    assert kept_or_measured(rays, case.frame, room()).kept
    file.unlink()
    file.mkdir()
    assert not kept_or_measured(rays, case.frame, room()).kept
    assert len(caplog.records) == 2
    assert [path.name for path in file.parent.iterdir()] == [file.name], "a draft was left behind"


def test_without_a_writable_cache_every_run_measures(case, rays, monkeypatch, tmp_path, caplog):
    blocker = tmp_path / "file"
    blocker.write_text("")
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(blocker / "below"))
    for _ in range(2):
        assert not kept_or_measured(rays, case.frame, room()).kept
    # The folder is no folder: said each time, as nothing can be remembered.
    assert all("ignored" in record.getMessage() for record in caplog.records)


def test_a_model_that_did_not_converge_is_used_but_not_kept(case, rays, monkeypatch):
    monkeypatch.setattr(cost_model, "MAX_STEPS", 1)
    model = kept_or_measured(rays, case.frame, room())
    assert not model.converged and not room().file.exists()


def test_writers_at_once_leave_one_whole_file(tmp_path):
    """A sweep starts many processes on one cache: each replaces the whole file or nothing."""
    file = tmp_path / "cache" / "kept.json"
    texts = [json.dumps({"writer": k, "filler": "x" * 20_000}) for k in range(8)]
    threads = [threading.Thread(target=paths.keep_text, args=(file, text)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert file.read_text(encoding="utf-8") in texts
    assert os.listdir(file.parent) == ["kept.json"]


def test_what_cannot_be_written_is_not_kept_and_leaves_nothing(tmp_path):
    target = tmp_path / "folder"
    (target / "inside").mkdir(parents=True)
    assert not paths.keep_text(target, "text")
    assert not paths.keep_text(Path("/proc/asmjax/kept"), "text")
    assert os.listdir(tmp_path) == ["folder"]
