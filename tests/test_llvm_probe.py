"""The LLVM probe gives the right verdict and the next command, and never ends this process."""

import dataclasses
import glob
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from asmjax.render import llvm


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path):
    """Each test remembers for itself, and no override is left from the machine."""
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)


@pytest.fixture
def nothing_loaded(monkeypatch):
    """As in a new process: a library of the test process itself would come first."""
    monkeypatch.setattr(llvm, "_loaded_library", lambda: None)


@pytest.fixture
def child_runs(monkeypatch):
    """Counts the child processes."""
    runs = []
    original = subprocess.run

    def counted(*arguments, **options):
        runs.append(arguments)
        return original(*arguments, **options)

    monkeypatch.setattr(subprocess, "run", counted)
    return runs


SAID = {
    14: "import sys; sys.exit('LLVM: the version 14.0.6 is too old')",
    15: "import os; os.write(2, b'LLVM ERROR: Cannot select: f32 = fminimum'); os.abort()",
    16: "import os; os.write(2, b'LLVM ERROR: Cannot select: f32 = fminimum'); os.abort()",
}
"""Children that end as those do that meet the versions which do not work on an x86 processor."""


def found(major: int) -> str | None:
    """A real library of this version, if there is one."""
    names = sorted(glob.glob(f"/usr/lib/*-linux-gnu/libLLVM-{major}*.so.*"))
    names += sorted(glob.glob(f"/usr/lib/*-linux-gnu/libLLVM.so.{major}.*"))
    return names[0] if names else None


def skip_unless_installed(major: int) -> None:
    """Skip where there is no real library of this version, and say so."""
    if found(major) is None:
        pytest.skip(f"libllvm{major} is not installed")


@pytest.fixture
def machine_with(monkeypatch, tmp_path, nothing_loaded):
    """Makes this a machine whose only LLVM is on the loader's path: None, a real one of a version
    that is installed, or a stand-in whose child process ends as a real one's does."""
    folder, system = tmp_path / "lib", tmp_path / "system"
    folder.mkdir()
    system.mkdir()

    def prepare(major: int | None, stand_in: bool = False) -> None:
        monkeypatch.setattr(llvm, "_system_folders", lambda: [system])
        monkeypatch.setenv("LD_LIBRARY_PATH", str(folder))
        if major is None:
            # Dr.Jit's own search cannot be redirected, so the child is stood in for.
            monkeypatch.setattr(llvm, "_CHILD", "import sys; sys.exit('LLVM backend is inactive')")
            return
        library = found(major)
        if stand_in or library is None:
            library = tmp_path / f"libLLVM-{major}.so.1"
            library.write_text("")
            monkeypatch.setattr(llvm, "_CHILD", SAID[major])
        (folder / "libLLVM.so").symlink_to(library)

    return prepare


def test_garbage_file_is_unusable(monkeypatch, tmp_path, nothing_loaded):
    garbage = tmp_path / "libLLVM.so.19.1"
    garbage.write_bytes(b"\x7fELF no library" * 100)
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(garbage))
    verdict = llvm.probe()
    assert not verdict.usable
    assert verdict.path == str(garbage)
    assert "cannot be loaded" in verdict.reason
    assert verdict.remedy == "unset DRJIT_LIBLLVM_PATH; apt-get install -y libllvm19"


def test_missing_file_is_unusable(monkeypatch, tmp_path, nothing_loaded):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "absent.so"))
    verdict = llvm.probe()
    assert not verdict.usable and "cannot be loaded" in verdict.reason


def test_no_library_at_all(machine_with):
    machine_with(None)
    verdict = llvm.probe()
    assert verdict == llvm.Verdict(False, None, None, "no LLVM library found")
    assert verdict.remedy == "apt-get install -y libllvm19"


@pytest.mark.parametrize("stand_in", [False, True])
@pytest.mark.parametrize(
    ("major", "reason"), [(14, "too old"), (15, "aborts the process"), (16, "aborts the process")]
)
def test_old_versions_are_unusable(machine_with, tmp_path, child_runs, major, reason, stand_in):
    """Rationale: an abort of these would take the caller's process with it, and an installed
    library stays unseen behind one on the loader's path."""
    if not stand_in:
        skip_unless_installed(major)
    machine_with(major, stand_in)
    verdict = llvm.probe()
    if verdict.usable and major > 14:
        pytest.skip(f"this processor's back end in LLVM {major} can select fminimum")
    assert not verdict.usable and reason in verdict.reason
    assert verdict.version is not None and verdict.version.startswith(str(major))
    assert verdict.remedy == (
        "apt-get install -y libllvm19 && export "
        f"DRJIT_LIBLLVM_PATH={tmp_path}/system/libLLVM.so.19.1"
    )
    assert llvm.probe() == verdict and len(child_runs) == 1


