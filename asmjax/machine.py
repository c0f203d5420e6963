"""The machine that asmjax runs on, told without importing anything heavy."""

import ctypes
import gc
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_KEPT_BYTES = 1 << 30

_keeps = False


def cpu_name() -> str:
    """Model of the processor, as it names itself."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"


def usable_cores() -> int:
    """Cores that this process may use: a container may be given fewer than the machine has."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory_bytes() -> int:
    """Main memory in bytes; 0 where it cannot be told."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 0


def process_bytes() -> int:
    """Main memory that this process holds now; 0 where it cannot be told."""
    return _own_pages(1)


def address_bytes() -> int:
    """Addresses that this process has now, with memory behind them or not; 0 where it cannot be
    told."""
    return _own_pages(0)


def peak_bytes() -> int:
    """The most main memory that this process has held since `forget_peak`; 0 where it cannot be
    told."""
    for line in _lines(Path("/proc/self/status")):
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) << 10
    return 0


def forget_peak() -> None:
    """Let `peak_bytes` count anew from here, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def free_memory_bytes(system: Path = Path("/")) -> int | None:
    """Main memory that this process may still get, bytes; None where it cannot be told.

    The least of what the machine has free, what its control groups (of a container, of a job on a
    cluster) leave, and what `ulimit -v` leaves. File caches that give way count as free.

    Args:
        system: where proc and sys are found.
    """
    room = [*_machine_room(system), *_group_room(system), *_limit_room()]
    return max(0, min(room)) if room else None


def _machine_room(system: Path) -> Iterator[int]:
    for line in _lines(system / "proc/meminfo"):
        if line.startswith("MemAvailable:"):
            yield int(line.split()[1]) << 10
            return
    if physical := memory_bytes():
        yield physical


def _group_room(system: Path) -> Iterator[int]:
    """What each control group around this process leaves, of both versions of their files."""
    for line in _lines(system / "proc/self/cgroup"):
        _, kinds, path = line.split(":", 2)
        if kinds == "":
            top, limit, used, cache = "", "memory.max", "memory.current", "inactive_file"
        elif "memory" in kinds.split(","):
            top, limit, used = "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
            cache = "total_inactive_file"
        else:
            continue
        root = system / "sys/fs/cgroup" / top
        # In a container the path may be the host's: its root then is this process's own group.
        inner = root / path.strip("/")
        for group in dict.fromkeys([inner, *inner.parents]):
            if not group.is_relative_to(root):
                break
            most, taken = (next(_lines(group / name), "") for name in (limit, used))
            if most.isdigit() and taken.isdigit():
                found = (line.split() for line in _lines(group / "memory.stat"))
                gives_way = sum(int(number) for name, number in found if name == cache)
                yield int(most) - int(taken) + gives_way


def _limit_room() -> Iterator[int]:
    try:
        import resource
    except ImportError:
        return
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most != resource.RLIM_INFINITY:
        yield most - address_bytes()


def _own_pages(column: int) -> int:
    """Bytes of this process: of addresses (0) or of main memory (1)."""
    line = next(_lines(Path("/proc/self/statm")), "")
    return int(line.split()[column]) * os.sysconf("SC_PAGE_SIZE") if line else 0


def _lines(path: Path) -> Iterator[str]:
    try:
        yield from path.read_text(errors="replace").splitlines()
    except OSError:
        return


def keep_freed_memory() -> bool:
    """Let the process keep up to 1 GB that it frees, and say whether it does.

    Arrays of some megabytes come and go with every frame. As the C library starts, it hands each
    back to the system and asks for it anew, at a page fault for every 4 KB. Changes the whole
    process, so a library user must ask for it; only the GNU C library can be told.
    """
    global _keeps
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    _keeps = all([mallopt(what, _KEPT_BYTES) == 1 for what in (_TRIM_THRESHOLD, _MMAP_THRESHOLD)])
    return _keeps


def keeps_freed_memory() -> bool:
    """Whether `keep_freed_memory` was called with success: times differ by it."""
    return _keeps


def collect_rarely() -> None:
    """Let Python look for cycles among its objects far less often.

    JAX makes hundreds of thousands of them as it traces; looking through them again and again takes
    a twentieth of a search's time, at moments that no timed run can choose. Changes the whole
    process, so a library user must ask for it.
    """
    gc.set_threshold(50_000, 20, 50)
