"""`asmjax info`: everything a bug report needs, and how to repair a slow set-up."""

import json
import platform
from pathlib import Path
from typing import Any

from asmjax import paths
from asmjax.libraries import versions
from asmjax.options import MEGABYTE, InfoOptions


def print_info(options: InfoOptions) -> None:
    """Print the facts as aligned text or as JSON."""
    facts = collect()
    print(json.dumps(facts, indent=2) if options.json else as_text(facts))


def collect() -> dict[str, dict[str, Any]]:
    """Facts by section. LLVM is tried afresh, so a repair shows at once (about 1 s)."""
    import jax

    from asmjax.render import llvm
    from asmjax.render.variant import choose_variant
    from asmjax.shadow.adaptive import calibration_dir

    verdict = llvm.probe(refresh=True)
    caches = {
        "asmjax": paths.cache_dir(),
        "jax": paths.jax_cache_dir(),
        "drjit": paths.drjit_cache_dir(),
    }
    return {
        "versions": {"python": platform.python_version()} | versions(),
        "renderer": {"variant": choose_variant() if verdict.usable else "scalar_rgb"},
        "llvm": {
            "path": verdict.path,
            "version": verdict.version,
            "usable": verdict.usable,
            "reason": verdict.reason,
            "repair": verdict.remedy,
        },
        "devices": {f"jax {device.id}": str(device.device_kind) for device in jax.devices()},
        "caches": {
            name: {"path": str(path), "bytes": paths.folder_bytes(path)}
            for name, path in caches.items()
        }
        | {"calibrations": {"path": str(calibration_dir()), "count": _count(calibration_dir())}},
    }


def _count(folder: Path) -> int:
    """Calibrations kept in `folder`; 0 where there is none."""
    return sum(1 for _ in folder.glob("*.json"))


def as_text(facts: dict[str, dict[str, Any]]) -> str:
    """The facts in aligned columns, one section after the other."""
    lines = []
    for section, rows in facts.items():
        lines.append(section)
        for name, value in rows.items():
            lines.append(f"  {name:<14}{_readable(value)}")
    return "\n".join(lines)


def _readable(value: Any) -> str:
    match value:
        case None | "":
            return "-"
        case bool():
            return "yes" if value else "no"
        case {"path": path, "count": count}:
            return f"{path}  ({count} kept)"
        case {"path": path, "bytes": size}:
            return f"{path}  ({size / MEGABYTE:.1f} MB)"
        case _:
            return str(value)
