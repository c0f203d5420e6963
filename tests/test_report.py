"""The report: its schema, its files, the table, and that the documentation names every key."""

import copy
import csv
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from asmjax.memory import Forecast, Limit, Memory
from asmjax.plain import NonFinite, plain
from asmjax.report import (
    MAP_NAMES,
    RUN_KEYS,
    RUN_SCHEMA,
    WALKTHROUGH_KEYS,
    WALKTHROUGH_SCHEMA,
    InvalidReport,
    comparison_table,
    csv_text,
    key_paths,
    map_summary,
    method_record,
    provenance,
    run_report,
    significant,
    validate_report,
    write_csv,
    write_json,
)
from asmjax.report.outputs import SINGLE_RUN, WALKTHROUGH
from asmjax.report.record import report_of_entries
from asmjax.report.table import MAX_WIDTH, short_count
from asmjax.writing import WriteError

DOCS = Path(__file__).parents[1] / "docs"
ARRAYS = ("valid", "position", "truth", "visibility_<method>", *MAP_NAMES)
ADAPTIVE = {"nodes": 950, "passes": 14, "max_level": 13, "status": "converged"}


def method(name="uniform-2048", wrong=0.025, **changes):
    adaptive = ADAPTIVE if name.startswith("adaptive") else {}
    settings = {
        "settings": {"resolution": 2048, "test": "depth"},
        "effective_resolution": 2048,
        "bytes": 2**24,
        "rays": 2048**2,
        "seconds": {"build": 0.0483, "query": 0.002},
        "error": {
            "misclassified_fraction": wrong,
            "false_lit_fraction": 0.6 * wrong,
            "false_dark_fraction": 0.4 * wrong,
            "boundary_displacement_px": {"mean": 1.634, "p95": 4.4},
        },
    }
    return method_record(name, **(settings | adaptive | changes))


def report(**changes):
    entries = {
        "argv": ["asmjax", "run", "a scene.xml"],
        "provenance": provenance("llvm_ad_rgb"),
        "seed": 0,
        "scene": "paper_room",
        "view": "overview",
        "light": "0 (point)",
        "size": (512, 256),
        "truth": {
            "samples": 1, "rays": 131072, "seconds": 0.01, "valid_pixels": 131000,
            "lit_fraction": 0.7,
        },
        "cost_model": {"a_seconds_per_texel": 1e-8, "b_seconds": 1e-4, "residual": 0.05},
        "maps": {name: map_summary(np.arange(9.0), np.arange(9) > 0) for name in MAP_NAMES},
        "methods": [
            method(),
            method("adaptive-16MB", 0.0004),
            method("rays-1", 0.0, effective_resolution=None, bytes=0),
        ],
    }  # fmt: skip
    return run_report(**(entries | changes))


def test_a_report_is_valid_json_with_the_documented_command():
    made = report(notices=["the area light is represented by its centre"])
    assert made["schema"] == RUN_SCHEMA == "asmjax/run/1"
    assert made["command"] == "asmjax run 'a scene.xml'"
    assert made["size"] == [512, 256]
    assert made["methods"][0]["seconds"]["total"] == pytest.approx(0.0503)
    assert json.loads(json.dumps(made, allow_nan=False)) == made


def test_numbers_of_numpy_and_jax_become_plain():
    import jax.numpy as jnp

    made = report(
        seed=np.int64(3),
        methods=[method(rays=jnp.int32(7), bytes=np.uint64(8), settings={"r": jnp.float32(0.5)})],
    )
    assert type(made["seed"]) is int
    assert type(made["methods"][0]["rays"]) is int
    assert made["methods"][0]["settings"] == {"r": 0.5}
    assert plain({1: (np.float32(2), np.bool_(True), Path("a"), None)}, NonFinite.KEPT) == {
        "1": [2.0, True, "a", None]
    }


