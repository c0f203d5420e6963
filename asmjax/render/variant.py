"""The one place that chooses and starts a Mitsuba variant, explicitly and once per process.

Nothing happens on import. A variant cannot be changed later: arrays of one variant are no
arrays of another, and a failed LLVM start cannot be repaired in the same process.
"""

import logging
import os
import sys
from types import ModuleType

from asmjax.errors import UseError, unknown_name
from asmjax.render import llvm
from asmjax.render.search_path import look_in_package_first

VARIANTS = ("llvm_ad_rgb", "cuda_ad_rgb", "scalar_rgb")
"""Variants that asmjax supports; the first usable of llvm and scalar is the default."""

_log = logging.getLogger("asmjax")


def choose_variant(requested: str | None = None) -> str:
    """The variant to use: the requested one, or `llvm_ad_rgb` where it works, or `scalar_rgb`.

    CUDA is taken on request only. Falling back to `scalar_rgb` (the same hits, about 16 times
    slower) logs one warning with the command that repairs it.

    Raises:
        UseError: unknown variant, or `llvm_ad_rgb` requested where LLVM would abort the process.
    """
    return _choose(requested)[0]


def activate(requested: str | None = None) -> ModuleType:
    """Start a variant (see `choose_variant`) and return the `mitsuba` module.

    The first call decides; later calls without `requested`, or with the same one, are free.

    Raises:
        UseError: as `choose_variant`; or another variant is active in this process; or the
            chosen one cannot start here.
    """
    import mitsuba as mi

    current = mi.variant()
    if current is None:
        _start(mi, *_choose(requested))
    elif current not in VARIANTS or requested not in (None, current):
        raise UseError(
            f"Mitsuba variant '{current}' is active in this process, "
            f"not '{requested or 'one of asmjax'}'; allowed: {', '.join(VARIANTS)}, "
            "one per process; start a new process"
        )
    return mi


def active_variant() -> str | None:
    """The variant of this process, None as long as there is none; starts nothing."""
    mi = sys.modules.get("mitsuba")
    return mi.variant() if mi else None


def _choose(requested: str | None) -> tuple[str, str | None]:
    """The variant, and the LLVM library that was tried for it."""
    if requested is not None and requested not in VARIANTS:
        raise unknown_name(
            "variant", requested, VARIANTS, "Leave it out to take the fastest that works here."
        )
    if requested in ("cuda_ad_rgb", "scalar_rgb"):
        return requested, None
    verdict = llvm.probe()
    if verdict.usable:
        return "llvm_ad_rgb", verdict.path
    if requested:
        raise UseError(
            f"variant '{requested}' cannot run here: {verdict.reason}; allowed: scalar_rgb; "
            f"to repair: {verdict.remedy}"
        )
    _log.warning(
        "%s; using scalar_rgb, about 16 times slower. To repair: %s",
        verdict.reason,
        verdict.remedy,
    )
    return "scalar_rgb", None


def _start(mi: ModuleType, variant: str, library: str | None) -> None:
    if library:
        # Dr.Jit must load the very library that was tried, here and in child processes.
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)
    try:
        mi.set_variant(variant)
    except ImportError as problem:
        message = (str(problem).strip() or "no message").splitlines()[0]
        others = ", ".join(name for name in VARIANTS if name != variant)
        raise UseError(
            f"variant '{variant}' cannot start here ({message}); allowed: {others}"
        ) from problem

    import drjit as dr

    # Dr.Jit 1.5.0 deadlocks when it logs at Info or above from several Python threads.
    dr.set_log_level(dr.LogLevel.Warn)
    # Otherwise a folder "plugins" in the current folder brings native code of its own.
    look_in_package_first(mi)
