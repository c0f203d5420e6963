"""Which LLVM library Dr.Jit would load here, and whether it works.

LLVM is loaded by Dr.Jit 1.5 when a variant `llvm_*` starts. Versions 15 and 16 pass its version
check and cast rays, then abort the whole process at the first kernel that holds a minimum
("Cannot select ... fminimum"), which no `try` can catch. So the first look happens in a child
process, and the verdict is remembered per Dr.Jit version, library file and CPU.

`python -m asmjax.render.llvm` prints the verdict; exit code 0 means usable, 1 not.
"""

import dataclasses
import glob
import hashlib
import importlib.metadata
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from asmjax import paths

PROBE_SECONDS = 60.0
"""Time limit of the child process; it needs about 1 s, more on a loaded machine."""

INSTALL = "apt-get install -y libllvm19"
"""Installs a library that works."""

INSTALLED = "libLLVM.so.19.1"
"""Its name in the system's folder."""

PLAIN = "libLLVM.so"
"""The name that Dr.Jit asks the loader for first."""

# Runs in the child. The minimum is what LLVM 15 cannot compile on x86; the render is what the
# user will ask for next. A scratch kernel cache keeps kernels of another LLVM out of it.
_CHILD = """
import os, re, sys
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
# Before the current folder, whose plugins are strangers' code.
mi.file_resolver().prepend(os.path.dirname(mi.__file__))
import drjit as dr
least = dr.minimum(dr.arange(mi.Float, 16), 7.0)
dr.eval(least)
assert least[15] == 7.0
film = {"type": "hdrfilm", "width": 4, "height": 4}
scene = mi.load_dict({
    "type": "scene", "integrator": {"type": "direct"}, "light": {"type": "constant"},
    "sensor": {"type": "perspective", "film": film}, "ball": {"type": "sphere"},
})
image = mi.render(scene, spp=1)
dr.eval(image)
dr.sync_thread()
with open("/proc/self/maps") as maps:
    loaded = re.findall(r"/[^\\n]*libLLVM[^\\n]*", maps.read())
print("loaded:" + (loaded[0] if loaded else ""))
print("version:" + ".".join(map(str, dr.detail.llvm_version())))
"""


_FROM_OUTSIDE = (1, 2, 9, 15)
"""Signals that end a child that did nothing wrong: SIGHUP, SIGINT, SIGKILL (a lack of memory too),
SIGTERM; by number, as not every system has their names."""


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What is known about LLVM on this machine.

    `usable`: renders work. `path`, `version`: the library, None when none was found or unknown.
    `reason`: one line for people.
    """

    usable: bool
    path: str | None
    version: str | None
    reason: str

    @property
    def remedy(self) -> str:
        """The one command that repairs it, empty when usable."""
        if self.usable:
            return ""
        if os.environ.get("DRJIT_LIBLLVM_PATH"):
            # An override is final for Dr.Jit: it must go, or an installed library stays unseen.
            return f"unset DRJIT_LIBLLVM_PATH; {INSTALL}"
        if self.path is not None and _from_loader(Path(self.path)):
            # A library on the loader's path goes before any that is installed.
            return f"{INSTALL} && export DRJIT_LIBLLVM_PATH={_system_folders()[0]}/{INSTALLED}"
        return INSTALL


def find_library() -> Path | None:
    """The library Dr.Jit would choose in a new process, or None.

    Its order: a libLLVM already loaded in this process, `DRJIT_LIBLLVM_PATH` (which is final,
    even when wrong), `libLLVM.so` on the loader's path, the last `libLLVM*.so.*` by name in the
    multiarch folder that is no symbolic link.
    """
    if loaded := _loaded_library():
        return loaded
    if named := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return Path(named)
    for folder in (*_loader_folders(), *_system_folders()):
        if (plain := folder / PLAIN).exists():
            return plain.resolve()
    for folder in _system_folders():
        found = sorted(glob.glob(str(folder / "libLLVM*.so.*")))
        if files := [name for name in found if not os.path.islink(name)]:
            return Path(files[-1])
    return None


def probe(refresh: bool = False) -> Verdict:
    """Whether `llvm_ad_rgb` works here, from memory or by trying it in a child process.

    Args:
        refresh: try again even when a verdict is remembered.

    Never raises and never aborts this process. An unwritable cache folder only means that the
    next process tries again (about 1 s).
    """
    library = find_library()
    record = paths.cache_dir() / "llvm" / f"{_key(library)}.json"
    if not refresh and (known := _recall(record)):
        return known
    verdict, lasting = _try_in_child(library)
    if lasting:
        paths.keep_text(record, json.dumps(dataclasses.asdict(verdict)))
    return verdict


def _loaded_library() -> Path | None:
    try:
        maps = Path("/proc/self/maps").read_text()
    except OSError:
        return None
    loaded = re.search(r"/[^\n]*libLLVM[^\n]*", maps)
    return Path(loaded.group()) if loaded else None


def _loader_folders() -> list[Path]:
    return [Path(part) for part in os.environ.get("LD_LIBRARY_PATH", "").split(":") if part]


def _from_loader(library: Path) -> bool:
    """Whether it is the one that the loader's path leads to."""
    plain = next((p for f in _loader_folders() if (p := f / PLAIN).exists()), None)
    return plain is not None and plain.resolve() == library