def _set(tree, path, value):
    *parents, last = path
    for step in parents:
        tree = tree[step]
    if value is ...:
        del tree[last]
    else:
        tree[last] = value


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("schema",), "asmjax/run/0", "schema: expected 'asmjax/run/1'"),
        (("seed",), ..., "seed: missing"),
        (("seed",), 1.5, "seed: expected an integer, got 1.5"),
        (("seed",), True, "seed: expected an integer, got True"),
        (("extra",), 1, "extra: unknown key; known: schema"),
        (("size",), [512, 0], "size: expected two positive integers"),
        (("versions",), {"jax": 1}, "versions: expected an object of texts"),
        (("machine", "cores"), -1, "machine.cores: expected an integer of at least 0"),
        (("truth", "lit_fraction"), 1.01, "truth.lit_fraction: expected a number from 0 to 1"),
        (("cost_model", "residual"), math.nan, "cost_model.residual: expected a finite number"),
        (("maps", "m"), ..., "maps.m: missing"),
        (("maps", "m", "p95"), math.inf, "maps.m.p95: expected a finite number"),
        (("maps", "m", "p95"), "2", "maps.m.p95: expected a finite number, got '2'"),
        (("methods",), {}, "methods: expected a list"),
        (("methods", 1), [], r"methods\[1\]: expected an object"),
        (("methods", 1, "name"), "csm-4", r"methods\[1\].name: 'csm-4' must begin with one of"),
        (("methods", 1, "name"), "uniform-2048", r"methods\[1\].name: 'uniform-2048' occurs twice"),
        (("methods", 1, "nodes"), ..., r"methods\[1\].nodes: missing, needed for an adaptive"),
        (("methods", 0, "bytes"), None, r"methods\[0\].bytes: expected an integer"),
        (("methods", 0, "seconds", "total"), -0.1, r"methods\[0\].seconds.total: expected a fin"),
        (
            ("methods", 0, "settings"),
            {"warp": {"n": [1.0, math.nan]}},
            r"methods\[0\].settings.warp.n\[1\]: nan cannot be stored",
        ),
        (
            ("methods", 0, "error", "false_lit_fraction"),
            0.5,
            r"methods\[0\].error.misclassified_fraction: 0.025 is not false lit \+ false dark",
        ),
        (
            ("methods", 0, "error", "boundary_displacement_px", "mean"),
            ...,
            r"methods\[0\].error.boundary_displacement_px.mean: missing \(mean distance",
        ),
        (("notices",), ["a", 1], "notices: expected a list of texts"),
    ],
)
def test_what_is_wrong_is_named_by_its_path(path, value, message):
    broken = copy.deepcopy(report())
    _set(broken, path, value)
    with pytest.raises(InvalidReport, match=f"^{message}"):
        validate_report(broken)


