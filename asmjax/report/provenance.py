"""Where numbers come from: versions and machine, told without importing anything heavy."""

import os
import platform
import sys
from importlib import metadata
from pathlib import Path

PACKAGES = ("asmjax", "jax", "jaxlib", "equinox", "numpy", "scipy", "mitsuba", "drjit")
"""Packages whose versions can change a result."""


def provenance(variant: str, device: str = "cpu") -> dict:
    """The `versions` and `machine` entries of a report.

    Args:
        variant: the Mitsuba variant that casts the rays.
        device: where the JAX kernels run.
    """
    return {
        "versions": {"python": platform.python_version()} | _versions(),
        "machine": {
            "cpu": _cpu(),
            "cores": _cores(),
            "memory_bytes": _memory_bytes(),
            "device": device,
            "variant": variant,
        },
    }


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            # A source tree on the path is not installed; absent says so.
            found[name] = "not installed"
    return found


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"


def _cores() -> int:
    # A container may be given fewer cores than the machine has.
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _memory_bytes() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 0
