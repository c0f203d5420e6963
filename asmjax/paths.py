"""Files: one cache folder per user for what may be forgotten, the key of this CPU, whole writes."""

import contextlib
import hashlib
import os
import platform
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO


def cache_dir() -> Path:
    """The per-user cache folder, not created here.

    `ASMJAX_CACHE_DIR` if set, else `asmjax` in `XDG_CACHE_HOME`, else `~/.cache/asmjax`.
    """
    if own := os.environ.get("ASMJAX_CACHE_DIR"):
        return Path(own)
    if base := os.environ.get("XDG_CACHE_HOME"):
        return Path(base) / "asmjax"
    return Path(os.path.expanduser("~")) / ".cache" / "asmjax"


def jax_cache_dir() -> Path:
    """The folder of JAX's compiled programs for this CPU; not created here."""
    return cache_dir() / "jax" / cpu_key()


def drjit_cache_dir() -> Path:
    """The folder where Dr.Jit keeps compiled kernels (its own rule; asmjax leaves it alone)."""
    if own := os.environ.get("DRJIT_CACHE_DIR"):
        return Path(own)
    return Path(os.path.expanduser("~")) / ".drjit"


def writable_dir(path: Path) -> Path | None:
    """`path` created if need be, or None where nothing can be written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return path if os.access(path, os.W_OK) else None


def keep_text(path: Path, text: str) -> bool:
    """Put `text` into the file `path`, whole or not at all; whether that was possible.

    What is kept may be forgotten: no full disk and no missing right raises.
    """
    if writable_dir(path.parent) is None:
        return False
    draft = None
    try:
        with tempfile.NamedTemporaryFile(
            "w", dir=path.parent, prefix=".", delete=False, encoding="utf-8"
        ) as file:
            draft = file.name
            file.write(text)
        os.replace(draft, path)
    except OSError:
        if draft is not None:
            Path(draft).unlink(missing_ok=True)
        return False
    return True


@contextlib.contextmanager
def atomic_file(path: str | os.PathLike) -> Iterator[BinaryIO]:
    """A new file that takes the place of the one at `path` when the block ends: in one step that
    survives a power cut. Where the block raises, the old one stays."""
    target = Path(path)
    # Same folder: a rename is atomic only within one file system.
    scratch = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with scratch.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(scratch, target)
    except BaseException:
        scratch.unlink(missing_ok=True)
        raise
    if os.name == "posix":
        folder = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def write_atomic(path: str | os.PathLike, content: str | bytes) -> None:
    """Replace the file at `path` as `atomic_file` does; text becomes UTF-8."""
    with atomic_file(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def folder_bytes(path: Path) -> int:
    """Bytes of all regular files below `path`; 0 when it does not exist."""
    total = 0
    for folder, _, names in os.walk(path):
        for name in names:
            try:
                total += os.lstat(os.path.join(folder, name)).st_size
            except OSError:
                continue  # another process may tidy its cache while we look
    return total


def cpu_key() -> str:
    """12 hex digits that differ between CPU models and instruction sets.

    Compiled code in a home folder shared by unlike machines can stop with SIGILL, so everything
    compiled or tried on a CPU is remembered under its key.
    """
    facts = [platform.machine()]
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as info:
            for line in info:
                if not line.strip():
                    break  # the first core speaks for all
                if line.startswith(("vendor_id", "cpu family", "model", "flags", "Features")):
                    facts.append(" ".join(line.split()))
    except OSError:
        facts.append(platform.processor())
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:12]