def walkthrough(**changes):
    frame = {
        "frame": 0,
        "eye": {"origin": (0, 0, 1), "target": (0, 0, 0), "up": (0, 1, 0), "fov_x_deg": 40.0}
        | {"seconds": 0.01},
        "light_position": None,
        "light_direction": (0.0, 0.0, -1.0),
        "light_frame_refitted": False,
        "moved_boxes": 0,
        "truth": report()["truth"],
        "methods": [
            method(seconds={"build": 0.1, "id_pass": 0.0}),
            method("adaptive-16MB", 0.0, seconds={"id_pass": 0.001}, nodes_made=3),
        ],
    }
    entries = {
        "schema": WALKTHROUGH_SCHEMA,
        "argv": ["asmjax", "run", "--frames", "2"],
        "provenance": provenance("llvm_ad_rgb"),
        "seed": 0,
        "scene": "paper_room",
        "view": "path of the scene",
        "light": "sun (directional)",
        "size": (4, 4),
        "motion": "camera",
        "frames_asked": 2,
        "ended": "complete",
        "memory_limit_bytes": 2**24,
        "cost_model": {"a_seconds_per_texel": 1e-8, "b_seconds": 1e-4, "residual": 0.05},
        "summary": {"first_frame": 1, "frames": 1, "methods": []},
        "frames": [frame, frame | {"frame": 1}],
        "notices": [],
    }
    return report_of_entries(**(entries | changes))


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("frames", 1, "frame"), 2, r"frames\[1\].frame: expected 1, got 2"),
        (("frames", 0, "eye", "up"), [0, 1], r"frames\[0\].eye.up: expected three finite"),
        (("frames", 0, "light_frame_refitted"), 0, r"frames\[0\].light_frame_refitted: expected t"),
        (("frames", 0, "methods", 0, "seconds", "id_pass"), ..., r"frames\[0\].methods\[0\].sec"),
        (("frames", 1, "methods", 1, "status"), ..., r"frames\[1\].methods\[1\].status: missing"),
        (("frames", 0, "methods", 1, "name"), "uniform-2048", r"frames\[0\].methods\[1\].name: 'u"),
        (("maps",), {}, "maps: unknown key"),
        (("ended",), ..., "ended: missing"),
    ],
)
def test_a_walkthrough_has_a_schema_of_its_own(path, value, message):
    made = walkthrough()
    assert made["frames"][0]["methods"][0]["seconds"]["total"] == 0.1
    broken = copy.deepcopy(made)
    _set(broken, path, value)
    with pytest.raises(InvalidReport, match=f"^{message}"):
        validate_report(broken)


def test_the_estimate_of_memory_is_among_the_keys():
    made = report(memory=Forecast(Limit(None, 7, "test"), Memory(host=5)))
    assert made["memory"] == {"held_bytes": 7, "estimate_bytes": 5, "limit_bytes": None}
    made["memory"]["held_bytes"] = -1
    with pytest.raises(InvalidReport, match="^memory.held_bytes: expected an integer of at least"):
        validate_report(made)


def test_optional_keys_may_be_absent():
    made = report()
    for name in MAP_NAMES:
        del made["maps"][name]["count"]
    validate_report(made)
    with pytest.raises(InvalidReport, match="^report: expected an object, got list"):
        validate_report([made])


