"""Where numbers come from: versions and machine, told without importing anything heavy."""

import platform

from asmjax import machine
from asmjax.libraries import versions


def provenance(variant: str, device: str = "cpu") -> dict:
    """The `versions` and `machine` entries of a report.

    Args:
        variant: the Mitsuba variant that casts the rays.
        device: where the JAX kernels run.
    """
    installed = {name: version or "not installed" for name, version in versions().items()}
    return {
        "versions": {"python": platform.python_version()} | installed,
        "machine": {
            "cpu": machine.cpu_name(),
            "cores": machine.usable_cores(),
            "memory_bytes": machine.memory_bytes(),
            "device": device,
            "variant": variant,
        },
    }