def _system_folders() -> list[Path]:
    multiarch = Path(f"/usr/lib/{platform.machine()}-linux-gnu")
    return [multiarch if multiarch.is_dir() else Path("/usr/lib64")]


def _key(library: Path | None) -> str:
    """What the verdict depends on; a changed library or CPU asks for a new trial."""
    facts = [importlib.metadata.version("drjit"), paths.cpu_key(), str(library)]
    try:
        if library is None:
            facts.append(os.environ.get("LD_LIBRARY_PATH", ""))
        else:
            stat = library.stat()
            facts += [str(stat.st_size), str(stat.st_mtime_ns)]
    except OSError:
        facts.append("unreadable")
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:24]


def _recall(record: Path) -> Verdict | None:
    try:
        return Verdict(**json.loads(record.read_text()))
    except (OSError, ValueError, TypeError):
        return None  # absent, torn or of another version: try again


def _try_in_child(library: Path | None) -> tuple[Verdict, bool]:
    """The verdict, and whether the next process would come to it too: a machine that was too busy
    or out of memory says nothing about the library."""
    with tempfile.TemporaryDirectory() as scratch:
        environment = dict(os.environ, DRJIT_CACHE_DIR=scratch)
        if library is not None:
            environment["DRJIT_LIBLLVM_PATH"] = str(library)
        try:
            # -c keeps the child away from the caller's main module, so nothing runs twice; -P from
            # modules in the current folder.
            child = subprocess.run(
                [sys.executable, "-P", "-c", _CHILD],
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=PROBE_SECONDS,
            )
        except subprocess.TimeoutExpired:
            slow = f"a first kernel took longer than {PROBE_SECONDS:.0f} s"
            return _unusable(library, slow), False
        except OSError as problem:
            return _unusable(library, f"cannot start a child process ({problem})"), False
    if child.returncode == 0:
        told = dict(line.split(":", 1) for line in child.stdout.splitlines() if ":" in line)
        path, version = told.get("loaded") or None, told.get("version")
        return Verdict(True, path, version, f"LLVM {version} works"), True
    reason = _explain(library, child.returncode, child.stderr)
    return _unusable(library, reason), -child.returncode not in _FROM_OUTSIDE


def _unusable(library: Path | None, reason: str) -> Verdict:
    path = None if library is None else str(library)
    return Verdict(False, path, _version_of(library), reason)


def _version_of(library: Path | None) -> str | None:
    """The version in a file name such as libLLVM-15.so.1 or libLLVM.so.19.1."""
    name = library.name if library else ""
    match = re.search(r"libLLVM(?:-([\d.]*\d)\.so|\.so\.([\d.]*\d))", name)
    return (match.group(1) or match.group(2)) if match else None


def _explain(library: Path | None, returncode: int, stderr: str) -> str:
    """One line for people from what the child said before it ended."""
    version = _version_of(library)
    named = f"LLVM {version}" if version else f"{library}"
    if "Cannot select" in stderr:
        return f"{named} cannot compile Dr.Jit's kernels and aborts the process"
    if "too old" in stderr:
        return f"{named} is too old for Dr.Jit"
    if library is None:
        return "no LLVM library found"
    if "jit_find_library" in stderr:
        return f"{library} cannot be loaded as a library"
    if returncode < 0:
        return f"{named} ends the process with signal {-returncode}"
    last = stderr.strip().splitlines()[-1] if stderr.strip() else "no message"
    return f"{named} does not start: {last[:200]}"


def main() -> int:
    """Print the verdict on one line; 0 usable, 1 not."""
    verdict = probe()
    print(verdict.reason + (f"; remedy: {verdict.remedy}" if verdict.remedy else ""))
    return 0 if verdict.usable else 1


if __name__ == "__main__":
    sys.exit(main())
