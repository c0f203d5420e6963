"""Where numbers come from: versions and machine, told without importing anything heavy."""

import platform
from importlib import metadata

from asmjax import machine

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
            "cpu": machine.cpu_name(),
            "cores": machine.usable_cores(),
            "memory_bytes": machine.memory_bytes(),
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