def test_a_version_of_the_system_is_repaired_by_a_newer_one(monkeypatch, tmp_path, machine_with):
    """The system's newest is taken, so nothing else is to do than to install it."""
    machine_with(None)
    (tmp_path / "system" / "libLLVM-15.so.1").write_text("")
    monkeypatch.setattr(llvm, "_CHILD", SAID[15])
    verdict = llvm.probe()
    assert "aborts the process" in verdict.reason and verdict.version == "15"
    assert verdict.remedy == "apt-get install -y libllvm19"


def test_version_19_is_usable(machine_with):
    skip_unless_installed(19)
    machine_with(19)
    start = time.perf_counter()
    verdict = llvm.probe()
    assert time.perf_counter() - start < 20  # about 1 s when the machine is idle
    assert verdict.usable and verdict.remedy == ""
    assert verdict.version is not None and verdict.version.startswith("19.")


def test_verdict_is_remembered_until_the_file_changes(
    monkeypatch, tmp_path, nothing_loaded, child_runs
):
    library = tmp_path / "libLLVM.so"
    library.write_bytes(b"one")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(library))
    first = llvm.probe()
    assert llvm.probe() == first
    assert len(child_runs) == 1
    assert llvm.probe(refresh=True) == first and len(child_runs) == 2
    library.write_bytes(b"other content")
    llvm.probe()
    assert len(child_runs) == 3


@pytest.mark.parametrize("torn", ["", "{", '{"usable": true}', "[1, 2]", '{"surplus": 1}'])
def test_torn_record_is_tried_again(monkeypatch, tmp_path, nothing_loaded, torn):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "absent.so"))
    verdict = llvm.probe()
    (record,) = (tmp_path / "cache" / "llvm").iterdir()
    assert json.loads(record.read_text()) == dataclasses.asdict(verdict)
    record.write_text(torn)
    assert llvm.probe() == verdict


def test_works_without_a_writable_cache(monkeypatch, tmp_path, nothing_loaded):
    blocked = tmp_path / "a_file"
    blocked.write_text("")
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(blocked / "below"))
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "absent.so"))
    assert not llvm.probe().usable


def test_child_that_hangs_is_unusable(monkeypatch, nothing_loaded):
    monkeypatch.setattr(llvm, "PROBE_SECONDS", 0.2)
    monkeypatch.setattr(llvm, "_CHILD", "import time; time.sleep(60)")
    verdict = llvm.probe()
    assert not verdict.usable and "longer than" in verdict.reason


@pytest.mark.parametrize(("number", "lasting"), [(11, True), (9, False)])
def test_child_that_dies_is_unusable(monkeypatch, tmp_path, nothing_loaded, number, lasting):
    """Once, or for ever: a crash is the library's, but one that is killed says nothing of it."""
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(llvm, "_CHILD", f"import os; os.kill(os.getpid(), {number})")
    assert not llvm.probe().usable
    monkeypatch.setattr(llvm, "_CHILD", "print('version:99')")
    assert llvm.probe().usable is not lasting


def test_search_order(monkeypatch, tmp_path, nothing_loaded):
    system, extra = tmp_path / "system", tmp_path / "extra"
    system.mkdir()
    extra.mkdir()
    monkeypatch.setattr(llvm, "_system_folders", lambda: [system])
    monkeypatch.setenv("LD_LIBRARY_PATH", "")
    assert llvm.find_library() is None
    for name in ("libLLVM-14.0.6.so.1", "libLLVM-15.so.1", "libLLVM.so.19.1"):
        (system / name).write_text("")
    (system / "libLLVM.so.99").symlink_to(system / "libLLVM-14.0.6.so.1")
    assert llvm.find_library() == system / "libLLVM.so.19.1"
    (extra / "libLLVM.so").write_text("")
    monkeypatch.setenv("LD_LIBRARY_PATH", str(extra))
    assert llvm.find_library() == extra / "libLLVM.so"
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/named/by/hand.so")
    assert llvm.find_library() == Path("/named/by/hand.so")


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-14.0.6.so.1", "14.0.6"),
        ("libLLVM-15.so.1", "15"),
        ("libLLVM.so.19.1", "19.1"),
        ("libLLVM.so", None),
        ("other.so.3", None),
    ],
)
def test_version_of_file_name(name, version):
    assert llvm._version_of(Path("/lib") / name) == version


def test_as_a_program(monkeypatch, tmp_path):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "absent.so"))
    done = subprocess.run(
        [sys.executable, "-m", "asmjax.render.llvm"], capture_output=True, text=True
    )
    assert done.returncode == 1 and done.stderr == ""
    assert done.stdout.count("\n") == 1 and "remedy:" in done.stdout


def test_import_starts_nothing():
    code = (
        "import sys, asmjax.render.llvm, asmjax.render.variant; "
        "sys.exit(bool({'mitsuba', 'drjit', 'jax'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
