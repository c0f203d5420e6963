"""Scene files of unknown origin: scanned, meshes checked, and loaded in a child process first.

A scene file can make Mitsuba read any file, run native code of its choice, or crash. `admit` lets
through what the scan (`asmjax.scene.scan`), the checks of mesh files (`asmjax.scene.mesh_files`)
and a child process (`asmjax.render.trial`) found harmless, and remembers it by the contents of all
files, so that an unchanged scene is loaded twice only once. Files must not change meanwhile.
"""

import hashlib
import importlib.metadata
import json
import os
import select
import signal
import subprocess
import sys
import time
from functools import cache
from importlib.machinery import PathFinder
from pathlib import Path
from typing import NamedTuple

from asmjax import paths
from asmjax.errors import UseError, file_errors, require
from asmjax.scene.file_names import shown
from asmjax.scene.mesh_files import check_mesh_file
from asmjax.scene.scan import SceneFiles, scan

RULES = 5
"""Number of the rules; a change of what is refused forgets what was let through."""

START_SECONDS = 120.0
"""In which a child must start; it needs less than 1 s on an idle machine."""

LEAST_SECONDS, BYTES_A_SECOND = 20.0, 2 * 2**20
"""Time to load a scene: so many seconds, and one for so many bytes of its files."""

LEAST_MEMORY, MEMORY_A_BYTE = 16 * 2**30, 64
"""Address space to load a scene, in bytes: so much, and so much for each byte of its files."""

LONGEST_ANSWER = 2**16
"""Bytes of a child's answer."""

DANGEROUS = frozenset({"blender"})
"""Plugins that no scene file may have: this one takes places in memory from its integers."""

KEPT = ("PATH", "HOME", "TMPDIR", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "VIRTUAL_ENV")
"""What a child keeps of the environment, with all that begins as `KEPT_FAMILIES`."""

KEPT_FAMILIES = ("ASMJAX_", "DRJIT_", "XDG_")


class Admitted(NamedTuple):
    """A scene that may be loaded.

    Attributes:
        files: all that it consists of.
        bytes: of main memory that loading it took at its peak.
    """

    files: SceneFiles
    bytes: int


def admit(path: Path, variant: str | None = None, room: int | None = None) -> Admitted:
    """The files of the scene at `path`, if it may be loaded in this process.

    Args:
        variant: what it will be loaded in. The child loads it in llvm_ad_rgb if that is asked for,
            otherwise in scalar_rgb, which starts fastest and reads the same files.
        room: bytes that loading may take; None for no limit but that of `LEAST_MEMORY`.

    Raises:
        UseError: it may not; one line with file, place, what is allowed, and what to do.
    """
    files = _scanned(path)
    variant = variant if variant == "llvm_ad_rgb" else "scalar_rgb"
    record = paths.cache_dir() / "scenes" / f"{_digest(path, files, variant)}.json"
    known = _kept_bytes(record)
    if known is not None:
        return Admitted(files, known)
    check_meshes(files)
    with Trial(variant) as trial:
        took = trial.load(path, files.bytes(), room=room)
    paths.keep_text(record, json.dumps({"scene": path.name, "rules": RULES, "bytes": took}))
    return Admitted(files, took)


