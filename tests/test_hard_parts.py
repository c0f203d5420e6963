"""`make test-hard`: no test is left out of its parts, and a part that fails fails the whole."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("test_hard", ROOT / "scripts" / "test_hard.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_file_is_in_one_part(script):
    every = sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("tests/**/test_*.py"))
    parts = [script.files_of(part) for part in script.PARTS]
    assert all(parts) and sorted(sum(parts, [])) == every


def test_ends_as_its_parts_do(script, tmp_path, monkeypatch, capsys):
    """By pytest's own record, whatever it counts; and an unknown part is one line."""
    monkeypatch.setattr(script, "FOLDER", tmp_path)
    record = '<testsuites><testsuite tests="5" skipped="1" failures="{}" errors="0">{}</testsuite>'
    case = '<testcase name="a" time="2.5"/><testcase name="b" time="61"/>'
    codes = {"render": 0, "jobs": 1}

    def run(part, options):
        path = tmp_path / f"{part}.xml"
        path.write_text(record.format(codes[part], case) + "</testsuites>")
        return script._ended(part, path, codes[part], 90.0, 120.0)

    monkeypatch.setattr(script, "run", run)
    assert script.main(["render", "-x"]) == 0
    assert script.main(["render", "jobs"]) == 1
    assert "jobs              3      1       1    1.5     2.0  b (61 s)" in capsys.readouterr().out
    assert script._ended("hostile", tmp_path / "no.xml", -9, 1.0, 1.0).failed == 1
    assert script.main(["hostlie"]) == 2
    assert "unknown part 'hostlie'; allowed: hard_cases, render" in capsys.readouterr().err