def test_the_documentation_names_every_key():
    text, walks = (
        (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in ("report", "walkthroughs")
    )
    for path, key in key_paths(RUN_KEYS):
        if path.startswith("plan."):
            continue  # stands under the plans
        *parents, name = path.split(".")
        summary = parents[:1] == ["maps"] and len(parents) == 2
        assert f"`{name if summary else path}`" in text or f"`{path}." in text, path
        assert key.means
    # A walkthrough's table leaves out what it has in common with a single run.
    common = {path for path, _ in key_paths(RUN_KEYS)}
    seconds = ("build", "analysis", "query", "id_pass", "total")
    for path, key in key_paths(WALKTHROUGH_KEYS):
        assert key.means
        if path in common or path.removeprefix("frames[].") in common:
            continue
        if path in {f"summary.methods[].seconds.{stage}" for stage in seconds}:
            continue
        assert f"`{path.removesuffix('[]')}`" in walks or f"`{path}." in walks, path
    assert RUN_SCHEMA in text and WALKTHROUGH_SCHEMA in walks
    for name in ARRAYS:
        assert f"| `{name}` |" in text, name
    for page, files in ((text, SINGLE_RUN), (walks, WALKTHROUGH)):
        for file in files:
            assert "[" in file or f"`{file}`" in page, file


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "report.json"
    write_json(path, {"a": 1})
    with pytest.raises(InvalidReport, match=r"b\[0\]: inf cannot be stored"):
        write_json(path, {"b": [math.inf]})
    with pytest.raises(InvalidReport, match="b: a complex cannot be stored"):
        write_json(path, {"b": 1j})
    monkeypatch.setattr("os.fsync", _fail)
    with pytest.raises(WriteError, match=r"report.json' \(disk full\); choose another --out"):
        write_json(path, {"c": 1})
    assert json.loads(path.read_text()) == {"a": 1}
    assert list(tmp_path.iterdir()) == [path]


def _fail(descriptor):
    raise OSError("disk full")


def test_map_summary_leaves_out_what_has_no_value():
    values = np.array([[1.0, 2.0, 3.0], [np.inf, np.nan, 100.0]])
    valid = np.array([[True, True, True], [True, True, False]])
    assert map_summary(values, valid) == {"p50": 2.0, "p95": 2.9, "max": 3.0, "count": 3}
    nothing = map_summary(values, valid & False)
    assert nothing == {"p50": 0.0, "p95": 0.0, "max": 0.0, "count": 0}


def test_provenance_names_versions_and_machine():
    made = provenance("scalar_rgb", device="cpu")
    assert made["machine"]["variant"] == "scalar_rgb"
    assert made["machine"]["cores"] >= 1
    assert made["versions"]["numpy"] == np.__version__
    assert made["versions"]["python"].startswith("3.")


def test_importing_the_report_loads_nothing_heavy():
    code = (
        "import sys, asmjax.report, asmjax.metrics; asmjax.report.provenance('scalar_rgb');"
        "print([n for n in ('jax', 'equinox', 'matplotlib', 'scipy', 'mitsuba', 'drjit')"
        " if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_table_is_aligned_and_has_units():
    lines = comparison_table(report()["methods"]).splitlines()
    assert len(lines) == 6
    for word in ("milliseconds", "false, % of pixels", "edge off, px", "eff. texels"):
        assert word in lines[0]
    heads = "method per side MB rays build analysis query total all lit dark mean p95".split()
    assert lines[1].split() == heads
    cells = [line.split() for line in lines[3:]]
    assert cells[0] == (
        "uniform-2048 2048 16.0 4.19M 48.3 0.0 2.0 50.3 2.50 1.50 1.00 1.63 4.40".split()
    )
    assert cells[2][:2] == ["rays-1", "-"]
    assert cells[2][8:11] == ["0", "0", "0"]
    # Right-aligned: numbers end where their heads end.
    for line in lines[3:]:
        assert len(line) == len(lines[1])
        assert line[lines[1].index("total") + 4] != " "


def test_the_table_fits_a_terminal_whatever_it_holds():
    huge = method(
        "uniform-with-a-very-long-name-of-settings", 0.99999, effective_resolution=2**24,
        bytes=2**40, rays=2**40, seconds={"build": 999.0, "analysis": 999.0, "query": 999.0},
    )  # fmt: skip
    lines = comparison_table([method(), method("adaptive-16MB", 1e-7), huge]).splitlines()
    assert max(map(len, lines)) <= MAX_WIDTH
    assert "~" in lines[-1]
    assert len(comparison_table([]).splitlines()) == 3


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (1e-9, "<.0001"), (0.00314, "0.0031"), (0.1534, "0.153"), (2.514, "2.51"),
     (84.94, "84.9"), (1234.4, "1234")],
)  # fmt: skip
def test_significant(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (999, "999"), (1000, "1.00k"), (65536, "65.5k"), (999_499, "999k"),
     (999_500, "1.00M"), (2**30, "1.07G")],
)  # fmt: skip
def test_short_count(value, text):
    assert short_count(value) == text


def test_csv_holds_the_unrounded_numbers(tmp_path):
    methods = report()["methods"]
    write_csv(tmp_path / "methods.csv", methods)
    text = (tmp_path / "methods.csv").read_text()
    assert text == csv_text(methods)
    rows = list(csv.DictReader(text.splitlines()))
    assert [row["method"] for row in rows] == ["uniform-2048", "adaptive-16MB", "rays-1"]
    assert float(rows[0]["misclassified_percent"]) == pytest.approx(2.5, rel=1e-12)
    assert float(rows[0]["build_ms"]) == pytest.approx(48.3, rel=1e-12)
    assert rows[2]["effective_resolution"] == ""