def _kept_bytes(record: Path) -> int | None:
    """What loading took when the scene was let through; None where it was not, or says nothing."""
    try:
        took = json.loads(record.read_text(encoding="utf-8"))["bytes"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return took if isinstance(took, int) else None


def examine(path: Path, trial: "Trial") -> None:
    """As `admit`, for many scenes in a row, each anew, in a child that is there already.

    Raises:
        UseError: as `admit`.
    """
    files = _scanned(path)
    check_meshes(files)
    trial.load(path, files.bytes())


def _scanned(path: Path) -> SceneFiles:
    """The files of a scene, which are not more than could be loaded."""
    files = scan(path, shipped_plugins())
    size, memory = files.bytes(), os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    require(
        size <= memory,
        f"the files of scene {shown(path.name)} have {size / 2**30:,.1f} GiB, more than the "
        f"{memory / 2**30:,.1f} GiB of this machine's memory; make it smaller.",
    )
    return files


@cache
def shipped_plugins() -> frozenset[str]:
    """Names of the native plugins that are installed with Mitsuba, which is not imported, and that
    a scene file may have.

    Raises:
        UseError: none are found.
    """
    # Not `importlib.util.find_spec`: an imported Mitsuba hides where it came from.
    package = PathFinder.find_spec("mitsuba")
    places = (package.submodule_search_locations if package else None) or []
    found = frozenset(file.stem for place in places for file in Path(place).glob("plugins/*.so"))
    if not found:
        raise UseError("Mitsuba's plugins are not found; install mitsuba again.")
    return found - DANGEROUS


def check_meshes(files: SceneFiles) -> None:
    """Raise `UseError` where a mesh file of the scene is not what it says."""
    for reference in files.references:
        name = files.folder.relative(reference.path)
        check_mesh_file(reference.path, reference.kind, name)


def _digest(path: Path, files: SceneFiles, variant: str) -> str:
    """What the verdict depends on: rules, renderer, and all files with their names."""
    state = hashlib.blake2b(digest_size=16)

    def add(*parts: str) -> None:
        for part in parts:
            state.update(f"{len(part)}:{part}".encode(errors="surrogateescape"))

    add(str(RULES), importlib.metadata.version("mitsuba"), variant, path.name)
    everything = {*files.documents, *(reference.path for reference in files.references)}
    for file in sorted(everything):
        name = files.folder.relative(file)
        failed = f"file {shown(name)} of scene {shown(path.name)} cannot be read"
        with file_errors(failed, "make it readable"), file.open("rb") as content:
            add(name, hashlib.file_digest(content, "blake2b").hexdigest())
    return state.hexdigest()


class Trial:
    """A child process that loads scenes, and is started again after each that ends it.

    Use it in a `with` statement; the child starts at the first scene.
    """

    def __init__(self, variant: str = "scalar_rgb"):
        self._variant = variant
        self._child: subprocess.Popen | None = None

    def __enter__(self) -> "Trial":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def load(
        self, path: Path, size: int, seconds: float | None = None, room: int | None = None
    ) -> int:
        """Load the scene at `path`, whose files have `size` bytes, within `seconds` and `room` more
        bytes of addresses; the bytes of main memory that it took at its peak.

        Raises:
            UseError: Mitsuba refused it, or crashed, or took too long.
        """
        what = f"scene file {shown(path.name)}"
        if seconds is None:
            seconds = LEAST_SECONDS + size / BYTES_A_SECOND
        child = self._started()
        request = {
            "path": str(path.absolute()),
            "memory": LEAST_MEMORY + MEMORY_A_BYTE * size,
            "seconds": seconds,
            "room": room,
        }
        try:
            _pipe(child.stdin).write(json.dumps(request).encode() + b"\n")
            _pipe(child.stdin).flush()
            answer = self._answer(child, seconds)
        except BrokenPipeError:
            answer = None
        except TimeoutError as problem:
            self.close()
            raise UseError(
                f"{what} took Mitsuba's loader more than {seconds:.0f} s, which its files are too "
                "small for; mend the scene, or load it while the machine does less."
            ) from problem
        if answer is None:
            raise UseError(
                f"{what} crashed Mitsuba's loader ({self._end()}); mend the scene, most likely its "
                "meshes or textures."
            )
        if answer["refused"] is not None:
            raise UseError(f"{what} {answer['refused']}")
        return answer["bytes"]

    def close(self) -> None:
        """End the child."""
        child, self._child = self._child, None
        if child is None:
            return
        child.kill()
        child.wait()
        for pipe in (child.stdin, child.stdout):
            _close(pipe)

    def _started(self) -> subprocess.Popen:
        if self._child is not None:
            return self._child
        try:
            self._child = child = subprocess.Popen(
                # -P: whatever lies in the current folder is no module.
                [sys.executable, "-P", "-m", "asmjax.render.trial", self._variant],
                env=_environment(),
                cwd="/",
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            answer = self._answer(child, START_SECONDS)
        except (OSError, TimeoutError) as problem:
            self.close()
            raise UseError(f"no process could be started to check the scene in: {problem}.") from (
                problem
            )
        if answer is None or answer["refused"] is not None:
            said = answer["refused"] if answer else self._end()
            self.close()
            raise UseError(
                f"Mitsuba does not start in a process of its own ({said}), where the scene would "
                "be checked; `asmjax info` says more."
            )
        return child

    def _answer(self, child: subprocess.Popen, seconds: float) -> dict | None:
        """The next answer, or None where the child ended; `TimeoutError` where there is none."""
        got, ends = b"", time.monotonic() + seconds
        channel = _pipe(child.stdout).fileno()
        while not got.endswith(b"\n"):
            left = ends - time.monotonic()
            if left <= 0 or not select.select([channel], [], [], left)[0]:
                raise TimeoutError
            more = os.read(channel, LONGEST_ANSWER)
            if not more or len(got) > LONGEST_ANSWER:
                return None
            got += more
        return json.loads(got)

    def _end(self) -> str:
        """How the child ended, in words; the next scene gets another."""
        child, self._child = self._child, None
        if child is None:
            return "it did not run"
        try:
            code = child.wait(timeout=10)
        except subprocess.TimeoutExpired:
            child.kill()
            code = child.wait()
        for pipe in (child.stdin, child.stdout):
            _close(pipe)
        if code >= 0:
            return f"exit code {code}"
        names = {int(number): number.name for number in signal.Signals}
        return f"signal {-code}, {names.get(-code, 'unknown')}"


def _pipe(pipe):
    assert pipe is not None  # all are made by `_started`
    return pipe


def _close(pipe) -> None:
    """Close an end of a pipe; what was not read on the other side is lost."""
    try:
        _pipe(pipe).close()
    except BrokenPipeError:
        pass


def _environment() -> dict[str, str]:
    """What a child needs: the same packages, few threads' worth of address space, no secrets."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name in KEPT or name.startswith(KEPT_FAMILIES)
    }
    package = str(Path(__file__).parents[2])
    own = [part for part in os.environ.get("PYTHONPATH", "").split(os.pathsep) if part]
    return {
        **kept,
        "PYTHONPATH": os.pathsep.join([package, *(os.path.abspath(part) for part in own)]),
        "MALLOC_ARENA_MAX": "2",
    }
